#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <iterator>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <tuple>

#include "weft/base/error.h"
#include "weft/base/parallel.h"
#include "weft/base/quantile.h"
#include "weft/dynamics/simulate.h"
#include "weft/dynamics/sparse_cholesky.h"
#include "weft/dynamics/state.h"
#include "weft/optics/raster.h"
#include "weft/registration/start_shapes.h"
#include "weft/registration/stripe_surface.h"

namespace weft {
namespace {

// Fewest decoded points that fix a surface.
constexpr int least_points = 200;
// Worst fit that is a measurement: median distance of the points, m, and share of them that see
// cloth.
constexpr double largest_residual = 0.003;
constexpr double least_met = 0.8;
// The rim of the silhouette weighs as much as points over a strip of this width, m.
constexpr double contour_strip = 0.01;

/// One step of the annealing. Lengths in m.
struct SheetStage {
  double scale;        ///< distance at which a point loses half its pull
  double bend_length;  ///< (bend stiffness / weight per area)^(1/3)
  double stiffness;    ///< in-plane stiffness over (weight per area times size of the swatch)
  double give;         ///< normal displacement of a point whose pull equals the weight of its area
  int rounds;          ///< associations
  int steps;           ///< Newton steps per association
};

using SheetStages = std::span<const SheetStage>;

// Two ways to begin. Pulled to the points at once, cloth that shows no stripes stays where the
// start has it; left to sag first, it hangs as gravity has it, but what the points say may come too
// late.
constexpr std::array<SheetStage, 4> pulled = {{
    {0.100, 0.060, 10, 1e-3, 8, 2},
    {0.060, 0.040, 25, 5e-4, 6, 2},
    {0.040, 0.030, 60, 2e-4, 6, 2},
    {0.020, 0.020, 120, 1e-4, 6, 2},
}};
constexpr std::array<SheetStage, 4> sagging = {{
    {0.100, 0.060, 20, 5e-2, 8, 2},
    {0.060, 0.040, 50, 1e-2, 6, 2},
    {0.040, 0.030, 100, 2e-3, 6, 2},
    {0.020, 0.020, 120, 1e-4, 6, 2},
}};
// All ways end alike, and are compared there: in a sheet as limp as much clothing cloth, and in one
// as limp as silk.
constexpr std::array<SheetStage, 2> last_stages(double bend_length) {
  return {{{0.010, bend_length, 250, 5e-5, 6, 2}, {0.005, bend_length, 250, 5e-5, 6, 2}}};
}
constexpr std::array<SheetStage, 2> last = last_stages(0.015), limp_last = last_stages(0.008);

// Ways out of a wrong end, which lead back through the last stages. A stiffer sheet smooths what
// the points hold least, above all what they do not see; held by them loosely, it hangs as well.
using Reheating = std::array<SheetStage, 2>;
constexpr Reheating stiffened(double scale, double bend_length) {
  return {{{scale, bend_length, 60, 1e-4, 4, 2}, {0.010, 0.030, 120, 1e-4, 4, 2}}};
}
constexpr Reheating loosened(double scale, double bend_length) {
  return {{{scale, bend_length, 60, 1e-2, 4, 2}, {0.010, 0.030, 120, 1e-3, 4, 2}}};
}
constexpr std::array<Reheating, 4> reheatings = {{
    stiffened(0.020, 0.060),
    stiffened(0.020, 0.120),
    loosened(0.020, 0.030),
    loosened(0.020, 0.060),
}};
// Widths of the strips along a rim that may lie folded over to the other side, of the swatch.
constexpr std::array<double, 2> turned_strips = {0.050, 0.075};
// Least gain of a way out, of the energy, and how many are taken in turn.
constexpr double least_gain = 0.02;
constexpr int most_ways_out = 6;
// Ends that are kept beside the one of least energy: how much more they may have, how far they are
// from each other at least (m, mean over the vertices), and how many.
constexpr double kept_energy = 1.5;
constexpr double kept_distance = 5e-4;
constexpr std::size_t most_kept = 12;
// Of the ends of the first sheet, those from which the limp one goes on.
constexpr std::size_t gone_on_with = 4;

/// Pulls the point of a triangle towards a plane: 1/2 weight (normal . (sum b_i x_i) - offset)^2.
struct PlaneTerm {
  int triangle = 0;
  Vec3 barycentric;
  Vec3 normal;        ///< unit
  double offset = 0;  ///< m
  double weight = 0;  ///< N/m
};

/// The nearest triangle that each pixel sees.
class VisibleTriangles {
 public:
  VisibleTriangles(const Rig& rig, const TriangleMesh& mesh)
      : rig_(&rig),
        mesh_(&mesh),
        // A pack is read beyond the end.
        inverse_depth_(static_cast<std::size_t>(rig.height) * rig.width + kFloatLanes),
        id_(inverse_depth_.size()) {}

  void update(const Points& x) {
    erase();
    image_.resize(3, x.cols());
    for (Eigen::Index v = 0; v < x.cols(); ++v) image_.col(v) = rig_->camera.project(x.col(v));
    for (int t = 0; t < mesh_->triangle_count(); ++t) draw(t);
  }

