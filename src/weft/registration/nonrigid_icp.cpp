#include "weft/registration/nonrigid_icp.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "weft/base/error.h"
#include "weft/base/parallel.h"
#include "weft/base/quantile.h"
#include "weft/dynamics/sparse_cholesky.h"
#include "weft/registration/point_tree.h"

namespace weft {
namespace {

// Points that are associated in one task.
constexpr int kChunk = 2048;
// The nearest vertices whose triangles are searched for the nearest point.
constexpr int kNearVertices = 3;
// A landmark against the points of a cell.
constexpr double kLandmarkWeight = 20;
// A robust weight below this is none.
constexpr double kLeastPull = 0.01;
// Damping against the points of a cell: what neither points nor rim hold, such as a sheet that
// turns on a cylinder, must not run away by their noise.
constexpr double kLeastDamping = 1e-3;
// The reach at the end, in standard deviations of the inliers.
constexpr double kReachOverScatter = 4;
// Strain that curvature may explain.
constexpr double kLargestChord = 0.05;
constexpr int kCoarseRounds = 30, kLastRounds = 24;
constexpr double kCoarseStill = 0.01;  // of the reach
// Pull of a rim vertex against the points of a cell. Where the points end is known to a fraction of
// their spacing only; what is needed at last is that the sheet does not slide.
// Pull of a vertex without points on the nearest one, against the points of a cell.
constexpr double kBarePull = 0.3;
// The reach of the rim is at least this many distances between points.
constexpr double kRimReach = 3;
constexpr double kFineRim = 0.05, kLastRim = 0.01;
constexpr double kCoarseCosine = 0.5;
// In the last steps the reach falls by at most this a step.
constexpr double kReachFall = 0.7;
// Curvature that is usual in folds, of 1 / cell, and the least smoothing, of a cell.
constexpr double kUsualCurvature = 1.0 / 3;
constexpr double kLeastSmoothing = 0.3;

double robust_weight(double r, double reach) {
  const double q = 1 + (r / reach) * (r / reach);
  return 1 / (q * q);
}

/// The nearest point of a triangle to p (Ericson, Real-Time Collision Detection, 5.1.5), as
/// weights.
Vec3 nearest_in_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = b - a, ac = c - a, ap = p - a;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return {1, 0, 0};
  const Vec3 bp = p - b;
  const double d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return {0, 1, 0};
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    const double v = d1 / (d1 - d3);
    return {1 - v, v, 0};
  }
  const Vec3 cp = p - c;
  const double d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return {0, 0, 1};
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    const double w = d2 / (d2 - d6);
    return {1 - w, 0, w};
  }
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    const double w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return {0, 1 - w, w};
  }
  const double sum = va + vb + vc;
  return {va / sum, vb / sum, vc / sum};
}

/// A symmetric 3 n x 3 n matrix, lower triangle, addressed by pairs of vertices.
class BlockMatrix {
 public:
  BlockMatrix(int vertices, const std::vector<std::pair<int, int>>& pairs)
      : later_(vertices_of(vertices)) {
    for (const auto& [a, b] : pairs) {
      if (a != b) later_[static_cast<std::size_t>(std::min(a, b))].push_back(std::max(a, b));
    }
    std::vector<int> outer{0}, inner;
    for (int j = 0; j < vertices; ++j) {
      auto& later = later_[static_cast<std::size_t>(j)];
      std::sort(later.begin(), later.end());
      later.erase(std::unique(later.begin(), later.end()), later.end());
      for (int c = 0; c < 3; ++c) {
        for (int r = c; r < 3; ++r) inner.push_back(3 * j + r);
        for (const int i : later) {
          for (int r = 0; r < 3; ++r) inner.push_back(3 * i + r);
        }
        outer.push_back(static_cast<int>(inner.size()));
      }
    }
    std::vector<double> values(inner.size(), 0.0);
    matrix_ = Eigen::Map<SparseMatrix>(3 * vertices, 3 * vertices,
                                       static_cast<Eigen::Index>(inner.size()), outer.data(),
                                       inner.data(), values.data());
  }

  /// Adds `block` for rows of vertex i and columns of vertex j (i >= j, or its transpose).
  void add(int i, int j, const Mat3& block) {
    if (i == j) return add_diagonal(i, block);
    if (i < j) return add_later(j, i, block.transpose());
    add_later(i, j, block);
  }

  SparseMatrix& matrix() { return matrix_; }
  Eigen::Map<VecX> values() { return {matrix_.valuePtr(), matrix_.nonZeros()}; }

 private:
  static std::vector<std::vector<int>> vertices_of(int count) {
    return std::vector<std::vector<int>>(static_cast<std::size_t>(count));
  }
  void add_diagonal(int i, const Mat3& block) {
    for (int c = 0; c < 3; ++c) {
      double* column = matrix_.valuePtr() + matrix_.outerIndexPtr()[3 * i + c];
      for (int r = c; r < 3; ++r) column[r - c] += block(r, c);
    }
  }
  void add_later(int i, int j, const Mat3& block) {
    const auto& later = later_[static_cast<std::size_t>(j)];
    const auto k = std::lower_bound(later.begin(), later.end(), i) - later.begin();
    for (int c = 0; c < 3; ++c) {
      double* column = matrix_.valuePtr() + matrix_.outerIndexPtr()[3 * j + c] + (3 - c) + 3 * k;
      for (int r = 0; r < 3; ++r) column[r] += block(r, c);
    }
  }

  std::vector<std::vector<int>> later_;  ///< neighbours of higher index, of each vertex
  SparseMatrix matrix_;
};

