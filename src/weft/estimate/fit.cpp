#include "weft/estimate/fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <map>
#include <mutex>
#include <numeric>

#include "weft/base/clock.h"
#include "weft/base/error.h"
#include "weft/base/interrupt.h"
#include "weft/base/parallel.h"
#include "weft/base/random.h"

namespace weft {
namespace {

class Fit {
 public:
  Fit(const Problem& problem, const FitOptions& options, EvaluationStore* store,
      const FitObserver& observer)
      : problem_(problem), options_(options), store_(store), observer_(observer) {
    if (options.coarse_frames < 0) throw Error("coarse_frames must not be negative");
    if (options.coarse_finalists < 1) throw Error("coarse_finalists must be at least 1");
    for (const std::string& name : options.coarse_parameters) {
      parameter_index(problem.initial().model, name);  // throws for an unknown one
      const int dimension = problem.index_of(name);
      if (dimension >= 0) coarse_dimensions_.push_back(dimension);
    }
    if (!(options.prior_weight >= 0)) throw Error("prior_weight must not be negative");
    result_.seed = options.seed;
    result_.compared = problem.trials();
  }

  FitResult run() {
    const auto begin = Clock::now();
    evaluate_middle();
    VecX start = start_point(problem_, options_.start, options_.start_seed.value_or(options_.seed));
    if (!coarse_dimensions_.empty() && !stopped_) start = search_coarsely(start);
    if (!stopped_) anneal_from(start);
    conclude();
    result_.wall_s = seconds_since(begin);
    return std::move(result_);
  }

 private:
  using Key = std::pair<int, std::vector<double>>;

  int all_threads() const { return weft::all_threads(options_.threads); }

  /// Of `fabric`, through the store; every evaluation of a run passes here.
  ProblemEvaluation evaluate_fabric(const Fabric& fabric, int frame_count, std::string_view phase,
                                    int threads) {
    const Key key{frame_count, {fabric.values.begin(), fabric.values.end()}};
    {
      const std::lock_guard lock(mutex_);
      const auto known = known_.find(key);
      if (known != known_.end()) return known->second;
    }
    const StoredEvaluation stored =
        evaluate_stored(problem_, fabric, frame_count, phase, store_, threads);
    const std::lock_guard lock(mutex_);
    ++result_.evaluations;
    result_.replayed += stored.replayed;
    result_.diverged += stored.evaluation.diverged;
    return known_[key] = stored.evaluation;
  }

  double prior_error(const VecX& scaled) const {
    return problem_.prior_cost(scaled, options_.prior_weight);
  }

  ErrorFunction error_function(int frame_count, std::string_view phase, int threads) {
    return [this, frame_count, phase, threads](const VecX& scaled) {
      return evaluate_fabric(problem_.fabric(scaled), frame_count, phase, threads).error +
             prior_error(scaled);
    };
  }

  void record(std::string_view phase, double error, double best, double temperature) {
    result_.history.push_back(
        {std::string(phase), result_.history.size() + 1, error, best, temperature});
  }

  /// Tells the observer; false if the fit is to stop.
  bool tell(FitStep step, std::size_t done, std::size_t total) {
    FitProgress progress{std::move(step), {}, done, total, 0};
    {
      const std::lock_guard lock(mutex_);
      progress.replayed = result_.replayed;
    }
    if (observer_ && !observer_(progress)) stopped_ = true;
    if (interrupted()) stopped_ = true;
    return !stopped_;
  }

  void keep_if_better(const VecX& scaled, double error) {
    if (result_.scaled.size() > 0 && !(error < best_error_)) return;
    result_.scaled = scaled;
    best_error_ = error;
  }

  void evaluate_middle() {
    const VecX middle = VecX::Constant(problem_.dimension(), 0.5);
    result_.initial = evaluate_fabric(problem_.fabric(middle), 0, "start", all_threads());
    result_.start = result_.initial;
    result_.start_fabric = problem_.fabric(middle);
    keep_if_better(middle, result_.initial.error + prior_error(middle));
    record("start", result_.initial.error, result_.initial.error, 0);
    tell(result_.history.back(), 1, 1);
  }

  VecX search_coarsely(const VecX& base) {
    CoarseOptions coarse;
    coarse.levels = options_.coarse_levels;
    coarse.dimensions = coarse_dimensions_;
    coarse.threads = options_.threads;
    const std::vector<VecX> grid = coarse_grid(base, coarse);
    const std::size_t before = result_.history.size();
    const SearchResult found =
        coarse_search(error_function(options_.coarse_frames, "coarse", 1), base, coarse,
                      [&](std::size_t done, double error, double best, double) {
                        return tell({"coarse", before + done, error, best, 0}, done, grid.size());
                      });
    double best = kInfinity;
    for (const double error : found.errors) {
      if (std::isnan(error)) continue;
      best = std::min(best, error);
      record("coarse", error, best, 0);
    }
    if (stopped_ || !std::isfinite(found.error)) return found.best;
    return best_finalist(grid, found.errors);
  }

  /// The best points of the coarse search, all frames compared.
  VecX best_finalist(const std::vector<VecX>& grid, const std::vector<double>& errors) {
    std::vector<std::size_t> order(grid.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return errors[a] < errors[b]; });
    const auto count = std::min(grid.size(), static_cast<std::size_t>(options_.coarse_finalists));
    if (count == 1) return grid[order[0]];
    std::vector<double> full(count, std::numeric_limits<double>::quiet_NaN());
    const ErrorFunction error = error_function(0, "finalists", 1);
    parallel_for(count, options_.threads, [&](std::size_t i) {
      if (!interrupted()) full[i] = error(grid[order[i]]);
    });
    if (interrupted()) stopped_ = true;
    double best = kInfinity;
    std::size_t winner = 0;
    for (std::size_t i = 0; i < count; ++i) {
      if (std::isnan(full[i])) continue;  // left out
      if (full[i] < best) {
        best = full[i];
        winner = i;
      }
      keep_if_better(grid[order[i]], full[i]);
      record("finalists", full[i], best, 0);
      tell(result_.history.back(), i + 1, count);
    }
    return grid[order[winner]];
  }

