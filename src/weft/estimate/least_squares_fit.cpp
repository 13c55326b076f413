#include "weft/estimate/least_squares_fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <mutex>
#include <numeric>
#include <optional>

#include "weft/base/clock.h"
#include "weft/base/error.h"
#include "weft/base/interrupt.h"
#include "weft/base/parallel.h"
#include "weft/base/random.h"
#include "weft/estimate/choose_start.h"
#include "weft/estimate/stored_search.h"
#include "weft/estimate/uncertainty.h"

namespace weft {
namespace {

/// Of the error of the candidates: dents of one way are 2 to 5 % deep.
constexpr double kAnotherWay = 0.9;

/// A fabric, and the starts that suit it.
struct Contender {
  VecX scaled;
  std::shared_ptr<const Problem> problem;
  double cost = kInfinity;
};

bool starts_differ(const Problem& problem) {
  return std::ranges::any_of(problem.trials(),
                             [](const auto& trial) { return !trial->other_starts.empty(); });
}

const char* const kStoppedEarly = "stopped before the end: the best so far";

/// Stable: of equal costs the earlier one stays in front.
void sort_by_cost(std::vector<Contender>& candidates) {
  std::ranges::stable_sort(candidates, {}, &Contender::cost);
}

/// One point in each of `count` layers of every coordinate.
std::vector<VecX> latin_hypercube(int count, int dimension, std::uint64_t seed) {
  Rng rng(seed, 2);
  std::vector<VecX> points(static_cast<std::size_t>(count), VecX(dimension));
  std::vector<int> layers(static_cast<std::size_t>(count));
  for (int i = 0; i < dimension; ++i) {
    std::iota(layers.begin(), layers.end(), 0);
    for (std::size_t k = layers.size(); k > 1; --k)
      std::swap(layers[k - 1], layers[static_cast<std::size_t>(rng.uniform() * double(k))]);
    for (std::size_t k = 0; k < layers.size(); ++k)
      points[k][i] = (layers[k] + rng.uniform()) / count;
  }
  return points;
}

class LeastSquaresFit {
 public:
  LeastSquaresFit(const Problem& problem, const LeastSquaresFitOptions& options,
                  EvaluationStore* store, const FitObserver& observer)
      : problem_(std::make_shared<Problem>(problem)),
        screened_(problem_),
        options_(options),
        stages_(options.stages),
        store_(store),
        observer_(observer) {
    if (problem.evaluator())
      throw Error("least squares needs trials; this problem has an evaluator of its own");
    if (options.screening_points < 0) throw Error("screening_points must not be negative");
    if (options.screening_frames < 0) throw Error("screening_frames must not be negative");
    for (const std::string& name : options.screening_parameters)
      parameter_index(problem.initial().model, name);  // throws for an unknown one
    if (options.stages.empty()) throw Error("least squares needs at least one stage");
    for (const FitStage& stage : options.stages) {
      if (stage.frames < 0) throw Error("frames of a stage must not be negative");
      if (!(stage.pull >= 0)) throw Error("the pull of a stage must not be negative");
      if (stage.survivors < 1) throw Error("a stage needs at least one survivor");
      if (!(stage.fold_weight >= 0))
        throw Error("the folds' weight of a stage must not be negative");
      if (stage.scattered < 0) throw Error("scattered points of a stage must not be negative");
      if (!(stage.scatter >= 0 && stage.scatter <= 1))
        throw Error(
            fmt::format("the scatter of a stage is {:g}, must be in [0, 1]", stage.scatter));
    }
    if (options.hops.rounds < 0) throw Error("rounds of hops must not be negative");
    if (options.hops.drawn < 1 || options.hops.descents < 1 || options.hops.max_iterations < 1 ||
        options.hops.steps_before < 1 || options.hops.patience < 1)
      throw Error("hops need a point, a descent, an iteration and a round's patience at least");
    if (!(options.hops.least_gain >= 0))
      throw Error("the least gain of a hop must not be negative");
    if (options.hops.rounds > 0) {
      int& iterations = stages_.back().max_iterations;
      iterations = std::min(iterations, options.hops.steps_before);
    }
    result_.seed = options.seed;
  }

