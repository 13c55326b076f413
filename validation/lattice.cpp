/// Where is weft's model the limit, on captures whose true surface was moved by a lattice of
/// springs?
///
///     weft_validate_lattice CAPTURE [OUT.csv]
///
/// CAPTURE with [truth] on a grid of square quads, and with the constants of the lattice in
/// CAPTURE/truth/parameters.toml. Simulates that lattice, with a program of its own, and prints its
/// mean distance to the true surface over the fit frames and over the later ones, mm: with all
/// terms as in the source, then with one term changed at a time. The first row says how far the
/// source's motion is determined by its constants at all; each other row says what a model that
/// lacks the term cannot do better than, without a change of its other parameters. OUT.csv: the
/// distance by variant and frame, m.
///
/// The lattice, for quads of side h (m):
/// - Mass rho h^2 at every vertex, the rim's too (kg); gravity.
/// - Air drag c_a m v against the velocity v (c_a: 1/s).
/// - Springs along the edges, of length L = h, stiffness k (N/m), in compression another one; and
///   along both diagonals of each quad, L = h sqrt(2), k_d, which go slack when shorter than L.
///   With d the unit vector from end i to end j and l their distance, the force on i is
///       f = (k (l - L) + c_s (v_j - v_i) . d) d,    c_s the tension damping (N s/m).
/// - Bending at each edge between two quads and, with the two triangles beside it as faces, at each
///   diagonal. With theta the angle between the faces' normals n_a and n_b (rad), v_a and v_b the
///   faces' mean velocities and v_e that of the edge, each face is pushed along its normal by
///       f = w (2 B / h) theta - (4 c_b / h^2) ((v_a - v_e) . n_a + (v_b - v_e) . n_b),
///   shared evenly by its vertices, and the ends of the edge take the opposite force. w is 1 at
///   edges, sqrt(2) at diagonals; B the bending stiffness (N m), c_b its damping (N m s). An edge
///   thus feels one angle, the mean of those at its two ends; a variant feels both.
/// - Implicit Euler, linearised once a step of dt = 1/64 frame:
///       (M + dt D + dt^2 K) dv = dt (f - dt K v),    v += dv,    x += dt v,
///   D and K of springs (K without the part of a compressed spring across d) and drag; bending is
///   explicit. Conjugate gradients until the residual is 1 % of the right-hand side.
/// - Vertices are the control points of a subdivision surface: the true surface's points are their
///   limits, (1, 4, 1)/6 along both directions, along the rim only on it, corners as they are.
///
/// Starts at the control points of the first true frame and settles for 0.7 s, the first 70 % with
/// 2.5 /s more drag; then the cloth is at rest and the fixtures follow
/// the capture, in straight lines between its path's points at every quarter of a frame.
#include <fmt/core.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <fstream>
#include <numbers>
#include <string>
#include <vector>

#include "program.h"
#include "source_lattice.h"
#include "weft/base/error.h"
#include "weft/base/parallel.h"
#include "weft/capture/capture.h"

