#include "weft/estimate/mechanical_trial.h"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <cmath>

#include "weft/base/error.h"
#include "weft/base/parallel.h"
#include "weft/dynamics/clip_poses.h"
#include "weft/dynamics/static_system.h"
#include "weft/estimate/computed_overhang.h"
#include "weft/mesh/grid_lines.h"

namespace weft {
namespace {

constexpr int kMostTestCells = 200;
constexpr int kFewestCells = 8;        // of a search that is far from its end
constexpr double kWidestCell = 2;      // of the narrow side
constexpr double kFinestCell = 0.25;   // at a clip, of the widest one
constexpr double kClampStrip = 0.02;   // of a cell
constexpr double kDeepestStrip = 0.4;  // of a clip's depth
constexpr double kSameLine = 1e-7;     // m

std::vector<MaterialRectangle> regions_of(const std::vector<Clip>& clips) {
  std::vector<MaterialRectangle> regions;
  for (const Clip& clip : clips) regions.push_back(clip.region);
  return regions;
}

/// Along axis 0 (u) or 1 (v): from where to where a clip reaches, and whether it does so across the
/// whole swatch.
struct Extent {
  double lower, upper;
  bool whole;
};

std::vector<Extent> extents_along(int axis, const std::vector<MaterialRectangle>& regions,
                                  const Vec2& size) {
  const int across = 1 - axis;
  std::vector<Extent> extents;
  for (const MaterialRectangle& region : regions) {
    const bool whole =
        region.lower[across] < kSameLine && region.upper[across] > size[across] - kSameLine;
    Extent extent{region.lower[axis], region.upper[axis], whole};
    // What a clip at the edge of the swatch holds has no corner there.
    if (!whole && extent.lower < kSameLine) extent.lower = -size[axis];
    if (!whole && extent.upper > size[axis] - kSameLine) extent.upper = 2 * size[axis];
    extents.push_back(extent);
  }
  std::sort(extents.begin(), extents.end(),
            [](const Extent& a, const Extent& b) { return a.lower < b.lower; });
  return extents;
}

/// Longest stretch that no clip covers across the whole swatch.
double free_side(const std::vector<Extent>& extents, double size) {
  double longest = 0, reached = 0;
  for (const Extent& extent : extents) {
    if (!extent.whole) continue;
    longest = std::max(longest, extent.lower - reached);
    reached = std::max(reached, extent.upper);
  }
  longest = std::max(longest, size - reached);
  return longest > 0 ? longest : size;
}

/// Whether `place` is a border of a clip from which free cloth lies in direction `side` (-1, 1). Of
/// a clip that does not reach across the swatch there is free cloth on both sides, beyond its
/// corners.
bool is_border(const Extent& extent, double place, int side) {
  const bool lower = std::abs(extent.lower - place) < kSameLine;
  const bool upper = std::abs(extent.upper - place) < kSameLine;
  return (upper && (side > 0 || !extent.whole)) || (lower && (side < 0 || !extent.whole));
}

/// Lines above `lower` up to `upper`, two neighbouring borders of clips, and those beside them.
void add_interval(double lower, double upper, double spacing, const std::vector<Extent>& extents,
                  std::vector<double>& lines) {
  GridGrading grading{.spacing = spacing, .first = kFinestCell * spacing};
  bool inside = false;
  double clip_below = 0, clip_above = 0;  // depths of the clips across the swatch at either end
  for (const Extent& extent : extents) {
    inside |= extent.whole && extent.lower < lower + kSameLine && extent.upper > upper - kSameLine;
    grading.fine_lower |= is_border(extent, lower, 1);
    grading.fine_upper |= is_border(extent, upper, -1);
    if (!extent.whole) continue;
    if (is_border(extent, lower, 1)) clip_below = extent.upper - extent.lower;
    if (is_border(extent, upper, -1)) clip_above = extent.upper - extent.lower;
  }
  if (inside) {  // rigid: one cell will do
    lines.push_back(upper);
    return;
  }
  const std::vector<double> cells = graded_lines(lower, upper, grading);
  lines.insert(lines.end(), cells.begin() + 1, cells.end());
  const double first = cells[1] - cells[0], last = upper - cells[cells.size() - 2];
  if (clip_below > 0)
    lines.push_back(lower - std::min(kClampStrip * first, kDeepestStrip * clip_below));
  if (clip_above > 0)
    lines.push_back(upper + std::min(kClampStrip * last, kDeepestStrip * clip_above));
}

std::vector<double> lines_along(const std::vector<Extent>& extents, double size, double spacing) {
  std::vector<double> borders;
  for (const Extent& extent : extents) borders.insert(borders.end(), {extent.lower, extent.upper});
  // With a spacing as wide as the swatch: the borders alone.
  const std::vector<double> fixed = grid_lines(size, borders, size);
  std::vector<double> lines{0.0};
  for (std::size_t i = 0; i + 1 < fixed.size(); ++i)
    add_interval(fixed[i], fixed[i + 1], spacing, extents, lines);
  std::sort(lines.begin(), lines.end());
  return lines;
}

TriangleMesh make_mesh(const std::vector<MaterialRectangle>& regions, const Vec2& size,
                       const MechanicalOptions& options) {
  const std::vector<Extent> u = extents_along(0, regions, size),
                            v = extents_along(1, regions, size);
  Vec2 spacing = Vec2(free_side(u, size.x()), free_side(v, size.y())) / options.cells;
  spacing = spacing.cwiseMin(kWidestCell * spacing.minCoeff());
  return make_swatch(lines_along(u, size.x(), spacing.x()), lines_along(v, size.y(), spacing.y()),
                     options.pattern);
}

void add_points(const MeasuredGeometry& geometry, const std::vector<MaterialRectangle>& regions,
                MechanicalStage& stage) {
  const MaterialLocator locator(stage.mesh);
  const MaterialPoints& uv = geometry.mesh.material;
  std::vector<Eigen::Triplet<double>> entries;
  for (Eigen::Index i = 0; i < uv.cols(); ++i) {
    const auto hit = locator.locate(uv.col(i));
    const auto& triangle = stage.mesh.triangles[at(hit.triangle)];
    for (int corner = 0; corner < 3; ++corner)
      for (int k = 0; k < 3; ++k)
        entries.emplace_back(static_cast<int>(3 * i + k), 3 * triangle[at(corner)] + k,
                             hit.barycentric[corner]);
    const Vec2 point = uv.col(i);
    stage.point_held.push_back(std::any_of(regions.begin(), regions.end(),
                                           [&](const auto& r) { return r.contains(point); }));
  }
  stage.points.resize(static_cast<int>(3 * uv.cols()), 3 * stage.mesh.vertex_count());
  stage.points.setFromTriplets(entries.begin(), entries.end());
}

/// Frames of one trial that follow each other: each starts from the one before.
struct Chain {
  std::size_t trial;
  std::vector<int> frames;
};

/// Whether frames depend on those before them.
enum class ModelMemory { none, friction };

std::vector<Chain> chains_of(const std::vector<std::shared_ptr<const MechanicalTrial>>& trials,
                             const MechanicalFrames* near, ModelMemory memory) {
  std::vector<Chain> chains;
  for (std::size_t t = 0; t < trials.size(); ++t) {
    for (int frame = 0; frame < trials[t]->capture.frame_count; ++frame) {
      // A shape to start from makes frames independent of each other; those of an overhang test are
      // one.
      const bool alone = memory == ModelMemory::none && (trials[t]->geometry || near) &&
                         !trials[t]->capture.overhang;
      if (frame == 0 || alone) chains.push_back({t, {}});
      chains.back().frames.push_back(frame);
    }
  }
  return chains;
}

/// Where a frame starts.
struct FrameStart {
  Points x;
  std::vector<Clip> clips;  ///< of these the loaded ones; empty: where x has them
  StaticOptions::Start kind = StaticOptions::Start::any;
};

/// Loaded clips where they were found at the frame `before`, moved along as measured.
std::vector<Clip> moved_along(const MechanicalCapture& capture, int frame,
                              const MechanicalFrame& before) {
  std::vector<Clip> clips = capture.clips(frame);
  for (std::size_t c = 0; c < clips.size(); ++c) {
    if (!capture.fixtures[c].loaded() || !before.converged) continue;
    const Clip &found = before.clips[c], &was = capture.fixtures[c].frames[at(before.frame)];
    clips[c].position += found.position - was.position;
    clips[c].rotation = clips[c].rotation * was.rotation.conjugate() * found.rotation;
    clips[c].rotation.normalize();
  }
  return clips;
}

/// Where the frame starts; `before` is the frame before it in its chain, null for the first.
FrameStart start_of(const MechanicalTrial& trial, int frame, const MechanicalFrame* before) {
  const MechanicalStage& stage = trial.stages[at(trial.stage_of_frame[at(frame)])];
  const MaterialPoints& material = stage.mesh.material;
  const std::vector<Clip> measured = trial.capture.clips(frame);
  if (trial.geometry) {
    const MeasuredGeometry& geometry = *trial.geometry;
    return {interpolate(geometry.mesh, MaterialLocator(geometry.mesh), geometry.frames[at(frame)],
                        material),
            measured};
  }
  Points between = blend_of_clips(material, measured);
  if (!before) return {std::move(between), measured};
  const MechanicalStage& old = trial.stages[at(trial.stage_of_frame[at(before->frame)])];
  const Points moved = between - blend_of_clips(material, trial.capture.clips(before->frame));
  const Points there = &old == &stage
                           ? before->x
                           : interpolate(old.mesh, MaterialLocator(old.mesh), before->x, material);
  return {there + moved, moved_along(trial.capture, frame, *before)};
}

/// The cloth of a stage.
struct StageModel {
  std::unique_ptr<ElasticModel> model;
  VecX first_history;  ///< of friction, before the first frame
  std::unique_ptr<HeavyCloth> cloth;
  std::unique_ptr<StaticSystem> system;  ///< of its first frame; null without clips
};

StageModel stage_model(const MechanicalTrial& trial, const MechanicalStage& stage,
                       const Fabric& fabric) {
  const MechanicalCapture& capture = trial.capture;
  StageModel result;
  result.model = make_elastic_model(stage.mesh, fabric, capture.grain_angle);
  result.first_history = result.model->history();
  if (capture.picture_frame || stage.frames.empty()) return result;
  result.cloth =
      std::make_unique<HeavyCloth>(*result.model, capture.areal_density, capture.gravity);
  result.system = system_between_clips(*result.cloth, capture.clips(stage.frames.front()));
  return result;
}

/// Of the stages of each trial.
std::vector<std::vector<StageModel>> stage_models(
    const std::vector<std::shared_ptr<const MechanicalTrial>>& trials, const Fabric& fabric,
    int threads) {
  std::vector<std::vector<StageModel>> models(trials.size());
  parallel_for(trials.size(), threads, [&](std::size_t t) {
    for (const MechanicalStage& stage : trials[t]->stages)
      models[t].push_back(stage_model(*trials[t], stage, fabric));
  });
  return models;
}

/// What internal friction remembers of the frame before.
struct History {
  int stage = -1;  ///< whose mesh it is of; -1: none yet
  VecX values;
  MatX derivative;  ///< empty without derivatives
};

/// The history after a frame at x, with d x / d parameters.
void advance(const ElasticModel& model, const Points& x, const MatX& x_derivative,
             History& history) {
  if (history.derivative.size() == 0)
    history.derivative = MatX::Zero(model.history_size(), x_derivative.cols());
  history.derivative = model.next_history_derivative(x, x_derivative, history.derivative);
}

/// Of a picture frame. `history` is that of the frame before, its derivative then of this one.
MechanicalFrame sheared_frame(const MechanicalTrial& trial, int frame, const ElasticModel& model,
                              MechanicalDerivatives derivatives, History& history) {
  const PictureFrame& bars = *trial.capture.picture_frame;
  const FrameThreads threads = frame_threads(bars.shear[frame]);
  const Clip& clip = trial.capture.fixtures.front().frames[at(frame)];
  const MaterialPoints arms = model.mesh().material.colwise() - clip.region.center();
  const Points moves = threads.rate * arms / frame_displacement_rate(bars.side, bars.shear[frame]);
  MechanicalFrame result;
  result.frame = frame;
  result.converged = true;
  result.clips = {clip};
  result.x = (threads.along * arms).colwise() + clip.position;
  Points gradient;
  model.gradient(result.x, gradient);
  result.forces = result.torques = Points::Zero(3, 1);
  result.forces(0, 0) = gradient.cwiseProduct(moves).sum();
  if (derivatives != MechanicalDerivatives::all) return result;
  MatX by_parameters;
  model.parameter_derivative(result.x, by_parameters);
  if (history.derivative.size() > 0)
    model.add_history_derivative(result.x, history.derivative, by_parameters);
  result.force_derivative = MatX::Zero(3, by_parameters.cols());
  result.force_derivative.row(0) = flat(moves).transpose() * by_parameters;
  if (model.history_size() > 0)
    advance(model, result.x, MatX::Zero(result.x.size(), by_parameters.cols()), history);
  return result;
}

/// Takes over what was found, but for the shape.
void take(const ClipEquilibrium& found, MechanicalFrame& result) {
  result.converged = found.converged;
  result.residual = found.residual;
  result.iterations = found.iterations;
  result.forces = found.forces;
  result.torques = found.torques;
}

/// With all clips held. Returns the shape's derivative by what is asked for.
MatX solve_held(const StageModel& stage, const MatX& history_derivative, FrameStart start,
                const StaticOptions& statics, MechanicalDerivatives derivatives,
                MechanicalFrame& result) {
  ClippedCloth clipped(*stage.cloth, result.clips, stage.system.get());
  ClipEquilibrium found = clipped.solve(std::move(start.x), statics);
  take(found, result);
  result.x = std::move(found.x);
  if (derivatives == MechanicalDerivatives::poses) {
    ClipPoseSensitivities s = clipped.pose_sensitivities(result.x);
    result.pose_derivative = std::move(s.forces);
    return std::move(s.x);
  }
  if (derivatives != MechanicalDerivatives::all) return {};
  ClipSensitivities s = clipped.sensitivities(result.x, history_derivative);
  result.force_derivative = std::move(s.forces);
  result.inexact = s.inexact;
  return std::move(s.x);
}

/// The same with loaded clips, but by the poses nothing.
MatX solve_loaded(const StageModel& stage, std::vector<std::optional<ClipLoad>> loads,
                  const MatX& history_derivative, FrameStart start, const StaticOptions& statics,
                  MechanicalDerivatives derivatives, MechanicalFrame& result) {
  LoadedCloth loaded(*stage.cloth, result.clips, std::move(loads), stage.system.get());
  const std::vector<Clip> from =
      start.clips.empty() ? loaded.clips_of_shape(start.x) : std::move(start.clips);
  const LoadedEquilibrium found = loaded.solve(std::move(start.x), from, statics);
  take(found.cloth, result);
  result.clips = found.clips;
  result.x = found.cloth.x;
  if (derivatives == MechanicalDerivatives::poses) {
    LoadedPoseSensitivities s = loaded.pose_sensitivities(found);
    result.pose_derivative = std::move(s.forces);
    result.clips_by_poses = std::move(s.poses);
  }
  if (derivatives != MechanicalDerivatives::all) return {};
  LoadedSensitivities s = loaded.sensitivities(found, history_derivative);
  result.force_derivative = std::move(s.forces);
  result.clip_derivative = std::move(s.poses);
  result.inexact = s.inexact;
  return std::move(s.x);
}

/// Of a frame, after `moves` (none: empty).
std::vector<Clip> moved_clips(const MechanicalCapture& capture, int frame, const VecX& moves) {
  std::vector<Clip> clips = capture.clips(frame);
  if (moves.size() == 0) return clips;
  assert(moves.size() == 6 * static_cast<Eigen::Index>(clips.size()));
  for (std::size_t c = 0; c < clips.size(); ++c)
    clips[c] = moved_clip(clips[c], moves.segment<6>(6 * static_cast<Eigen::Index>(c)));
  return clips;
}

/// `models` are the trial's; with internal friction they are this thread's alone. `history` is that
/// of the frame before, then of this one.
MechanicalFrame simulate_frame(const MechanicalTrial& trial, int frame,
                               const std::vector<StageModel>& models,
                               MechanicalDerivatives derivatives, FrameStart start,
                               const VecX& moves, History& history) {
  const int stage_index = trial.stage_of_frame[at(frame)];
  const MechanicalStage& stage = trial.stages[at(stage_index)];
  const MechanicalCapture& capture = trial.capture;
  const StageModel& of_stage = models[at(stage_index)];
  const auto& model = of_stage.model;
  const bool remembers = model->history_size() > 0;
  if (history.stage != stage_index) history = {stage_index, of_stage.first_history, {}};
  if (remembers) model->set_history(history.values);
  if (capture.picture_frame) {
    MechanicalFrame result = sheared_frame(trial, frame, *model, derivatives, history);
    if (remembers) history.values = model->next_history(result.x);
    return result;
  }
  StaticOptions statics = trial.options.statics;
  statics.start = start.kind;
  MechanicalFrame result;
  result.frame = frame;
  result.clips = moved_clips(capture, frame, moves);
  const MatX x_derivative = capture.has_loaded()
                                ? solve_loaded(of_stage, capture.loads(frame), history.derivative,
                                               std::move(start), statics, derivatives, result)
                                : solve_held(of_stage, history.derivative, std::move(start),
                                             statics, derivatives, result);
  if (trial.geometry) {
    const VecX points = stage.points * flat(result.x);
    result.points = Points::Map(points.data(), 3, points.size() / 3);
  }
  if (derivatives == MechanicalDerivatives::all) {
    if (remembers) advance(*model, result.x, x_derivative, history);
    if (trial.geometry) result.point_derivative = stage.points * x_derivative;
  } else if (trial.geometry && x_derivative.size() > 0) {
    result.points_by_poses = stage.points * x_derivative;
  }
  if (remembers) history.values = model->next_history(result.x);
  return result;
}

/// Sums of differences, over a frame or over all.
struct Sums {
  double force_squares = 0, force_max = 0;
  int forces = 0;
  double distances = 0, distance_squares = 0, distance_max = 0;
  int points = 0;
  double shift_squares = 0, turn_squares = 0;
  int poses = 0;