  FitResult run() {
    const auto begin = Clock::now();
    std::vector<Contender> candidates = screen();
    renew_starts(stages_.front(), candidates);
    for (std::size_t k = 0; k < stages_.size() && !stopped_; ++k) {
      run_stage(stages_[k], candidates);
      const bool last = k + 1 == stages_.size();
      const FitStage& next = stages_[last ? k : k + 1];
      keep_best(next.survivors, candidates);
      const bool renewed = renew_starts(next, candidates);
      // What the last stage said, it said of other starts.
      if (renewed || !last) settle_starts(candidates);
      if (renewed && last) run_stage(stages_[k], candidates);
    }
    if (stopped_) look_at_best_of_fewer_frames(candidates);
    hop();
    conclude();
    result_.wall_s = seconds_since(begin);
    return std::move(result_);
  }

 private:
  /// Tells the observer of an evaluation on all frames that is a phase of its own, and records it.
  void note_start(const Contender& point, const ProblemEvaluation& evaluation) {
    announce("start", evaluation, 1);
    record("start", point, 0, evaluation);
  }

  /// History and best so far, in an order that does not depend on the threads.
  void record(const std::string& phase, const Contender& point, int frame_count,
              const ProblemEvaluation& evaluation) {
    ++result_.evaluations;
    result_.diverged += evaluation.diverged;
    const bool first = result_.history.empty() || result_.history.back().phase != phase;
    const double best =
        first ? evaluation.error : std::min(result_.history.back().best, evaluation.error);
    result_.history.push_back({phase, result_.history.size() + 1, evaluation.error, best, 0});
    const double error = evaluation.error + problem_->prior_cost(point.scaled, prior_weight_);
    if (frame_count == 0 && (result_.scaled.size() == 0 || error < best_error_)) {
      result_.scaled = point.scaled;
      result_.final = evaluation;
      best_problem_ = point.problem;
      best_error_ = error;
    }
  }

  /// Progress, as evaluations end; asks whether to go on.
  void announce(const std::string& phase, const ProblemEvaluation& evaluation,
                std::size_t total = 0) {
    const std::lock_guard lock(announcing_);
    if (phase != phase_) begin_phase(phase);
    if (part_ != told_part_) begin_part();
    phase_best_ = std::min(phase_best_, evaluation.error);
    ++phase_done_;
    tell({phase, ++announced_, evaluation.error, phase_best_, 0}, total);
  }

  /// Of the search for starts, which is no evaluation of the fit's; `error`: of what it begins
  /// from.
  void announce_starts(double error, std::size_t tried) {
    const std::lock_guard lock(announcing_);
    if (tried == 0) begin_phase("starts");
    phase_done_ = tried;
    tell({"starts", announced_, error, error, 0}, 0);
  }

  void begin_phase(const std::string& phase) {
    phase_ = phase;
    phase_best_ = kInfinity;
    begin_part();
  }

  void begin_part() {
    told_part_ = part_;
    phase_done_ = 0;
  }

  void tell(FitStep step, std::size_t total) {
    const std::size_t replayed = result_.replayed + replayed_below_;
    if (observer_ && !observer_({std::move(step), part_, phase_done_, total, replayed}))
      stopped_ = true;
    if (interrupted()) stopped_ = true;
  }

  /// In descents that are under way: result_ has them when all are recorded.
  void count_replay_below() {
    const std::lock_guard lock(announcing_);
    ++replayed_below_;
  }

  /// Of each candidate; nothing where the fit was stopped before.
  using MaybeEvaluated = std::vector<std::optional<StoredEvaluation>>;

  /// Evaluates on one thread, and tells the observer when that ends. `total`: of the phase, 0 if
  /// not known.
  std::optional<StoredEvaluation> tell_of(const Contender& point, int frame_count,
                                          const std::string& phase, std::size_t total = 0) {
    if (stopped_ || interrupted()) return {};
    StoredEvaluation found = evaluate_point(point, frame_count, phase, 1);
    if (found.replayed) count_replay_below();
    announce(phase, found.evaluation, total);
    return found;
  }