  int at(const Vec2& pixel) const {
    const int column = static_cast<int>(std::floor(pixel.x()));
    const int row = static_cast<int>(std::floor(pixel.y()));
    if (row < 0 || row >= rig_->height || column < 0 || column >= rig_->width) return -1;
    return inverse_depth_[index(row, column)] > 0 ? id_[index(row, column)] : -1;
  }

  /// Projections of the vertices: x, y in px and depth in m.
  const Points& image() const { return image_; }

 private:
  std::size_t index(int row, int column) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(rig_->width) +
           static_cast<std::size_t>(column);
  }

  void erase() {
    for (int row = rows_.first; row < rows_.last; ++row)
      std::fill_n(&inverse_depth_[index(row, columns_.first)], columns_.last - columns_.first,
                  0.0f);
    rows_ = {rig_->height, 0};
    columns_ = {rig_->width, 0};
  }

  void draw(int t) {
    const auto& [i, j, k] = mesh_->triangles[static_cast<std::size_t>(t)];
    if (image_(2, i) <= 0 || image_(2, j) <= 0 || image_(2, k) <= 0) return;
    const auto point = [&](int v) {
      return ImagePoint{static_cast<float>(image_(0, v)), static_cast<float>(image_(1, v))};
    };
    const auto inverse = [&](int v) { return static_cast<float>(1 / image_(2, v)); };
    BarycentricGradient barycentric;
    if (!barycentric.set(point(i), point(j), point(k))) return;
    const ImagePoint gradient = barycentric.of(inverse(i), inverse(j), inverse(k));
    const ImagePoint origin = point(i);
    const float inverse_origin = inverse(i);
    Extent rows = rows_, columns = columns_;
    float* const nearest = inverse_depth_.data();
    int* const id = id_.data();
    for_each_span(point(i), point(j), point(k), rig_->width, rig_->height,
                  [&](int row, int begin, int end) {
                    rows = {std::min(rows.first, row), std::max(rows.last, row + 1)};
                    columns = {std::min(columns.first, begin), std::max(columns.last, end)};
                    const float dy = static_cast<float>(row) + 0.5f - origin.y;
                    for (int first = begin; first < end; first += kFloatLanes) {
                      const IntLanes column = first + int_lanes([](int lane) { return lane; });
                      const FloatLanes dx = to_float(column) + 0.5f - origin.x;
                      const FloatLanes value = inverse_origin + gradient.x * dx + gradient.y * dy;
                      const std::size_t at = index(row, first);
                      const FloatLanes before = load_lanes<FloatLanes>(nearest + at);
                      const IntLanes seen = (column < end) & (value > before);
                      store_lanes(nearest + at, seen ? value : before);
                      store_lanes(id + at, seen ? IntLanes{} + t : load_lanes<IntLanes>(id + at));
                    }
                  });
    rows_ = rows;
    columns_ = columns;
  }

  const Rig* rig_;
  const TriangleMesh* mesh_;
  std::vector<float> inverse_depth_;  ///< of rows one after another; 0: nothing
  std::vector<int> id_;               ///< valid where something is
  Extent rows_, columns_;             ///< of what is drawn
  Points image_;
};

/// A pixel on the rim of the silhouette and the image direction out of it.
struct ContourPoint {
  Vec2 pixel;
  Vec2 outward;  ///< unit
};

/// Every boundary pixel of the silhouette; normals from a window's centre of mass.
std::vector<ContourPoint> silhouette_contour(const Mask& silhouette) {
  constexpr int window = 5;
  std::vector<ContourPoint> contour;
  const int rows = static_cast<int>(silhouette.rows()),
            columns = static_cast<int>(silhouette.cols());
  for (int y = window; y + window < rows; ++y) {
    for (int x = window; x + window < columns; ++x) {
      if (!silhouette(y, x) || (silhouette(y - 1, x) && silhouette(y + 1, x) &&
                                silhouette(y, x - 1) && silhouette(y, x + 1))) {
        continue;
      }
      Vec2 inward = Vec2::Zero();
      for (int dy = -window; dy <= window; ++dy) {
        for (int dx = -window; dx <= window; ++dx) {
          if (silhouette(y + dy, x + dx)) inward += Vec2(dx, dy);
        }
      }
      if (inward.norm() < 1) continue;
      const Vec2 outward = -inward.normalized();
      // The rim runs half a pixel outside the centre of the last pixel of cloth.
      contour.push_back({Vec2(x + 0.5, y + 0.5) + 0.5 * outward, outward});
    }
  }
  return contour;
}

/// An edge of the mesh with one triangle.
struct RimEdge {
  int triangle;
  std::array<int, 2> corners;  ///< of the triangle, 0 to 2
};

std::vector<RimEdge> rim_edges(const TriangleMesh& mesh) {
  struct Side {
    int low, high, triangle, corner;
  };
  std::vector<Side> sides;
  for (int t = 0; t < mesh.triangle_count(); ++t) {
    const auto& triangle = mesh.triangles[static_cast<std::size_t>(t)];
    for (int k = 0; k < 3; ++k) {
      const int a = triangle[static_cast<std::size_t>(k)];
      const int b = triangle[static_cast<std::size_t>((k + 1) % 3)];
      sides.push_back({std::min(a, b), std::max(a, b), t, k});
    }
  }
  std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
    return std::tie(a.low, a.high, a.triangle) < std::tie(b.low, b.high, b.triangle);
  });
  std::vector<RimEdge> rim;
  for (std::size_t k = 0; k < sides.size(); ++k) {
    const auto same = [&](std::size_t other) {
      return other < sides.size() && sides[other].low == sides[k].low &&
             sides[other].high == sides[k].high;
    };
    if ((k > 0 && same(k - 1)) || same(k + 1)) continue;
    rim.push_back({sides[k].triangle, {sides[k].corner, (sides[k].corner + 1) % 3}});
  }
  return rim;
}

