#include "weft/estimate/mechanical_problem.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "weft/base/error.h"
#include "weft/base/parallel.h"
#include "weft/estimate/computed_overhang.h"
#include "weft/estimate/content_hash.h"
#include "weft/estimate/mesh_error.h"
#include "weft/estimate/packed_numbers.h"
#include "weft/estimate/pose_residuals.h"

namespace weft {
namespace {

/// Steps to where clips are most probably, and the gain that is not worth one: they are looked for
/// again after each search.
constexpr int kMostPoseSteps = 3;
constexpr double kEnoughByPoses = 1;
/// Pieces of a single shape, and points of one: residuals of neighbours depend on each other.
constexpr Eigen::Index kMostPieces = 8, kLeastPiece = 2;

void check(const MechanicalCostOptions& options) {
  if (!(options.force_noise > 0) || !std::isfinite(options.force_noise))
    throw Error(fmt::format("force noise is {:g} N, must be above 0", options.force_noise));
  if (!(options.point_noise > 0) || !std::isfinite(options.point_noise))
    throw Error(fmt::format("point noise is {:g} m, must be above 0", options.point_noise));
  if (!(options.least_way > 0) || !std::isfinite(options.least_way))
    throw Error(fmt::format("least way of a clip is {:g} m, must be above 0", options.least_way));
}

/// The long side of a clip, where it is now.
Vec3 along(const Clip& clip) {
  const Vec2 size = clip.region.upper - clip.region.lower;
  return clip.rotation * (size.x() >= size.y() ? Vec3::UnitX() : Vec3::UnitY());
}

}  // namespace

MechanicalResiduals mechanical_residuals_from_name(std::string_view name) {
  if (name == "auto") return MechanicalResiduals::automatic;
  if (name == "forces") return MechanicalResiduals::forces;
  if (name == "points") return MechanicalResiduals::points;
  if (name == "both") return MechanicalResiduals::both;
  if (name == "stretch-points") return MechanicalResiduals::stretch_points;
  throw Error(
      fmt::format("residuals \"{}\" are not known; known: auto, forces, points, both, "
                  "stretch-points",
                  name));
}

CordFriction cord_friction_from_name(std::string_view name) {
  if (name == "none") return CordFriction::none;
  if (name == "auto") return CordFriction::as_captured;
  if (name == "fit") return CordFriction::fitted;
  throw Error(fmt::format("cord friction \"{}\" is not known; known: auto, fit, none", name));
}

MechanicalProblem::MechanicalProblem(std::vector<std::shared_ptr<const MechanicalTrial>> trials,
                                     Fabric fabric, const std::vector<std::string>& free,
                                     const MechanicalCostOptions& options, int threads)
    : trials_(std::move(trials)), fabric_(std::move(fabric)), options_(options), threads_(threads) {
  check(options);
  for (const std::string& name : free) {
    const int index = fabric_.value_index(name);
    if (std::find(indices_.begin(), indices_.end(), index) != indices_.end())
      throw Error(fmt::format("parameter \"{}\" is named twice", name));
    indices_.push_back(index);
  }
  if (indices_.empty()) throw Error("no parameters to search");
  add_ties();
  std::size_t forces = 0;
  bool points_beside = false;
  for (const auto& trial : trials_) {
    std::size_t count = pose_residual_count(trial->capture);
    if (trial->capture.overhang) count += at(trial->capture.overhang->lengths.size());
    if (uses_forces(*trial)) {
      count += force_count(*trial);
      forces += force_count(*trial);
      points_beside = points_beside || uses_points(*trial);
    }
    if (uses_points(*trial))
      for (const int stage : trial->stage_of_frame)
        count += 3 * at(std::count(trial->stages[at(stage)].point_held.begin(),
                                   trial->stages[at(stage)].point_held.end(), 0));
    if (count == 0)
      throw Error(fmt::format("capture \"{}\" has nothing to compare: no measured {}",
                              trial->capture.name, uses_forces(*trial) ? "forces" : "points"));
    residual_count_ += static_cast<double>(count);
  }
  if (points_beside) force_share_ = static_cast<double>(forces) / residual_count_;
  for (std::size_t t = 0; t < trials_.size(); ++t) add_friction(t);
  priors_ = WeighedPriors(
      options.priors, dimension(), [&](const VecX& x) { return this->fabric(x); },
      residual_noise(*this));
  for (const std::string& row : options.smooth)
    priors_.add_smooth_curve(
        row, [&](const VecX& x) { return this->fabric(x); }, dimension());
}

void MechanicalProblem::add_friction(std::size_t t) {
  const MechanicalTrial& trial = *trials_[t];
  const bool wanted = options_.cord_friction == CordFriction::fitted ||
                      (options_.cord_friction == CordFriction::as_captured &&
                       trial.capture.drive == ClipDrive::cords);
  if (!wanted || !uses_forces(trial)) return;
  Friction friction{t, ways_of_clips(trial.capture, options_.least_way), options_.force_noise};
  bool seen = false;  // in what is compared
  for (int frame = 0; frame < trial.capture.frame_count; ++frame)
    for_each_force(trial, frame, [&](std::size_t fixture, const Vec3& direction, double value) {
      seen = seen || direction.dot(friction.ways[fixture].col(frame)) != 0;
      friction.largest_force = std::max(friction.largest_force, std::abs(value));
    });
  if (seen) friction_.push_back(std::move(friction));
}

std::vector<std::size_t> MechanicalProblem::with_friction() const {
  std::vector<std::size_t> trials;
  for (const Friction& friction : friction_) trials.push_back(friction.trial);
  return trials;
}

ParameterInfo MechanicalProblem::friction_info(std::size_t i) const {
  const double most = friction_[i].largest_force;
  return {"cord_friction", "N", -most, most, 0, Scale::linear, "friction of the cords", ""};
}

std::size_t MechanicalProblem::friction_of(std::size_t trial) const {
  std::size_t i = 0;
  while (i < friction_.size() && friction_[i].trial != trial) ++i;
  return i;
}

void MechanicalProblem::add_ties() {
  followers_.resize(indices_.size());
  for (const ParameterTie& tie : options_.ties) {
    const int follower = fabric_.value_index(tie.follower);
    const auto leader =
        std::find(indices_.begin(), indices_.end(), fabric_.value_index(tie.leader));
    if (leader == indices_.end() ||
        std::find(indices_.begin(), indices_.end(), follower) != indices_.end())
      throw Error(
          fmt::format("\"{}\" cannot follow \"{}\": the one must not be searched, the "
                      "other must be",
                      tie.follower, tie.leader));
    followers_[at(leader - indices_.begin())].push_back(follower);
  }
}

std::size_t MechanicalProblem::force_count(const MechanicalTrial& trial) const {
  std::size_t count = 0;
  for (int frame = 0; frame < trial.capture.frame_count; ++frame)
    for_each_force(trial, frame, [&](std::size_t, const Vec3&, double) { ++count; });
  return count;
}

bool MechanicalProblem::only_along_clips(const MechanicalTrial& trial) const {
  return options_.forces == MechanicalForces::along_clips &&
         std::ranges::any_of(trial.capture.fixtures, [](const MechanicalFixture& fixture) {
           return (!fixture.forces.array().isNaN()).colwise().all().any();
         });
}

bool MechanicalProblem::uses_forces(const MechanicalTrial& trial) const {
  switch (options_.residuals) {
    case MechanicalResiduals::points:
      return false;
    case MechanicalResiduals::forces:
    case MechanicalResiduals::both:
      return true;
    default:
      return trial.capture.fixtures.size() > 1 || !trial.geometry;
  }
}

bool MechanicalProblem::moves_clips(const MechanicalTrial& trial) const {
  return uses_points(trial) || priors_.has_smooth_curves();
}

bool MechanicalProblem::uses_points(const MechanicalTrial& trial) const {
  if (!trial.geometry) return false;
  switch (options_.residuals) {
    case MechanicalResiduals::forces:
      return false;
    case MechanicalResiduals::points:
    case MechanicalResiduals::both:
      return true;
    case MechanicalResiduals::stretch_points:
      return trial.capture.fixtures.size() == 1 || is_stretch(trial.isolated_strain);
    default:
      return trial.capture.fixtures.size() == 1;
  }
}

MechanicalProblem MechanicalProblem::refined() const {
  MechanicalProblem finer = *this;
  for (auto& trial : finer.trials_) trial = weft::refined(*trial);
  finer.keep_in(store_);
  return finer;
}

std::optional<MechanicalProblem> MechanicalProblem::on_half_the_cells() const {
  auto trials = weft::on_half_the_cells(trials_);
  if (trials.empty()) return std::nullopt;
  MechanicalProblem coarser = *this;
  coarser.trials_ = std::move(trials);
  coarser.keep_in(store_);
  return coarser;
}

VecX MechanicalProblem::scaled(const Fabric& fabric) const {
  VecX x(dimension());
  for (int i = 0; i < dimension(); ++i) x[i] = to_scaled(info(i), fabric.values[indices_[at(i)]]);
  return x;
}

Fabric MechanicalProblem::fabric(const VecX& scaled) const {
  Fabric fabric = fabric_;
  for (int i = 0; i < dimension(); ++i) {
    const double value = from_scaled(info(i), scaled[i]);
    fabric.values[indices_[at(i)]] = value;
    for (const int follower : followers_[at(i)]) fabric.values[follower] = value;
  }
  return fabric;
}

std::string MechanicalProblem::simulate(const VecX& scaled, MechanicalDerivatives derivatives,
                                        const MechanicalFrames* from,
                                        MechanicalFrames& frames) const {
  std::string reason;
  try {
    frames = simulate_mechanical(trials_, fabric(scaled), derivatives, threads_, from,
                                 moves_.empty() ? nullptr : &moves_);
  } catch (const Error& error) {
    reason = error.what();  // of values that the model refuses
  }
  for (std::size_t t = 0; reason.empty() && t < frames.size(); ++t)
    for (const MechanicalFrame& frame : frames[t]) {
      if (!(frame.residual <= options_.largest_residual) && reason.empty())
        reason = fmt::format("{}: no equilibrium at frame {}: a net force of {:.2g} N is left",
                             trials_[t]->capture.name, frame.frame, frame.residual);
      if (reason.empty()) reason = overhang_problem(*trials_[t], frame);
    }
  if (reason.empty()) return {};
  frames.clear();
  return from ? simulate(scaled, derivatives, nullptr, frames) : reason;
}

template <typename Add>
void MechanicalProblem::for_each_force(const MechanicalTrial& trial, int frame,
                                       const Add& add) const {
  const bool along_clips = only_along_clips(trial);
  for (std::size_t c = 0; c < trial.capture.fixtures.size(); ++c) {
    const MechanicalFixture& fixture = trial.capture.fixtures[c];
    if (fixture.forces.cols() == 0) continue;
    const Vec3 measured = fixture.forces.col(frame);
    if (along_clips) {
      const Vec3 direction = along(fixture.frames[at(frame)]);
      if (!measured.hasNaN()) add(c, direction, direction.dot(measured));
      continue;
    }
    for (int k = 0; k < 3; ++k)
      if (!std::isnan(measured[k])) add(c, Vec3::Unit(k), measured[k]);
  }
}

void MechanicalProblem::add_force_residuals(std::size_t trial, const MechanicalFrame& frame,
                                            MechanicalDerivatives derivatives, Eigen::Index& count,
                                            Residuals& r) const {
  const std::size_t friction = friction_of(trial);
  for_each_force(
      *trials_[trial], frame.frame, [&](std::size_t fixture, const Vec3& direction, double value) {
        const auto clip = static_cast<Eigen::Index>(fixture);
        r.values[count] = (direction.dot(frame.forces.col(clip)) - value) / options_.force_noise;
        if (friction < friction_.size())
          r.ways[count] = direction.dot(friction_[friction].ways[fixture].col(frame.frame)) /
                          options_.force_noise;
        if (derivatives == MechanicalDerivatives::all)
          r.jacobian.row(count) = direction.transpose() *
                                  frame.force_derivative.middleRows(3 * clip, 3) /
                                  options_.force_noise;
        ++count;
      });
}

bool MechanicalProblem::has_clip_noise(const MechanicalTrial& trial) const {
  return trial.capture.clip_noise > 0 && (uses_forces(trial) || trial.capture.has_loaded());
}

bool MechanicalProblem::has_clip_noise() const {
  return std::any_of(trials_.begin(), trials_.end(),
                     [&](const auto& trial) { return has_clip_noise(*trial); });
}

/// Of a frame's compared components: one a row, 3 fixtures columns.
MatX MechanicalProblem::compared_directions(const MechanicalTrial& trial, int frame) const {
  const auto columns = 3 * static_cast<Eigen::Index>(trial.capture.fixtures.size());
  MatX directions = MatX::Zero(columns, columns);
  Eigen::Index count = 0;
  if (!uses_forces(trial)) return directions.topRows(0);
  for_each_force(trial, frame, [&](std::size_t fixture, const Vec3& direction, double) {
    directions.row(count++).segment<3>(3 * static_cast<Eigen::Index>(fixture)) = direction;
  });
  return directions.topRows(count);
}

/// What one standard deviation of each coordinate of the poses does to the differences of a frame,
/// over their noise, in the order of residuals().
SharedErrors MechanicalProblem::shared_errors(const MechanicalTrial& trial,
                                              const MechanicalFrame& frame) const {
  const MatX forces = compared_directions(trial, frame.frame) * frame.pose_derivative;
  MatX poses(0, forces.cols());
  if (trial.capture.has_loaded())
    poses = pose_residuals(trial, frame, options_.point_noise).by_moves * frame.clips_by_poses;
  const std::vector<Eigen::Index> compared = compared_coordinates(trial, frame.frame);
  const bool moved = !compared.empty() && frame.points_by_poses.rows() > 0;
  const MatX points =
      moved ? MatX(frame.points_by_poses(compared, Eigen::all))
            : MatX(MatX::Zero(static_cast<Eigen::Index>(compared.size()), forces.cols()));
  MatX by_errors(forces.rows() + poses.rows() + points.rows(), frame.pose_derivative.cols());
  by_errors.topRows(forces.rows()) = forces / options_.force_noise;
  // Those of loaded clips are over their noise already.
  by_errors.middleRows(forces.rows(), poses.rows()) = poses;
  by_errors.bottomRows(points.rows()) = points / options_.point_noise;
  return SharedErrors(
      by_errors *
      pose_deviations(trial.capture.clips(frame.frame), trial.capture.clip_noise).asDiagonal());
}

ForceWeights MechanicalProblem::weights_of(const MechanicalFrames& frames) const {
  ForceWeights weights(trials_.size());
  for (std::size_t t = 0; t < trials_.size(); ++t) {
    const MechanicalTrial& trial = *trials_[t];
    weights[t].resize(frames[t].size());
    if (!has_clip_noise(trial)) continue;
    parallel_for(frames[t].size(), threads_, [&](std::size_t i) {
      weights[t][i].shared = shared_errors(trial, frames[t][i]);
      if (!weights_.empty()) weights[t][i].moves = weights_[t][i].moves;
    });
  }
  return weights;
}

/// Of the points of a frame.
std::vector<Eigen::Index> MechanicalProblem::compared_coordinates(const MechanicalTrial& trial,
                                                                  int frame) const {
  std::vector<Eigen::Index> compared;
  if (!uses_points(trial)) return compared;
  const std::vector<char>& held = trial.stages[at(trial.stage_of_frame[at(frame)])].point_held;
  for (Eigen::Index i = 0; i < trial.geometry->frames[at(frame)].cols(); ++i)
    if (!held[at(i)]) compared.insert(compared.end(), {3 * i, 3 * i + 1, 3 * i + 2});
  return compared;
}

void MechanicalProblem::weigh(std::size_t trial, int frame, Residuals& r) const {
  if (weights_.empty() || weights_[trial][at(frame)].shared.none()) return;
  const auto& [errors, moves] = weights_[trial][at(frame)];
  if (moves.size() > 0) r.values -= errors.by_errors() * moves;  // as measured
  r.values = errors.weighed(r.values);
  r.ways = errors.weighed(r.ways);
  if (r.jacobian.rows() > 0) r.jacobian = errors.weighed(r.jacobian);
}

void MechanicalProblem::differences(std::size_t t, const MechanicalFrame& frame,
                                    MechanicalDerivatives derivatives, Residuals& r) const {
  const MechanicalTrial& trial = *trials_[t];
  const bool slopes = derivatives == MechanicalDerivatives::all;
  const Eigen::Index parameters = fabric_.values.size();
  const PoseResiduals poses = pose_residuals(trial, frame, options_.point_noise);
  const Eigen::Index most =
      frame.forces.size() + poses.values.size() + (trial.geometry ? frame.points.size() : 0);
  r.values.resize(most);
  r.ways.setZero(most);
  r.jacobian.resize(slopes ? most : 0, parameters);
  Eigen::Index count = 0;
  if (uses_forces(trial)) add_force_residuals(t, frame, derivatives, count, r);
  if (poses.values.size() > 0) {
    r.values.segment(count, poses.values.size()) = poses.values;
    if (slopes)
      r.jacobian.middleRows(count, poses.values.size()) = poses.by_moves * frame.clip_derivative;
    count += poses.values.size();
  }
  if (const auto compared = compared_coordinates(trial, frame.frame); !compared.empty()) {
    const auto n = static_cast<Eigen::Index>(compared.size());
    const VecX off = flat(frame.points) - flat(trial.geometry->frames[at(frame.frame)]);
    r.values.segment(count, n) = off(compared) / options_.point_noise;
    if (slopes)
      r.jacobian.middleRows(count, n) =
          frame.point_derivative(compared, Eigen::all) / options_.point_noise;
    count += n;
  }
  r.values.conservativeResize(count);
  r.ways.conservativeResize(count);
  if (slopes) r.jacobian.conservativeResize(count, parameters);
}

void MechanicalProblem::residuals(std::size_t t, const MechanicalFrame& frame,
                                  MechanicalDerivatives derivatives, Residuals& r) const {
  differences(t, frame, derivatives, r);
  weigh(t, frame.frame, r);
  const std::optional<OverhangTest>& overhang = trials_[t]->capture.overhang;
  if (!overhang) return;
  const Eigen::Index count = r.values.size();
  r.values.conservativeResize(count + 1);
  r.ways.conservativeResize(count + 1);
  r.values[count] = overhang_residual(*overhang, frame);
  r.ways[count] = 0;
  if (derivatives != MechanicalDerivatives::all) return;
  r.jacobian.conservativeResize(count + 1, fabric_.values.size());
  r.jacobian.row(count) = frame.overhang_derivative.transpose() / overhang->deviation;
}

double MechanicalProblem::best_friction(std::size_t trial,
                                        const std::vector<MechanicalFrame>& frames) const {
  if (friction_of(trial) == friction_.size()) return 0;
  double slope = 0, curvature = 0;
  Residuals r;
  for (const MechanicalFrame& frame : frames) {
    residuals(trial, frame, MechanicalDerivatives::none, r);
    slope += r.ways.dot(r.values);
    curvature += r.ways.squaredNorm();
  }
  return std::max(0.0, -slope / curvature);
}

double MechanicalProblem::cost_of(const MechanicalFrames& frames) const {
  double sum = 0;
  Residuals r;
  for (std::size_t t = 0; t < trials_.size(); ++t) {
    const double friction = best_friction(t, frames[t]);
    for (const MechanicalFrame& frame : frames[t]) {
      residuals(t, frame, MechanicalDerivatives::none, r);
      sum += (r.values + friction * r.ways).squaredNorm();
    }
  }
  return sum / residual_count_;
}

namespace {

/// Of the residuals of a frame, what is left out together: all of them, but of a capture that is a
/// single shape pieces of it, one after the other, first residual and count.
std::vector<std::pair<Eigen::Index, Eigen::Index>> pieces_of(const MechanicalTrial& trial,
                                                             Eigen::Index residuals) {
  if (trial.capture.frame_count > 1) return {{0, residuals}};
  const Eigen::Index points = residuals / 3;
  const Eigen::Index pieces = std::clamp<Eigen::Index>(points / kLeastPiece, 1, kMostPieces);
  std::vector<std::pair<Eigen::Index, Eigen::Index>> found;
  for (Eigen::Index k = 0; k < pieces; ++k) {
    const Eigen::Index first = 3 * (k * points / pieces);
    const Eigen::Index end = k + 1 == pieces ? residuals : 3 * ((k + 1) * points / pieces);
    found.emplace_back(first, end - first);
  }
  return found;
}

}  // namespace

MechanicalProblem::Linearization MechanicalProblem::linearization_of(const MechanicalFrames& frames,
                                                                     const VecX& scaled) const {
  const auto n = static_cast<Eigen::Index>(dimension()),
             all = n + static_cast<Eigen::Index>(friction_.size());
  Linearization result;
  VecX gradient = VecX::Zero(all);
  MatX hessian = MatX::Zero(all, all);
  VecX slopes(n);
  for (int i = 0; i < dimension(); ++i) slopes[i] = scaled_slope(info(i), scaled[i]);
  const double factor = 1 / residual_count_;
  result.friction = VecX::Zero(all - n);
  Residuals r;
  for (std::size_t t = 0; t < trials_.size(); ++t) {
    const double friction = best_friction(t, frames[t]);
    const std::size_t place = friction_of(t);
    for (const MechanicalFrame& frame : frames[t]) {
      residuals(t, frame, MechanicalDerivatives::all, r);
      const VecX values = r.values + friction * r.ways;
      MatX jacobian = MatX::Zero(values.size(), all);
      jacobian.leftCols(n) = r.jacobian(Eigen::all, indices_);
      for (int i = 0; i < dimension(); ++i)
        for (const int follower : followers_[at(i)]) jacobian.col(i) += r.jacobian.col(follower);
      jacobian.leftCols(n) *= slopes.asDiagonal();
      if (place < friction_.size()) {
        const auto j = static_cast<Eigen::Index>(place);
        const ParameterInfo info = friction_info(place);
        jacobian.col(n + j) = (info.upper - info.lower) * r.ways;
        result.friction[j] = friction;
      }
      result.model.cost += factor * values.squaredNorm();
      for (const auto& [first, count] : pieces_of(*trials_[t], values.size())) {
        CostPart part = part_of_squares(t, frame.frame, factor, jacobian.middleRows(first, count),
                                        values.segment(first, count));
        gradient += part.gradient;
        hessian += part.hessian;
        result.parts.push_back(std::move(part));
      }
      if (frame.inexact) ++result.inexact;
    }
  }
  result.model.gradient = gradient.head(n);
  result.model.hessian = hessian.topLeftCorner(n, n);
  // No capture shares its friction with another: the complement goes one by one.
  for (Eigen::Index j = n; j < all; ++j)
    if (result.friction[j - n] > 0)
      result.model.hessian -= hessian.col(j).head(n) * hessian.row(j).head(n) / hessian(j, j);
  return result;
}

namespace {

/// Of an evaluation that found no equilibrium: infinity, and why.
VecX refusal(const std::string& reason) {
  NumberWriter writer;
  writer.add(kInfinity);
  for (const char c : reason) writer.add(static_cast<double>(c));
  return writer.numbers();
}

std::string reason_of(const VecX& numbers) {
  std::string reason;
  if (std::isfinite(numbers[0])) return reason;
  for (const double number : numbers.tail(numbers.size() - 1)) reason += static_cast<char>(number);
  return reason;
}

VecX to_numbers(const MechanicalProblem::Linearization& l) {
  NumberWriter writer;
  writer.add(l.model.cost);
  writer.add(static_cast<double>(l.inexact));
  writer.add(l.model.gradient);
  writer.add(l.model.hessian);
  writer.add(l.friction);
  add_parts(l.parts, writer);
  return writer.numbers();
}

/// Of `n` free parameters and the friction of `frictions` captures.
MechanicalProblem::Linearization from_numbers(const VecX& numbers, Eigen::Index n,
                                              Eigen::Index frictions) {
  MechanicalProblem::Linearization l;
  if (!std::isfinite(numbers[0])) {
    l.model = {kInfinity, VecX::Zero(n), MatX::Zero(n, n)};
    l.friction = VecX::Zero(frictions);
    l.reason = reason_of(numbers);
    return l;
  }
  NumberReader reader(numbers);
  l.model.cost = reader.number();
  l.inexact = static_cast<int>(reader.number());
  l.model.gradient = reader.vector(n);
  l.model.hessian = reader.matrix(n, n);
  l.friction = reader.vector(frictions);
  l.parts = read_parts(reader, n + frictions);
  return l;
}

VecX to_numbers(const ForceWeights& weights) {
  NumberWriter writer;
  writer.add(0.0);  // finite: there are weights
  for (const std::vector<PoseErrors>& trial : weights)
    for (const PoseErrors& errors : trial) {
      writer.add(static_cast<double>(errors.shared.by_errors().rows()));
      writer.add(static_cast<double>(errors.shared.by_errors().cols()));
      writer.add(errors.shared.by_errors());
      writer.add(static_cast<double>(errors.moves.size()));
      writer.add(errors.moves);
    }
  return writer.numbers();
}

/// m and rad.
ClipMoves moves_of(const ForceWeights& weights,
                   const std::vector<std::shared_ptr<const MechanicalTrial>>& trials) {
  ClipMoves moves(weights.size());
  for (std::size_t t = 0; t < weights.size(); ++t) {
    const MechanicalCapture& capture = trials[t]->capture;
    for (int frame = 0; frame < capture.frame_count; ++frame) {
      VecX of_frame = weights[t][at(frame)].moves;
      if (of_frame.size() > 0)
        of_frame.array() *= pose_deviations(capture.clips(frame), capture.clip_noise).array();
      moves[t].push_back(std::move(of_frame));
    }
  }
  return moves;
}

ForceWeights weights_from_numbers(
    const VecX& numbers, const std::vector<std::shared_ptr<const MechanicalTrial>>& trials) {
  if (!std::isfinite(numbers[0])) return {};
  NumberReader reader(numbers);
  reader.number();
  ForceWeights weights;
  for (const auto& trial : trials) {
    std::vector<PoseErrors>& frames = weights.emplace_back();
    for (int frame = 0; frame < trial->capture.frame_count; ++frame) {
      const auto rows = static_cast<Eigen::Index>(reader.number());
      const auto columns = static_cast<Eigen::Index>(reader.number());
      SharedErrors shared(reader.matrix(rows, columns));
      const auto moves = static_cast<Eigen::Index>(reader.number());
      frames.push_back({std::move(shared), reader.vector(moves)});
    }
  }
  return weights;
}

}  // namespace

MechanicalProblem::PoseStep MechanicalProblem::pose_step(std::size_t t,
                                                         const MechanicalFrame& frame,
                                                         double friction) const {
  const auto& [errors, moves] = weights_[t][at(frame.frame)];
  Residuals r;
  differences(t, frame, MechanicalDerivatives::none, r);
  const VecX values = r.values + friction * r.ways;
  PoseStep step{moves, values.squaredNorm() + moves.squaredNorm()};
  if (errors.none() || !moves_clips(*trials_[t])) return step;
  const MatX& by_errors = errors.by_errors();
  const VecX here = moves.size() > 0 ? moves : VecX(VecX::Zero(by_errors.cols()));
  const VecX as_measured = values - by_errors * here;
  step.moves = -errors.estimate(as_measured);
  step.gain = step.squares - (as_measured + by_errors * step.moves).squaredNorm() -
              step.moves.squaredNorm();
  return step;
}

MechanicalProblem::PoseSteps MechanicalProblem::pose_steps(const MechanicalFrames& frames,
                                                           const VecX& friction) const {
  PoseSteps steps(frames.size());
  for (std::size_t t = 0; t < frames.size(); ++t)
    for (const MechanicalFrame& frame : frames[t])
      steps[t].push_back(pose_step(t, frame, friction[static_cast<Eigen::Index>(t)]));
  return steps;
}

ForceWeights MechanicalProblem::found_weights(const VecX& scaled, MechanicalFrames& frames) const {
  MechanicalProblem best = *this;
  best.keep_in(nullptr);
  best.weigh_by(weights_of(frames));
  std::vector<std::vector<double>> shares;  // of a frame's step, that is tried
  for (const auto& trial : frames) shares.emplace_back(trial.size(), 1.0);
  for (int k = 0; k < kMostPoseSteps; ++k) {
    VecX friction(static_cast<Eigen::Index>(frames.size()));
    for (std::size_t t = 0; t < frames.size(); ++t)
      friction[static_cast<Eigen::Index>(t)] = best.best_friction(t, frames[t]);
    const PoseSteps steps = best.pose_steps(frames, friction);
    ForceWeights next = best.weights_;
    double gain = 0;
    for (std::size_t t = 0; t < frames.size(); ++t)
      for (std::size_t i = 0; i < frames[t].size(); ++i) {
        gain += steps[t][i].gain;
        VecX& moves = next[t][i].moves;
        if (moves.size() == 0) moves.setZero(steps[t][i].moves.size());
        moves += shares[t][i] * (steps[t][i].moves - moves);
      }
    if (gain < kEnoughByPoses) break;
    MechanicalProblem tried = best;
    tried.weigh_by(std::move(next));
    MechanicalFrames there;
    if (!tried.simulate(scaled, MechanicalDerivatives::poses, &frames, there).empty()) break;
    tried.weigh_by(tried.weights_of(there));
    const PoseSteps after = tried.pose_steps(there, friction);
    ForceWeights taken = best.weights_;
    for (std::size_t t = 0; t < frames.size(); ++t)
      for (std::size_t i = 0; i < frames[t].size(); ++i)
        if (after[t][i].squares <= steps[t][i].squares) {
          taken[t][i] = tried.weights_[t][i];
          frames[t][i] = std::move(there[t][i]);
        } else {
          shares[t][i] *= 0.5;
        }
    best.weigh_by(std::move(taken));
  }
  return best.weights_;
}

ForceWeights MechanicalProblem::force_weights(const VecX& scaled, MechanicalShapes* near,
                                              ClipPlaces places) const {
  if (!has_clip_noise()) return {};
  const bool as_weighed = places == ClipPlaces::as_weighed;
  const VecX numbers =
      ask(as_weighed ? Question::weights : Question::found_weights, scaled, near,
          [&](const MechanicalFrames* from, MechanicalFrames& found) {
            const std::string why = simulate(scaled, MechanicalDerivatives::poses, from, found);
            if (!why.empty()) return refusal(why);
            return to_numbers(as_weighed ? weights_of(found) : found_weights(scaled, found));
          });
  return weights_from_numbers(numbers, trials_);
}

void MechanicalProblem::weigh_by(ForceWeights weights) {
  weights_ = std::move(weights);
  moves_ = moves_of(weights_, trials_);
  if (store_) fingerprint_ = fingerprint();
}

double MechanicalProblem::cost(const VecX& scaled, std::string* reason,
                               MechanicalShapes* near) const {
  const VecX numbers =
      ask(Question::cost, scaled, near, [&](const MechanicalFrames* from, MechanicalFrames& found) {
        const std::string why = simulate(scaled, MechanicalDerivatives::none, from, found);
        return why.empty() ? VecX(VecX::Constant(1, cost_of(found))) : refusal(why);
      });
  if (reason) *reason = reason_of(numbers);
  return numbers[0];
}

MechanicalProblem::Linearization MechanicalProblem::linearize(const VecX& scaled,
                                                              MechanicalShapes* near) const {
  const VecX numbers =
      ask(Question::linearization, scaled, near,
          [&](const MechanicalFrames* from, MechanicalFrames& found) {
            const std::string why = simulate(scaled, MechanicalDerivatives::all, from, found);
            return why.empty() ? to_numbers(linearization_of(found, scaled)) : refusal(why);
          });
  return from_numbers(numbers, dimension(), static_cast<Eigen::Index>(friction_.size()));
}

struct MechanicalShapes::Source {
  MechanicalShapes shapes;
  std::vector<std::shared_ptr<const MechanicalTrial>> trials;
};

MechanicalShapes MechanicalProblem::as_starts(const MechanicalShapes& shapes,
                                              std::string chain) const {
  MechanicalShapes starts(std::move(chain));
  if (shapes.empty()) return starts;
  if (!shapes.evaluation_.empty()) starts.evaluation_ = "from " + shapes.evaluation_;
  starts.source_ = std::make_shared<MechanicalShapes::Source>(shapes, trials_);
  return starts;
}

std::shared_ptr<const MechanicalFrames> MechanicalProblem::frames(
    const MechanicalShapes& near) const {
  const auto of = [&](const MechanicalShapes& shapes, const auto& trials) {
    if (shapes.frames_ || shapes.evaluation_.empty()) return shapes.frames_;
    return std::shared_ptr<const MechanicalFrames>(std::make_shared<MechanicalFrames>(
        store_->shapes(shapes.chain_, shapes.evaluation_, trials)));
  };
  if (!near.source_) return of(near, trials_);
  const auto& source = *near.source_;
  return std::make_shared<MechanicalFrames>(
      starts_between(source.trials, *of(source.shapes, source.trials), trials_));
}

VecX MechanicalProblem::ask(Question question, const VecX& scaled, MechanicalShapes* near,
                            const Answer& answer) const {
  const MechanicalShapes none = near ? MechanicalShapes(near->chain_) : MechanicalShapes();
  MechanicalShapes after = none;
  if (store_) {
    after.evaluation_ = key(question, scaled, near);
    if (const auto known = store_->find(after.evaluation_)) {
      if (near) *near = std::isfinite((*known)[0]) ? after : none;
      return *known;
    }
  }
  const std::shared_ptr<const MechanicalFrames> from = near ? frames(*near) : nullptr;
  const auto found = std::make_shared<MechanicalFrames>();
  VecX numbers = answer(from.get(), *found);
  const bool finite = std::isfinite(numbers[0]);
  after.frames_ = found;
  if (store_) {
    if (near && finite) store_->add_shapes(after.chain_, after.evaluation_, *found);
    store_->add(after.evaluation_, numbers);
    // What comes starts from here.
    if (near && finite && question == Question::linearization)
      store_->remove_shapes_but(after.chain_, after.evaluation_);
  }
  if (near) *near = finite ? after : none;
  return numbers;
}

std::string MechanicalProblem::key(Question question, const VecX& scaled,
                                   const MechanicalShapes* near) const {
  ContentHash hash;
  hash.add(std::string_view(fingerprint_));
  hash.add(question);
  hash.add(scaled);
  // An evaluation that keeps its shapes is not one that does not.
  hash.add(near != nullptr);
  if (near) {
    hash.add(std::string_view(near->chain_));  // whose shapes they are
    hash.add(std::string_view(near->evaluation_));
  }
  return hash.hex();
}

std::string MechanicalProblem::fingerprint() const {
  ContentHash hash;
  for (const auto& trial : trials_) add_trial(hash, *trial);
  add_fabric(hash, fabric_);
  for (std::size_t i = 0; i < indices_.size(); ++i) {
    hash.add(indices_[i]);
    hash.add(followers_[i].size());
    for (const int follower : followers_[i]) hash.add(follower);
  }
  hash.add(options_.residuals);
  hash.add(options_.forces);
  hash.add(priors_.has_smooth_curves());
  for (const double value : {options_.force_noise, options_.point_noise, options_.largest_residual})
    hash.add(value);
  for (const Friction& friction : friction_) {
    hash.add(friction.trial);
    for (const Points& ways : friction.ways) hash.add(ways);
  }
  for (const std::vector<PoseErrors>& trial : weights_)
    for (const PoseErrors& errors : trial) {
      hash.add(errors.shared.by_errors());
      hash.add(errors.moves);
    }
  return hash.hex();
}

void MechanicalProblem::keep_in(std::shared_ptr<MechanicalStore> store) {
  store_ = std::move(store);
  fingerprint_ = store_ ? fingerprint() : std::string();
}

}  // namespace weft
