#include "weft/estimate/mechanical_fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "weft/base/error.h"
#include "weft/estimate/content_hash.h"
#include "weft/estimate/packed_numbers.h"
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
  finer.keep_in(store_);
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

std::string MechanicalProblem::simulate(const VecX& scaled, MechanicalDerivatives derivatives,
                                        const MechanicalFrames* from,
                                        MechanicalFrames& frames) const {
  std::string reason;
  try {
    frames = simulate_mechanical(trials_, fabric(scaled), derivatives, threads_, from);
  } catch (const Error& error) {
    reason = error.what();  // of values that the model refuses
  }
  for (std::size_t t = 0; reason.empty() && t < frames.size(); ++t)
    for (const MechanicalFrame& frame : frames[t])
      if (!(frame.residual <= options_.largest_residual) && reason.empty())
        reason = fmt::format("{}: no equilibrium at frame {}: a net force of {:.2g} N is left",
                             trials_[t]->capture.name, frame.frame, frame.residual);
  if (reason.empty()) return {};
  frames.clear();
  return from ? simulate(scaled, derivatives, nullptr, frames) : reason;
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

double MechanicalProblem::cost_of(const MechanicalFrames& frames) const {
  double sum = 0;
  VecX r;
  for (std::size_t t = 0; t < trials_.size(); ++t)
    for (const MechanicalFrame& frame : frames[t]) {
      residuals(*trials_[t], frame, r, nullptr);
      sum += r.squaredNorm();
    }
  return sum / static_cast<double>(residual_count_);
}

MechanicalProblem::Linearization MechanicalProblem::linearization_of(const MechanicalFrames& frames,
                                                                     const VecX& scaled) const {
  Linearization result;
  result.model.gradient = VecX::Zero(dimension());
  result.model.hessian = MatX::Zero(dimension(), dimension());
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
  add_parts(l.parts, writer);
  return writer.numbers();
}

MechanicalProblem::Linearization from_numbers(const VecX& numbers, Eigen::Index n) {
  MechanicalProblem::Linearization l;
  if (!std::isfinite(numbers[0])) {
    l.model = {kInfinity, VecX::Zero(n), MatX::Zero(n, n)};
    l.reason = reason_of(numbers);
    return l;
  }
  NumberReader reader(numbers);
  l.model.cost = reader.number();
  l.inexact = static_cast<int>(reader.number());
  l.model.gradient = reader.vector(n);
  l.model.hessian = reader.matrix(n, n);
  l.parts = read_parts(reader, n);
  return l;
}

}  // namespace

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
  return from_numbers(numbers, dimension());
}

VecX MechanicalProblem::ask(Question question, const VecX& scaled, MechanicalShapes* near,
                            const Answer& answer) const {
  MechanicalShapes after;
  if (store_) {
    after.evaluation_ = key(question, scaled, near);
    if (const auto known = store_->find(after.evaluation_)) {
      if (near) *near = std::isfinite((*known)[0]) ? after : MechanicalShapes();
      return *known;
    }
  }
  std::shared_ptr<const MechanicalFrames> from = near ? near->frames_ : nullptr;
  if (near && !from && !near->evaluation_.empty())
    from = std::make_shared<MechanicalFrames>(store_->shapes(near->evaluation_, trials_));
  const auto found = std::make_shared<MechanicalFrames>();
  VecX numbers = answer(from.get(), *found);
  const bool finite = std::isfinite(numbers[0]);
  after.frames_ = found;
  if (store_) {
    if (near && finite) store_->add_shapes(after.evaluation_, *found);
    store_->add(after.evaluation_, numbers);
    // What comes starts from here.
    if (near && finite && question == Question::linearization)
      store_->remove_shapes_but(after.evaluation_);
  }
  if (near) *near = finite ? after : MechanicalShapes();
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
  if (near) hash.add(std::string_view(near->evaluation_));
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
  for (const double value : {options_.force_noise, options_.point_noise, options_.largest_residual})
    hash.add(value);
  return hash.hex();
}

void MechanicalProblem::keep_in(std::shared_ptr<MechanicalStore> store) {
  store_ = std::move(store);
  fingerprint_ = store_ ? fingerprint() : std::string();
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

/// Evaluations of a problem that its store knew.
class Replays {
 public:
  explicit Replays(const MechanicalProblem& problem)
      : problem_(problem), before_(problem.replayed()) {}
  std::size_t since() const { return problem_.replayed() - before_; }

 private:
  const MechanicalProblem& problem_;
  std::size_t before_;
};

}  // namespace

std::string fit_fingerprint(const MechanicalProblem& problem, const Fabric& start,
                            const MechanicalFitOptions& options) {
  ContentHash hash;
  hash.add(std::string_view(problem.fingerprint()));
  hash.add(problem.scaled(start));
  const LeastSquaresOptions& search = options.least_squares;
  hash.add(search.max_iterations);
  for (const double value :
       {search.step_tolerance, search.cost_tolerance, search.initial_damping, search.largest_step})
    hash.add(value);
  return hash.hex();
}

MechanicalFitResult fit_mechanical(const MechanicalProblem& problem, const Fabric& start,
                                   const MechanicalFitOptions& options,
                                   const MechanicalFitObserver& observer) {
  const auto begin = std::chrono::steady_clock::now();
  MechanicalFitResult result;
  const VecX from = problem.scaled(start);
  result.start = problem.fabric(from);
  std::string reason;
  bool stopped = false;
  // Of each evaluation its cost, and whether it was taken from the store.
  const auto count = [&](const auto& evaluate) {
    const Replays replays(problem);
    const double cost = evaluate();
    MechanicalFitStep step{++result.evaluations, cost, cost, replays.since() > 0};
    result.replayed += replays.since();
    if (!result.history.empty()) step.best = std::min(step.best, result.history.back().best);
    result.history.push_back(step);
    if (observer && !observer(step)) stopped = true;
  };
  MechanicalShapes shapes, tried;  // equilibria of the last linearization, and of the last cost
  VecX tried_at;
  const LinearizeFunction linearize = [&](const VecX& x) {
    if (tried_at.size() > 0 && tried_at == x) shapes = tried;
    QuadraticModel model;
    count([&] {
      model = problem.linearize(x, &shapes).model;
      return model.cost;
    });
    tried_at.resize(0);
    return model;
  };
  const CostFunction cost = [&](const VecX& x) {
    tried = shapes;
    tried_at = x;
    double value = 0;
    count([&] { return value = problem.cost(x, nullptr, &tried); });
    return value;
  };
  result.cost_start = problem.cost(from, &reason, &shapes);
  if (!std::isfinite(result.cost_start))
    throw MechanicalStartError(fmt::format("the start cannot be computed: {}", reason));
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
  const Replays at_end_replays(problem);
  const MechanicalProblem::Linearization at_end = problem.linearize(found.x);
  ++result.evaluations;
  result.replayed += at_end_replays.since();
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
  const Replays replays(problem);
  const MechanicalProblem::Linearization found = problem.linearize(x);
  result.replayed = replays.since();
  result.cost_start = result.cost = found.model.cost;
  result.evaluations = 1;
  result.end = LeastSquaresEnd::small_step;
  result.inexact = found.inexact;
  add_intervals(problem, x, found, options, result);
  result.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return result;
}

}  // namespace weft