/// The rim in the image; the edges side by side, so that several are looked at together.
class RimImage {
 public:
  /// `image`: projections of the vertices, in px.
  void set(const std::vector<RimEdge>& rim, const TriangleMesh& mesh, const Points& image) {
    const auto count = static_cast<Eigen::Index>(rim.size());
    from_.resize(count, 2);
    along_.resize(count, 2);
    share_.resize(count);
    distance_.resize(count);
    for (Eigen::Index e = 0; e < count; ++e) {
      const RimEdge& edge = rim[static_cast<std::size_t>(e)];
      const auto& triangle = mesh.triangles[static_cast<std::size_t>(edge.triangle)];
      const auto corner = [&](std::size_t k) -> Vec2 {
        return image.col(triangle[static_cast<std::size_t>(edge.corners[k])]).head<2>();
      };
      from_.row(e) = corner(0).transpose();
      along_.row(e) = (corner(1) - corner(0)).transpose();
    }
    squared_length_ = along_.col(0).square() + along_.col(1).square();
  }

  struct Nearest {
    Eigen::Index edge = -1;  ///< -1: none
    double share = 0;        ///< of the way along it
    double squared_distance = kInfinity;
  };
  Nearest nearest(const Vec2& pixel) {
    const auto x = pixel.x() - from_.col(0), y = pixel.y() - from_.col(1);
    share_ = (x * along_.col(0) + y * along_.col(1)) / squared_length_;
    share_ = (share_ < 0.0).select(0.0, (share_ > 1.0).select(1.0, share_));
    distance_ = (from_.col(0) + share_ * along_.col(0) - pixel.x()).square() +
                (from_.col(1) + share_ * along_.col(1) - pixel.y()).square();
    Nearest result;
    for (Eigen::Index e = 0; e < distance_.size(); ++e)
      if (distance_[e] < result.squared_distance) result = {e, share_[e], distance_[e]};
    return result;
  }

 private:
  Eigen::ArrayX2d from_, along_;
  Eigen::ArrayXd squared_length_, share_, distance_;
};

/// Non-rigid registration: a cloth under gravity, pulled to the measured points and the silhouette.
class SurfaceFitter {
 public:
  /// `fabric`: of the sheet; a generic one, which each stage stiffens, where it is not given.
  SurfaceFitter(const StripePoints& points, const Mask& silhouette, const Rig& rig,
                const Scene& scene, const std::optional<Fabric>& fabric = {});

  /// Takes `x` through the stages; returns its energy at the last of them, J: elastic, and robust
  /// misfit. Gravity is left out: a moving cloth is not where its weight would have it.
  double anneal(Points& x, SheetStages stages);
  /// Distances of the points to the surface, m; NaN for points that see no cloth.
  std::vector<double> distances(const Points& x, Eigen::VectorXi& support);

 private:
  void find_slots();
  void set_stage(const SheetStage& stage);
  void associate_points(const Points& x, const SheetStage& stage);
  void associate_contour(const Points& x, const SheetStage& stage);
  double misfit(const Points& x, const SheetStage& stage);
  void keep_inside(const Points& x, const SheetStage& stage);
  PlaneTerm image_term(const Points& x, int triangle, const Vec3& barycentric,
                       const ContourPoint& target) const;
  bool newton_step(Points& x);
  double energy(const Points& x) const;
  double residual(const PlaneTerm& term, const Points& x) const {
    const auto& [i, j, k] = scene_.mesh.triangles[static_cast<std::size_t>(term.triangle)];
    return term.normal.dot(x.col(i)) * term.barycentric(0) +
           term.normal.dot(x.col(j)) * term.barycentric(1) +
           term.normal.dot(x.col(k)) * term.barycentric(2) - term.offset;
  }
  void add_terms(const Points& x);
  /// Where three rows lie together in the Hessian's columns: those of a corner of a triangle in
  /// the columns of another one.
  struct PairSlots {
    std::size_t row, column;  ///< corners; the vertex of `row` has the larger index
    std::array<int, 3> columns;
  };
  /// Of a triangle's lower 9 x 9 block.
  struct BlockSlots {
    std::array<std::array<int, 3>, 3> diagonal;  ///< of each corner
    std::array<PairSlots, 3> pairs;
  };
  void add_block(const BlockSlots& slots, const std::array<Vec3, 3>& jacobian, double weight);
  bool inside_silhouette(const Vec2& pixel) const;
  bool intersect(int triangle, const Points& x, const Vec3& ray, Vec3& barycentric) const;