/// weight / 2 |direction^T (sum b_i x_i) - target|^2: along one normal, or in all directions.
struct Pull {
  std::array<int, 3> vertices{};
  Vec3 share;         ///< barycentric weights
  Mat3 metric;        ///< n n^T, or the identity
  Vec3 target;        ///< m
  double weight = 0;  ///< m^2
};

/// The nearest point of the grid to a point of the scan.
struct Association {
  int triangle = -1;
  Vec3 share = Vec3::Zero();
  Vec3 normal = Vec3::Zero();
  double along = 0;   ///< signed distance along the normal, m
  double across = 0;  ///< distance beyond the rim, m; 0 over the inside
  double weight = 0;  ///< robust, 0 to 1
};

struct Stage {
  double reach, smoothing, isometry;  ///< m
  int rounds;
  bool coarse;  ///< wider than cells
  bool last;
};

/// A second difference over the grid: sum of c_k x_k, times a weight.
struct Bend {
  std::array<int, 4> vertices{};
  std::array<double, 4> coefficients{};
  double weight = 0;  ///< m^2: area
};

/// A cell of the grid, corners (0,0), (1,0), (0,1), (1,1) in (u, v).
struct Cell {
  std::array<int, 4> vertices{};
  double rest_u = 1, rest_v = 1;  ///< lengths that curved fibres of unit length show as chords
};

/// A vertex of the rim on one side of the swatch.
struct RimVertex {
  int vertex = 0, inner = 0;   ///< `inner`: the next vertex inward
  int before = 0, after = 0;   ///< along the rim; the vertex itself at the ends
  std::vector<double> beyond;  ///< how far points lie beyond it, m
};

std::vector<Bend> make_bends(const GridTemplate& grid) {
  const double hu = grid.cell_u(), hv = grid.cell_v(), area = hu * hv;
  const double uu = 1 / (hu * hu), vv = 1 / (hv * hv), uv = 1 / (hu * hv);
  const int row = grid.columns;
  std::vector<Bend> bends;
  for (int j = 0; j < grid.rows; ++j) {
    for (int i = 0; i < grid.columns; ++i) {
      const int k = grid.vertex(i, j);
      if (i > 0 && i + 1 < grid.columns) {
        bends.push_back({{k - 1, k, k + 1, k}, {uu, -2 * uu, uu, 0}, area});
      }
      if (j > 0 && j + 1 < grid.rows) {
        bends.push_back({{k - row, k, k + row, k}, {vv, -2 * vv, vv, 0}, area});
      }
      if (i + 1 < grid.columns && j + 1 < grid.rows) {
        bends.push_back({{k, k + 1, k + row, k + row + 1}, {uv, -uv, -uv, uv}, 2 * area});
      }
    }
  }
  return bends;
}

std::vector<Cell> make_cells(const GridTemplate& grid) {
  std::vector<Cell> cells;
  for (int j = 0; j + 1 < grid.rows; ++j) {
    for (int i = 0; i + 1 < grid.columns; ++i) {
      const int a = grid.vertex(i, j), b = grid.vertex(i, j + 1);
      cells.push_back({{a, a + 1, b, b + 1}, 1, 1});
    }
  }
  return cells;
}

class GridIcp {
 public:
  GridIcp(const GridTemplate& grid, const Scan& scan, const ScanGeometry& geometry,
          const std::vector<Landmark>& landmarks, const RegistrationOptions& options);
  ScanRegistration run(const RegistrationStart& start);
  VecX distances(const Points& x);

 private:
  void make_rim();
  std::vector<std::pair<int, int>> pairs() const;
  std::vector<Stage> stages(double start_reach) const;
  void set_scales(Stage& stage, double previous) const;

  void associate(const Points& x, const Stage& stage);
  Association nearest(const Points& x, const PointTree& tree, int point,
                      std::vector<PointTree::Neighbour>& near) const;
  void weigh(const Stage& stage);
  void make_pulls(const Points& x, const Stage& stage);
  void draw_rim(const Points& x, const Stage& stage);
  void make_tree();
  void draw_bare_vertices(const Points& x, const Stage& stage);
  void collect_beyond(const Points& x, double reach);
  void find_curvature(const Points& x);
  Vec3 bulge(const std::array<int, 3>& triangle, const Vec3& share) const;
  void correct_chords(const Points& x);
  double scatter() const;

  double energy(const Points& x, const Stage& stage) const;
  double step(Points& x, const Stage& stage);
  void assemble(const Points& x, const Stage& stage);
  double cost(const Points& x, const Stage& stage);
  void finish(ScanRegistration& result, const Stage& stage);
  void finish_vertices(ScanRegistration& result) const;

  const GridTemplate& grid_;
  const Scan& scan_;
  const ScanGeometry& geometry_;
  RegistrationOptions options_;
  std::vector<Bend> bends_;
  std::vector<Cell> cells_;
  std::array<std::vector<RimVertex>, 4> rim_;  ///< u = 0, u = width, v = 0, v = height
  std::vector<std::vector<int>> triangles_of_vertex_;
  std::vector<char> rim_edge_;  ///< of each triangle, bit k: the edge from corner k is on the rim
  std::vector<int> points_;     ///< that take part
  const std::vector<char>* piece_ = nullptr;
  RegistrationStart::View view_ = RegistrationStart::View::part;
  std::vector<int> tree_points_;  ///< of the scan, in the tree
  std::optional<PointTree> tree_;
  VecX area_;              ///< of each of them, m^2
  double usual_area_ = 0;  ///< median, m^2
  std::vector<Association> associations_;
  std::vector<Pull> pulls_, landmark_pulls_;
  BlockMatrix matrix_;
  VecX bend_values_;  ///< of the matrix, for smoothing 1
  SparseCholesky<double> cholesky_;
  Points gradient_, trial_;
  Points uu_, uv_, vv_;  ///< second derivatives at the vertices, 1/m
  double cell_;          ///< m
  double damping_ = 1e-3;
};

