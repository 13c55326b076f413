#include "weft/estimate/residual_intervals.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

namespace weft {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// Half an interval of this part of the range and more says nothing (as in uncertainty.cpp).
constexpr double kWidestHalf = 0.5;
constexpr double kManyDegrees = 1e6;  // of freedom: the normal distribution
constexpr double kLeastLost = 1e-6;   // share of a parameter that no part determines

/// Indices of the parameters that are not held at a bound.
std::vector<Eigen::Index> inside_bounds(const VecX& scaled, const VecX& gradient) {
  std::vector<Eigen::Index> indices;
  for (Eigen::Index i = 0; i < scaled.size(); ++i) {
    const bool held = (scaled[i] <= 0 && gradient[i] > 0) || (scaled[i] >= 1 && gradient[i] < 0);
    if (!held) indices.push_back(i);
  }
  return indices;
}

/// The cost's Gauss-Newton matrix is 2 J^T J / count.
VecX noise_variances(const MatX& hessian, std::size_t residual_count) {
  const Eigen::LDLT<MatX> factor(hessian);
  const Eigen::Index n = hessian.rows();
  if (factor.info() != Eigen::Success || !(factor.vectorD().minCoeff() > 0))
    return VecX::Constant(n, kInfinity);
  return 2 / static_cast<double>(residual_count) * factor.solve(MatX::Identity(n, n)).diagonal();
}

}  // namespace

ResidualIntervals residual_intervals(const std::vector<ParameterInfo>& infos, const VecX& scaled,
                                     const QuadraticModel& model,
                                     const std::vector<CostPart>& parts, std::size_t residual_count,
                                     double confidence, const VecX& systematic) {
  ResidualIntervals result;
  if (parts.size() < 2) return result;
  const auto free = inside_bounds(scaled, model.gradient);
  const Eigen::Index n = scaled.size();
  MatX covariance = MatX::Zero(n, n);
  VecX noise = VecX::Zero(n), lost = VecX::Zero(n);
  if (!free.empty()) {
    std::vector<CostPart> own;
    for (const CostPart& part : parts)
      own.push_back(
          {part.trial, part.frame, VecX(part.gradient(free)), MatX(part.hessian(free, free))});
    const ClusterCovariance c = cluster_covariance(own);
    result.condition = c.condition;
    covariance(free, free) = c.covariance;
    noise(free) = noise_variances(model.hessian(free, free), residual_count);
    lost(free) = VecX(c.undetermined.rowwise().squaredNorm());
  }
  const double t = student_quantile(0.5 + 0.5 * confidence, static_cast<double>(parts.size()) - 1);
  const double normal = student_quantile(0.5 + 0.5 * confidence, kManyDegrees);
  result.correlation = MatX::Constant(n, n, std::numeric_limits<double>::quiet_NaN());
  for (Eigen::Index i = 0; i < n; ++i) {
    const ParameterInfo& info = infos[static_cast<std::size_t>(i)];
    ParameterInterval interval;
    interval.name = info.name;
    interval.unit = info.unit;
    interval.value = from_scaled(info, scaled[i]);
    interval.half_width = std::max(t * std::sqrt(covariance(i, i)), normal * std::sqrt(noise[i]));
    if (systematic.size() > 0) interval.half_width += systematic[i];
    interval.at_lower = scaled[i] <= 0;
    interval.at_upper = scaled[i] >= 1;
    const bool held = std::find(free.begin(), free.end(), i) == free.end();
    interval.determined = !held && lost[i] < kLeastLost && interval.half_width <= kWidestHalf;
    interval.lower = interval.determined ? from_scaled(info, scaled[i] - interval.half_width) : 0;
    interval.upper =
        interval.determined ? from_scaled(info, scaled[i] + interval.half_width) : kInfinity;
    result.intervals.push_back(interval);
    for (Eigen::Index j = 0; j < n; ++j) {
      const double scale = std::sqrt(covariance(i, i) * covariance(j, j));
      if (scale > 0) result.correlation(i, j) = covariance(i, j) / scale;
    }
  }
  return result;
}

}  // namespace weft
