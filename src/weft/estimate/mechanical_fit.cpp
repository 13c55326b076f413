#include "weft/estimate/mechanical_fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "weft/base/clock.h"
#include "weft/estimate/content_hash.h"
#include "weft/estimate/replays.h"

namespace weft {
namespace {

/// Of a search with new weights: they have not changed where it ends.
constexpr double kEnoughByWeights = 0.1;
constexpr int kMostSearches = 8;
constexpr double kSameWeight = 1.01;  // of the priors

/// The free parameters and friction side by side.
class WithFriction {
 public:
  using Linearization = MechanicalProblem::Linearization;
  explicit WithFriction(MechanicalProblem problem) : problem_(std::move(problem)) {
    for (int i = 0; i < problem_.dimension(); ++i) infos_.push_back(problem_.info(i));
    for (std::size_t i = 0; i < problem_.with_friction().size(); ++i)
      infos_.push_back(problem_.friction_info(i));
  }

  const std::vector<ParameterInfo>& infos() const { return infos_; }
  double residual_count() const { return problem_.residual_count(); }
  const WeighedPriors& priors() const { return problem_.priors(); }
  WithFriction refined() const { return WithFriction(problem_.refined()); }

  VecX scaled(const VecX& free, const VecX& friction) const {
    VecX x(free.size() + friction.size());
    x << free, friction;
    for (Eigen::Index i = free.size(); i < x.size(); ++i) x[i] = to_scaled(infos_[at(i)], x[i]);
    return x;
  }
  /// `found` with the model of all at `scaled`. Differences are linear in the friction.
  Linearization model_of_all(const VecX& scaled, Linearization found) const {
    if (!std::isfinite(found.model.cost)) return found;
    const Eigen::Index all = scaled.size(), frictions = found.friction.size();
    found.model.gradient = VecX::Zero(all);
    found.model.hessian = MatX::Zero(all, all);
    for (const CostPart& part : found.parts) {
      found.model.gradient += part.gradient;
      found.model.hessian += part.hessian;
    }
    const VecX there = this->scaled(scaled.head(all - frictions), found.friction);
    found.model.gradient += found.model.hessian * (scaled - there);
    return found;
  }
  Linearization linearize(const VecX& scaled, MechanicalShapes* near) const {
    return model_of_all(scaled, problem_.linearize(scaled.head(problem_.dimension()), near));
  }

 private:
  MechanicalProblem problem_;
  std::vector<ParameterInfo> infos_;
};

void add_friction_intervals(const MechanicalProblem& problem, const VecX& friction,
                            const std::vector<ParameterInterval>& intervals,
                            MechanicalFitResult& result) {
  const std::vector<std::size_t> trials = problem.with_friction();
  for (std::size_t i = 0; i < trials.size(); ++i) {
    const double value = friction[static_cast<Eigen::Index>(i)];
    ParameterInterval interval = intervals[i];
    interval.name = problem.trials()[trials[i]]->capture.name;
    interval.lower = std::max(0.0, interval.lower);
    interval.at_lower = value == 0;
    result.cord_friction.push_back({trials[i], std::move(interval)});
  }
}

/// `shapes`: those of `found`.
void add_intervals(const MechanicalProblem& problem, const VecX& scaled,
                   const MechanicalProblem::Linearization& found, const MechanicalShapes& shapes,
                   const MechanicalFitOptions& options, MechanicalFitResult& result) {
  const WithFriction joint(problem);
  const VecX x = joint.scaled(scaled, found.friction);
  const MechanicalProblem::Linearization all = joint.model_of_all(x, found);
  if (options.mesh_error == MeshError::included) {
    MechanicalShapes starts = problem.as_starts(shapes, "end-finer");
    result.mesh = find_mesh_shift(joint, x, all, &starts);
  }
  const VecX mesh_halves = mesh_half_widths(result.mesh.shift);
  const Eigen::Index n = problem.dimension();
  if (result.mesh.shift.size() > 0) result.mesh.shift.conservativeResize(n);
  if (!std::isfinite(found.model.cost)) return;
  // Friction is free here even at zero, of which the fabric is not sure.
  ResidualIntervals intervals =
      residual_intervals(joint.infos(), x, all.model, found.parts, problem.residual_count(),
                         options.confidence, mesh_halves, problem.priors().term(scaled, x.size()));
  const std::vector<ParameterInterval> frictions(intervals.intervals.begin() + n,
                                                 intervals.intervals.end());
  intervals.intervals.resize(at(n));
  result.intervals = std::move(intervals.intervals);
  result.certainty = std::move(intervals.certainty);
  for (MatX* matrix : {&result.certainty.covariance, &result.certainty.correlation})
    *matrix = MatX(matrix->topLeftCorner(n, n));
  // What friction leaves open is not known of the fabric.
  result.certainty.information = 0.5 * problem.residual_count() * found.model.hessian;
  add_friction_intervals(problem, found.friction, frictions, result);
}

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
  hash.add(options.first_cells);
  problem.priors().add_to(hash);
  return hash.hex();
}

namespace {

MechanicalFitOptions without_mesh(MechanicalFitOptions options) {
  options.mesh_error = MeshError::left_out;
  return options;
}

/// Of a fit that was stopped.
void leave_mesh_unknown(const MechanicalFitOptions& asked, MechanicalFitResult& result) {
  if (asked.mesh_error == MeshError::included) result.mesh.unknown = "the fit was stopped";
}

/// Searches one after the other, each with the weights of where the one before ended.
class FitSearch {
 public:
  FitSearch(const MechanicalProblem& problem, const MechanicalFitOptions& options,
            const MechanicalFitObserver& observer, MechanicalShapes* near)
      : problem_(problem), options_(options), observer_(observer), near_(near) {
    if (near) shapes_ = *near;
  }