GridIcp::GridIcp(const GridTemplate& grid, const Scan& scan, const ScanGeometry& geometry,
                 const std::vector<Landmark>& landmarks, const RegistrationOptions& options)
    : grid_(grid),
      scan_(scan),
      geometry_(geometry),
      options_(options),
      bends_(make_bends(grid)),
      cells_(make_cells(grid)),
      matrix_(grid.mesh.vertex_count(), pairs()),
      cholesky_(matrix_.matrix(),
                std::vector<char>(static_cast<std::size_t>(grid.mesh.vertex_count()), 0),
                grid.mesh.material),
      cell_(std::sqrt(grid.cell_u() * grid.cell_v())) {
  make_rim();
  for (const Bend& bend : bends_) {
    for (std::size_t a = 0; a < 4; ++a) {
      for (std::size_t b = 0; b <= a; ++b) {
        const double value = bend.weight * bend.coefficients[a] * bend.coefficients[b];
        if (value != 0) matrix_.add(bend.vertices[a], bend.vertices[b], value * Mat3::Identity());
      }
    }
  }
  bend_values_ = matrix_.values();
  const MaterialLocator locator(grid.mesh);
  for (const Landmark& landmark : landmarks) {
    const MaterialLocator::Hit hit = locator.locate(landmark.uv);
    landmark_pulls_.push_back({grid.mesh.triangles[static_cast<std::size_t>(hit.triangle)],
                               hit.barycentric, Mat3::Identity(), landmark.position,
                               kLandmarkWeight * cell_ * cell_ * landmark.weight});
  }
  std::vector<double> areas;
  for (int i = 0; i < scan.size(); ++i) {
    if (!geometry.on_surface[static_cast<std::size_t>(i)]) continue;
    points_.push_back(i);
    areas.push_back(M_PI * geometry.spacing[i] * geometry.spacing[i]);
  }
  usual_area_ = quantile(areas, 0.5);
  area_.resize(static_cast<Eigen::Index>(areas.size()));
  for (std::size_t i = 0; i < areas.size(); ++i) {
    area_[static_cast<Eigen::Index>(i)] = std::clamp(areas[i], usual_area_ / 4, usual_area_ * 4);
  }
  associations_.resize(points_.size());
}

std::vector<std::pair<int, int>> GridIcp::pairs() const {
  std::vector<std::pair<int, int>> all;
  const auto add = [&](const std::array<int, 4>& vertices) {
    for (const int a : vertices) {
      for (const int b : vertices) all.emplace_back(a, b);
    }
  };
  for (const Bend& bend : bends_) add(bend.vertices);
  for (const Cell& cell : cells_) add(cell.vertices);
  return all;
}

void GridIcp::make_rim() {
  const int last_column = grid_.columns - 1, last_row = grid_.rows - 1;
  for (int j = 0; j <= last_row; ++j) {
    const int before = std::max(j - 1, 0), after = std::min(j + 1, last_row);
    rim_[0].push_back({grid_.vertex(0, j),
                       grid_.vertex(1, j),
                       grid_.vertex(0, before),
                       grid_.vertex(0, after),
                       {}});
    rim_[1].push_back({grid_.vertex(last_column, j),
                       grid_.vertex(last_column - 1, j),
                       grid_.vertex(last_column, before),
                       grid_.vertex(last_column, after),
                       {}});
  }
  for (int i = 0; i <= last_column; ++i) {
    const int before = std::max(i - 1, 0), after = std::min(i + 1, last_column);
    rim_[2].push_back({grid_.vertex(i, 0),
                       grid_.vertex(i, 1),
                       grid_.vertex(before, 0),
                       grid_.vertex(after, 0),
                       {}});
    rim_[3].push_back({grid_.vertex(i, last_row),
                       grid_.vertex(i, last_row - 1),
                       grid_.vertex(before, last_row),
                       grid_.vertex(after, last_row),
                       {}});
  }
  triangles_of_vertex_.resize(static_cast<std::size_t>(grid_.mesh.vertex_count()));
  rim_edge_.assign(grid_.mesh.triangles.size(), 0);
  for (int t = 0; t < grid_.mesh.triangle_count(); ++t) {
    const auto& triangle = grid_.mesh.triangles[static_cast<std::size_t>(t)];
    for (std::size_t k = 0; k < 3; ++k) {
      const int a = triangle[k], b = triangle[(k + 1) % 3];
      triangles_of_vertex_[static_cast<std::size_t>(a)].push_back(t);
      const auto both = [&](int index, int last, int divisor) {
        const int ia = divisor ? a / grid_.columns : a % grid_.columns;
        const int ib = divisor ? b / grid_.columns : b % grid_.columns;
        return ia == ib && (ia == index || ia == last);
      };
      if (both(0, last_column, 0) || both(0, last_row, 1)) {
        rim_edge_[static_cast<std::size_t>(t)] |= static_cast<char>(1 << k);
      }
    }
  }
}