  /// What tell_of() found of the first candidates, in their order.
  void record_each(const MaybeEvaluated& found, const std::string& phase, int frame_count,
                   std::vector<Contender>& candidates) {
    replayed_below_ = 0;
    for (std::size_t i = 0; i < found.size(); ++i) {
      if (!found[i]) {
        stopped_ = true;
        continue;
      }
      result_.replayed += found[i]->replayed;
      candidates[i].cost = found[i]->evaluation.error;
      record(phase, candidates[i], frame_count, found[i]->evaluation);
    }
  }

  Contender middle() const { return {VecX::Constant(problem_->dimension(), 0.5), problem_}; }

  StoredEvaluation evaluate_point(const Contender& point, int frame_count, const std::string& phase,
                                  int threads) const {
    return evaluate_stored(*point.problem, problem_->fabric(point.scaled), frame_count, phase,
                           store_, threads);
  }

  void note_middle(const StoredEvaluation& stored) {
    result_.replayed += stored.replayed;
    result_.initial = result_.start = stored.evaluation;
    result_.start_fabric = problem_->fabric(middle().scaled);
    note_start(middle(), stored.evaluation);
  }

  VecX first_guess() const {
    return start_point(*problem_, options_.start, options_.start_seed.value_or(options_.seed));
  }

  /// Where parameters stay that nothing determines.
  VecX reference() const {
    if (options_.start == FitOptions::Start::random)
      return start_point(*problem_, FitOptions::Start::middle, options_.seed);
    return first_guess();
  }

  /// The start and the points of the screening about it; the start alone without one.
  std::vector<Contender> points_to_screen() const {
    std::vector<Contender> candidates{{first_guess(), problem_, 0}};
    std::vector<Eigen::Index> dimensions;
    for (const std::string& name : options_.screening_parameters)
      if (const int i = problem_->index_of(name); i >= 0) dimensions.push_back(i);
    if (options_.screening_points == 0 || dimensions.empty()) return candidates;
    for (const VecX& point : latin_hypercube(options_.screening_points,
                                             static_cast<int>(dimensions.size()), options_.seed)) {
      candidates.push_back({reference(), problem_});
      candidates.back().scaled(dimensions) = point;
    }
    return candidates;
  }

  /// The middle of the ranges, which reports compare with, and the points to screen are evaluated
  /// side by side: a simulation has one thread. Returns the points, best first.
  std::vector<Contender> screen() {
    std::vector<Contender> candidates = points_to_screen();
    const std::size_t screened = candidates.size() > 1 ? candidates.size() : 0;
    StoredEvaluation of_middle;
    MaybeEvaluated found(screened);
    parallel_for(1 + screened, options_.threads, [&](std::size_t i) {
      if (i == 0)
        of_middle = evaluate_point(middle(), 0, "start", options_.threads);
      else
        found[i - 1] = tell_of(candidates[i - 1], options_.screening_frames, "screening", screened);
    });
    note_middle(of_middle);
    record_each(found, "screening", options_.screening_frames, candidates);
    sort_by_cost(candidates);
    return candidates;
  }

  /// The last of those kept is the best one from the given starts, if no other is: which starts are
  /// right a fit says that has adapted a fabric to each, not the first frames with one fabric.
  void keep_best(int count, std::vector<Contender>& candidates) const {
    sort_by_cost(candidates);
    if (candidates.size() <= static_cast<std::size_t>(count)) return;
    const auto end = candidates.begin() + count;
    const auto given = std::ranges::find(candidates, problem_, &Contender::problem);
    if (count > 1 && given != candidates.end() && given >= end) end[-1] = std::move(*given);
    candidates.erase(end, candidates.end());
  }

  /// Gives the best candidate the starts that suit its fabric over the frames of `next`, and with
  /// it those that had the same; true if they are others than before.
  bool renew_starts(const FitStage& next, std::vector<Contender>& candidates) {
    if (stopped_ || !starts_differ(*problem_)) return false;
    const Contender before = candidates.front();
    std::size_t tried = 0;
    announce_starts(before.cost, tried);
    if (stopped_) return false;
    auto suited = with_starts_for_stored(*before.problem, problem_->fabric(before.scaled),
                                         next.frames, options_.threads, store_, [&] {
                                           announce_starts(before.cost, ++tried);
                                           return !stopped_;
                                         });
    if (stopped_) return false;
    announce_starts(before.cost, tried);
    if (suited == before.problem->trials()) return false;
    const auto renewed =
        std::make_shared<const Problem>(before.problem->with_trials(std::move(suited)));
    give(renewed, before.problem, candidates);
    candidates.push_back(before);
    return true;
  }