  void anneal_from(const VecX& start) {
    AnnealingOptions annealing = options_.annealing;
    annealing.seed = options_.seed;
    annealing.threads = options_.threads;
    result_.start_fabric = problem_.fabric(start);
    // All cores for each evaluation: one that no other evaluation needs looks at frames.
    const SearchResult found =
        anneal(error_function(0, "anneal", all_threads()), start, annealing,
               [&](std::size_t done, double error, double best, double temperature) {
                 record("anneal", error, best, temperature);
                 return tell(result_.history.back(), done, annealing.max_evaluations);
               });
    result_.start = evaluate_fabric(result_.start_fabric, 0, "anneal", all_threads());
    keep_if_better(found.best, found.error);
  }

  void conclude() {
    result_.fabric = problem_.fabric(result_.scaled);
    result_.final = evaluate_fabric(result_.fabric, 0, "final", all_threads());
    if (!problem_.evaluator())
      for (const auto& trial : problem_.trials())
        result_.trials.push_back(evaluate(*trial, result_.fabric, 0, nullptr, options_.threads));
    if (options_.with_variability && !stopped_ && std::isfinite(result_.final.error))
      analyse_variability();
    result_.prior_weight = options_.prior_weight;
    result_.prior_error = prior_error(result_.scaled);
    result_.stopped = stopped_;
    warn();
  }

  void analyse_variability() {
    VariabilityOptions options = options_.variability;
    options.threads = options_.threads;
    // The curves evaluate through a problem whose evaluator is this fit, so that they are counted.
    std::size_t done = 0;
    const Problem counted(problem_.trials(), problem_.initial(), problem_.free(),
                          [&](const Fabric& fabric, int frame_count) {
                            const ProblemEvaluation evaluation =
                                evaluate_fabric(fabric, frame_count, "variability", 1);
                            const std::lock_guard lock(observer_mutex_);
                            ++done;
                            tell({"variability", result_.history.size() + done, evaluation.error,
                                  result_.final.error, 0},
                                 done, 0);
                            return evaluation;
                          });
    result_.variability =
        variability(counted, result_.fabric, options, nullptr, [&] { return !stopped_.load(); });
  }

  void warn() {
    for (const PerturbationCurve& curve : result_.variability)
      if (!curve.warning.empty()) result_.warnings.push_back(curve.warning);
    if (result_.variability.empty()) warn_of_bounds();
    for (std::size_t i = 0; i < result_.trials.size(); ++i) warn_of_overlap(i);
    if (result_.diverged > 0)
      result_.warnings.push_back(
          fmt::format("{} of {} evaluations diverged", result_.diverged, result_.evaluations));
    if (!std::isfinite(result_.final.error))
      result_.warnings.push_back("every simulation diverged: there is no estimate");
    if (stopped_) result_.warnings.push_back("stopped before the end: the best so far");
  }

  void warn_of_bounds() {
    for (int i = 0; i < problem_.dimension(); ++i) {
      const double scaled = result_.scaled[i];
      if (scaled >= at_bound_distance && scaled <= 1 - at_bound_distance) continue;
      const ParameterInfo& info = problem_.info(i);
      result_.warnings.push_back(fmt::format("{} lies at the {} bound of its range ({:.4g} {})",
                                             info.name, scaled < 0.5 ? "lower" : "upper",
                                             result_.fabric.value(info.name), info.unit));
    }
  }

  void warn_of_overlap(std::size_t i) {
    double masked = 0, overlap = 0;
    for (const FrameError& frame : result_.trials[i].frames) {
      masked += frame.mask_pixels;
      overlap += frame.overlap_pixels;
    }
    if (overlap < 0.7 * masked)
      result_.remarks.push_back(
          fmt::format("{}: only {:.0f} % of the measured folds have a simulated counterpart",
                      problem_.trials()[i]->capture.name, 100 * overlap / masked));
  }

  const Problem& problem_;
  const FitOptions& options_;
  EvaluationStore* store_;
  const FitObserver& observer_;
  std::vector<int> coarse_dimensions_;
  std::mutex mutex_, observer_mutex_;
  std::map<Key, ProblemEvaluation> known_;
  double best_error_ = kInfinity;
  std::atomic<bool> stopped_ = false;
  FitResult result_;
};

}  // namespace

VecX start_point(const Problem& problem, FitOptions::Start start, std::uint64_t seed) {
  switch (start) {
    case FitOptions::Start::initial:
      return problem.scaled(problem.initial()).cwiseMax(0).cwiseMin(1);
    case FitOptions::Start::random: {
      Rng rng(seed, 1);
      VecX scaled(problem.dimension());
      for (double& coordinate : scaled) coordinate = rng.uniform();
      return scaled;
    }
    case FitOptions::Start::middle:
      break;
  }
  return VecX::Constant(problem.dimension(), 0.5);
}

FitResult run_fit(const Problem& problem, const FitOptions& options, EvaluationStore* store,
                  const FitObserver& observer) {
  return Fit(problem, options, store, observer).run();
}

}  // namespace weft