  MechanicalFitResult run(const Fabric& start) {
    const auto begin = Clock::now();
    const VecX from = problem_.scaled(start);
    result_.start = problem_.fabric(from);
    result_.residual_count = problem_.residual_count();
    result_.force_share = problem_.force_share();
    // Far from the estimate clips would move for what is wrong with the fabric.
    if (problem_.weights().empty()) weigh(from, MechanicalProblem::ClipPlaces::as_weighed);
    if (problem_.priors().has_smooth_curves()) weigh_priors(from);
    std::string reason;
    result_.cost_start = problem_.cost(from, &reason, &shapes_);
    if (!std::isfinite(result_.cost_start))
      throw MechanicalStartError(fmt::format("the start cannot be computed: {}", reason));
    finish(search_all(from));
    result_.wall_s = seconds_since(begin);
    return std::move(result_);
  }

 private:
  /// False where there are no weights to be had.
  bool weigh(const VecX& x, MechanicalProblem::ClipPlaces places) {
    ForceWeights weights = problem_.force_weights(x, &shapes_, places);
    if (weights.empty()) return false;
    problem_.weigh_by(std::move(weights));
    linearized_at_.resize(0);
    return true;
  }

  const MechanicalProblem::Linearization& linearized(const VecX& x) {
    if (linearized_at_.size() == 0 || linearized_at_ != x) {
      linearized_ = problem_.linearize(x, &shapes_);
      linearized_at_ = x;
    }
    return linearized_;
  }

  /// By the dispersion of the residuals at `x`, and curves as rough as is most probable there.
  /// False where both are as they were, or not known.
  bool weigh_priors(const VecX& x) {
    if (problem_.priors().empty()) return false;
    const MechanicalProblem::Linearization& found = linearized(x);
    if (!std::isfinite(found.model.cost)) return false;
    const double weight =
        residual_dispersion(found.parts, found.model.cost, problem_.residual_count());
    const double change = weight / problem_.priors().weight();
    const bool same = std::max(change, 1 / change) < kSameWeight;
    if (!same) problem_.weigh_priors(weight);
    if (!problem_.priors().has_smooth_curves()) return !same;
    const WeighedPriors::Roughness before = problem_.priors().roughness();
    problem_.roughen_by(problem_.priors().most_probable_roughness(x, found.model));
    return !same || problem_.priors().roughness() != before;
  }

