#include "weft/estimate/residual_intervals.h"

#include <algorithm>
#include <limits>

#include "weft/estimate/estimate_scatter.h"

namespace weft {

ResidualIntervals residual_intervals(const std::vector<ParameterInfo>& infos, const VecX& scaled,
                                     const QuadraticModel& model,
                                     const std::vector<CostPart>& parts, std::size_t residual_count,
                                     double confidence, const VecX& systematic) {
  ResidualIntervals result;
  // The cost's Gauss-Newton matrix is 2 J^T J / count.
  const double dispersion = 2 / static_cast<double>(residual_count);
  const EstimateScatter scatter =
      scatter_of(scaled, model, parts, dispersion, std::max(1.0, model.cost));
  result.certainty = {confidence,
                      dispersion,
                      parts.size(),
                      scatter.covariance,
                      correlation_of(scatter.covariance),
                      model.hessian / dispersion,
                      scatter.condition};
  for (Eigen::Index i = 0; i < scaled.size(); ++i) {
    double half = half_width(scatter, i, confidence);
    if (systematic.size() > 0) half += systematic[i];
    ParameterInterval interval =
        interval_about(infos[static_cast<std::size_t>(i)], scaled[i], half);
    interval.determined = scatter.determined(i) && half <= widest_half_interval;
    if (!interval.determined) {
      interval.lower = 0;
      interval.upper = std::numeric_limits<double>::infinity();
    }
    result.intervals.push_back(interval);
  }
  return result;
}

}  // namespace weft
