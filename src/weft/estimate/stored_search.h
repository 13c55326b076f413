#pragma once
#include <memory>
#include <vector>

#include "weft/estimate/choose_start.h"
#include "weft/estimate/evaluation_store.h"
#include "weft/estimate/linearize_trial.h"

namespace weft {

/// What a least squares fit asks of a point, through the store: replayed where it was asked before
/// with the same captures, starts, parameters and options, else added. `store` may be null; options
/// with a simulator of their own go past it. The rows of evaluations are not touched.
struct StoredCost : ProblemCost {
  bool replayed = false;
};
StoredCost evaluate_cost_stored(const Problem& problem, const VecX& scaled,
                                const LinearizationOptions& options, EvaluationStore* store);

/// Without the parts of the frames.
struct StoredLinearization {
  ProblemEvaluation evaluation;
  QuadraticModel model;
  bool replayed = false;
};
StoredLinearization linearize_stored(const Problem& problem, const VecX& scaled,
                                     const LinearizationOptions& options, EvaluationStore* store);

/// with_starts_for() and with_settled_starts() of the problem's trials. Where the observer stops
/// the search they are returned as they are, and nothing is stored.
std::vector<std::shared_ptr<const Trial>> with_starts_for_stored(
    const Problem& problem, const Fabric& fabric, int frame_count, int threads,
    EvaluationStore* store, const StartObserver& observer = {});
std::vector<std::shared_ptr<const Trial>> with_settled_starts_stored(const Problem& problem,
                                                                     const Fabric& fabric,
                                                                     int threads,
                                                                     EvaluationStore* store);

}  // namespace weft