std::vector<Stage> GridIcp::stages(double start_reach) const {
  const double size = std::sqrt(grid_.width * grid_.height);
  const bool fixed = landmark_pulls_.size() >= 16;
  const double start = start_reach > 0            ? start_reach
                       : options_.start_error > 0 ? options_.start_error
                                                  : 0.15 * size;
  const double smoothing = options_.smoothing > 0 ? options_.smoothing : 0.5 * cell_;
  const double isometry = options_.isometry > 0 ? options_.isometry : (fixed ? 0.1 : 0.5) * size;
  std::vector<Stage> stages;
  const double finest = std::max(0.5 * cell_, 2 * options_.least_reach);
  for (double reach = start; reach > finest; reach /= 2) {
    stages.push_back({reach, std::max(0.5 * reach, smoothing),
                      isometry * std::min(1.0, 0.1 * start / reach),
                      reach > 2 * cell_ ? kCoarseRounds : 8, reach > 2 * cell_, false});
  }
  stages.push_back({finest, smoothing, isometry, 8, false, false});
  stages.push_back({finest, smoothing, isometry, kLastRounds, false, true});
  return stages;
}

Association GridIcp::nearest(const Points& x, const PointTree& tree, int point,
                             std::vector<PointTree::Neighbour>& near) const {
  const Vec3 p = scan_.position.col(point);
  tree.nearest(p, kNearVertices, near);
  Association best;
  double best_squared = kInfinity;
  for (const auto& vertex : near) {
    for (const int t : triangles_of_vertex_[static_cast<std::size_t>(vertex.index)]) {
      const auto& [i, j, k] = grid_.mesh.triangles[static_cast<std::size_t>(t)];
      const Vec3 share = nearest_in_triangle(p, x.col(i), x.col(j), x.col(k));
      const double squared =
          (share[0] * x.col(i) + share[1] * x.col(j) + share[2] * x.col(k) - p).squaredNorm();
      if (squared >= best_squared) continue;
      best_squared = squared;
      best.triangle = t;
      best.share = share;
    }
  }
  const auto& [i, j, k] = grid_.mesh.triangles[static_cast<std::size_t>(best.triangle)];
  best.normal = (x.col(j) - x.col(i)).cross(x.col(k) - x.col(i)).normalized();
  const Vec3 offset = p - best.share[0] * x.col(i) - best.share[1] * x.col(j) -
                      best.share[2] * x.col(k) - bulge({i, j, k}, best.share);
  best.along = best.normal.dot(offset);
  for (std::size_t e = 0; e < 3; ++e) {
    // The weight of the corner across the edge is 0: the nearest point is on that edge.
    const bool on_edge = best.share[static_cast<Eigen::Index>((e + 2) % 3)] <= 1e-12;
    if (on_edge && (rim_edge_[static_cast<std::size_t>(best.triangle)] >> e & 1)) {
      best.across = (offset - best.along * best.normal).norm();
    }
  }
  return best;
}

void GridIcp::associate(const Points& x, const Stage& stage) {
  const PointTree tree(x);
  find_curvature(x);
  const auto chunks = (points_.size() + kChunk - 1) / kChunk;
  parallel_for(chunks, options_.threads, [&](std::size_t chunk) {
    std::vector<PointTree::Neighbour> near;
    const std::size_t end = std::min(points_.size(), (chunk + 1) * kChunk);
    for (std::size_t i = chunk * kChunk; i < end; ++i) {
      associations_[i] = nearest(x, tree, points_[i], near);
    }
  });
  weigh(stage);  // the scatter of the last step's inliers would hold it at their reach
}

void GridIcp::weigh(const Stage& stage) {
  const double least_cosine = std::cos(options_.largest_turn);
  for (std::size_t i = 0; i < points_.size(); ++i) {
    Association& a = associations_[i];
    const double cosine = std::abs(a.normal.dot(geometry_.normal.col(points_[i])));
    // A sheet that is still far from its shape may be turned further.
    const double limit = stage.coarse ? kCoarseCosine * least_cosine : least_cosine;
    a.weight = cosine < limit ? 0 : robust_weight(std::hypot(a.along, a.across), stage.reach);
    const bool other =
        stage.coarse && !piece_->empty() && !(*piece_)[static_cast<std::size_t>(points_[i])];
    if (a.weight < kLeastPull || other) a.weight = 0;
  }
}

void GridIcp::make_pulls(const Points& x, const Stage& stage) {
  pulls_ = landmark_pulls_;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Association& a = associations_[i];
    if (a.weight == 0) continue;
    const double weight = a.weight * area_[static_cast<Eigen::Index>(i)];
    const auto& triangle = grid_.mesh.triangles[static_cast<std::size_t>(a.triangle)];
    const Vec3 p = scan_.position.col(points_[i]);
    if (a.across == 0) {
      pulls_.push_back({triangle, a.share, a.normal * a.normal.transpose(),
                        p - bulge(triangle, a.share), weight});
    } else if (!stage.last) {
      pulls_.push_back({triangle, a.share, Mat3::Identity(), p, weight});
    }
  }
  draw_rim(x, stage);
  if (stage.coarse && tree_) draw_bare_vertices(x, stage);
}

void GridIcp::make_tree() {
  if (view_ == RegistrationStart::View::part) return;
  for (const int i : points_) {
    if (piece_->empty() || (*piece_)[static_cast<std::size_t>(i)]) tree_points_.push_back(i);
  }
  if (!tree_points_.empty()) tree_.emplace(Points(scan_.position(Eigen::all, tree_points_)));
}

void GridIcp::draw_bare_vertices(const Points& x, const Stage& stage) {
  std::vector<char> bare(static_cast<std::size_t>(x.cols()), 1);
  for (const Association& a : associations_) {
    if (a.weight == 0) continue;
    for (const int v : grid_.mesh.triangles[static_cast<std::size_t>(a.triangle)]) {
      bare[static_cast<std::size_t>(v)] = 0;
    }
  }
  for (int v = 0; v < x.cols(); ++v) {
    if (!bare[static_cast<std::size_t>(v)]) continue;
    const PointTree::Neighbour near = tree_->nearest(x.col(v));
    const double weight = kBarePull * robust_weight(std::sqrt(near.squared), stage.reach);
    pulls_.push_back({{v, v, v},
                      Vec3(1, 0, 0),
                      Mat3::Identity(),
                      scan_.position.col(tree_points_[static_cast<std::size_t>(near.index)]),
                      weight * cell_ * cell_});
  }
}

