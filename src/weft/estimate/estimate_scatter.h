#pragma once
#include <vector>

#include "weft/estimate/uncertainty.h"
#include "weft/fabric/parameter.h"

namespace weft {

/// How a least-squares estimate scatters: what intervals are made of. Coordinates scaled to [0, 1].
struct EstimateScatter {
  std::vector<Eigen::Index> free;  ///< parameters that no bound holds
  /// Of the jackknife (uncertainty.h); in directions that one part decides alone, by the noise.
  /// Zero for held ones.
  MatX covariance;
  VecX prior;  ///< what of its variances the prior's own width makes; zero without one
  /// Variances by the noise alone; zero for held ones, infinite for what no part determines.
  VecX noise;
  VecX undetermined;     ///< share of a parameter that no part determines, 0 to 1
  double condition = 0;  ///< of the Gauss-Newton matrix of the free ones
  std::size_t parts = 0;

  bool held(Eigen::Index i) const;
  /// Neither held nor, in a part that counts, left open by the data.
  bool determined(Eigen::Index i) const;
};

/// Parameters, scaled to [0, 1], but for those at a bound towards which the cost falls.
std::vector<Eigen::Index> inside_bounds(const VecX& scaled, const VecX& gradient);

/// Parameters at a bound towards which the cost falls are held. The noise's covariance is
/// `dispersion` times the inverse of the cost's Gauss-Newton matrix, where that is not singular.
/// Where one part decides alone nothing can be left out: there it is what counts, `alone` times, >=
/// 1; with a single part everywhere. Throws Error as cluster_covariance(), and for no parts.
///
/// `prior`: besides the parts, never left out, and in the model's gradient and matrix; empty:
/// nothing. What one part decides alone is told from the parts: without that one the prior would
/// be left, which says nothing of how sure the part is. The parts' gradients are taken where they
/// balance without the prior. The noise's covariance is then A^-1
/// (dispersion H + V) A^-1 with A the model's matrix, H the parts' and V the covariance of the
/// prior's gradient.
EstimateScatter scatter_of(const VecX& scaled, const QuadraticModel& model,
                           const std::vector<CostPart>& parts, double dispersion, double alone = 1,
                           const PriorTerm& prior = {});

/// Of the interval to either side: the jackknife's, with Student's t (the prior's part of it is
/// normal), but at least as wide as the noise alone makes it.
double half_width(const EstimateScatter& scatter, Eigen::Index i, double confidence);

/// -1 to 1; NaN where a variance is zero.
MatX correlation_of(const MatX& covariance);

/// Of a normal distribution: half its interval over its standard deviation.
double normal_half_width(double confidence);

/// Opens the ends of an interval that are not inside of the range of the search: infinite, or 0
/// below where the parameter cannot be negative. Of one whose half width is above
/// widest_half_interval that leaves one end at most, of one that is infinite none.
void open_ends(const ParameterInfo& info, double scaled, double half_width,
               ParameterInterval& interval);

/// From `half_width` below `scaled` to `half_width` above, in the parameter's unit.
ParameterInterval interval_about(const ParameterInfo& info, double scaled, double half_width);

}  // namespace weft