  /// To those that have `before`.
  static void give(const std::shared_ptr<const Problem>& after,
                   const std::shared_ptr<const Problem>& before,
                   std::vector<Contender>& candidates) {
    for (Contender& candidate : candidates)
      if (candidate.problem == before) candidate.problem = after;
  }

  /// The problem itself where there was nothing to choose from.
  std::shared_ptr<const Problem> settled(const std::shared_ptr<const Problem>& problem,
                                         const VecX& scaled) const {
    if (!starts_differ(*problem)) return problem;
    return std::make_shared<const Problem>(problem->with_trials(
        with_settled_starts_stored(*problem, problem->fabric(scaled), options_.threads, store_)));
  }

  /// Starts of the best candidate, and with it of those that have the same.
  void settle_starts(std::vector<Contender>& candidates) {
    if (stopped_) return;
    const std::shared_ptr<const Problem> before = candidates.front().problem;
    const auto after = settled(before, candidates.front().scaled);
    give(after, before, candidates);
    if (problem_ == before) problem_ = after;
  }

  /// In each trial.
  bool silhouettes_count() const {
    return std::ranges::all_of(problem_->trials(),
                               [](const auto& trial) { return trial->options.alpha > 0; });
  }

  LinearizationOptions linearization_of(const FitStage& stage) const {
    LinearizationOptions options = options_.linearization;
    options.frame_count = stage.frames;
    options.residual.silhouette_sigma = stage.silhouette_sigma;
    options.residual.fold_scale = stage.fold_scale;
    options.residual.phase_weight = stage.phase_weight;
    options.residual.fold_weight = silhouettes_count() ? stage.fold_weight : 1;
    options.threads = options_.threads;
    return options;
  }

  /// Candidates are improved side by side. Where a core has no candidate left it follows the
  /// derivatives of another's motion and looks at its frames.
  void run_stage(const FitStage& stage, std::vector<Contender>& candidates) {
    part_ = fmt::format("stage {} of {}", &stage - stages_.data() + 1, stages_.size());
    const bool first = &stage == &stages_.front();
    if (first) keep_best(stage.survivors, candidates);  // by the screening
    const std::size_t descended = candidates.size();
    add_scattered(stage, candidates);
    const bool compared = candidates.size() == 1 || (first && stage.scattered == 0);
    // On all frames one alone is evaluated, too: no fit ends above where its last stage began.
    if (!compared || stage.frames == 0)
      compare_candidates(stage.frames, phase_of(stage), candidates);
    keep_other_ways(descended, candidates);
    keep_best(stage.survivors, candidates);
    const std::vector<Descent> descents = descend(stage, phase_of(stage), candidates);
    if (&stage == &stages_.back() && descents.front().end.size() > 0) {
      result_.start_fabric = problem_->fabric(candidates.front().scaled);
      result_.start = descents.front().start;
    }
    if (descents.front().end.size() > 0) weigh_priors(descents.front().prior_weight);
    record_all(stage, phase_of(stage), candidates, descents);
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      if (descents[i].end.size() == 0) continue;
      candidates[i].scaled = descents[i].end;
      candidates[i].cost = descents[i].cost;
    }
    part_.clear();
  }

  /// From the best point of all frames, with its starts.
  void hop() {
    const HopOptions& hops = options_.hops;
    FitStage stage = stages_.back();
    stage.frames = 0;
    stage.max_iterations = hops.max_iterations;
    Rng rng(options_.seed, 4);
    QuadraticModel model;
    VecX about;
    int fruitless = 0;
    std::vector<double> errors;  // before each round
    for (int round = 0; round < hops.rounds && fruitless < hops.patience && !stopped_; ++round) {
      part_ = fmt::format("round {} of at most {}", round + 1, hops.rounds);
      if (round == 0 || about != result_.scaled) model = model_at_best(stage);
      about = result_.scaled;
      if (!std::isfinite(model.cost)) return;
      errors.push_back(best_error_);
      std::vector<Contender> candidates;
      for (VecX& x : draw_by_curvature(result_.scaled, model, hops.drawn, rng, hops.draw))
        candidates.push_back({std::move(x), best_problem_});
      compare_candidates(stage.frames, "hops", candidates);
      if (stopped_) return;
      keep_best(hops.descents, candidates);
      record_all(stage, "hops", candidates, descend(stage, "hops", candidates));
      fruitless = best_error_ < (1 - hops.least_gain) * errors.back() ? 0 : fruitless + 1;
    }
    if (!errors.empty() && fruitless < hops.patience && !stopped_)
      result_.hop_gain = 1 - best_error_ / *(errors.end() - std::min(hops.patience, hops.rounds));
  }

