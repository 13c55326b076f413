#pragma once
#include <functional>
#include <memory>
#include <vector>

#include "weft/estimate/fit.h"
#include "weft/estimate/problem.h"

namespace weft {

/// Every fabric simulated in every trial, from the start that suits it there (Bhat 2003, figure
/// 14).
struct CrossEvaluation {
  MatX error_per_mask_pixel;  ///< fabrics x trials; infinity where diverged
  MatX error;                 ///< per frame (equations 8 and 9), likewise
  std::size_t diverged = 0;
  std::vector<TrialEvaluation> evaluations;  ///< row by row of the matrices
};
/// Fabrics and trials in any number; evaluated in parallel. `observer(done, total)` after each,
/// from one thread at a time; false stops (what is missing is NaN).
CrossEvaluation cross_evaluate(const std::vector<Fabric>& fabrics,
                               const std::vector<std::shared_ptr<const Trial>>& trials,
                               int threads = 0,
                               const std::function<bool(std::size_t, std::size_t)>& observer = {});

/// Several trials of one fabric, each fitted by itself; the fit with the smallest sum over all
/// trials of the error per frame is kept (Bhat 2003, table 3).
struct TrialSelection {
  std::vector<FitResult> fits;  ///< one a trial
  CrossEvaluation cross;        ///< fits x trials
  VecX sum;                     ///< of cross.error over the trials, one a fit
  int selected = 0;             ///< index of the smallest sum; the first of equal ones
};
/// `stores` one a trial, or empty. The observer gets the steps of fit k with its index.
TrialSelection fit_and_select(
    const std::vector<std::shared_ptr<const Trial>>& trials, const Fabric& initial,
    const std::vector<std::string>& free, const FitOptions& options,
    const std::vector<EvaluationStore*>& stores = {},
    const std::function<bool(std::size_t trial, const FitProgress&)>& observer = {});

}  // namespace weft
