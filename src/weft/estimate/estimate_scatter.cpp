#include "weft/estimate/estimate_scatter.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "weft/base/dense.h"

namespace weft {
namespace {

constexpr double kManyDegrees = 1e6;  // of freedom: the normal distribution
constexpr double kLeastLost = 1e-6;   // share of a parameter that no part determines

double two_sided_quantile(double confidence, double degrees_of_freedom) {
  return student_quantile(0.5 + 0.5 * confidence, degrees_of_freedom);
}

/// Those that a single cluster determines.
MatX lone_directions(const ClusterCovariance& found) {
  return found.undetermined.rightCols(found.undetermined.cols() - found.without_data);
}

/// A prior pulls the estimate from the parts' own; that all of them pull back is no scatter. So
/// their gradients are taken where they would balance without it.
void take_out_pull(std::vector<CostPart>& parts) {
  const Eigen::Index n = parts.front().gradient.size();
  VecX gradient = VecX::Zero(n);
  MatX hessian = MatX::Zero(n, n);
  for (const CostPart& part : parts) {
    gradient += part.gradient;
    hessian += part.hessian;
  }
  const VecX step = pseudo_inverse(hessian) * gradient;
  for (CostPart& part : parts) part.gradient -= part.hessian * step;
}

}  // namespace

std::vector<Eigen::Index> inside_bounds(const VecX& scaled, const VecX& gradient) {
  std::vector<Eigen::Index> indices;
  for (Eigen::Index i = 0; i < scaled.size(); ++i) {
    const bool held = (scaled[i] <= 0 && gradient[i] > 0) || (scaled[i] >= 1 && gradient[i] < 0);
    if (!held) indices.push_back(i);
  }
  return indices;
}

bool EstimateScatter::held(Eigen::Index i) const {
  return std::find(free.begin(), free.end(), i) == free.end();
}

bool EstimateScatter::determined(Eigen::Index i) const {
  return !held(i) && undetermined[i] < kLeastLost;
}

EstimateScatter scatter_of(const VecX& scaled, const QuadraticModel& model,
                           const std::vector<CostPart>& parts, double dispersion, double alone,
                           const PriorTerm& prior) {
  const Eigen::Index n = scaled.size();
  EstimateScatter scatter;
  scatter.free = inside_bounds(scaled, model.gradient);
  scatter.covariance = MatX::Zero(n, n);
  scatter.noise = scatter.undetermined = scatter.prior = VecX::Zero(n);
  scatter.parts = parts.size();
  const auto& free = scatter.free;
  if (free.empty()) return scatter;
  const MatX hessian = model.hessian(free, free);
  std::vector<CostPart> own = of_parameters(free, parts);
  PriorTerm known = of_parameters(free, prior);
  const bool with_prior = known.gradient.size() > 0;
  if (with_prior) {
    take_out_pull(own);
    known.gradient.setZero();
  }
  const ClusterCovariance found =
      with_prior ? cluster_covariance(own, known, lone_directions(cluster_covariance(own)))
                 : cluster_covariance(own);
  scatter.condition = found.condition;
  const MatX lone = lone_directions(found);
  const auto along_lone = [&](const MatX& matrix) {
    return congruence(congruence(matrix, lone), lone.transpose());
  };
  const MatX inverse = pseudo_inverse(hessian);
  MatX noise = dispersion * inverse, noise_alone = alone * noise;
  if (with_prior) {
    const MatX by_data = dispersion * congruence(hessian - known.hessian, inverse),
               by_prior = congruence(known.gradient_covariance, inverse);
    noise = by_data + by_prior;
    noise_alone = alone * by_data + by_prior;
    scatter.prior(free) = VecX((found.of_prior + along_lone(by_prior)).diagonal());
  }
  scatter.covariance(free, free) = found.covariance + along_lone(noise_alone);
  scatter.undetermined(free) =
      VecX(found.undetermined.leftCols(found.without_data).rowwise().squaredNorm());
  const auto left_open = scatter.undetermined(free).array() >= kLeastLost;
  scatter.noise(free) = VecX(left_open.select(kInfinity, noise.diagonal()));
  return scatter;
}

double half_width(const EstimateScatter& scatter, Eigen::Index i, double confidence) {
  const double t = scatter.parts < 2
                       ? normal_half_width(confidence)
                       : two_sided_quantile(confidence, static_cast<double>(scatter.parts) - 1);
  const double normal = normal_half_width(confidence), prior = scatter.prior[i],
               data = std::max(0.0, scatter.covariance(i, i) - prior);
  return std::max(std::sqrt(t * t * data + normal * normal * prior),
                  normal * std::sqrt(scatter.noise[i]));
}

MatX correlation_of(const MatX& covariance) {
  const Eigen::Index n = covariance.rows();
  MatX correlation = MatX::Constant(n, n, std::numeric_limits<double>::quiet_NaN());
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      const double scale = std::sqrt(covariance(i, i) * covariance(j, j));
      if (scale > 0) correlation(i, j) = covariance(i, j) / scale;
    }
  }
  return correlation;
}

double normal_half_width(double confidence) { return two_sided_quantile(confidence, kManyDegrees); }

void open_ends(const ParameterInfo& info, double scaled, double half_width,
               ParameterInterval& interval) {
  if (!(scaled - half_width > 0)) interval.lower = info.lower < 0 ? -kInfinity : 0;
  if (!(scaled + half_width < 1)) interval.upper = kInfinity;
}

ParameterInterval interval_about(const ParameterInfo& info, double scaled, double half_width) {
  ParameterInterval interval;
  interval.name = info.name;
  interval.unit = info.unit;
  interval.value = from_scaled(info, scaled);
  interval.half_width = half_width;
  interval.lower = from_scaled(info, scaled - half_width);
  interval.upper = from_scaled(info, scaled + half_width);
  interval.at_lower = scaled <= 0;
  interval.at_upper = scaled >= 1;
  return interval;
}

}  // namespace weft