  /// With the priors; its cost is infinite where there is no best yet.
  QuadraticModel model_at_best(const FitStage& stage) const {
    QuadraticModel model;
    model.cost = kInfinity;
    if (result_.scaled.size() == 0 || !std::isfinite(result_.final.error)) return model;
    // A descent that found no better point has it already.
    const auto known = std::ranges::find_if(linearized_, [&](const Linearized& l) {
      return l.problem == best_problem_ && l.scaled == result_.scaled;
    });
    model = known != linearized_.end()
                ? known->model
                : linearize_stored(*best_problem_, result_.scaled, linearization_of(stage), store_)
                      .model;
    add_priors(result_.scaled, prior_weight_, model);
    return model;
  }

  void add_scattered(const FitStage& stage, std::vector<Contender>& candidates) const {
    Rng rng(options_.seed, 3);
    const std::size_t centres = candidates.size();
    for (int i = 0; i < stage.scattered; ++i) {
      Contender drawn = candidates[static_cast<std::size_t>(i) % centres];
      for (double& coordinate : drawn.scaled)
        coordinate = std::clamp(coordinate + stage.scatter * rng.uniform(-1, 1), 0.0, 1.0);
      candidates.push_back(std::move(drawn));
    }
  }

  /// Of the candidates after the first `descended` only those that took another way: dents of the
  /// same way differ by less, and where a descent ended is the better start in them.
  static void keep_other_ways(std::size_t descended, std::vector<Contender>& candidates) {
    double best = kInfinity;
    for (std::size_t i = 0; i < descended; ++i) best = std::min(best, candidates[i].cost);
    const auto first = candidates.begin() + static_cast<std::ptrdiff_t>(descended);
    candidates.erase(
        std::remove_if(first, candidates.end(),
                       [&](const Contender& c) { return !(c.cost < kAnotherWay * best); }),
        candidates.end());
  }

  static std::string phase_of(const FitStage& stage) {
    return stage.frames > 0 ? fmt::format("{} frames", stage.frames) : "all frames";
  }

  /// By the error on so many frames.
  void compare_candidates(int frame_count, const std::string& phase,
                          std::vector<Contender>& candidates) {
    MaybeEvaluated found(candidates.size());
    parallel_for(candidates.size(), options_.threads,
                 [&](std::size_t i) { found[i] = tell_of(candidates[i], frame_count, phase); });
    record_each(found, phase, frame_count, candidates);
  }

  /// A point, and the model there, without priors.
  struct Linearized {
    std::shared_ptr<const Problem> problem;
    VecX scaled;
    QuadraticModel model;
  };
  /// A point that a descent evaluated.
  struct Tried {
    VecX scaled;
    ProblemEvaluation evaluation;
    bool replayed = false;
  };
  struct Descent {
    std::vector<Tried> tried;  ///< in order
    ProblemEvaluation start;   ///< of the first linearization
    VecX end;                  ///< empty if it never ran
    double cost = kInfinity;
    double prior_weight = 0;  ///< by the noise of the first linearization's residuals
    Linearized last;
  };

  double prior_weight_at(const Problem& problem, const VecX& scaled,
                         const LinearizationOptions& options) const {
    if (!problem.has_prior()) return 0;
    const std::vector<PatchPart> parts = linearize_patches(problem, scaled, options);
    if (parts.empty()) return prior_weight_;  // a motion that diverged
    const double dispersion = cluster_dispersion(parts);
    return std::isfinite(dispersion) ? dispersion : prior_weight_;
  }