  LeastSquaresResult search_all(const VecX& from) {
    LeastSquaresResult found = search(from, result_.cost_start + problem_.priors().cost(from));
    result_.cost_first = found.cost;
    for (int searches = 1; searches < kMostSearches && !stopped_; ++searches) {
      const MechanicalProblem held = problem_;
      const bool forces = weigh(found.x, MechanicalProblem::ClipPlaces::most_probable),
                 priors = weigh_priors(found.x);
      if (!forces && !priors) break;
      const double before =
          problem_.cost(found.x, nullptr, &shapes_) + problem_.priors().cost(found.x);
      if (!std::isfinite(before)) {
        problem_ = held;
        linearized_at_.resize(0);
        break;
      }
      found = search(found.x, before);
      if ((before - found.cost) * problem_.residual_count() < kEnoughByWeights) break;
    }
    return found;
  }

  /// With the weights that the problem has now; the cost at `from` is `cost_there`.
  LeastSquaresResult search(const VecX& from, double cost_there) {
    best_ = kInfinity;
    VecX tried_at;
    MechanicalShapes tried;  // equilibria of the last cost
    const LinearizeFunction linearize = [&](const VecX& x) {
      if (tried_at.size() > 0 && tried_at == x) shapes_ = tried;
      QuadraticModel model;
      count([&] {
        model = linearized(x).model;
        problem_.priors().add_to(x, model);
        return model.cost;
      });
      tried_at.resize(0);
      return model;
    };
    const CostFunction cost = [&](const VecX& x) {
      tried = shapes_;
      tried_at = x;
      double value = 0;
      count([&] { return value = problem_.cost(x, nullptr, &tried) + problem_.priors().cost(x); });
      return value;
    };
    PayingSteps steps(cost_there, problem_.residual_count());
    const LeastSquaresObserver after_step = [&](const LeastSquaresStep& step) {
      return !stopped_ && steps.pay_after(step);
    };
    const VecX zero = VecX::Zero(from.size()), one = VecX::Ones(from.size());
    return minimize_least_squares(linearize, cost, from, zero, one, options_.least_squares,
                                  after_step);
  }

  /// Of each evaluation its cost, and whether it was taken from the store.
  template <typename Evaluate>
  void count(const Evaluate& evaluate) {
    const Replays replays(problem_);
    const double cost = evaluate();
    best_ = std::min(best_, cost);
    const MechanicalFitStep step{++result_.evaluations, cost, best_, replays.since() > 0};
    result_.replayed += replays.since();
    result_.history.push_back(step);
    if (observer_ && !observer_(step)) stopped_ = true;
  }

  void finish(const LeastSquaresResult& found) {
    result_.fabric = problem_.fabric(found.x);
    result_.prior_weight = problem_.priors().weight();
    result_.prior_error = problem_.priors().cost(found.x);
    result_.roughness = problem_.priors().roughness();
    result_.cost = found.cost - result_.prior_error;
    result_.end = found.end == LeastSquaresEnd::stopped && !stopped_
                      ? LeastSquaresEnd::small_reduction
                      : found.end;
    const Replays replays(problem_);
    // A fit that was stopped goes on from the shapes that are in the store now.
    MechanicalShapes anew("end");
    MechanicalShapes& shapes = near_ && !stopped_ ? shapes_ : anew;
    const MechanicalProblem::Linearization at_end = problem_.linearize(found.x, &shapes);
    if (near_) *near_ = shapes_;
    ++result_.evaluations;
    result_.replayed += replays.since();
    result_.inexact = at_end.inexact;
    result_.weights = problem_.weights();
    if (stopped_) leave_mesh_unknown(options_, result_);
    add_intervals(problem_, found.x, at_end, shapes, stopped_ ? without_mesh(options_) : options_,
                  result_);
  }