void GridIcp::collect_beyond(const Points& x, double reach) {
  for (auto& side : rim_) {
    for (RimVertex& vertex : side) vertex.beyond.clear();
  }
  const int band_u = static_cast<int>(std::ceil(reach / grid_.cell_u()));
  const int band_v = static_cast<int>(std::ceil(reach / grid_.cell_v()));
  const auto add = [&](RimVertex& rim, const Vec3& p) {
    const Vec3 along = (x.col(rim.after) - x.col(rim.before)).normalized();
    Vec3 out = x.col(rim.vertex) - x.col(rim.inner);
    out = (out - out.dot(along) * along).normalized();
    const double beyond = out.dot(p - x.col(rim.vertex));
    if (beyond < reach) rim.beyond.push_back(beyond);
  };
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Association& a = associations_[i];
    if (a.weight == 0) continue;
    const auto& triangle = grid_.mesh.triangles[static_cast<std::size_t>(a.triangle)];
    Eigen::Index corner = 0;
    a.share.maxCoeff(&corner);
    const int vertex = triangle[static_cast<std::size_t>(corner)];
    const int column = vertex % grid_.columns, row = vertex / grid_.columns;
    const Vec3 p = scan_.position.col(points_[i]);
    if (column <= band_u) add(rim_[0][static_cast<std::size_t>(row)], p);
    if (column >= grid_.columns - 1 - band_u) add(rim_[1][static_cast<std::size_t>(row)], p);
    if (row <= band_v) add(rim_[2][static_cast<std::size_t>(column)], p);
    if (row >= grid_.rows - 1 - band_v) add(rim_[3][static_cast<std::size_t>(column)], p);
  }
}

void GridIcp::draw_rim(const Points& x, const Stage& stage) {
  // The outermost points of a strip are on average a point's area over its width inside of the rim;
  // the second one is less moved by an outlier than the first.
  constexpr std::size_t rank = 2;
  constexpr std::size_t fewest = 4;
  const double reach = std::max(stage.reach, kRimReach * std::sqrt(usual_area_));
  const double share = stage.coarse ? 1 : stage.last ? kLastRim : kFineRim;
  collect_beyond(x, 2 * reach);
  for (std::size_t side = 0; side < 4; ++side) {
    const double width = side < 2 ? grid_.cell_v() : grid_.cell_u();
    for (RimVertex& rim : rim_[side]) {
      if (rim.beyond.size() < fewest) continue;
      std::nth_element(rim.beyond.begin(), rim.beyond.begin() + (rank - 1), rim.beyond.end(),
                       std::greater<>());
      const double end = rim.beyond[rank - 1] + static_cast<double>(rank) * usual_area_ / width;
      // The edge of a view looks like a rim: a sheet that is not yet where it belongs is not drawn
      // in.
      const bool part = view_ == RegistrationStart::View::part;
      if (part && ((stage.coarse && end < 0) || std::abs(end) > reach)) continue;
      const double weight = share * robust_weight(end, reach) * cell_ * cell_;
      const Vec3 along = (x.col(rim.after) - x.col(rim.before)).normalized();
      Vec3 out = x.col(rim.vertex) - x.col(rim.inner);
      out = (out - out.dot(along) * along).normalized();
      pulls_.push_back({{rim.vertex, rim.vertex, rim.vertex},
                        Vec3(1, 0, 0),
                        out * out.transpose(),
                        x.col(rim.vertex) + end * out,
                        weight});
    }
  }
}

void GridIcp::find_curvature(const Points& x) {
  const int columns = grid_.columns, rows = grid_.rows;
  const double hu = grid_.cell_u(), hv = grid_.cell_v();
  uu_.resize(3, x.cols());
  uv_.resize(3, x.cols());
  vv_.resize(3, x.cols());
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < columns; ++i) {
      const int here = grid_.vertex(i, j);
      const int u = grid_.vertex(std::clamp(i, 1, columns - 2), j);
      const int v = grid_.vertex(i, std::clamp(j, 1, rows - 2));
      const int w = grid_.vertex(std::clamp(i, 1, columns - 2), std::clamp(j, 1, rows - 2));
      uu_.col(here) = (x.col(u - 1) - 2 * x.col(u) + x.col(u + 1)) / (hu * hu);
      vv_.col(here) = (x.col(v - columns) - 2 * x.col(v) + x.col(v + columns)) / (hv * hv);
      uv_.col(here) = (x.col(w + columns + 1) - x.col(w + columns - 1) - x.col(w - columns + 1) +
                       x.col(w - columns - 1)) /
                      (4 * hu * hv);
    }
  }
}

/// From the flat triangle to the curved surface through its vertices: for a quadratic function
/// -1/2 sum over its edges of share_a share_b times the second derivative along the edge.
Vec3 GridIcp::bulge(const std::array<int, 3>& triangle, const Vec3& share) const {
  Vec3 sum = Vec3::Zero();
  for (std::size_t a = 0; a < 3; ++a) {
    const std::size_t b = (a + 1) % 3;
    const int i = triangle[a], j = triangle[b];
    const Vec2 e = grid_.mesh.material.col(j) - grid_.mesh.material.col(i);
    const double both =
        share[static_cast<Eigen::Index>(a)] * share[static_cast<Eigen::Index>(b)] / 2;
    sum -=
        both / 2 *
        (e.x() * e.x() * (uu_.col(i) + uu_.col(j)) + 2 * e.x() * e.y() * (uv_.col(i) + uv_.col(j)) +
         e.y() * e.y() * (vv_.col(i) + vv_.col(j)));
  }
  return sum;
}