  /// The best so far is judged by the new weight from then on.
  void weigh_priors(double weight) {
    prior_weight_ = weight;
    if (result_.scaled.size() > 0)
      best_error_ = result_.final.error + problem_->prior_cost(result_.scaled, prior_weight_);
  }

  void add_priors(const VecX& scaled, double weight, QuadraticModel& model) const {
    if (weight == 0 || !std::isfinite(model.cost)) return;
    const QuadraticModel prior = problem_->prior_model(scaled);
    model.cost += weight * prior.cost;
    model.gradient += weight * prior.gradient;
    model.hessian += weight * prior.hessian;
  }

  /// One of each candidate, side by side.
  std::vector<Descent> descend(const FitStage& stage, const std::string& phase,
                               const std::vector<Contender>& candidates) {
    std::vector<Descent> descents(candidates.size());
    parallel_for(candidates.size(), options_.threads, [&](std::size_t i) {
      if (!stopped_) descents[i] = improve(stage, phase, candidates[i]);
    });
    return descents;
  }

  void record_all(const FitStage& stage, const std::string& phase,
                  const std::vector<Contender>& candidates, const std::vector<Descent>& descents) {
    linearized_.clear();
    replayed_below_ = 0;
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      for (const Tried& tried : descents[i].tried) {
        result_.replayed += tried.replayed;
        record(phase, {tried.scaled, candidates[i].problem}, stage.frames, tried.evaluation);
      }
      if (stage.frames == 0 && descents[i].last.problem) linearized_.push_back(descents[i].last);
    }
  }

  Descent improve(const FitStage& stage, const std::string& phase, const Contender& candidate) {
    const LinearizationOptions options = linearization_of(stage);
    const VecX origin = reference();
    const Problem& problem = *candidate.problem;
    Descent descent;
    descent.prior_weight = prior_weight_;
    double pull = -1;  // set by the first linearization, as is the weight of the priors
    const auto linearized = [&](const VecX& scaled) {
      StoredLinearization found = linearize_stored(problem, scaled, options, store_);
      if (pull < 0) {
        pull = std::isfinite(found.model.cost) ? stage.pull * found.model.cost : 0;
        descent.start = found.evaluation;
        descent.prior_weight = prior_weight_at(problem, scaled, options);
      }
      descent.last = {candidate.problem, scaled, found.model};
      add_priors(scaled, descent.prior_weight, found.model);
      found.model.cost += pull * (scaled - origin).squaredNorm();
      found.model.gradient += 2 * pull * (scaled - origin);
      found.model.hessian.diagonal().array() += 2 * pull;
      return found.model;
    };
    const auto cost = [&](const VecX& scaled) {
      const StoredCost found = evaluate_cost_stored(problem, scaled, options, store_);
      if (store_)
        store_->add(problem, problem.fabric(scaled), stage.frames, phase, found.evaluation);
      descent.tried.push_back({scaled, found.evaluation, found.replayed});
      if (found.replayed) count_replay_below();
      announce(phase, found.evaluation);
      return found.cost + problem.prior_cost(scaled, descent.prior_weight) +
             pull * (scaled - origin).squaredNorm();
    };
    LeastSquaresOptions solver = options_.solver;
    solver.max_iterations = stage.max_iterations;
    const Eigen::Index n = candidate.scaled.size();
    const LeastSquaresResult found =
        minimize_least_squares(linearized, cost, candidate.scaled, VecX::Zero(n), VecX::Ones(n),
                               solver, [&](const LeastSquaresStep&) { return !stopped_; });
    descent.end = found.x;
    descent.cost = found.cost;
    return descent;
  }

  /// Reports show the middle of the ranges beside the estimate: from one start, unless that fabric
  /// finds no equilibrium from there.
  void look_at_middle_from_there() {
    const Contender there{middle().scaled, best_problem_};
    const StoredEvaluation stored = evaluate_point(there, 0, "start", options_.threads);
    result_.replayed += stored.replayed;
    if (!stored.evaluation.diverged) result_.initial = stored.evaluation;
    note_start(there, stored.evaluation);
  }