  const StripePoints& points_;
  const Mask& silhouette_;
  const Rig& rig_;
  const Scene& scene_;
  bool generic_;
  Fabric fabric_;
  ClothModel model_;
  SparseCholesky<float> cholesky_;  // of a direction that a line search checks
  SparseMatrix hessian_;
  VisibleTriangles visible_;
  std::vector<ContourPoint> contour_;
  std::vector<RimEdge> rim_;
  RimImage rim_image_;
  Points rays_;  ///< 3 x points: unit directions of their pixels
  std::vector<PlaneTerm> terms_;
  std::vector<int> first_triangle_;  ///< of each vertex
  VecX areas_;                       ///< of each vertex, m^2
  std::vector<BlockSlots> slots_;    ///< of each triangle
  double weight_;                    ///< areal weight, N/m^2
  double point_area_;                ///< m^2 that a decoded point stands for
  double pixel_size_;                ///< m at the depth of the fixtures
  double damping_ = 1;
  Points gradient_, direction_, trial_;
};

SurfaceFitter::SurfaceFitter(const StripePoints& points, const Mask& silhouette, const Rig& rig,
                             const Scene& scene, const std::optional<Fabric>& fabric)
    : points_(points),
      silhouette_(silhouette),
      rig_(rig),
      scene_(scene),
      generic_(!fabric),
      fabric_(fabric ? *fabric : Fabric::with_defaults("registration prior")),
      model_(scene.mesh, fabric_, scene.areal_density, scene.gravity),
      cholesky_(model_.hessian_pattern(), held_vertices(scene.fixtures, scene.mesh.vertex_count()),
                scene.mesh.material),
      hessian_(model_.hessian_pattern()),
      visible_(rig, scene.mesh),
      contour_(silhouette_contour(silhouette)),
      rim_(rim_edges(scene.mesh)) {
  weight_ = scene.areal_density * std::max(scene.gravity.norm(), 1.0);
  const Vec3 fixture = scene.fixtures.front().motion.position(scene.frame_times.front());
  const Vec3 pixel = rig.camera.project(fixture);
  pixel_size_ = (rig.camera.unproject({pixel.x() + 1, pixel.y()}, pixel.z()) - fixture).norm();
  const double cloth_area =
      static_cast<double>((silhouette != 0).count()) * pixel_size_ * pixel_size_;
  point_area_ = cloth_area / std::max<double>(1.0, static_cast<double>(points.pixel.cols()));

  areas_ = vertex_areas(scene.mesh);
  first_triangle_.assign(static_cast<std::size_t>(scene.mesh.vertex_count()), -1);
  for (int t = scene.mesh.triangle_count() - 1; t >= 0; --t) {
    for (const int v : scene.mesh.triangles[static_cast<std::size_t>(t)]) {
      first_triangle_[static_cast<std::size_t>(v)] = t;
    }
  }
  find_slots();
  rays_.resize(3, points.pixel.cols());
  for (Eigen::Index p = 0; p < rays_.cols(); ++p)
    rays_.col(p) = rig.camera.ray(points.pixel.col(p));
}

void SurfaceFitter::find_slots() {
  const auto slot = [&](int row, int column) {
    const int* begin = hessian_.innerIndexPtr() + hessian_.outerIndexPtr()[column];
    const int* end = hessian_.innerIndexPtr() + hessian_.outerIndexPtr()[column + 1];
    return static_cast<int>(std::lower_bound(begin, end, row) - hessian_.innerIndexPtr());
  };
  slots_.resize(scene_.mesh.triangles.size());
  for (std::size_t t = 0; t < slots_.size(); ++t) {
    const auto& vertices = scene_.mesh.triangles[t];
    for (std::size_t k = 0; k < 3; ++k)
      for (int axis = 0; axis < 3; ++axis)
        slots_[t].diagonal[k][static_cast<std::size_t>(axis)] =
            slot(3 * vertices[k] + axis, 3 * vertices[k] + axis);
    for (std::size_t k = 0; k < 3; ++k) {
      PairSlots& pair = slots_[t].pairs[k];
      pair = {k == 0 ? 1u : 2u, k == 2 ? 1u : 0u, {}};
      if (vertices[pair.row] < vertices[pair.column]) std::swap(pair.row, pair.column);
      for (int axis = 0; axis < 3; ++axis)
        pair.columns[static_cast<std::size_t>(axis)] =
            slot(3 * vertices[pair.row], 3 * vertices[pair.column] + axis);
    }
  }
}

void SurfaceFitter::set_stage(const SheetStage& stage) {
  if (!generic_) return;
  // Stiffness in units of the weight that hangs from the cloth: in-plane strain of its own weight
  // is 1/250 per length, whatever the fabric.
  const double length =
      (scene_.mesh.material.rowwise().maxCoeff() - scene_.mesh.material.rowwise().minCoeff())
          .maxCoeff();
  fabric_.values(parameter_index(fabric_.model, "stretch_stiffness")) =
      stage.stiffness * weight_ * length;
  fabric_.values(parameter_index(fabric_.model, "shear_stiffness")) =
      0.4 * stage.stiffness * weight_ * length;
  fabric_.values(parameter_index(fabric_.model, "bend_stiffness")) =
      weight_ * std::pow(stage.bend_length, 3);
  model_.set_fabric(fabric_);
}