namespace {

using namespace weft;
using validation::Constants;
using validation::Grid;
using validation::grid_of;
using validation::LimitSurface;

constexpr int kStepsPerFrame = 64;
constexpr int kLinesPerFrame = 4;          // of the fixtures' paths
constexpr double kSettling = 0.7;          // s
constexpr double kSettlingDrag = 2.5;      // 1/s
constexpr double kSettlingDragPart = 0.7;  // of the settling
constexpr double kSolverTolerance = 0.01;  // of the right-hand side
constexpr int kMaxSolverIterations = 100;

enum class EdgeAngles {
  mean,        // of the two ends, between quads
  at_each_end  // each end by itself, half as stiff, between the triangles of the edge and its sides
};

/// A change of one term: factors on what the source has.
struct Variant {
  std::string name;
  double diagonal = 1;
  double diagonal_compression = 0;  // stiffness in compression over that in tension
  double rim_mass = 1;
  double rim_edge = 1;
  double diagonal_bending = 1;
  double edge_compression = 1;
  double rim_drag = 1;  // on top of what its mass does
  EdgeAngles edge_angles = EdgeAngles::mean;
  double solver_tolerance = kSolverTolerance;
};

std::vector<Variant> variants() {
  return {{.name = "all as in the source"},
          {.name = "diagonals resist compression too", .diagonal_compression = 1},
          {.name = "the same with 0.75 k_d", .diagonal = 0.75, .diagonal_compression = 1},
          {.name = "rim vertices with half mass", .rim_mass = 0.5},
          {.name = "rim edges with half stiffness", .rim_edge = 0.5},
          {.name = "diagonals' bending x 0.75", .diagonal_bending = 0.75},
          {.name = "no bending springs on diagonals", .diagonal_bending = 0},
          {.name = "k_d 1 % off", .diagonal = 0.99},
          {.name = "edges at 0.1 k in compression", .edge_compression = 0.1},
          {.name = "rim vertices with half drag", .rim_drag = 0.5},
          {.name = "an angle at each end of an edge", .edge_angles = EdgeAngles::at_each_end},
          {.name = "the same, diagonals' bending x 0.75",
           .diagonal_bending = 0.75,
           .edge_angles = EdgeAngles::at_each_end},
          {.name = "solved to 1e-6", .solver_tolerance = 1e-6}};
}

struct Spring {
  int i, j;
  double length;                // m
  double tension, compression;  // N/m
  double damping;               // N s/m
  bool slack;                   // no force at all when shorter than `length`
};

std::vector<Spring> make_springs(const Grid& grid, const Constants& c, const Variant& variant) {
  std::vector<Spring> springs;
  const auto edge = [&](int i, int j, bool rim) {
    const double scale = rim ? variant.rim_edge : 1;
    springs.push_back({i, j, grid.side, scale * c.edge,
                       scale * variant.edge_compression * c.edge_compression, c.tension_damping,
                       false});
  };
  const double k = variant.diagonal * c.diagonal;
  const auto diagonal = [&](int i, int j) {
    springs.push_back({i, j, std::numbers::sqrt2 * grid.side, k, variant.diagonal_compression * k,
                       c.tension_damping, variant.diagonal_compression == 0});
  };
  for (int r = 0; r < grid.rows; ++r) {
    for (int q = 0; q < grid.columns; ++q) {
      const bool right = q + 1 < grid.columns, below = r + 1 < grid.rows;
      if (right) edge(grid.vertex(r, q), grid.vertex(r, q + 1), grid.rim_row(r));
      if (below) edge(grid.vertex(r, q), grid.vertex(r + 1, q), grid.rim_column(q));
      if (!right || !below) continue;
      diagonal(grid.vertex(r, q), grid.vertex(r + 1, q + 1));
      diagonal(grid.vertex(r, q + 1), grid.vertex(r + 1, q));
    }
  }
  return springs;
}

/// Two faces that meet at the edge from i to j. They have 4 vertices beside an edge of the grid, 3
/// beside a diagonal.
struct Fold {
  int i, j;
  std::array<int, 4> a, b;
  int face_size;
  double stiffness;  // what stands before the angle, N/rad
};

std::vector<Fold> make_folds(const Grid& grid, const Constants& c, const Variant& variant) {
  std::vector<Fold> folds;
  const double edge = 2 * c.bending / grid.side;
  // Beside the edge from i to j the quads have the sides i - a, j - a2 and i - b, j - b2.
  const auto add = [&](int i, int j, int a, int a2, int b, int b2) {
    if (variant.edge_angles == EdgeAngles::mean) {
      folds.push_back({i, j, {i, j, a2, a}, {i, j, b2, b}, 4, edge});
      return;
    }
    // Half of the moment, by a force a third of which has a lever, not half of it.
    const double each = 0.5 * 1.5 * edge;
    folds.push_back({i, j, {i, j, a, 0}, {i, j, b, 0}, 3, each});
    folds.push_back({i, j, {i, j, a2, 0}, {i, j, b2, 0}, 3, each});
  };
  for (int r = 0; r < grid.rows; ++r) {
    for (int q = 0; q < grid.columns; ++q) {
      const auto v = [&](int row, int column) { return grid.vertex(row, column); };
      if (q + 1 < grid.columns && !grid.rim_row(r))
        add(v(r, q), v(r, q + 1), v(r - 1, q), v(r - 1, q + 1), v(r + 1, q), v(r + 1, q + 1));
      if (r + 1 < grid.rows && !grid.rim_column(q))
        add(v(r, q), v(r + 1, q), v(r, q - 1), v(r + 1, q - 1), v(r, q + 1), v(r + 1, q + 1));
    }
  }
  const double diagonal = variant.diagonal_bending * std::numbers::sqrt2 * edge;
  if (diagonal == 0) return folds;  // its damper goes too
  for (int r = 0; r + 1 < grid.rows; ++r) {
    for (int q = 0; q + 1 < grid.columns; ++q) {
      const auto [p0, p1, p2, p3] = grid.quad(r, q);
      folds.push_back({p0, p2, {p0, p1, p2, 0}, {p2, p3, p0, 0}, 3, diagonal});
      folds.push_back({p1, p3, {p1, p2, p3, 0}, {p3, p0, p1, 0}, 3, diagonal});
    }
  }
  return folds;
}

VecX make_masses(const Grid& grid, const Constants& c, const Variant& variant) {
  VecX masses(grid.columns * grid.rows);
  for (int r = 0; r < grid.rows; ++r) {
    for (int q = 0; q < grid.columns; ++q) {
      masses[grid.vertex(r, q)] = c.density * grid.side * grid.side *
                                  (grid.rim_row(r) ? variant.rim_mass : 1) *
                                  (grid.rim_column(q) ? variant.rim_mass : 1);
    }
  }
  return masses;
}

VecX rim_drag(const Grid& grid, const Variant& variant) {
  VecX share = VecX::Ones(grid.columns * grid.rows);
  for (int r = 0; r < grid.rows; ++r)
    for (int q = 0; q < grid.columns; ++q)
      share[grid.vertex(r, q)] =
          (grid.rim_row(r) ? variant.rim_drag : 1) * (grid.rim_column(q) ? variant.rim_drag : 1);
  return share;
}

class Lattice {
 public:
  Lattice(const Grid& grid, const Constants& constants, const Variant& variant, const Scene& scene,
          const Points& start)
      : x(start),
        v(Points::Zero(3, start.cols())),
        springs_(make_springs(grid, constants, variant)),
        folds_(make_folds(grid, constants, variant)),
        masses_(make_masses(grid, constants, variant)),
        drag_share_(rim_drag(grid, variant)),
        fold_damping_(4 * constants.bending_damping / (grid.side * grid.side)),
        drag_rate_(constants.drag_rate),
        tolerance_(variant.solver_tolerance),
        scene_(scene),
        tangents_(springs_.size()) {
    for (Points* points : {&force_, &dv_, &residual_, &direction_, &product_})
      points->resizeLike(start);
  }