  /// Of a fit that was stopped before its candidates were compared on all frames: what it knows is
  /// more than the middle of the ranges.
  void look_at_best_of_fewer_frames(const std::vector<Contender>& candidates) {
    const std::string phase = phase_of(FitStage{});
    if (std::ranges::find(result_.history, phase, &FitStep::phase) != result_.history.end()) return;
    const Contender& best = *std::ranges::min_element(candidates, {}, &Contender::cost);
    if (!std::isfinite(best.cost)) return;
    const StoredEvaluation found = evaluate_point(best, 0, phase, options_.threads);
    result_.replayed += found.replayed;
    record(phase, best, 0, found.evaluation);
  }

  void conclude() {
    part_.clear();
    if (best_problem_ != screened_ && !stopped_) look_at_middle_from_there();
    result_.compared = best_problem_->trials();
    result_.fabric = problem_->fabric(result_.scaled);
    result_.prior_weight = prior_weight_;
    result_.prior_error = problem_->prior_cost(result_.scaled, prior_weight_);
    result_.stopped = stopped_;
    warn();
  }

  void warn() {
    for (int i = 0; i < problem_->dimension(); ++i) {
      const double scaled = result_.scaled[i];
      if (scaled >= at_bound_distance && scaled <= 1 - at_bound_distance) continue;
      const ParameterInfo& info = problem_->info(i);
      result_.warnings.push_back(fmt::format("{} lies at the {} bound of its range ({:.4g} {})",
                                             info.name, scaled < 0.5 ? "lower" : "upper",
                                             result_.fabric.value(info.name), info.unit));
    }
    if (result_.diverged > 0)
      result_.warnings.push_back(
          fmt::format("{} of {} evaluations diverged", result_.diverged, result_.evaluations));
    if (problem_->has_prior() && prior_weight_ == 0 && !stopped_)
      result_.warnings.push_back(
          "priors, and tests beside the videos, did not count: the scatter of the residuals, which "
          "they are weighed by, is not known");
    if (!std::isfinite(result_.final.error))
      result_.warnings.push_back("every simulation diverged: there is no estimate");
    if (stopped_) result_.warnings.emplace_back(kStoppedEarly);
  }

  std::shared_ptr<const Problem> problem_;       // with the starts that were given, or settled
  std::shared_ptr<const Problem> screened_;      // with those that were given
  std::shared_ptr<const Problem> best_problem_;  // of the best so far
  const LeastSquaresFitOptions& options_;
  std::vector<FitStage> stages_;
  EvaluationStore* store_;
  const FitObserver& observer_;
  std::mutex announcing_;
  std::size_t replayed_below_ = 0;  // among what is not recorded yet
  std::string phase_;               // of the last announcement, with what follows
  std::string part_, told_part_;    // now, and of the last announcement
  double phase_best_ = kInfinity;
  std::size_t phase_done_ = 0, announced_ = 0;
  std::atomic<bool> stopped_ = false;
  double best_error_ = kInfinity;
  double prior_weight_ = 0;
  std::vector<Linearized> linearized_;  // where the last descents over all frames did so last
  FitResult result_;
};

/// Of the estimate, frame by frame.
void add_trials(int threads, FitResult& result) {
  if (!std::isfinite(result.final.error)) return;
  for (const auto& trial : result.compared)
    result.trials.push_back(evaluate(*trial, result.fabric, 0, nullptr, threads));
}

/// Annealing kept the starts that suited where it began; others may suit where it ended.
void take_better_starts(const Problem& problem, int threads, const FitObserver& observer,
                        FitResult& result) {
  if (result.stopped || !std::isfinite(result.final.error) || !starts_differ(problem)) return;
  const FitStep from{"starts", result.history.size(), result.final.error, result.final.error, 0};
  std::size_t tried = 0;
  const auto goes_on = [&] {
    if (observer && !observer({from, "", tried, 0, result.replayed})) result.stopped = true;
    if (interrupted()) result.stopped = true;
    return !result.stopped;
  };
  std::vector<std::shared_ptr<const Trial>> trials;
  if (goes_on())
    trials = with_starts_for(result.compared, result.fabric, 0, threads, [&] {
      ++tried;
      return goes_on();
    });
  if (result.stopped) result.warnings.emplace_back(kStoppedEarly);
  if (result.stopped || trials == result.compared) return;
  const ProblemEvaluation there = evaluate(problem.with_trials(trials), result.fabric, 0, threads);
  if (!(there.error < result.final.error)) return;
  result.compared = std::move(trials);
  result.final = there;
  result.trials.clear();
  add_trials(threads, result);
}