  void add(const Sums& other) {
    force_squares += other.force_squares;
    force_max = std::max(force_max, other.force_max);
    forces += other.forces;
    distances += other.distances;
    distance_squares += other.distance_squares;
    distance_max = std::max(distance_max, other.distance_max);
    points += other.points;
    shift_squares += other.shift_squares;
    turn_squares += other.turn_squares;
    poses += other.poses;
  }
  double force_rms() const { return forces ? std::sqrt(force_squares / forces) : 0; }
  SurfaceDistance distance() const {
    if (!points) return {};
    return {distances / points, std::sqrt(distance_squares / points), distance_max};
  }
  PoseDistance pose() const {
    if (!poses) return {};
    return {std::sqrt(shift_squares / poses), std::sqrt(turn_squares / poses), poses};
  }
};

void add_poses(const MechanicalTrial& trial, const MechanicalFrame& frame, Sums& sums) {
  for (std::size_t c = 0; c < trial.capture.fixtures.size(); ++c) {
    const MechanicalFixture& fixture = trial.capture.fixtures[c];
    if (!fixture.loaded()) continue;
    const Vec6 difference = pose_difference(frame.clips[c], fixture.frames[at(frame.frame)]);
    sums.shift_squares += difference.head<3>().squaredNorm();
    sums.turn_squares += difference.tail<3>().squaredNorm();
    ++sums.poses;
  }
}

Sums difference(const MechanicalTrial& trial, const MechanicalFrame& frame) {
  Sums sums;
  for (std::size_t c = 0; c < trial.capture.fixtures.size(); ++c) {
    const Points& measured = trial.capture.fixtures[c].forces;
    if (measured.cols() == 0) continue;
    for (Eigen::Index k = 0; k < 3; ++k) {
      const double d = frame.forces(k, static_cast<Eigen::Index>(c)) - measured(k, frame.frame);
      if (std::isnan(measured(k, frame.frame))) continue;
      sums.force_squares += d * d;
      sums.force_max = std::max(sums.force_max, std::abs(d));
      ++sums.forces;
    }
  }
  add_poses(trial, frame, sums);
  if (!trial.geometry) return sums;
  const Points& measured = trial.geometry->frames[at(frame.frame)];
  const MechanicalStage& stage = trial.stages[at(trial.stage_of_frame[at(frame.frame)])];
  for (Eigen::Index i = 0; i < measured.cols(); ++i) {
    if (stage.point_held[at(i)]) continue;
    const double d = (frame.points.col(i) - measured.col(i)).norm();
    sums.distances += d;
    sums.distance_squares += d * d;
    sums.distance_max = std::max(sums.distance_max, d);
    ++sums.points;
  }
  return sums;
}

double largest_measured_force(const MechanicalCapture& capture) {
  double largest = 0;
  for (const MechanicalFixture& fixture : capture.fixtures)
    for (Eigen::Index k = 0; k < fixture.forces.cols(); ++k) {
      const Vec3 force = fixture.forces.col(k);
      const Vec3 known = force.array().isNaN().select(Vec3::Zero(), force);
      largest = std::max(largest, known.norm());
    }
  return largest;
}

}  // namespace

std::shared_ptr<const MechanicalTrial> prepare_mechanical(const MechanicalCapture& capture,
                                                          std::optional<MeasuredGeometry> geometry,
                                                          const MechanicalOptions& options) {
  if (options.cells < 2 || options.cells > kMostTestCells)
    throw Error(fmt::format("cells is {}, must be in [2, {}]", options.cells, kMostTestCells));
  auto trial = std::make_shared<MechanicalTrial>();
  trial->capture = capture;
  trial->isolated_strain = isolated_strain(capture);
  trial->options = options;
  trial->geometry = std::move(geometry);
  std::vector<std::vector<MaterialRectangle>> seen;
  for (int frame = 0; frame < capture.frame_count; ++frame) {
    const auto regions = regions_of(capture.clips(frame));
    const auto found = std::find(seen.begin(), seen.end(), regions);
    const auto index = static_cast<std::size_t>(found - seen.begin());
    if (found == seen.end()) {
      seen.push_back(regions);
      MechanicalStage& stage = trial->stages.emplace_back();
      stage.mesh = capture.picture_frame
                       ? make_swatch(capture.width, capture.height, options.cells + 1,
                                     options.cells + 1, options.pattern)
                       : make_mesh(regions, Vec2(capture.width, capture.height), options);
      clip_of_vertices(stage.mesh, capture.clips(frame));  // throws if they do not fit
      if (trial->geometry) add_points(*trial->geometry, regions, stage);
    }
    trial->stages[index].frames.push_back(frame);
    trial->stage_of_frame.push_back(static_cast<int>(index));
  }
  return trial;
}

std::shared_ptr<const MechanicalTrial> prepare_mechanical(const MechanicalCapture& capture,
                                                          const MechanicalOptions& options) {
  std::optional<MeasuredGeometry> geometry;
  if (capture.geometry) geometry = read_geometry(capture);
  return prepare_mechanical(capture, std::move(geometry), options);
}

std::shared_ptr<const MechanicalTrial> refined(const MechanicalTrial& trial) {
  MechanicalOptions options = trial.options;
  options.cells *= 2;
  return prepare_mechanical(trial.capture, trial.geometry, options);
}

std::vector<std::shared_ptr<const MechanicalTrial>> on_half_the_cells(
    std::vector<std::shared_ptr<const MechanicalTrial>> trials) {
  for (auto& trial : trials) {
    MechanicalOptions options = trial->options;
    options.cells /= 2;
    if (options.cells < kFewestCells) return {};
    trial = prepare_mechanical(trial->capture, trial->geometry, options);
  }
  return trials;
}

MechanicalFrames simulate_mechanical(
    const std::vector<std::shared_ptr<const MechanicalTrial>>& trials, const Fabric& fabric,
    MechanicalDerivatives derivatives, int threads, const MechanicalFrames* near,
    const ClipMoves* moves) {
  MechanicalFrames results;
  for (const auto& trial : trials) results.emplace_back(at(trial->capture.frame_count));
  const std::vector<std::vector<StageModel>> models = stage_models(trials, fabric, threads);
  const ModelMemory memory = !trials.empty() && models.front().front().first_history.size() > 0
                                 ? ModelMemory::friction
                                 : ModelMemory::none;
  const std::vector<Chain> chains = chains_of(trials, near, memory);
  const VecX as_captured;
  parallel_for(chains.size(), threads, [&](std::size_t i) {
    const MechanicalFrame* before = nullptr;
    History history;
    for (const int frame : chains[i].frames) {
      const std::size_t t = chains[i].trial;
      MechanicalFrame& result = results[t][at(frame)];
      if (trials[t]->capture.overhang && before) {
        result = *before;
        result.frame = frame;
        continue;
      }
      const MechanicalFrame* known = near ? &(*near)[t][at(frame)] : nullptr;
      FrameStart start = known ? FrameStart{known->x, {}} : start_of(*trials[t], frame, before);
      if (known && known->converged) start.kind = StaticOptions::Start::near_equilibrium;
      result = simulate_frame(*trials[t], frame, models[t], derivatives, std::move(start),
                              moves ? (*moves)[t][at(frame)] : as_captured, history);
      if (trials[t]->capture.overhang) add_overhang(*trials[t], fabric, derivatives, result);
      before = &result;
    }
  });
  return results;
}

MechanicalFrames starts_between(const std::vector<std::shared_ptr<const MechanicalTrial>>& trials,
                                const MechanicalFrames& from,
                                const std::vector<std::shared_ptr<const MechanicalTrial>>& to) {
  MechanicalFrames starts(trials.size());
  for (std::size_t t = 0; t < trials.size(); ++t) {
    starts[t].resize(from[t].size());
    for (std::size_t s = 0; s < trials[t]->stages.size(); ++s) {
      const MechanicalStage& stage = trials[t]->stages[s];
      const MaterialLocator locator(stage.mesh);
      for (const int frame : stage.frames) {
        starts[t][at(frame)].frame = frame;
        starts[t][at(frame)].x =
            interpolate(stage.mesh, locator, from[t][at(frame)].x, to[t]->stages[s].mesh.material);
      }
    }
  }
  return starts;
}

MechanicalEvaluation compare_mechanical(const MechanicalTrial& trial,
                                        const std::vector<MechanicalFrame>& frames) {
  MechanicalEvaluation evaluation;
  Sums all;
  for (const MechanicalFrame& frame : frames) {
    const Sums sums = difference(trial, frame);
    all.add(sums);
    evaluation.frames.push_back({frame.frame, frame.converged, frame.residual, sums.force_rms(),
                                 sums.force_max, sums.forces, sums.distance(), sums.points,
                                 sums.pose()});
    if (trial.capture.overhang)
      evaluation.frames.back().overhang =
          frame.overhang - trial.capture.overhang->lengths[frame.frame];
    if (!frame.converged) ++evaluation.not_converged;
  }
  if (trial.capture.overhang)
    evaluation.overhang = overhang_difference(*trial.capture.overhang, frames);
  evaluation.largest_force = largest_measured_force(trial.capture);
  evaluation.force_rms = all.force_rms();
  if (evaluation.largest_force > 0)
    evaluation.force_relative = evaluation.force_rms / evaluation.largest_force;
  evaluation.force_count = all.forces;
  evaluation.distance = all.distance();
  evaluation.point_count = all.points;
  evaluation.pose = all.pose();
  return evaluation;
}

}  // namespace weft
