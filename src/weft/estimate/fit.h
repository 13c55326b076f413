#pragma once
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "weft/estimate/evaluation_store.h"
#include "weft/estimate/optimize.h"
#include "weft/estimate/problem.h"
#include "weft/estimate/variability.h"

namespace weft {

/// The published protocol (Bhat 2003, sections 5 and 6): coarse search, annealing, variability.
struct FitOptions {
  /// Searched coarsely, where they are free. Empty: no coarse search.
  std::vector<std::string> coarse_parameters{"bend_stiffness", "stretch_stiffness",
                                             "shear_stiffness"};
  int coarse_levels = 4;
  /// Compared frames of each trial in the coarse search. One shows the settled shape, on which only
  /// stiffnesses act.
  int coarse_frames = 1;
  /// The best of the coarse search are evaluated on all frames and the best of those starts the
  /// annealing; 1 is the paper's way.
  int coarse_finalists = 4;
  /// Where the parameters that the coarse search leaves alone start.
  enum class Start {
    middle,   ///< of their ranges (scaled 0.5)
    random,   ///< uniform in their scaled ranges, from start_seed (the paper's way)
    initial,  ///< the problem's initial fabric
  } start = Start::middle;
  AnnealingOptions annealing;  ///< its seed and threads are overwritten by the ones below
  /// Weight of Problem::prior_cost() in what the search minimizes: error + weight * prior; >= 0.
  /// Errors in the history of a search with priors have it in them, those of evaluations do not.
  double prior_weight = 0;
  bool with_variability = true;
  VariabilityOptions variability;  ///< its threads are overwritten
  std::uint64_t seed = 1;
  std::optional<std::uint64_t> start_seed;  ///< of Start::random; none: seed
  int threads = 0;                          ///< 0: all cores; the result does not depend on it
};

/// One evaluation of the search, in the order in which the search made it.
struct FitStep {
  std::string phase;           ///< "start", "coarse", "finalists", "anneal"
  std::size_t evaluation = 0;  ///< from 1, over all phases
  double error = 0;        ///< ProblemEvaluation::error; infinity if diverged. In the coarse search
                           ///< on coarse_frames only, so not comparable with the other phases.
  double best = 0;         ///< smallest so far in this phase
  double temperature = 0;  ///< annealing only
};

/// While a fit runs: the step just made and how many its phase has in all.
struct FitProgress {
  FitStep step;
  std::string part;  ///< where a phase has several: "stage 1 of 3", "round 2 of at most 4"
  /// In this part of the phase; done 0: it begins, from what `step` says; total 0: not known
  /// (variability, descents, starts).
  std::size_t done = 0, total = 0;
  std::size_t replayed = 0;  ///< evaluations so far that were read from the store
};
/// Called from one thread at a time. Returning false stops the fit with the best so far, as
/// weft::interrupted() does.
using FitObserver = std::function<bool(const FitProgress&)>;

/// Where one of several whole searches ended.
struct SearchEnd {
  std::uint64_t seed = 0;
  Fabric fabric;
  double error = 0;             ///< ProblemEvaluation::error of it
  std::size_t evaluations = 0;  ///< of this search
};

struct FitResult {
  /// What the fabrics were compared with: the problem's trials, with the starts that suited the
  /// fabric found so far where the method chooses them (run_least_squares_fit).
  std::vector<std::shared_ptr<const Trial>> compared;
  Fabric fabric;  ///< the estimate; name and density as in problem.initial()
  VecX scaled;
  /// At the middle of all ranges (scaled 0.5), all frames; least squares: from the starts of the
  /// estimate, or where it diverges from those that were given.
  ProblemEvaluation initial;
  /// Where annealing started, all frames; `initial` where it was stopped before.
  ProblemEvaluation start;
  Fabric start_fabric;
  ProblemEvaluation final;  ///< of the estimate, all frames
  /// Weight of the priors, in the unit of the error, and what they add to the error at the
  /// estimate; 0 without priors.
  double prior_weight = 0, prior_error = 0;
  /// Of the estimate, with the errors of each frame; empty if the problem has its own evaluator.
  std::vector<TrialEvaluation> trials;
  /// Part of the error that the last rounds of hops took off it, where their number ended them
  /// (HopOptions::patience rounds; run_least_squares_fit): more may take off more. 0: fruitless
  /// ones ended them, or there were none.
  double hop_gain = 0;
  /// Those that were not stopped, in order (AutoFitOptions::searches); empty: there was one.
  std::vector<SearchEnd> searches;
  std::vector<FitStep> history;
  std::vector<PerturbationCurve> variability;  ///< empty if not asked for, or stopped before
  std::size_t evaluations = 0;                 ///< asked for, all phases (variability included)
  std::size_t replayed = 0;                    ///< of those, read from the store
  std::size_t diverged = 0;                    ///< of those, with an infinite error
  double wall_s = 0;                           ///< of this run
  std::uint64_t seed = 0;
  bool stopped = false;               ///< by a signal or the observer: the best so far, not the end
  std::vector<std::string> warnings;  ///< parameters at a bound or not determined, diverged runs
  std::vector<std::string> remarks;   ///< further ones, about how far the captures were compared
};

/// Scaled parameters at which a search of `problem` starts; `seed`: of Start::random alone.
VecX start_point(const Problem& problem, FitOptions::Start start, std::uint64_t seed);

/// Fits the free parameters of `problem`. Deterministic for a seed and options, whatever the number
/// of threads. `store` may be null; with one, evaluations made before are replayed from it. Throws
/// Error for options out of range or coarse parameters that the model does not have.
FitResult run_fit(const Problem& problem, const FitOptions& options,
                  EvaluationStore* store = nullptr, const FitObserver& observer = {});

}  // namespace weft