/// A fibre of curvature k over a cell of width h shows a chord shorter by k^2 h^2 / 24.
void GridIcp::correct_chords(const Points& x) {
  const auto chord = [&](int vertex, int step, int index, int count) {
    const int at = vertex + (index == 0 ? step : index == count - 1 ? -step : 0);
    const Vec3 second = x.col(at - step) - 2 * x.col(at) + x.col(at + step);
    const Vec3 tangent = (x.col(at + step) - x.col(at - step)).normalized();
    const double across = (second - second.dot(tangent) * tangent).squaredNorm();
    const double h = step == 1 ? grid_.cell_u() : grid_.cell_v();
    return std::min(across / (h * h) / 24, kLargestChord);
  };
  for (Cell& cell : cells_) {
    double u = 0, v = 0;
    for (const int vertex : cell.vertices) {
      u += chord(vertex, 1, vertex % grid_.columns, grid_.columns) / 4;
      v += chord(vertex, grid_.columns, vertex / grid_.columns, grid_.rows) / 4;
    }
    cell.rest_u = 1 - u;
    cell.rest_v = 1 - v;
  }
}

/// Standard deviation of the inliers along the normal, from their median: m.
double GridIcp::scatter() const {
  std::vector<double> distances;
  for (const Association& a : associations_) {
    if (a.weight > 0 && a.across == 0) distances.push_back(std::abs(a.along));
  }
  return 1.4826 * quantile(std::move(distances), 0.5);
}

/// The reach of late steps follows the scatter of the inliers, and so does smoothing at the end:
/// the variance of what n points say of a cell, against the one of curvature.
void GridIcp::set_scales(Stage& stage, double previous) const {
  if (stage.coarse) return;
  const double scattered = scatter();
  const double least =
      std::max(options_.least_reach, std::min(previous, kReachOverScatter * scattered));
  stage.reach = std::max(stage.last ? kReachFall * stage.reach : stage.reach, least);
  if (!stage.last || options_.smoothing > 0) return;
  const double fourth = usual_area_ * std::pow(scattered / kUsualCurvature, 2);
  stage.smoothing = std::clamp(std::pow(fourth, 0.25), kLeastSmoothing * cell_, cell_);
}

double GridIcp::energy(const Points& x, const Stage& stage) const {
  double sum = 0;
  for (const Pull& pull : pulls_) {
    const Vec3 d = pull.share[0] * x.col(pull.vertices[0]) +
                   pull.share[1] * x.col(pull.vertices[1]) +
                   pull.share[2] * x.col(pull.vertices[2]) - pull.target;
    sum += pull.weight * d.dot(pull.metric * d);
  }
  const double b4 = std::pow(stage.smoothing, 4);
  for (const Bend& bend : bends_) {
    Vec3 d = Vec3::Zero();
    for (std::size_t k = 0; k < 4; ++k) d += bend.coefficients[k] * x.col(bend.vertices[k]);
    sum += b4 * bend.weight * d.squaredNorm();
  }
  const double hu = grid_.cell_u(), hv = grid_.cell_v();
  const double scale = stage.isometry * stage.isometry * hu * hv;
  for (const Cell& cell : cells_) {
    const auto& q = cell.vertices;
    const Vec3 wu = (x.col(q[1]) - x.col(q[0]) + x.col(q[3]) - x.col(q[2])) / (2 * hu);
    const Vec3 wv = (x.col(q[2]) - x.col(q[0]) + x.col(q[3]) - x.col(q[1])) / (2 * hv);
    const double eu = wu.norm() - cell.rest_u, ev = wv.norm() - cell.rest_v, s = wu.dot(wv);
    sum += scale * (eu * eu + ev * ev + 0.5 * s * s);
  }
  return 0.5 * sum;
}

void GridIcp::assemble(const Points& x, const Stage& stage) {
  const double b4 = std::pow(stage.smoothing, 4);
  matrix_.values() = b4 * bend_values_;
  gradient_.setZero(3, x.cols());
  for (const Bend& bend : bends_) {
    Vec3 d = Vec3::Zero();
    for (std::size_t k = 0; k < 4; ++k) d += bend.coefficients[k] * x.col(bend.vertices[k]);
    for (std::size_t k = 0; k < 4; ++k) {
      gradient_.col(bend.vertices[k]) += b4 * bend.weight * bend.coefficients[k] * d;
    }
  }
  for (const Pull& pull : pulls_) {
    const Vec3 d = pull.share[0] * x.col(pull.vertices[0]) +
                   pull.share[1] * x.col(pull.vertices[1]) +
                   pull.share[2] * x.col(pull.vertices[2]) - pull.target;
    const Vec3 force = pull.weight * (pull.metric * d);
    for (std::size_t a = 0; a < 3; ++a) {
      const double sa = pull.share[static_cast<Eigen::Index>(a)];
      if (sa == 0) continue;
      gradient_.col(pull.vertices[a]) += sa * force;
      for (std::size_t b = 0; b <= a; ++b) {
        const double sb = pull.share[static_cast<Eigen::Index>(b)];
        if (sb != 0) {
          matrix_.add(pull.vertices[a], pull.vertices[b], pull.weight * sa * sb * pull.metric);
        }
      }
    }
  }
  const double hu = grid_.cell_u(), hv = grid_.cell_v();
  const double scale = stage.isometry * stage.isometry * hu * hv;
  const std::array<double, 4> cu{-0.5 / hu, 0.5 / hu, -0.5 / hu, 0.5 / hu};
  const std::array<double, 4> cv{-0.5 / hv, -0.5 / hv, 0.5 / hv, 0.5 / hv};
  for (const Cell& cell : cells_) {
    Vec3 wu = Vec3::Zero(), wv = Vec3::Zero();
    for (std::size_t k = 0; k < 4; ++k) {
      wu += cu[k] * x.col(cell.vertices[k]);
      wv += cv[k] * x.col(cell.vertices[k]);
    }
    const double eu = wu.norm() - cell.rest_u, ev = wv.norm() - cell.rest_v, s = wu.dot(wv);
    const Vec3 du = wu.normalized(), dv = wv.normalized();
    std::array<Vec3, 4> ds;
    for (std::size_t k = 0; k < 4; ++k) {
      ds[k] = cu[k] * wv + cv[k] * wu;
      gradient_.col(cell.vertices[k]) +=
          scale * (eu * cu[k] * du + ev * cv[k] * dv + 0.5 * s * ds[k]);
    }
    const Mat3 duu = du * du.transpose(), dvv = dv * dv.transpose();
    for (std::size_t a = 0; a < 4; ++a) {
      for (std::size_t b = 0; b <= a; ++b) {
        matrix_.add(
            cell.vertices[a], cell.vertices[b],
            scale * (cu[a] * cu[b] * duu + cv[a] * cv[b] * dvv + 0.5 * ds[a] * ds[b].transpose()));
      }
    }
  }
}