/// Numbered on from the `before` evaluations of earlier searches, the k-th of `count` named.
FitObserver told_of_search(const FitObserver& observer, int k, int count, std::size_t before) {
  if (!observer) return {};
  return [&observer, k, count, before](FitProgress progress) {
    progress.step.phase = fmt::format("search {} of {}: {}", k + 1, count, progress.step.phase);
    progress.step.evaluation += before;
    return observer(progress);
  };
}

/// History and counts of a part of a fit, after those of the parts before it.
void append(FitResult& part, FitResult& whole) {
  const std::size_t before = whole.history.size();
  for (FitStep& step : part.history) {
    step.evaluation += before;
    whole.history.push_back(std::move(step));
  }
  whole.evaluations += part.evaluations;
  whole.replayed += part.replayed;
  whole.diverged += part.diverged;
  whole.wall_s += part.wall_s;
  whole.stopped = part.stopped;
}

/// To the part whose estimate is that of the whole.
void take_history(FitResult& whole, FitResult& part) {
  part.history = std::move(whole.history);
  part.searches = std::move(whole.searches);
  part.evaluations = whole.evaluations;
  part.replayed = whole.replayed;
  part.diverged = whole.diverged;
  part.wall_s = whole.wall_s;
  part.stopped = whole.stopped;
}

/// The best of all searches, with the history and the counts of all.
FitResult search_repeatedly(const Problem& problem, const AutoFitOptions& options,
                            EvaluationStore* store, const FitObserver& observer) {
  if (options.searches < 1) throw Error("searches must be at least 1");
  LeastSquaresFitOptions one = options.least_squares;
  if (options.searches == 1) return LeastSquaresFit(problem, one, store, observer).run();
  FitResult kept, all;
  for (int k = 0; k < options.searches && !all.stopped; ++k) {
    one.seed = options.least_squares.seed + static_cast<std::uint64_t>(k);
    const FitObserver told = told_of_search(observer, k, options.searches, all.evaluations);
    FitResult found = LeastSquaresFit(problem, one, store, told).run();
    append(found, all);
    if (!found.stopped)
      all.searches.push_back({one.seed, found.fabric, found.final.error, found.evaluations});
    if (k == 0 || found.final.error + found.prior_error < kept.final.error + kept.prior_error)
      kept = std::move(found);
  }
  take_history(all, kept);
  kept.seed = options.least_squares.seed;
  return kept;
}

}  // namespace

FitResult run_least_squares_fit(const Problem& problem, const LeastSquaresFitOptions& options,
                                EvaluationStore* store, const FitObserver& observer) {
  FitResult result = LeastSquaresFit(problem, options, store, observer).run();
  add_trials(options.threads, result);
  return result;
}

AutoFitOptions::AutoFitOptions() {
  least_squares.hops.rounds = 4;
  annealing.annealing.max_evaluations = 0;
  annealing.annealing.simplex_size = 0.1;
}

FitResult run_auto_fit(const Problem& problem, const AutoFitOptions& options,
                       EvaluationStore* store, const FitObserver& observer) {
  FitResult descent = search_repeatedly(problem, options, store, observer);
  const bool can_anneal = !descent.stopped && std::isfinite(descent.final.error);
  if (!can_anneal || options.annealing.annealing.max_evaluations == 0) {
    add_trials(options.least_squares.threads, descent);
    return descent;
  }
  FitOptions annealing = options.annealing;
  annealing.start = FitOptions::Start::initial;
  annealing.coarse_parameters.clear();
  const Problem from_there(descent.compared, descent.fabric, problem.free(), {}, problem.priors(),
                           problem.other());
  annealing.prior_weight = descent.prior_weight;
  FitResult result = run_fit(from_there, annealing, store, observer);
  result.initial = descent.initial;
  append(result, descent);
  take_history(descent, result);
  take_better_starts(from_there, options.least_squares.threads, observer, result);
  return result;
}

}  // namespace weft
