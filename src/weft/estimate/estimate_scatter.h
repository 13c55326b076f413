#pragma once
#include <vector>

#include "weft/estimate/uncertainty.h"
#include "weft/fabric/parameter.h"

namespace weft {

/// How a least-squares estimate scatters: what intervals are made of. Coordinates scaled to [0, 1].
struct EstimateScatter {
  std::vector<Eigen::Index> free;  ///< parameters that no bound holds
  MatX covariance;                 ///< of the jackknife (uncertainty.h); zero for held ones
  VecX noise;                      ///< variances by the noise alone; zero for held ones
  VecX undetermined;               ///< share of a parameter that no part determines, 0 to 1
  double condition = 0;            ///< of the Gauss-Newton matrix of the free ones
  std::size_t parts = 0;

  bool held(Eigen::Index i) const;
  /// Neither held nor, in a part that counts, left open by the data.
  bool determined(Eigen::Index i) const;
};

/// Parameters that no bound holds: those that are not at a bound towards which the cost falls.
std::vector<Eigen::Index> inside_bounds(const VecX& scaled, const VecX& gradient);

/// Parameters at a bound towards which the cost falls are held. The noise's variances are those of
/// `dispersion` times the inverse of the cost's Gauss-Newton matrix, infinite where that is
/// singular. `prior`: besides the parts, never left out; empty: nothing. With fewer than two parts
/// nothing but `free` is found. Throws Error as cluster_covariance().
EstimateScatter scatter_of(const VecX& scaled, const QuadraticModel& model,
                           const std::vector<CostPart>& parts, double dispersion,
                           const PriorTerm& prior = {});

/// Of the interval to either side: the jackknife's, with Student's t, but at least as wide as the
/// noise alone makes it. Throws Error for fewer than two parts.
double half_width(const EstimateScatter& scatter, Eigen::Index i, double confidence);

/// -1 to 1; NaN where a variance is zero.
MatX correlation_of(const MatX& covariance);

/// Of a normal distribution: half its interval over its standard deviation.
double normal_half_width(double confidence);

/// From `half_width` below `scaled` to `half_width` above, in the parameter's unit.
ParameterInterval interval_about(const ParameterInfo& info, double scaled, double half_width);

}  // namespace weft