/// One damped Gauss-Newton step; returns its root mean square, m.
double GridIcp::step(Points& x, const Stage& stage) {
  assemble(x, stage);
  const double before = energy(x, stage);
  const double mass = grid_.cell_u() * grid_.cell_v();
  for (int attempt = 0; attempt < 6; ++attempt) {
    for (int v = 0; v < grid_.mesh.vertex_count(); ++v) {
      matrix_.add(v, v, (attempt == 0 ? damping_ : 0.9 * damping_) * mass * Mat3::Identity());
    }
    if (cholesky_.factorize(matrix_.matrix())) {
      trial_ = gradient_;
      cholesky_.solve(trial_);
      const double length = std::sqrt(trial_.squaredNorm() / static_cast<double>(trial_.cols()));
      trial_ = x - trial_;
      if (energy(trial_, stage) <= before) {
        x.swap(trial_);
        damping_ = std::max(damping_ / 3, kLeastDamping);
        return length;
      }
    }
    damping_ *= 10;
  }
  return 0;
}

ScanRegistration GridIcp::run(const RegistrationStart& start) {
  ScanRegistration result;
  Points x = start.x;
  piece_ = &start.piece;
  view_ = start.view;
  make_tree();
  const double still = 3e-4 * cell_;
  Stage last{};
  double previous = kInfinity;
  for (Stage stage : stages(start.reach)) {
    damping_ = std::max(damping_, 1e-2);
    for (int round = 0; round < stage.rounds; ++round) {
      associate(x, stage);
      const double reach = stage.reach;
      set_scales(stage, previous);
      weigh(stage);
      correct_chords(x);
      make_pulls(x, stage);
      const double moved = step(x, stage);
      ++result.rounds;
      if (moved < (stage.coarse ? kCoarseStill * stage.reach : still) && stage.reach > 0.95 * reach)
        break;
    }
    last = stage;
    previous = stage.reach;
  }
  associate(x, last);
  correct_chords(x);
  result.x = std::move(x);
  finish(result, last);
  return result;
}

VecX GridIcp::distances(const Points& x) {
  const std::vector<char> all;
  piece_ = &all;
  associate(
      x,
      {.reach = cell_, .smoothing = 0, .isometry = 0, .rounds = 0, .coarse = true, .last = false});
  VecX along(static_cast<Eigen::Index>(associations_.size()));
  for (std::size_t i = 0; i < associations_.size(); ++i) {
    const Association& a = associations_[i];
    along[static_cast<Eigen::Index>(i)] =
        a.across == 0 ? a.along : std::numeric_limits<double>::quiet_NaN();
  }
  return along;
}

void GridIcp::finish(ScanRegistration& result, const Stage& stage) {
  const Points& x = result.x;
  result.reach = stage.reach;
  result.points = scan_.size();
  std::vector<double> residual;
  for (const Association& a : associations_) {
    if (a.weight > 0 && a.across == 0) residual.push_back(a.along);
  }
  result.inliers = static_cast<int>(residual.size());
  result.residual = Eigen::Map<const VecX>(residual.data(), result.inliers);
  if (!residual.empty()) {
    result.residual_rms = std::sqrt(result.residual.squaredNorm() / result.inliers);
    for (double& r : residual) r = std::abs(r);
    result.residual_median = quantile(residual, 0.5);
    result.residual_p95 = quantile(residual, 0.95);
  }
  double sum = 0;
  for (const Pull& pull : landmark_pulls_) {
    sum += (pull.share[0] * x.col(pull.vertices[0]) + pull.share[1] * x.col(pull.vertices[1]) +
            pull.share[2] * x.col(pull.vertices[2]) - pull.target)
               .squaredNorm();
  }
  if (!landmark_pulls_.empty()) {
    result.landmark_rms = std::sqrt(sum / static_cast<double>(landmark_pulls_.size()));
  }
  sum = 0;
  for (const Cell& cell : cells_) {
    const auto& q = cell.vertices;
    const Vec3 wu = (x.col(q[1]) - x.col(q[0]) + x.col(q[3]) - x.col(q[2])) / (2 * grid_.cell_u());
    const Vec3 wv = (x.col(q[2]) - x.col(q[0]) + x.col(q[3]) - x.col(q[1])) / (2 * grid_.cell_v());
    sum += std::pow(wu.norm() - cell.rest_u, 2) + std::pow(wv.norm() - cell.rest_v, 2);
  }
  result.strain_rms = std::sqrt(sum / (2.0 * static_cast<double>(cells_.size())));
  finish_vertices(result);
  const VecX bare = (1 - result.weight.array()).matrix();
  result.cost = cost(x, stage) + 0.125 * cell_ * cell_ * vertex_areas(grid_.mesh).dot(bare);
}

