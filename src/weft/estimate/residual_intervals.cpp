#include "weft/estimate/residual_intervals.h"

#include <algorithm>
#include <cmath>

#include "weft/estimate/estimate_scatter.h"

namespace weft {
namespace {

/// Half of the interval of the prior alone, of parameter i; infinity without one.
double half_width_of_prior(const PriorTerm& prior, Eigen::Index i, double confidence) {
  if (prior.gradient.size() == 0 || !(prior.hessian(i, i) > 0)) return kInfinity;
  return normal_half_width(confidence) * std::sqrt(prior.gradient_covariance(i, i)) /
         prior.hessian(i, i);
}

}  // namespace

ResidualIntervals residual_intervals(const std::vector<ParameterInfo>& infos, const VecX& scaled,
                                     QuadraticModel model, const std::vector<CostPart>& parts,
                                     double residual_count, double confidence,
                                     const VecX& systematic, const PriorTerm& prior) {
  ResidualIntervals result;
  // The cost's Gauss-Newton matrix is 2 J^T J / count.
  const double dispersion = 2 / residual_count;
  const MatX information = model.hessian / dispersion;
  const VecX slope = model.gradient / dispersion;
  if (prior.gradient.size() > 0) {
    model.gradient += prior.gradient;
    model.hessian += prior.hessian;
  }
  const EstimateScatter scatter =
      scatter_of(scaled, model, parts, dispersion, std::max(1.0, model.cost), prior);
  result.certainty = {confidence,
                      dispersion,
                      parts.size(),
                      scatter.covariance,
                      correlation_of(scatter.covariance),
                      information,
                      slope,
                      scatter.condition,
                      residual_dispersion(parts, model.cost, residual_count) / dispersion};
  for (Eigen::Index i = 0; i < scaled.size(); ++i) {
    double half = half_width(scatter, i, confidence);
    if (systematic.size() > 0) half += systematic[i];
    ParameterInterval interval =
        interval_about(infos[static_cast<std::size_t>(i)], scaled[i], half);
    const bool known = scatter.determined(i) && half <= widest_half_interval;
    interval.determined =
        known && half <= widest_beside_prior * half_width_of_prior(prior, i, confidence);
    interval.by_prior = known && !interval.determined;
    if (!known) {
      // Of one that a bound holds the data say nothing, and a prior's single end is not theirs.
      const bool told =
          scatter.determined(i) && !std::isfinite(half_width_of_prior(prior, i, confidence));
      open_ends(infos[static_cast<std::size_t>(i)], scaled[i], told ? half : kInfinity, interval);
    }
    result.intervals.push_back(interval);
  }
  return result;
}

double residual_quantile(const ResidualCertainty& certainty) {
  if (certainty.overdispersion <= 1 || certainty.parts < 2)
    return normal_half_width(certainty.confidence);
  return student_quantile(0.5 + 0.5 * certainty.confidence,
                          static_cast<double>(certainty.parts) - 1);
}

double residual_dispersion(const std::vector<CostPart>& parts, double cost, double residual_count) {
  const double noise = 2 / residual_count;
  if (parts.size() >= 2) {
    const double scatter = cluster_dispersion(parts);
    if (std::isfinite(scatter)) return std::max(scatter, noise);
  }
  return noise * std::max(cost, 1.0);
}

}  // namespace weft
