#pragma once
#include "weft/estimate/evaluation_store.h"
#include "weft/estimate/linearize_trial.h"

namespace weft {

/// What a descent asks of a point, through the store: replayed where it was asked before with the
/// same captures, starts, parameters and options, else added. `store` may be null; with a simulator
/// of their own the options go past it. The rows of the paper's evaluations are not touched.
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

}  // namespace weft