double GridIcp::cost(const Points& x, const Stage& stage) {
  const double square = 0.25 * cell_ * cell_;
  pulls_ = landmark_pulls_;
  double sum = energy(x, stage);
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Association& a = associations_[i];
    const double r2 = a.along * a.along + a.across * a.across;
    sum += 0.5 * area_[static_cast<Eigen::Index>(i)] * square * r2 / (square + r2);
  }
  return sum;
}

void GridIcp::finish_vertices(ScanRegistration& result) const {
  const Eigen::Index n = result.x.cols();
  VecX covered = VecX::Zero(n), squares = VecX::Zero(n), shares = VecX::Zero(n);
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Association& a = associations_[i];
    if (a.weight == 0 || a.across > 0) continue;
    for (std::size_t k = 0; k < 3; ++k) {
      const double share = a.share[static_cast<Eigen::Index>(k)];
      const int v = grid_.mesh.triangles[static_cast<std::size_t>(a.triangle)][k];
      covered[v] += a.weight * share * area_[static_cast<Eigen::Index>(i)];
      squares[v] += share * a.along * a.along;
      shares[v] += share;
    }
  }
  const VecX areas = vertex_areas(grid_.mesh);
  result.weight.resize(n);
  result.distance.resize(n);
  for (Eigen::Index v = 0; v < n; ++v) {
    // Half of the area in points is as good as all of it.
    result.weight[v] = std::min(1.0, covered[v] / (0.5 * areas[v]));
    result.distance[v] = shares[v] > 0 ? std::sqrt(squares[v] / shares[v])
                                       : std::numeric_limits<double>::quiet_NaN();
  }
}

void check(const GridTemplate& grid, const Scan& scan, const ScanGeometry& geometry,
           const RegistrationStart& start, const std::vector<Landmark>& landmarks,
           const RegistrationOptions& options) {
  if (start.x.cols() != grid.mesh.vertex_count()) {
    throw Error(fmt::format("the start has {} vertices, the grid {}", start.x.cols(),
                            grid.mesh.vertex_count()));
  }
  if (!start.piece.empty() && static_cast<int>(start.piece.size()) != scan.size()) {
    throw Error(fmt::format("a piece of {} flags for a scan of {} points", start.piece.size(),
                            scan.size()));
  }
  if (geometry.normal.cols() != scan.size()) throw Error("normals of another scan");
  for (const double length :
       {options.start_error, options.smoothing, options.isometry, start.reach}) {
    if (!(length >= 0 && length < 1e3)) {
      throw Error(fmt::format("{} m: lengths of a registration must be 0 to 1000 m", length));
    }
  }
  if (!(options.least_reach > 0)) throw Error("the least reach must be above 0");
  for (const Landmark& landmark : landmarks) {
    const bool on = landmark.uv.x() >= -1e-9 && landmark.uv.x() <= grid.width + 1e-9 &&
                    landmark.uv.y() >= -1e-9 && landmark.uv.y() <= grid.height + 1e-9;
    if (!on || !landmark.position.allFinite()) {
      throw Error(fmt::format("landmark at (u, v) = ({}, {}) m: not on the swatch of {} x {} m",
                              landmark.uv.x(), landmark.uv.y(), grid.width, grid.height));
    }
  }
}

}  // namespace

GridTemplate make_grid_template(double width, double height, int columns, int rows) {
  if (columns < 3 || rows < 3) {
    throw Error(fmt::format("a grid of {} x {} vertices; at least 3 x 3", columns, rows));
  }
  return {width, height, columns, rows, make_swatch(width, height, columns, rows)};
}

ScanRegistration register_scan(const GridTemplate& grid, const Scan& scan,
                               const ScanGeometry& geometry, const RegistrationStart& start,
                               const std::vector<Landmark>& landmarks,
                               const RegistrationOptions& options) {
  check(grid, scan, geometry, start, landmarks, options);
  return GridIcp(grid, scan, geometry, landmarks, options).run(start);
}

ScanRegistration register_scan(const GridTemplate& grid, const Scan& scan,
                               const ScanGeometry& geometry,
                               const std::vector<RegistrationStart>& starts,
                               const std::vector<Landmark>& landmarks,
                               const RegistrationOptions& options) {
  if (starts.empty()) throw Error("a registration needs a start");
  ScanRegistration best;
  for (std::size_t k = 0; k < starts.size(); ++k) {
    ScanRegistration next = register_scan(grid, scan, geometry, starts[k], landmarks, options);
    if (k == 0 || next.cost < best.cost) best = std::move(next);
  }
  return best;
}

VecX distances_to_surface(const GridTemplate& grid, const Points& x, const Points& points) {
  Scan scan;
  scan.position = points;
  const ScanGeometry geometry{Points::Zero(3, points.cols()), VecX::Ones(points.cols()),
                              std::vector<char>(static_cast<std::size_t>(points.cols()), 1)};
  check(grid, scan, geometry, {x, {}}, {}, {});
  return GridIcp(grid, scan, geometry, {}, {}).distances(x);
}

}  // namespace weft