bool SurfaceFitter::intersect(int triangle, const Points& x, const Vec3& ray,
                              Vec3& barycentric) const {
  const auto& [i, j, k] = scene_.mesh.triangles[static_cast<std::size_t>(triangle)];
  const Vec3 origin = rig_.camera.center();
  const Vec3 e1 = x.col(j) - x.col(i), e2 = x.col(k) - x.col(i);
  const Vec3 p = ray.cross(e2);
  const double determinant = e1.dot(p);
  if (std::abs(determinant) < 1e-15) return false;
  const Vec3 s = origin - x.col(i);
  const double b1 = s.dot(p) / determinant, b2 = ray.dot(s.cross(e1)) / determinant;
  barycentric = Vec3(1 - b1 - b2, b1, b2);
  // The pixel's centre is inside; the point itself may lie up to a pixel outside.
  barycentric = barycentric.cwiseMax(0.0);
  barycentric /= barycentric.sum();
  return true;
}

void SurfaceFitter::associate_points(const Points& x, const SheetStage& stage) {
  const Points normals = vertex_normals(scene_.mesh, x);
  const double stiffness = weight_ / stage.give * point_area_;
  for (Eigen::Index p = 0; p < points_.pixel.cols(); ++p) {
    const int triangle = visible_.at(points_.pixel.col(p));
    if (triangle < 0) continue;
    PlaneTerm term;
    term.triangle = triangle;
    if (!intersect(triangle, x, rays_.col(p), term.barycentric)) continue;
    const auto& [i, j, k] = scene_.mesh.triangles[static_cast<std::size_t>(triangle)];
    term.normal = (normals.col(i) * term.barycentric(0) + normals.col(j) * term.barycentric(1) +
                   normals.col(k) * term.barycentric(2))
                      .normalized();
    term.offset = term.normal.dot(points_.position.col(p));
    const double ratio = residual(term, x) / stage.scale;
    term.weight = stiffness / std::pow(1 + ratio * ratio, 2);
    terms_.push_back(term);
  }
}

void SurfaceFitter::associate_contour(const Points& x, const SheetStage& stage) {
  const double stiffness = weight_ / stage.give * contour_strip * pixel_size_;
  rim_image_.set(rim_, scene_.mesh, visible_.image());
  for (const ContourPoint& point : contour_) {
    const auto [edge, share, squared_distance] = rim_image_.nearest(point.pixel);
    if (edge < 0) continue;
    const RimEdge& nearest = rim_[static_cast<std::size_t>(edge)];
    Vec3 barycentric = Vec3::Zero();
    barycentric(nearest.corners[0]) = 1 - share;
    barycentric(nearest.corners[1]) = share;
    PlaneTerm term = image_term(x, nearest.triangle, barycentric, point);
    const double ratio = std::sqrt(squared_distance) * pixel_size_ / stage.scale;
    term.weight = stiffness / std::pow(1 + ratio * ratio, 2);
    terms_.push_back(term);
  }
}

PlaneTerm SurfaceFitter::image_term(const Points& x, int triangle, const Vec3& barycentric,
                                    const ContourPoint& target) const {
  const auto& [i, j, k] = scene_.mesh.triangles[static_cast<std::size_t>(triangle)];
  const Vec3 world =
      x.col(i) * barycentric(0) + x.col(j) * barycentric(1) + x.col(k) * barycentric(2);
  const double depth = rig_.camera.project(world).z();
  const Vec3 point = rig_.camera.unproject(target.pixel, depth);
  PlaneTerm term;
  term.triangle = triangle;
  term.barycentric = barycentric;
  term.normal = (rig_.camera.unproject(target.pixel + target.outward, depth) - point).normalized();
  term.offset = term.normal.dot(point);
  return term;
}

void SurfaceFitter::keep_inside(const Points& x, const SheetStage& stage) {
  const Points& image = visible_.image();
  for (int t = 0; t < scene_.mesh.triangle_count(); ++t) {
    for (int corner = 0; corner < 3; ++corner) {
      const int v =
          scene_.mesh.triangles[static_cast<std::size_t>(t)][static_cast<std::size_t>(corner)];
      if (first_triangle_[static_cast<std::size_t>(v)] != t) continue;
      const Vec2 pixel = image.col(v).head<2>();
      if (inside_silhouette(pixel)) continue;
      const ContourPoint* nearest = nullptr;
      double least = kInfinity;
      for (const ContourPoint& point : contour_) {
        const double distance = (point.pixel - pixel).squaredNorm();
        if (distance < least) {
          least = distance;
          nearest = &point;
        }
      }
      if (!nearest || least < 0.25) continue;
      const ContourPoint target{nearest->pixel, (pixel - nearest->pixel).normalized()};
      PlaneTerm term = image_term(x, t, Vec3::Unit(corner), target);
      term.weight = weight_ / stage.give * areas_(v);
      terms_.push_back(term);
    }
  }
}

bool SurfaceFitter::inside_silhouette(const Vec2& pixel) const {
  const int column = static_cast<int>(std::floor(pixel.x()));
  const int row = static_cast<int>(std::floor(pixel.y()));
  return row >= 0 && row < silhouette_.rows() && column >= 0 && column < silhouette_.cols() &&
         silhouette_(row, column);
}