  /// One step of dt, s; `more_drag`, 1/s. Fixed vertices keep their velocity.
  void step(double dt, double more_drag);

  Points x, v;  // m, m/s

 private:
  /// Linearisation of a spring's force: across I + along d d^T by position, damping d d^T by
  /// velocity.
  struct Tangent {
    Vec3 d;
    double across, along, damping;
  };

  void add_spring(const Spring& spring, Tangent& tangent);
  void add_fold(const Fold& fold);
  void evaluate(double drag_rate);
  void multiply(double dt, double drag_rate, const Points& p, Points& product) const;
  void solve(double dt, double drag_rate);
  void clear_fixed(Points& points) const {
    for (const PointFixture& fixture : scene_.fixtures) points.col(fixture.vertex).setZero();
  }

  std::vector<Spring> springs_;
  std::vector<Fold> folds_;
  VecX masses_;          // kg
  VecX drag_share_;      // factor on the drag of a vertex
  double fold_damping_;  // N s/m
  double drag_rate_;     // 1/s
  double tolerance_;     // of the right-hand side
  const Scene& scene_;
  std::vector<Tangent> tangents_;
  Points force_, dv_, residual_, direction_, product_;
};

void Lattice::add_spring(const Spring& spring, Tangent& tangent) {
  const Vec3 between = x.col(spring.j) - x.col(spring.i);
  const double l = between.norm();
  tangent = {between / l, 0, 0, 0};
  const bool compressed = l < spring.length;
  if (compressed && spring.slack) return;
  const double k = compressed ? spring.compression : spring.tension;
  tangent.damping = spring.damping;
  // A compressed spring's stiffness across d is negative and left out.
  tangent.across = compressed ? 0 : k * (1 - spring.length / l);
  tangent.along = k - tangent.across;
  const double rate = (v.col(spring.j) - v.col(spring.i)).dot(tangent.d);
  const Vec3 f = (k * (l - spring.length) + spring.damping * rate) * tangent.d;
  force_.col(spring.i) += f;
  force_.col(spring.j) -= f;
}

void Lattice::add_fold(const Fold& fold) {
  const int n = fold.face_size;
  const auto mean = [n](const Points& points, const std::array<int, 4>& face) {
    Vec3 sum = Vec3::Zero();
    for (int k = 0; k < n; ++k) sum += points.col(face[static_cast<std::size_t>(k)]);
    return Vec3(sum / n);
  };
  const Vec3 xi = x.col(fold.i), xj = x.col(fold.j);
  const Vec3 normal_a = (xj - xi).cross(xi - mean(x, fold.a)).normalized();
  const Vec3 normal_b = (xi - xj).cross(xj - mean(x, fold.b)).normalized();
  const double angle =
      std::atan2(normal_a.cross(normal_b).dot((xi - xj).normalized()), normal_a.dot(normal_b));
  const Vec3 edge_velocity = 0.5 * (v.col(fold.i) + v.col(fold.j));
  const double rate = (mean(v, fold.a) - edge_velocity).dot(normal_a) +
                      (mean(v, fold.b) - edge_velocity).dot(normal_b);
  const double f = fold.stiffness * angle - fold_damping_ * rate;
  for (std::size_t k = 0; k < static_cast<std::size_t>(n); ++k) {
    force_.col(fold.a[k]) += f / n * normal_a;
    force_.col(fold.b[k]) += f / n * normal_b;
  }
  const Vec3 opposite = 0.5 * f * (normal_a + normal_b);
  force_.col(fold.i) -= opposite;
  force_.col(fold.j) -= opposite;
}

void Lattice::evaluate(double drag_rate) {
  force_ = (scene_.gravity.replicate(1, v.cols()) - drag_rate * v * drag_share_.asDiagonal()) *
           masses_.asDiagonal();
  for (std::size_t s = 0; s < springs_.size(); ++s) add_spring(springs_[s], tangents_[s]);
  for (const Fold& fold : folds_) add_fold(fold);
}

/// product = (M + dt D + dt^2 K) p.
void Lattice::multiply(double dt, double drag_rate, const Points& p, Points& product) const {
  product = (p + dt * drag_rate * p * drag_share_.asDiagonal()) * masses_.asDiagonal();
  for (std::size_t s = 0; s < springs_.size(); ++s) {
    const Tangent& t = tangents_[s];
    if (t.across == 0 && t.along == 0) continue;
    const Vec3 difference = p.col(springs_[s].i) - p.col(springs_[s].j);
    const Vec3 f = dt * dt * t.across * difference +
                   (dt * dt * t.along + dt * t.damping) * t.d.dot(difference) * t.d;
    product.col(springs_[s].i) += f;
    product.col(springs_[s].j) -= f;
  }
}

/// Conjugate gradients from dv = 0; residual_ holds the right-hand side.
void Lattice::solve(double dt, double drag_rate) {
  dv_.setZero();
  direction_ = residual_;
  double squared = residual_.squaredNorm();
  const double enough = tolerance_ * tolerance_ * squared;
  for (int k = 0; k < kMaxSolverIterations && squared > enough; ++k) {
    multiply(dt, drag_rate, direction_, product_);
    clear_fixed(product_);
    const double length = squared / direction_.cwiseProduct(product_).sum();
    dv_ += length * direction_;
    residual_ -= length * product_;
    const double before = squared;
    squared = residual_.squaredNorm();
    direction_ = residual_ + squared / before * direction_;
  }
}

void Lattice::step(double dt, double more_drag) {
  const double drag_rate = drag_rate_ + more_drag;
  evaluate(drag_rate);
  residual_ = dt * force_;
  for (std::size_t s = 0; s < springs_.size(); ++s) {
    const Tangent& t = tangents_[s];
    const Vec3 difference = v.col(springs_[s].i) - v.col(springs_[s].j);
    const Vec3 f = dt * dt * (t.across * difference + t.along * t.d.dot(difference) * t.d);
    residual_.col(springs_[s].i) -= f;
    residual_.col(springs_[s].j) += f;
  }
  clear_fixed(residual_);
  solve(dt, drag_rate);
  v += dv_;
  x += dt * v;
}

void settle(Lattice& lattice, double dt) {
  const auto steps = static_cast<int>(std::lround(kSettling / dt));
  for (int s = 0; s < steps; ++s)
    lattice.step(dt, s < kSettlingDragPart * steps ? kSettlingDrag : 0);
  lattice.v.setZero();
}

/// From one frame to the next. The fixtures move in straight lines between the measured path's
/// points at every quarter of a frame, as in the source.
void advance_frame(Lattice& lattice, const Scene& scene, double begin, double dt) {
  constexpr int kSteps = kStepsPerFrame / kLinesPerFrame;
  for (int line = 0; line < kLinesPerFrame; ++line) {
    const double from = begin + line * kSteps * dt, to = from + kSteps * dt;
    for (int s = 1; s <= kSteps; ++s) {
      for (const PointFixture& f : scene.fixtures)
        lattice.v.col(f.vertex) = (f.motion.position(to) - f.motion.position(from)) / (kSteps * dt);
      lattice.step(dt, 0);
      for (const PointFixture& f : scene.fixtures) {
        const Vec3 start = f.motion.position(from);
        lattice.x.col(f.vertex) = start + (f.motion.position(to) - start) * s / kSteps;
      }
    }
  }
}

/// Mean distance to the true surface at each frame, m.
std::vector<double> distances(const Grid& grid, const Constants& constants, const Variant& variant,
                              const Scene& scene, const TruthSurface& truth) {
  const LimitSurface surface(grid);
  Lattice lattice(grid, constants, variant, scene, surface.control(truth.frames[0]));
  const double dt = (scene.frame_times[1] - scene.frame_times[0]) / kStepsPerFrame;
  settle(lattice, dt);
  std::vector<double> result;
  for (std::size_t k = 0; k < truth.frames.size(); ++k) {
    if (k > 0) advance_frame(lattice, scene, scene.frame_times[k - 1], dt);
    result.push_back((surface.limits(lattice.x) - truth.frames[k]).colwise().norm().mean());
  }
  return result;
}

/// Mean over frames first to last, mm; nan where there is none.
double mean_millimetres(const std::vector<double>& distance, int first, int last) {
  double sum = 0;
  for (int k = first; k <= last; ++k) sum += distance[static_cast<std::size_t>(k)];
  return 1e3 * sum / (last - first + 1);
}

void write_csv(const std::string& path, const std::vector<std::vector<double>>& distance,
               const Scene& scene) {
  std::ofstream out(path);
  out << "variant,frame,time_s,distance_m\n";
  const std::vector<Variant> all = variants();
  for (std::size_t i = 0; i < all.size(); ++i)
    for (std::size_t k = 0; k < distance[i].size(); ++k)
      out << fmt::format("{},{},{:.6f},{:.6e}\n", all[i].name, k, scene.frame_times[k],
                         distance[i][k]);
  if (!out.flush()) throw Error(path + ": cannot be written");
}

int run(int argc, char** argv) {
  if (argc < 2 || argc > 3) throw Error("usage: weft_validate_lattice CAPTURE [OUT.csv]");
  const Capture capture = read_capture(argv[1]);
  const TruthSurface truth = read_truth(capture);
  const Constants constants = validation::read_constants(capture);
  if (capture.frame_count < 2) throw Error(capture.name + ": one frame is no motion");
  const Grid grid = grid_of(capture, truth.mesh);
  const Scene scene = make_scene(capture, grid.columns, grid.rows, 0, capture.frame_count - 1);
  const std::vector<Variant> all = variants();
  std::vector<std::vector<double>> distance(all.size());
  parallel_for(all.size(), 0, [&](std::size_t i) {
    distance[i] = distances(grid, constants, all[i], scene, truth);
  });
  fmt::print("{}: mean distance to the true surface, mm\n  {:34} {:>8} {:>10}\n", capture.name, "",
             "fit", "validation");
  for (std::size_t i = 0; i < all.size(); ++i)
    fmt::print("  {:34} {:8.2f} {:10.2f}\n", all[i].name,
               mean_millimetres(distance[i], capture.fit_first, capture.fit_last),
               mean_millimetres(distance[i], capture.fit_last + 1, capture.frame_count - 1));
  if (argc == 3) write_csv(argv[2], distance, scene);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return weft::validation::run_program("weft_validate_lattice", [&] { return run(argc, argv); });
}
