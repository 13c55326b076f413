#include "weft/estimate/mechanical_fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "weft/base/error.h"
#include "weft/estimate/residual_intervals.h"

namespace weft {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// Steps that lower the sum of squares by less are far inside the noise: a parameter one standard
/// deviation off costs 1.
constexpr double kEnoughReduction = 0.01;
constexpr int kEnoughSteps = 2;

std::size_t at(Eigen::Index i) { return static_cast<std::size_t>(i); }

void check(const MechanicalCostOptions& options) {
  if (!(options.force_noise > 0) || !std::isfinite(options.force_noise))
    throw Error(fmt::format("force noise is {:g} N, must be above 0", options.force_noise));
  if (!(options.point_noise > 0) || !std::isfinite(options.point_noise))
    throw Error(fmt::format("point noise is {:g} m, must be above 0", options.point_noise));
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
  throw Error(
      fmt::format("residuals \"{}\" are not known; known: auto, forces, points, both", name));
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
  for (const auto& trial : trials_) {
    std::size_t count = 0;
    if (uses_forces(*trial))
      for (const MechanicalFixture& fixture : trial->capture.fixtures)
        count += force_count(fixture);
    if (uses_points(*trial))
      for (const int stage : trial->stage_of_frame)
        count += 3 * at(std::count(trial->stages[at(stage)].point_held.begin(),
                                   trial->stages[at(stage)].point_held.end(), 0));
    if (count == 0)
      throw Error(fmt::format("capture \"{}\" has nothing to compare: no measured {}",
                              trial->capture.name, uses_forces(*trial) ? "forces" : "points"));
    residual_count_ += count;
  }
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

std::size_t MechanicalProblem::force_count(const MechanicalFixture& fixture) const {
  const auto known = !fixture.forces.array().isNaN();
  if (options_.forces == MechanicalForces::all) return at(known.count());
  return at(known.colwise().all().count());
}

bool MechanicalProblem::uses_forces(const MechanicalTrial& trial) const {
  if (options_.residuals == MechanicalResiduals::automatic)
    return trial.capture.fixtures.size() > 1 || !trial.geometry;
  return options_.residuals != MechanicalResiduals::points;
}

bool MechanicalProblem::uses_points(const MechanicalTrial& trial) const {
  if (!trial.geometry) return false;
  if (options_.residuals == MechanicalResiduals::automatic)
    return trial.capture.fixtures.size() == 1;
  return options_.residuals != MechanicalResiduals::forces;
}

MechanicalProblem MechanicalProblem::refined() const {
  MechanicalProblem finer = *this;
  for (auto& trial : finer.trials_) trial = weft::refined(*trial);
  return finer;
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

bool MechanicalProblem::simulate(const VecX& scaled, MechanicalDerivatives derivatives,
                                 MechanicalFrames& frames, std::string* reason) const {
  const MechanicalFrames near = std::move(frames);
  for (const bool from_measured : {near.empty(), true}) {
    std::string found;
    try {
      frames = simulate_mechanical(trials_, fabric(scaled), derivatives, threads_,
                                   from_measured ? nullptr : &near);
    } catch (const Error& error) {
      found = error.what();  // of values that the model refuses
    }
    for (std::size_t t = 0; found.empty() && t < frames.size(); ++t)
      for (const MechanicalFrame& frame : frames[t])
        if (!(frame.residual <= options_.largest_residual) && found.empty())
          found = fmt::format("{}: no equilibrium at frame {}: a net force of {:.2g} N is left",
                              trials_[t]->capture.name, frame.frame, frame.residual);
    if (reason) *reason = found;
    if (found.empty()) return true;
    frames.clear();
    if (from_measured) break;
  }
  return false;
}

void MechanicalProblem::add_force_residuals(const MechanicalTrial& trial,
                                            const MechanicalFrame& frame, Eigen::Index& count,
                                            VecX& r, MatX* jacobian) const {
  for (std::size_t c = 0; c < trial.capture.fixtures.size(); ++c) {
    const MechanicalFixture& fixture = trial.capture.fixtures[c];
    if (fixture.forces.cols() == 0) continue;
    const Vec3 measured = fixture.forces.col(frame.frame);
    const auto clip = static_cast<Eigen::Index>(c);
    const auto add = [&](const Vec3& direction, double value) {
      r[count] = (direction.dot(frame.forces.col(clip)) - value) / options_.force_noise;
      if (jacobian)
        jacobian->row(count) = direction.transpose() *
                               frame.force_derivative.middleRows(3 * clip, 3) /
                               options_.force_noise;
      ++count;
    };
    if (options_.forces == MechanicalForces::along_clips) {
      const Vec3 direction = along(fixture.frames[at(frame.frame)]);
      if (!measured.hasNaN()) add(direction, direction.dot(measured));
      continue;
    }
    for (int k = 0; k < 3; ++k)
      if (!std::isnan(measured[k])) add(Vec3::Unit(k), measured[k]);
  }
}

void MechanicalProblem::residuals(const MechanicalTrial& trial, const MechanicalFrame& frame,
                                  VecX& r, MatX* jacobian) const {
  const Eigen::Index parameters = fabric_.values.size();
  const MechanicalStage& stage = trial.stages[at(trial.stage_of_frame[at(frame.frame)])];
  const Eigen::Index most = frame.forces.size() + (trial.geometry ? frame.points.size() : 0);
  r.resize(most);
  if (jacobian) jacobian->resize(most, parameters);
  Eigen::Index count = 0;
  if (uses_forces(trial)) add_force_residuals(trial, frame, count, r, jacobian);
  if (uses_points(trial)) {
    const Points& measured = trial.geometry->frames[at(frame.frame)];
    for (Eigen::Index i = 0; i < measured.cols(); ++i) {
      if (stage.point_held[at(i)]) continue;
      for (Eigen::Index k = 0; k < 3; ++k) {
        r[count] = (frame.points(k, i) - measured(k, i)) / options_.point_noise;
        if (jacobian)
          jacobian->row(count) = frame.point_derivative.row(3 * i + k) / options_.point_noise;
        ++count;
      }
    }
  }
  r.conservativeResize(count);
  if (jacobian) jacobian->conservativeResize(count, parameters);
}

double MechanicalProblem::cost(const VecX& scaled, std::string* reason,
                               MechanicalFrames* near) const {
  MechanicalFrames own;
  MechanicalFrames& frames = near ? *near : own;
  if (!simulate(scaled, MechanicalDerivatives::none, frames, reason)) return kInfinity;
  double sum = 0;
  VecX r;
  for (std::size_t t = 0; t < trials_.size(); ++t)
    for (const MechanicalFrame& frame : frames[t]) {
      residuals(*trials_[t], frame, r, nullptr);
      sum += r.squaredNorm();
    }
  return sum / static_cast<double>(residual_count_);
}

MechanicalProblem::Linearization MechanicalProblem::linearize(const VecX& scaled,
                                                              MechanicalFrames* near) const {
  Linearization result;
  result.model.gradient = VecX::Zero(dimension());
  result.model.hessian = MatX::Zero(dimension(), dimension());
  MechanicalFrames own;
  MechanicalFrames& frames = near ? *near : own;
  if (!simulate(scaled, MechanicalDerivatives::all, frames, &result.reason)) {
    result.model.cost = kInfinity;
    return result;
  }
  VecX slopes(dimension());
  for (int i = 0; i < dimension(); ++i) slopes[i] = scaled_slope(info(i), scaled[i]);
  const double factor = 1 / static_cast<double>(residual_count_);
  VecX r;
  MatX all;
  for (std::size_t t = 0; t < trials_.size(); ++t) {
    for (const MechanicalFrame& frame : frames[t]) {
      residuals(*trials_[t], frame, r, &all);
      MatX jacobian = all(Eigen::all, indices_);
      for (int i = 0; i < dimension(); ++i)
        for (const int follower : followers_[at(i)]) jacobian.col(i) += all.col(follower);
      jacobian *= slopes.asDiagonal();
      CostPart part{t, frame.frame, 2 * factor * jacobian.transpose() * r,
                    2 * factor * jacobian.transpose() * jacobian};
      result.model.cost += factor * r.squaredNorm();
      result.model.gradient += part.gradient;
      result.model.hessian += part.hessian;
      result.parts.push_back(std::move(part));
      if (frame.inexact) ++result.inexact;
    }
  }
  return result;
}

namespace {

void add_intervals(const MechanicalProblem& problem, const VecX& scaled,
                   const MechanicalProblem::Linearization& found,
                   const MechanicalFitOptions& options, MechanicalFitResult& result) {
  if (options.mesh_error == MeshError::included)
    result.mesh = find_mesh_shift(problem, scaled, found);
  if (!std::isfinite(found.model.cost)) return;
  std::vector<ParameterInfo> infos;
  for (int i = 0; i < problem.dimension(); ++i) infos.push_back(problem.info(i));
  ResidualIntervals intervals =
      residual_intervals(infos, scaled, found.model, found.parts, problem.residual_count(),
                         options.confidence, mesh_half_widths(result.mesh.shift));
  result.intervals = std::move(intervals.intervals);
  result.correlation = std::move(intervals.correlation);
  result.condition = intervals.condition;
}

}  // namespace

MechanicalFitResult fit_mechanical(const MechanicalProblem& problem, const Fabric& start,
                                   const MechanicalFitOptions& options,
                                   const MechanicalFitObserver& observer) {
  const auto begin = std::chrono::steady_clock::now();
  MechanicalFitResult result;
  const VecX from = problem.scaled(start);
  result.start = problem.fabric(from);
  std::string reason;
  bool stopped = false;
  const auto count = [&](double cost) {
    MechanicalFitStep step{++result.evaluations, cost, cost};
    if (!result.history.empty()) step.best = std::min(step.best, result.history.back().best);
    result.history.push_back(step);
    if (observer && !observer(step)) stopped = true;
  };
  MechanicalFrames shapes, tried;  // equilibria of the last linearization, and of the last cost
  VecX tried_at;
  const LinearizeFunction linearize = [&](const VecX& x) {
    if (tried_at.size() > 0 && tried_at == x) shapes = std::move(tried);
    QuadraticModel model = problem.linearize(x, &shapes).model;
    tried_at.resize(0);
    count(model.cost);
    return model;
  };
  const CostFunction cost = [&](const VecX& x) {
    tried = shapes;
    tried_at = x;
    const double value = problem.cost(x, nullptr, &tried);
    count(value);
    return value;
  };
  result.cost_start = problem.cost(from, &reason, &shapes);
  if (!std::isfinite(result.cost_start))
    throw Error(fmt::format("the start cannot be computed: {}", reason));
  const VecX zero = VecX::Zero(from.size()), one = VecX::Ones(from.size());
  double reached = result.cost_start;
  int small_steps = 0;
  const LeastSquaresObserver after_step = [&](const LeastSquaresStep& step) {
    if (!step.accepted) return !stopped;
    const double reduction = (reached - step.cost) * static_cast<double>(problem.residual_count());
    reached = step.cost;
    small_steps = reduction < kEnoughReduction ? small_steps + 1 : 0;
    return !stopped && small_steps < kEnoughSteps;
  };
  const LeastSquaresResult found =
      minimize_least_squares(linearize, cost, from, zero, one, options.least_squares, after_step);
  result.fabric = problem.fabric(found.x);
  result.cost = found.cost;
  result.end = found.end == LeastSquaresEnd::stopped && !stopped ? LeastSquaresEnd::small_reduction
                                                                 : found.end;
  const MechanicalProblem::Linearization at_end = problem.linearize(found.x);
  ++result.evaluations;
  result.inexact = at_end.inexact;
  add_intervals(problem, found.x, at_end, options, result);
  result.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return result;
}

MechanicalFitResult assess_mechanical(const MechanicalProblem& problem, const Fabric& fabric,
                                      const MechanicalFitOptions& options) {
  const auto begin = std::chrono::steady_clock::now();
  MechanicalFitResult result;
  const VecX x = problem.scaled(fabric);
  result.start = result.fabric = problem.fabric(x);
  const MechanicalProblem::Linearization found = problem.linearize(x);
  result.cost_start = result.cost = found.model.cost;
  result.evaluations = 1;
  result.end = LeastSquaresEnd::small_step;
  result.inexact = found.inexact;
  add_intervals(problem, x, found, options, result);
  result.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return result;
}

}  // namespace weft