double SurfaceFitter::energy(const Points& x) const {
  double sum = model_.potential(x, {});
  for (const PlaneTerm& term : terms_) {
    const double r = residual(term, x);
    sum += 0.5 * term.weight * r * r;
  }
  return sum;
}

/// Adds weight j j^T, with j the jacobians of the triangle's corners.
void SurfaceFitter::add_block(const BlockSlots& slots, const std::array<Vec3, 3>& jacobian,
                              double weight) {
  double* values = hessian_.valuePtr();
  std::array<Vec3, 3> weighted;
  for (std::size_t k = 0; k < 3; ++k) weighted[k] = weight * jacobian[k];
  for (std::size_t k = 0; k < 3; ++k) {
    const auto& [first, second, third] = slots.diagonal[k];
    const Vec3 &w = weighted[k], &j = jacobian[k];
    Eigen::Map<Vec3>{values + first} += w * j.x();
    Eigen::Map<Vec2>{values + second} += w.tail<2>() * j.y();
    values[third] += w.z() * j.z();
  }
  for (const PairSlots& pair : slots.pairs) {
    // Weighted is the later corner, wherever its rows are.
    const bool later = pair.row > pair.column;
    const Vec3& rows = later ? weighted[pair.row] : jacobian[pair.row];
    const Vec3& columns = later ? jacobian[pair.column] : weighted[pair.column];
    for (std::size_t axis = 0; axis < 3; ++axis)
      Eigen::Map<Vec3>{values + pair.columns[axis]} +=
          rows * columns[static_cast<Eigen::Index>(axis)];
  }
}

void SurfaceFitter::add_terms(const Points& x) {
  for (const PlaneTerm& term : terms_) {
    const auto triangle = static_cast<std::size_t>(term.triangle);
    const auto& vertices = scene_.mesh.triangles[triangle];
    const double r = residual(term, x);
    std::array<Vec3, 3> jacobian;
    for (std::size_t k = 0; k < 3; ++k) {
      const double share = term.barycentric(static_cast<Eigen::Index>(k));
      jacobian[k] = share * term.normal;
      gradient_.col(vertices[k]) += term.weight * r * share * term.normal;
    }
    add_block(slots_[triangle], jacobian, term.weight);
  }
}

bool SurfaceFitter::newton_step(Points& x) {
  const double before = energy(x);
  for (int attempt = 0; attempt < 12; ++attempt) {
    hessian_.coeffs().setZero();
    model_.potential_hessian(x, {}, HessianKind::positive_semidefinite, gradient_, hessian_);
    add_terms(x);
    const auto diagonal = model_.diagonal_slots();
    for (Eigen::Index i = 0; i < gradient_.cols(); ++i) {
      for (Eigen::Index k = 0; k < 3; ++k) {
        hessian_.valuePtr()[diagonal[static_cast<std::size_t>(3 * i + k)]] +=
            damping_ * model_.masses()(i);
      }
    }
    if (!cholesky_.factorize(hessian_)) {
      damping_ *= 10;
      continue;
    }
    direction_ = -gradient_;
    cholesky_.solve(direction_);
    const double slope = gradient_.cwiseProduct(direction_).sum();
    double fraction = 1;
    for (; fraction > 1.0 / 64; fraction *= 0.5) {
      trial_ = x + fraction * direction_;
      if (energy(trial_) <= before + 1e-4 * fraction * slope) break;
    }
    if (fraction > 1.0 / 64) {
      x = trial_;
      damping_ = fraction == 1 ? std::max(damping_ / 4, 1.0) : damping_ * 4;
      return true;
    }
    damping_ *= 16;
  }
  return false;
}

double SurfaceFitter::anneal(Points& x, SheetStages stages) {
  damping_ = 100;
  for (const SheetStage& stage : stages) {
    set_stage(stage);
    for (int round = 0; round < stage.rounds; ++round) {
      visible_.update(x);
      terms_.clear();
      associate_points(x, stage);
      associate_contour(x, stage);
      keep_inside(x, stage);
      for (int step = 0; step < stage.steps; ++step) {
        if (!newton_step(x)) break;
      }
    }
  }
  return misfit(x, stages.back()) + model_.elastic_energy(x);
}

double SurfaceFitter::misfit(const Points& x, const SheetStage& stage) {
  const double point_stiffness = weight_ / stage.give * point_area_;
  const double scale_squared = stage.scale * stage.scale;
  visible_.update(x);
  terms_.clear();
  associate_points(x, stage);
  const double uncovered =
      static_cast<double>(points_.pixel.cols()) - static_cast<double>(terms_.size());
  double sum = 0.5 * uncovered * point_stiffness * scale_squared;
  const auto add = [&](double stiffness) {
    for (const PlaneTerm& term : terms_) {
      const double r = residual(term, x);
      sum += 0.5 * stiffness * r * r / (1 + r * r / scale_squared);
    }
  };
  add(point_stiffness);
  terms_.clear();
  associate_contour(x, stage);
  add(weight_ / stage.give * contour_strip * pixel_size_);
  return sum;
}