  MechanicalProblem problem_;
  const MechanicalFitOptions& options_;
  const MechanicalFitObserver& observer_;
  MechanicalShapes* near_;   ///< where to leave the shapes of the end; may be null
  MechanicalShapes shapes_;  ///< of the last linearization
  /// With the weights that the problem has; of no point where that is empty.
  MechanicalProblem::Linearization linearized_;
  VecX linearized_at_;
  MechanicalFitResult result_;
  double best_ = kInfinity;
  bool stopped_ = false;
};

/// Where it ended, but for what ended at a bound, which follows the error of the cells: as it
/// began.
Fabric inside_its_bounds(const MechanicalFitResult& found) {
  Fabric fabric = found.fabric;
  for (const ParameterInterval& p : found.intervals)
    if (p.at_lower || p.at_upper) fabric.set(p.name, found.start.value(p.name));
  return fabric;
}

/// `result` goes on from where `first` ended.
void prepend(MechanicalFitResult first, MechanicalFitResult& result) {
  for (MechanicalFitStep& step : result.history) {
    step.evaluation += first.evaluations;
    first.history.push_back(step);
  }
  result.history = std::move(first.history);
  result.start = std::move(first.start);
  result.cost_start = first.cost_start;
  result.evaluations += first.evaluations;
  result.replayed += first.replayed;
  result.wall_s += first.wall_s;
}

}  // namespace

MechanicalFitResult fit_mechanical(const MechanicalProblem& problem, const Fabric& start,
                                   const MechanicalFitOptions& options,
                                   const MechanicalFitObserver& observer, MechanicalShapes* near) {
  const auto straight = [&] { return FitSearch(problem, options, observer, near).run(start); };
  std::optional<MechanicalProblem> half;
  if (!near && options.first_cells == FirstCells::halved) half = problem.on_half_the_cells();
  if (!half) return straight();
  MechanicalFitResult first;
  try {
    first = FitSearch(*half, without_mesh(options), observer, nullptr).run(start);
  } catch (const MechanicalStartError&) {
    return straight();
  }
  MechanicalFitResult result;
  if (first.end == LeastSquaresEnd::stopped) {
    result = assess_stopped(problem, first.fabric, options);
    result.end = first.end;
  } else {
    const MechanicalFitObserver after_first = [&](MechanicalFitStep step) {
      step.evaluation += first.evaluations;
      return !observer || observer(step);
    };
    result = FitSearch(problem, options, after_first, nullptr).run(inside_its_bounds(first));
  }
  prepend(std::move(first), result);
  return result;
}

MechanicalFitResult assess_mechanical(const MechanicalProblem& problem, const Fabric& fabric,
                                      const MechanicalFitOptions& options,
                                      MechanicalShapes* shapes) {
  const auto begin = Clock::now();
  MechanicalFitResult result;
  MechanicalShapes here("end");
  MechanicalProblem weighed = problem;
  const VecX x = problem.scaled(fabric);
  result.start = result.fabric = problem.fabric(x);
  result.residual_count = problem.residual_count();
  result.force_share = problem.force_share();
  if (weighed.weights().empty()) weighed.weigh_by(weighed.force_weights(x, &here));
  const Replays replays(problem);
  const MechanicalProblem::Linearization found = weighed.linearize(x, &here);
  result.replayed = replays.since();
  if (std::isfinite(found.model.cost))
    weighed.weigh_priors(
        residual_dispersion(found.parts, found.model.cost, problem.residual_count()));
  result.prior_weight = weighed.priors().weight();
  result.prior_error = weighed.priors().cost(x);
  result.roughness = weighed.priors().roughness();
  result.cost_start = result.cost = found.model.cost;
  result.cost_first = result.cost + result.prior_error;
  result.evaluations = 1;
  result.end = LeastSquaresEnd::small_step;
  result.inexact = found.inexact;
  result.weights = weighed.weights();
  add_intervals(weighed, x, found, here, options, result);
  if (shapes) *shapes = here;
  result.wall_s = seconds_since(begin);
  return result;
}

MechanicalFitResult assess_stopped(const MechanicalProblem& problem, const Fabric& fabric,
                                   const MechanicalFitOptions& options, MechanicalShapes* shapes) {
  MechanicalFitResult result = assess_mechanical(problem, fabric, without_mesh(options), shapes);
  leave_mesh_unknown(options, result);
  return result;
}

}  // namespace weft
