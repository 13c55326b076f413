#include "weft/estimate/scan_trial.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include "weft/base/dense.h"
#include "weft/base/error.h"
#include "weft/base/parallel.h"
#include "weft/estimate/mechanical_trial.h"
#include "weft/mesh/grid_lines.h"

namespace weft {
namespace {

constexpr int kMostScanCells = 200;
constexpr double kSamePlace = 1e-7;      // m
constexpr double kEqualSpacing = 1e-4;   // of a cell
constexpr double kLeastShare = 1e-9;     // of a corner in what lies in a triangle
constexpr double kLeastScatter = 1e-12;  // of variances of poses, over the largest
constexpr std::size_t kMostHeldPoints = 256;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// Lines of a grid.
struct Lines {
  std::vector<double> u, v;
};

void sort_unique(std::vector<double>& values) {
  std::sort(values.begin(), values.end());
  const auto same = [](double a, double b) { return b - a < kSamePlace; };
  values.erase(std::unique(values.begin(), values.end(), same), values.end());
}

/// The lines whose crossings, row by row, are the vertices; nothing where there are none.
std::optional<Lines> grid_of(const TriangleMesh& mesh) {
  Lines lines;
  for (Eigen::Index i = 0; i < mesh.material.cols(); ++i) {
    lines.u.push_back(mesh.material(0, i));
    lines.v.push_back(mesh.material(1, i));
  }
  sort_unique(lines.u);
  sort_unique(lines.v);
  if (lines.u.size() * lines.v.size() != at(mesh.material.cols())) return {};
  for (std::size_t i = 0; i < at(mesh.material.cols()); ++i) {
    const Vec2 uv(lines.u[i % lines.u.size()], lines.v[i / lines.u.size()]);
    if ((uv - mesh.material.col(static_cast<Eigen::Index>(i))).norm() > kSamePlace) return {};
  }
  return lines;
}

std::vector<double> borders_along(int axis, const std::vector<ScanClamp>& clamps) {
  std::vector<double> borders;
  for (const ScanClamp& clamp : clamps)
    borders.insert(borders.end(), {clamp.region.lower[axis], clamp.region.upper[axis]});
  return borders;
}

/// Bars that hold an area want the mesh of a mechanical test, fine beside them.
bool only_broad_bars(const ScanTarget& target) {
  return std::all_of(target.clamps.begin(), target.clamps.end(), [](const ScanClamp& clamp) {
    return clamp.kind == ClampKind::bar &&
           (clamp.region.upper - clamp.region.lower).minCoeff() > kSamePlace;
  });
}

TriangleMesh mesh_of_bars(const ScanCapture& capture, const ScanTarget& target,
                          const ScanOptions& scan_options) {
  MechanicalCapture bars;
  bars.name = target.name;
  bars.width = capture.width;
  bars.height = capture.height;
  bars.frame_count = 1;
  for (const ScanClamp& clamp : target.clamps) {
    MechanicalFixture fixture;
    fixture.frames = {Clip{clamp.region, Vec3::Zero(), Eigen::Quaterniond::Identity()}};
    fixture.forces.resize(3, 0);
    bars.fixtures.push_back(fixture);
  }
  MechanicalOptions options;
  options.cells = scan_options.cells;
  options.pattern = scan_options.pattern;
  return prepare_mechanical(bars, options)->stages.front().mesh;
}

TriangleMesh simulated_mesh(const ScanCapture& capture, const ScanTarget& target,
                            const ScanShape& shape, const ScanOptions& options) {
  if (options.cells == 0) {
    if (const auto lines = grid_of(shape.mesh))
      return make_swatch(lines->u, lines->v, options.pattern);
    throw Error(fmt::format(
        "target \"{}\": its vertices are no grid of rows and columns; say on how many cells to "
        "simulate it",
        target.name));
  }
  if (only_broad_bars(target)) return mesh_of_bars(capture, target, options);
  const double spacing = std::min(capture.width, capture.height) / options.cells;
  return make_swatch(grid_lines(capture.width, borders_along(0, target.clamps), spacing),
                     grid_lines(capture.height, borders_along(1, target.clamps), spacing),
                     options.pattern);
}

bool equally_spaced(const std::vector<double>& lines) {
  const double cell = (lines.back() - lines.front()) / static_cast<double>(lines.size() - 1);
  for (std::size_t i = 0; i < lines.size(); ++i)
    if (std::abs(lines.front() + cell * static_cast<double>(i) - lines[i]) > kEqualSpacing * cell)
      return false;
  return true;
}

/// Rows 3 k to 3 k + 2: the surface of `mesh` at point k.
SparseMatrix sampling_of(const TriangleMesh& mesh, const MaterialPoints& uv) {
  const MaterialLocator locator(mesh);
  std::vector<Eigen::Triplet<double>> entries;
  for (Eigen::Index i = 0; i < uv.cols(); ++i) {
    const auto hit = locator.locate(uv.col(i));
    const auto& triangle = mesh.triangles[at(hit.triangle)];
    for (int corner = 0; corner < 3; ++corner)
      for (int k = 0; k < 3; ++k)
        entries.emplace_back(static_cast<int>(3 * i + k), 3 * triangle[at(corner)] + k,
                             hit.barycentric[corner]);
  }
  SparseMatrix matrix(static_cast<int>(3 * uv.cols()), 3 * mesh.vertex_count());
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

Points sampled(const SparseMatrix& sampling, const Points& x) {
  const VecX values = sampling * flat(x);
  return Points::Map(values.data(), 3, values.size() / 3);
}

/// 1 only where all that a point is sampled from was measured.
VecX sampled_weights(const TriangleMesh& mesh, const VecX& weights, const MaterialPoints& uv) {
  const MaterialLocator locator(mesh);
  VecX result(uv.cols());
  for (Eigen::Index i = 0; i < uv.cols(); ++i) {
    const auto hit = locator.locate(uv.col(i));
    double weight = 1;
    for (int corner = 0; corner < 3; ++corner)
      if (hit.barycentric[corner] > 1e-6)
        weight = std::min(weight, weights[mesh.triangles[at(hit.triangle)][at(corner)]]);
    result[i] = weight;
  }
  return result;
}

/// The rigid motion of the flat fabric nearest to `x`.
struct Pose {
  Vec2 center = Vec2::Zero();
  Vec3 position = Vec3::Zero();
  Mat3 rotation = Mat3::Identity();
  Vec3 place(const Vec2& uv) const {
    const Vec2 d = uv - center;
    return position + rotation * Vec3(d.x(), d.y(), 0);
  }
};

Pose nearest_pose(const MaterialPoints& uv, const Points& x) {
  Pose pose;
  pose.center = uv.rowwise().mean();
  pose.position = x.rowwise().mean();
  Mat3 sum = Mat3::Zero();
  for (Eigen::Index i = 0; i < uv.cols(); ++i) {
    const Vec2 d = uv.col(i) - pose.center;
    sum += (x.col(i) - pose.position) * Vec3(d.x(), d.y(), 0).transpose();
  }
  pose.rotation = nearest_rotation(singular_values_3(sum));
  return pose;
}

constexpr double kStraight = 1e-3;  // of the width over the length of points

/// The direction along which points lie, a unit vector; nothing where they span an area.
std::optional<Vec2> line_of(const MaterialPoints& uv) {
  const MaterialPoints d = uv.colwise() - Vec2(uv.rowwise().mean());
  const SymmetricEigen spread = symmetric_eigen(d * d.transpose());
  if (spread.values[0] > kStraight * kStraight * spread.values[1]) return {};
  return spread.vectors.col(1);
}

/// Turns a pose, the shortest way, until it has the points at `x` that are on one line, which say
/// nothing of the turn about that line.
Pose along_line(Pose pose, const Vec2& line, const MaterialPoints& uv, const Points& x) {
  const Vec2 center = uv.rowwise().mean();
  const Vec3 middle = x.rowwise().mean();
  Vec3 seen = Vec3::Zero();
  for (Eigen::Index i = 0; i < uv.cols(); ++i)
    seen += line.dot(uv.col(i) - center) * (x.col(i) - middle);
  const Vec3 is = pose.rotation * Vec3(line.x(), line.y(), 0);
  pose.rotation = turn_between(is, seen) * pose.rotation;
  pose.center = center;
  pose.position = middle;
  return pose;
}

/// Where a point of the scan or of its surface is: which vertices say so, and how much each.
struct SeenPoint {
  Vec2 uv = Vec2::Zero();
  std::vector<std::pair<int, double>> shares;
};

std::vector<SeenPoint> points_on(const ScanShape& shape, const MaterialLocator& locator,
                                 const MaterialPoints& uv) {
  std::vector<SeenPoint> points;
  for (Eigen::Index i = 0; i < uv.cols(); ++i) {
    const auto hit = locator.locate(uv.col(i));
    SeenPoint point{uv.col(i), {}};
    for (int corner = 0; corner < 3; ++corner)
      if (std::abs(hit.barycentric[corner]) > kLeastShare)
        point.shares.emplace_back(shape.mesh.triangles[at(hit.triangle)][at(corner)],
                                  hit.barycentric[corner]);
    points.push_back(std::move(point));
  }
  return points;
}

Mat3 inertia_of(const Pose& pose, const std::vector<SeenPoint>& points) {
  Mat3 inertia = Mat3::Zero();
  for (const SeenPoint& point : points) {
    const Vec3 r = pose.place(point.uv) - pose.position;
    inertia += r.squaredNorm() * Mat3::Identity() - r * r.transpose();
  }
  return inertia;
}

/// A pose, and which points it is nearest to: `seen`, and of what those do not say, being on one
/// line, `registered`.
struct BarPose {
  Pose pose;
  std::vector<SeenPoint> seen, registered;
};

/// From the scan's vertices in a region that were measured. What they do not say, being fewer than
/// two or on one line, is taken from where the registered grid has the vertices that are held.
BarPose pose_of_bar(const ScanTrial& trial, const ScanClamp& clamp,
                    const std::vector<int>& vertices) {
  std::vector<Eigen::Index> seen;
  std::vector<SeenPoint> seen_points;
  for (Eigen::Index i = 0; i < trial.shape.x.cols(); ++i)
    if (clamp.region.contains(trial.shape.mesh.material.col(i)) &&
        counts_as_measured(trial.shape.weights[i])) {
      seen.push_back(i);
      seen_points.push_back({trial.shape.mesh.material.col(i), {{static_cast<int>(i), 1.0}}});
    }
  const MaterialPoints seen_uv = trial.shape.mesh.material(Eigen::all, seen);
  const Points seen_x = trial.shape.x(Eigen::all, seen);
  const MaterialLocator locator(trial.shape.mesh);
  const MaterialPoints uv = trial.mesh.material(Eigen::all, vertices);
  const std::vector<SeenPoint> held_points = points_on(trial.shape, locator, uv);
  const auto line = seen.size() >= 2 ? line_of(seen_uv) : std::nullopt;
  if (seen.size() >= 2 && !line) return {nearest_pose(seen_uv, seen_x), seen_points, held_points};
  const Pose registered =
      nearest_pose(uv, interpolate(trial.shape.mesh, locator, trial.shape.x, uv));
  if (line) return {along_line(registered, *line, seen_uv, seen_x), seen_points, held_points};
  return {registered, held_points, held_points};
}

/// Makes ScanTrial::clamp_errors.
class ClampErrors {
 public:
  explicit ClampErrors(const ScanTrial& trial) : trial_(trial) {}

  /// The errors of a pose that is nearest to points: of its position the mean of theirs, of its
  /// turn J^-1 sum r x error, J their inertia about it. A turn that no point tells is without
  /// effect and left out.
  void add_bar(const BarPose& bar, const std::vector<int>& vertices) {
    const Pose& pose = bar.pose;
    const auto count = static_cast<double>(bar.seen.size());
    for (const SeenPoint& point : bar.seen)
      for (const auto& [vertex, share] : point.shares)
        for (int k = 0; k < 3; ++k)
          by_noise_.emplace_back(poses_ + k, 3 * vertex + k, share / count);
    for (const int i : vertices)
      for (int k = 0; k < 3; ++k) by_poses_.emplace_back(3 * i + k, poses_ + k, 1);
    poses_ += 3;
    const SymmetricEigen3 turns = symmetric_eigen_3(inertia_of(pose, bar.seen));
    const Mat3 registered = inertia_of(pose, bar.registered);
    const double least = kStraight * kStraight * std::max(turns.values.sum(), registered.trace());
    for (int k = 0; k < 3; ++k) {
      const Vec3 axis = turns.vectors.col(k);
      const double of_registered = axis.dot(registered * axis);
      if (turns.values[k] > least)
        add_turn(pose, axis, turns.values[k], bar.seen, vertices);
      else if (of_registered > least)
        add_turn(pose, axis, of_registered, bar.registered, vertices);
    }
  }

  /// Held where the scan's vertices have them.
  void add_points(const std::vector<SeenPoint>& points, const std::vector<int>& vertices) {
    std::map<int, int> first;  // column of each vertex of the scan
    for (const SeenPoint& point : points)
      for (const auto& [vertex, share] : point.shares)
        first.emplace(vertex, static_cast<int>(first.size()));
    if (first.size() > kMostHeldPoints) return;
    for (std::size_t i = 0; i < vertices.size(); ++i)
      for (const auto& [vertex, share] : points[i].shares)
        for (int k = 0; k < 3; ++k)
          of_points_.emplace_back(3 * vertices[i] + k, points_ + 3 * first.at(vertex) + k,
                                  share * trial_.target.noise);
    points_ += 3 * static_cast<int>(first.size());
  }

  SparseMatrix matrix() const {
    std::vector<Eigen::Triplet<double>> entries = of_points_;
    int count = points_;
    for (const VecX& error : pose_errors()) {
      for (const auto& entry : by_poses_)
        entries.emplace_back(entry.row(), count, entry.value() * error[entry.col()]);
      ++count;
    }
    SparseMatrix errors(3 * trial_.mesh.vertex_count(), count);
    errors.setFromTriplets(entries.begin(), entries.end());
    return errors;
  }

 private:
  /// About the axis, a unit vector, by points whose inertia about it is given. What is counted is
  /// the turn times the radius of gyration: a length, as positions are.
  void add_turn(const Pose& pose, const Vec3& axis, double inertia,
                const std::vector<SeenPoint>& points, const std::vector<int>& vertices) {
    const double radius = std::sqrt(inertia / static_cast<double>(points.size()));
    for (const SeenPoint& point : points) {
      const Vec3 by = radius / inertia * axis.cross(pose.place(point.uv) - pose.position);
      for (const auto& [vertex, share] : point.shares)
        for (int k = 0; k < 3; ++k) by_noise_.emplace_back(poses_, 3 * vertex + k, share * by[k]);
    }
    for (const int i : vertices) {
      const Vec3 r = pose.place(trial_.mesh.material.col(i)) - pose.position;
      const Vec3 move = axis.cross(r) / radius;
      for (int k = 0; k < 3; ++k) by_poses_.emplace_back(3 * i + k, poses_, move[k]);
    }
    ++poses_;
  }

  /// Bars that meet at a corner share its error: independent are the principal directions of what
  /// their poses scatter together.
  std::vector<VecX> pose_errors() const {
    std::vector<VecX> errors;
    if (poses_ == 0) return errors;
    SparseMatrix by_noise(poses_, 3 * trial_.shape.mesh.vertex_count());
    by_noise.setFromTriplets(by_noise_.begin(), by_noise_.end());
    const SymmetricEigen scatter = symmetric_eigen(MatX(by_noise * by_noise.transpose()));
    for (Eigen::Index k = 0; k < scatter.values.size(); ++k)
      if (scatter.values[k] > kLeastScatter * scatter.values[scatter.values.size() - 1])
        errors.push_back(trial_.target.noise * std::sqrt(scatter.values[k]) *
                         scatter.vectors.col(k));
    return errors;
  }

  const ScanTrial& trial_;
  std::vector<Eigen::Triplet<double>> by_noise_, by_poses_, of_points_;
  int poses_ = 0, points_ = 0;  ///< coordinates of all poses, errors of points
};

void hold(ScanTrial& trial) {
  const int vertices = trial.mesh.vertex_count();
  const MaterialLocator locator(trial.shape.mesh);
  const Points& from = trial.shape.start ? *trial.shape.start : trial.shape.x;
  trial.start = interpolate(trial.shape.mesh, locator, from, trial.mesh.material);
  trial.clamp_of.assign(at(vertices), -1);
  trial.held.assign(at(vertices), 0);
  int count = 0;
  ClampErrors errors(trial);
  for (std::size_t c = 0; c < trial.target.clamps.size(); ++c) {
    const ScanClamp& clamp = trial.target.clamps[c];
    std::vector<int> own;
    for (int i = 0; i < vertices; ++i) {
      if (trial.clamp_of[at(i)] >= 0 || !clamp.region.contains(trial.mesh.material.col(i)))
        continue;
      trial.clamp_of[at(i)] = static_cast<int>(c);
      trial.held[at(i)] = 1;
      own.push_back(i);
      ++count;
    }
    if (own.empty())
      throw error_at(clamp.where, fmt::format("target \"{}\": clamp \"{}\" holds no vertex of the "
                                              "simulated grid",
                                              trial.target.name, clamp.name));
    const Points seen =
        interpolate(trial.shape.mesh, locator, trial.shape.x, trial.mesh.material(Eigen::all, own));
    if (clamp.kind == ClampKind::bar && own.size() > 1) {
      const BarPose bar = pose_of_bar(trial, clamp, own);
      for (const int i : own) trial.start.col(i) = bar.pose.place(trial.mesh.material.col(i));
      errors.add_bar(bar, own);
    } else {
      trial.start(Eigen::all, own) = seen;
      errors.add_points(points_on(trial.shape, locator, trial.mesh.material(Eigen::all, own)), own);
    }
  }
  trial.clamp_errors = errors.matrix();
  if (count == vertices)
    throw Error(fmt::format("target \"{}\": clamps hold the whole cloth", trial.target.name));
}

bool equally_spaced(const Lines& lines) {
  return equally_spaced(lines.u) && equally_spaced(lines.v);
}

/// The coarser of the scan's grid and the simulated one, if it is an even one; else an even grid of
/// as many rows and columns as are simulated.
void set_descriptor_grid(ScanTrial& trial) {
  DescriptorGrid& grid = trial.grid;
  const auto scanned = grid_of(trial.shape.mesh);
  const bool use_scan = scanned && equally_spaced(*scanned) &&
                        trial.shape.mesh.vertex_count() <= trial.mesh.vertex_count();
  const Lines lines = use_scan ? *scanned : grid_of(trial.mesh).value();
  grid.columns = static_cast<int>(lines.u.size());
  grid.rows = static_cast<int>(lines.v.size());
  if (equally_spaced(lines)) {
    grid.mesh = make_swatch(lines.u, lines.v, GridPattern::uniform);
    return;
  }
  const Vec2 lower(lines.u.front(), lines.v.front()), upper(lines.u.back(), lines.v.back());
  grid.mesh = make_swatch(upper.x() - lower.x(), upper.y() - lower.y(), grid.columns, grid.rows,
                          GridPattern::uniform);
  grid.mesh.material.colwise() += lower;
}

std::shared_ptr<ScanTrial> prepare_target(const ScanCapture& capture, const ScanTarget& target,
                                          ScanShape shape, const ScanOptions& options) {
  auto trial = std::make_shared<ScanTrial>();
  trial->target = target;
  trial->shape = std::move(shape);
  if (trial->shape.weights.size() == 0)
    trial->shape.weights = VecX::Ones(trial->shape.mesh.vertex_count());
  trial->areal_density = capture.areal_density;
  trial->grain_angle = capture.grain_angle;
  trial->hem_width = capture.hem_width;
  trial->mesh = simulated_mesh(capture, target, trial->shape, options);
  trial->pattern = options.pattern;
  hold(*trial);

  DescriptorGrid& grid = trial->grid;
  set_descriptor_grid(*trial);
  const MaterialPoints& uv = grid.mesh.material;
  grid.weights = sampled_weights(trial->shape.mesh, trial->shape.weights, uv);
  trial->sampling = sampling_of(trial->mesh, uv);
  trial->measured = sampled(sampling_of(trial->shape.mesh, uv), trial->shape.x);
  trial->at_scan = sampling_of(trial->mesh, trial->shape.mesh.material);
  trial->measured_descriptor = make_shape_descriptor(options.descriptor, grid);
  trial->simulated_descriptor = make_shape_descriptor(
      options.descriptor, grid, options.descriptor == DescriptorKind::fourier ? target.noise : 0);
  return trial;
}

std::vector<double> halved(const std::vector<double>& lines) {
  std::vector<double> finer{lines.front()};
  for (std::size_t i = 1; i < lines.size(); ++i)
    finer.insert(finer.end(), {0.5 * (lines[i - 1] + lines[i]), lines[i]});
  return finer;
}

Points forces_of(const ScanTrial& trial, const Points& reactions) {
  Points forces = Points::Zero(3, static_cast<Eigen::Index>(trial.target.clamps.size()));
  for (std::size_t i = 0; i < trial.clamp_of.size(); ++i)
    if (trial.clamp_of[i] >= 0)
      forces.col(trial.clamp_of[i]) += reactions.col(static_cast<Eigen::Index>(i));
  return forces;
}

MatX force_derivatives_of(const ScanTrial& trial, const MatX& reactions) {
  MatX forces =
      MatX::Zero(3 * static_cast<Eigen::Index>(trial.target.clamps.size()), reactions.cols());
  for (std::size_t i = 0; i < trial.clamp_of.size(); ++i)
    if (trial.clamp_of[i] >= 0)
      forces.middleRows(3 * trial.clamp_of[i], 3) +=
          reactions.middleRows(3 * static_cast<Eigen::Index>(i), 3);
  return forces;
}

void check(const ScanOptions& options) {
  if (options.cells != 0 && (options.cells < 2 || options.cells > kMostScanCells))
    throw Error(fmt::format("cells is {}, must be 0 or in [2, {}]", options.cells, kMostScanCells));
}

}  // namespace

std::vector<std::shared_ptr<const ScanTrial>> prepare_scan(const ScanCapture& capture,
                                                           const std::vector<ScanShape>& shapes,
                                                           const ScanOptions& options) {
  check(options);
  if (shapes.size() != capture.targets.size())
    throw Error(fmt::format("{} shapes for {} targets", shapes.size(), capture.targets.size()));
  std::vector<std::shared_ptr<const ScanTrial>> trials;
  for (std::size_t i = 0; i < shapes.size(); ++i)
    trials.push_back(prepare_target(capture, capture.targets[i], shapes[i], options));
  return trials;
}

std::vector<std::shared_ptr<const ScanTrial>> prepare_scan(const ScanCapture& capture,
                                                           const ScanOptions& options) {
  check(options);
  std::vector<std::shared_ptr<const ScanTrial>> trials;
  for (const ScanTarget& target : capture.targets) {
    if (!target.grid.empty()) {
      trials.push_back(prepare_target(capture, target, read_scan_shape(capture, target), options));
      continue;
    }
    RegisteredScan found = register_raw_scan(capture, target, options.raw);
    const auto trial = prepare_target(capture, target, std::move(found.shape), options);
    trial->registration = std::move(found.registration);
    trials.push_back(trial);
  }
  return trials;
}

std::shared_ptr<const ScanTrial> refined(const ScanTrial& trial) {
  const Lines lines = grid_of(trial.mesh).value();
  const std::vector<double> u = halved(lines.u), v = halved(lines.v);
  const std::size_t cells = std::min(u.size(), v.size()) - 1;
  if (cells > at(kMostScanCells))
    throw Error(fmt::format("target \"{}\" would have {} cells across, more than {}",
                            trial.target.name, cells, kMostScanCells));
  auto finer = std::make_shared<ScanTrial>(trial);
  finer->mesh = make_swatch(u, v, trial.pattern);
  hold(*finer);
  finer->sampling = sampling_of(finer->mesh, trial.grid.mesh.material);
  finer->at_scan = sampling_of(finer->mesh, trial.shape.mesh.material);
  return finer;
}

namespace {

HeldCloth held_cloth(const ScanTrial& trial) {
  return {trial.mesh, trial.areal_density, trial.target.gravity, trial.grain_angle,
          trial.held, trial.start,         trial.hem_width};
}

}  // namespace

std::vector<ScanSimulation> simulate_scans(
    const std::vector<std::shared_ptr<const ScanTrial>>& trials, const EquilibriumSolver& solver,
    const Fabric& fabric, HeldDerivatives derivatives, int threads) {
  std::vector<ScanSimulation> results(trials.size());
  parallel_for(trials.size(), threads, [&](std::size_t i) {
    const ScanTrial& trial = *trials[i];
    ScanSimulation& result = results[i];
    result.rest = solver.solve(held_cloth(trial), fabric, derivatives);
    result.forces = forces_of(trial, result.rest.reactions);
    if (derivatives == HeldDerivatives::all)
      result.force_derivative = force_derivatives_of(trial, result.rest.reaction_derivative);
  });
  return results;
}

ScanResponse response_of_scan(const ScanTrial& trial, const Fabric& fabric, const Points& x,
                              const MatX& moves) {
  HeldResponse response = held_response(held_cloth(trial), fabric, x, moves);
  for (std::size_t i = 0; i < trial.held.size(); ++i)
    if (trial.held[i]) response.x.middleRows(3 * static_cast<Eigen::Index>(i), 3).setZero();
  return {std::move(response.x), force_derivatives_of(trial, response.forces)};
}

ScanDifference compare_scan(const ScanTrial& trial, const ScanSimulation& simulation) {
  ScanDifference difference;
  difference.converged = simulation.rest.converged;
  difference.residual = simulation.rest.residual;
  const Points at_scan = sampled(trial.at_scan, simulation.rest.x);
  double sum = 0, squares = 0;
  int within = 0;
  for (Eigen::Index i = 0; i < at_scan.cols(); ++i) {
    if (!counts_as_measured(trial.shape.weights[i])) continue;
    const double d = (at_scan.col(i) - trial.shape.x.col(i)).norm();
    sum += d;
    squares += d * d;
    difference.distance.max = std::max(difference.distance.max, d);
    if (d < difference.near) ++within;
    ++difference.point_count;
  }
  // Without a measured vertex nothing is known: 0 / 0.
  const double count = difference.point_count;
  if (difference.point_count == 0) difference.distance.max = kNaN;
  difference.distance.mean = sum / count;
  difference.distance.rms = std::sqrt(squares / count);
  difference.within = within / count;
  difference.forces = simulation.forces.colwise().norm().transpose();
  double force_squares = 0;
  for (std::size_t c = 0; c < trial.target.clamps.size(); ++c) {
    const auto& measured = trial.target.clamps[c].force;
    if (!measured) continue;
    const double d = difference.forces[static_cast<Eigen::Index>(c)] - *measured;
    force_squares += d * d;
    ++difference.force_count;
  }
  if (difference.force_count > 0)
    difference.force_rms = std::sqrt(force_squares / difference.force_count);
  return difference;
}

}  // namespace weft