std::vector<double> SurfaceFitter::distances(const Points& x, Eigen::VectorXi& support) {
  support = Eigen::VectorXi::Zero(scene_.mesh.vertex_count());
  std::vector<double> result(static_cast<std::size_t>(points_.pixel.cols()), std::nan(""));
  visible_.update(x);
  terms_.clear();
  constexpr double near = 0.005;
  for (Eigen::Index p = 0; p < points_.pixel.cols(); ++p) {
    const int triangle = visible_.at(points_.pixel.col(p));
    Vec3 barycentric;
    if (triangle < 0 || !intersect(triangle, x, rays_.col(p), barycentric)) continue;
    const auto& vertices = scene_.mesh.triangles[static_cast<std::size_t>(triangle)];
    const Vec3 a = x.col(vertices[0]), b = x.col(vertices[1]), c = x.col(vertices[2]);
    const Vec3 normal = (b - a).cross(c - a).normalized();
    const double distance = std::abs(normal.dot(points_.position.col(p) - a));
    result[static_cast<std::size_t>(p)] = distance;
    int nearest = 0;
    barycentric.maxCoeff(&nearest);
    if (distance < near) ++support(vertices[static_cast<std::size_t>(nearest)]);
  }
  return result;
}

/// The place that is `length` inside of a rim of the swatch, for the vertices between.
struct RimStrip {
  std::vector<int> vertices;
  MaterialPoints inner;  ///< of each
};

/// Of the rim u = 0, v = 0, u = largest, v = largest for side 0, 1, 2, 3; held vertices, which
/// cannot go along, left out.
RimStrip rim_strip(const Scene& scene, int side, double length) {
  const MaterialPoints& material = scene.mesh.material;
  const Eigen::Index axis = side % 2;
  const double rim = side < 2 ? material.row(axis).minCoeff() : material.row(axis).maxCoeff();
  const double inner = side < 2 ? rim + length : rim - length;
  const std::vector<char> held = held_vertices(scene.fixtures, scene.mesh.vertex_count());
  RimStrip strip;
  for (int v = 0; v < scene.mesh.vertex_count(); ++v)
    if (std::abs(material(axis, v) - rim) < 0.999 * length && !held[static_cast<std::size_t>(v)])
      strip.vertices.push_back(v);
  strip.inner.resize(2, static_cast<Eigen::Index>(strip.vertices.size()));
  for (Eigen::Index i = 0; i < strip.inner.cols(); ++i) {
    strip.inner.col(i) = material.col(strip.vertices[static_cast<std::size_t>(i)]);
    strip.inner(axis, i) = inner;
  }
  return strip;
}

/// Folds the strip over: in depth only, so that the camera sees it where it was.
Points folded_over(const RimStrip& strip, const Scene& scene, const Vec3& eye, const Points& x) {
  Points result = x;
  const Points inner = interpolate(scene.mesh, MaterialLocator(scene.mesh), x, strip.inner);
  for (Eigen::Index i = 0; i < inner.cols(); ++i) {
    const Vec3 ray = (inner.col(i) - eye).normalized();
    auto at = result.col(strip.vertices[static_cast<std::size_t>(i)]);
    at -= 2 * ray.dot(at - inner.col(i)) * ray;
  }
  return result;
}

/// Where a fit goes on, and how; it ends with the last stages.
struct Way {
  Points x;
  SheetStages stages;
};

/// What annealing cannot turn into one another is the side of the first fold: the flat sheet,
/// bulged to either side and folded once, and the bulges left to sag first.
std::vector<Way> beginnings(const Scene& scene) {
  std::vector<Way> result{{flat_sheet(scene), pulled}};
  const std::vector<StartShape> shapes = generic_starts(scene);
  for (std::size_t k = 0; k < 4; ++k) result.push_back({shapes[k].x, pulled});
  for (std::size_t k = 0; k < 2; ++k) result.push_back({shapes[k].x, sagging});
  return result;
}

std::vector<Way> ways_out(const Scene& scene, const Vec3& eye, const Points& x) {
  std::vector<Way> result;
  for (const Reheating& reheating : reheatings) result.push_back({x, reheating});
  const Vec2 size =
      scene.mesh.material.rowwise().maxCoeff() - scene.mesh.material.rowwise().minCoeff();
  for (int side = 0; side < 4; ++side)
    for (const double width : turned_strips)
      result.push_back(
          {folded_over(rim_strip(scene, side, width * size[side % 2]), scene, eye, x), {}});
  return result;
}

/// Where a way ended.
struct End {
  Points x;
  double energy = kInfinity;
  double stiff_energy = kInfinity;  ///< before the last stages
};

double mean_distance(const Points& a, const Points& b) { return (a - b).colwise().norm().mean(); }

/// Searches for the surface of least energy; keeps other ends that come near to it.
class SurfaceSearch {
 public:
  SurfaceSearch(const StripePoints& points, const Mask& silhouette, const Rig& rig,
                const Scene& scene, int threads, const std::optional<Fabric>& fabric = {})
      : scene_(scene), eye_(rig.camera.center()), threads_(threads) {
    for (int k = 0; k < all_threads(threads); ++k)
      fitters_.push_back(std::make_unique<SurfaceFitter>(points, silhouette, rig, scene, fabric));
  }

