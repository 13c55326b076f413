#include "weft/estimate/cross.h"

#include <atomic>
#include <limits>
#include <mutex>
#include <utility>

#include "weft/base/error.h"
#include "weft/base/parallel.h"
#include "weft/estimate/choose_start.h"

namespace weft {

CrossEvaluation cross_evaluate(const std::vector<Fabric>& fabrics,
                               const std::vector<std::shared_ptr<const Trial>>& trials, int threads,
                               const std::function<bool(std::size_t, std::size_t)>& observer) {
  const std::size_t columns = trials.size(), total = fabrics.size() * columns;
  CrossEvaluation result;
  result.error =
      MatX::Constant(static_cast<Eigen::Index>(fabrics.size()), static_cast<Eigen::Index>(columns),
                     std::numeric_limits<double>::quiet_NaN());
  result.error_per_mask_pixel = result.error;
  result.evaluations.resize(total);
  std::mutex mutex;
  std::atomic<bool> stop = false;
  std::size_t done = 0;
  parallel_for(total, threads, [&](std::size_t i) {
    if (stop) return;
    const std::size_t row = i / columns, column = i % columns;
    const auto trial = with_start_for(trials[column], fabrics[row], 0, 1);
    TrialEvaluation evaluation = evaluate(*trial, fabrics[row]);
    const std::lock_guard lock(mutex);
    const auto r = static_cast<Eigen::Index>(row), c = static_cast<Eigen::Index>(column);
    result.error(r, c) = evaluation.error;
    result.error_per_mask_pixel(r, c) = evaluation.error_per_mask_pixel;
    result.diverged += evaluation.diverged;
    result.evaluations[i] = std::move(evaluation);
    if (observer && !observer(++done, total)) stop = true;
  });
  return result;
}

TrialSelection fit_and_select(
    const std::vector<std::shared_ptr<const Trial>>& trials, const Fabric& initial,
    const std::vector<std::string>& free, const FitOptions& options,
    const std::vector<EvaluationStore*>& stores,
    const std::function<bool(std::size_t trial, const FitProgress&)>& observer) {
  if (trials.empty()) throw Error("no capture to fit");
  if (!stores.empty() && stores.size() != trials.size())
    throw Error("one store of evaluations a trial, or none");
  TrialSelection selection;
  std::vector<Fabric> fabrics;
  for (std::size_t k = 0; k < trials.size(); ++k) {
    const Problem problem({trials[k]}, initial, free);
    selection.fits.push_back(
        run_fit(problem, options, stores.empty() ? nullptr : stores[k],
                [&](const FitProgress& progress) { return !observer || observer(k, progress); }));
    fabrics.push_back(selection.fits.back().fabric);
  }
  selection.cross = cross_evaluate(fabrics, trials, options.threads);
  selection.sum = selection.cross.error.rowwise().sum();
  for (Eigen::Index k = 1; k < selection.sum.size(); ++k)
    if (selection.sum[k] < selection.sum[selection.selected])
      selection.selected = static_cast<int>(k);
  return selection;
}

}  // namespace weft