  /// Begins anew, with those ways and then `last` stages.
  void begin(const std::vector<Way>& ways, SheetStages last_stages) {
    ends_.clear();
    stiffly_best_ = {};
    follow(ways, last_stages);
  }

  /// Takes ways out of the best end while they lower it; the ends by energy, the least first.
  std::vector<End> go_on(SheetStages last_stages) {
    for (int k = 0; k < most_ways_out && !ends_.empty(); ++k) {
      const End best = ends_.front();
      follow(ways_out(scene_, eye_, best.x), last_stages);
      if (!(ends_.front().energy < (1 - least_gain) * best.energy)) break;
    }
    return std::move(ends_);
  }

  /// Of what was begun with, the end whose energy was least before the last stages: while
  /// the sheet is stiff it shows best where a first fold is on the wrong side.
  const End& stiffly_best() const { return stiffly_best_; }
  SurfaceFitter& fitter() { return *fitters_.front(); }

 private:
  void follow(const std::vector<Way>& ways, SheetStages last_stages) {
    std::vector<End> found(ways.size());
    std::atomic<std::size_t> next = 0;
    parallel_for(fitters_.size(), threads_, [&](std::size_t worker) {
      for (std::size_t i = next++; i < ways.size(); i = next++) {
        found[i].x = ways[i].x;
        if (!ways[i].stages.empty())
          found[i].stiff_energy = fitters_[worker]->anneal(found[i].x, ways[i].stages);
        found[i].energy = fitters_[worker]->anneal(found[i].x, last_stages);
      }
    });
    if (ends_.empty() && !found.empty())
      stiffly_best_ = *std::ranges::min_element(found, {}, &End::stiff_energy);
    for (End& end : found)
      if (std::isfinite(end.energy)) ends_.push_back(std::move(end));
    keep_distinct();
  }

  void keep_distinct() {
    std::ranges::stable_sort(ends_, {}, &End::energy);
    std::vector<End> kept;
    for (End& end : ends_) {
      if (kept.size() == most_kept) break;
      if (!kept.empty() && end.energy > kept_energy * kept.front().energy) break;
      const bool known = std::ranges::any_of(
          kept, [&](const End& k) { return mean_distance(k.x, end.x) < kept_distance; });
      if (!known) kept.push_back(std::move(end));
    }
    ends_ = std::move(kept);
  }

  const Scene& scene_;
  Vec3 eye_;
  int threads_;
  std::vector<std::unique_ptr<SurfaceFitter>> fitters_;  // one a thread
  std::vector<End> ends_;
  End stiffly_best_;
};

/// Of the sheet that was begun with, and of a limp one.
std::vector<End> other_ends(SurfaceSearch& search) {
  std::vector<End> ends = search.go_on(last);
  std::vector<Way> further;
  for (std::size_t k = 0; k < std::min(ends.size(), gone_on_with); ++k)
    further.push_back({ends[k].x, {}});
  search.begin(further, limp_last);
  std::ranges::move(search.go_on(limp_last), std::back_inserter(ends));
  return ends;
}

}  // namespace

SurfaceFit fit_surface(const StripePoints& points, const Mask& silhouette, const Rig& rig,
                       const Scene& scene, const SurfaceFitOptions& options) {
  SurfaceFit result;
  result.points = static_cast<int>(points.pixel.cols());
  result.support = Eigen::VectorXi::Zero(scene.mesh.vertex_count());
  result.x = flat_sheet(scene);
  if (result.points < least_points) {
    result.note = fmt::format("{} points were decoded from the stripes, at least {} are needed",
                              result.points, least_points);
    return result;
  }
  SurfaceSearch search(points, silhouette, rig, scene, options.threads);
  search.begin(beginnings(scene), last);
  result.x = search.stiffly_best().x;
  if (options.others) {
    for (End& end : other_ends(search))
      if (mean_distance(end.x, result.x) > kept_distance) result.others.push_back(std::move(end.x));
  }
  SurfaceFitter& fitter = search.fitter();
  std::vector<double> distances = fitter.distances(result.x, result.support);
  std::erase_if(distances, [](double distance) { return std::isnan(distance); });
  result.residual_median = quantile(distances, 0.5);
  result.residual_p95 = quantile(distances, 0.95);
  const double met = static_cast<double>(distances.size()) / result.points;
  result.usable = result.residual_median < largest_residual && met > least_met;
  if (!result.usable) {
    result.note = fmt::format(
        "the cloth stays {:.1f} mm (median) from the decoded points and meets {:.0f} % of them",
        1e3 * result.residual_median, 100 * met);
  }
  return result;
}

std::vector<RefinedSurface> refine_surfaces(const StripePoints& points, const Mask& silhouette,
                                            const Rig& rig, const Scene& scene,
                                            const Fabric& fabric, const std::vector<Points>& from,
                                            int threads) {
  std::vector<Way> ways;
  for (const Points& x : from) ways.push_back({x, {}});
  SurfaceSearch search(points, silhouette, rig, scene, threads, fabric);
  std::vector<RefinedSurface> result;
  search.begin(ways, last);
  for (End& end : search.go_on(last)) result.push_back({std::move(end.x), end.energy});
  return result;
}

}  // namespace weft
