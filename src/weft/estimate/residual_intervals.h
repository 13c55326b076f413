#pragma once
#include <vector>

#include "weft/estimate/uncertainty.h"
#include "weft/fabric/parameter.h"

namespace weft {

/// How sure an estimate is as a whole; a row and a column for each parameter, scaled coordinates.
struct ResidualCertainty {
  double confidence = 0;  ///< of the intervals
  double dispersion = 0;  ///< 2 / count: what a unit of minus the log likelihood is of the cost
  std::size_t parts = 0;  ///< that were left out in turn; 0: nothing is known
  MatX covariance;        ///< zero for parameters that a bound holds
  MatX correlation;       ///< NaN where not determined
  MatX information;       ///< J^T J: Fisher's, of the stated noise, of all parameters
  VecX slope;             ///< Uncertainty::slope, of the stated noise
  double condition = 0;   ///< of the Gauss-Newton matrix; infinity: singular
  /// residual_dispersion() over that of the stated noise, >= 1: by what the information has to be
  /// divided to be that of the residuals' own scatter.
  double overdispersion = 1;
};
struct ResidualIntervals {
  std::vector<ParameterInterval> intervals;
  ResidualCertainty certainty;
};

/// Intervals of a least-squares estimate whose residuals were divided by their noise and whose cost
/// is the mean of their squares: the jackknife over `parts` (uncertainty.h), which measures what
/// the model lacks, but at least as wide as the stated noise makes them, the diagonal of (J^T
/// J)^-1. What one part decides alone, as the weight of the only test of bending does, is as sure
/// as the noise makes it, which then counts max(1, cost) times. Parameters at a bound towards which
/// the cost falls are held. `infos`: of the parameters, in the order of `scaled`, the estimate in
/// coordinates scaled to [0, 1]. `systematic`: added to the half widths, scaled coordinates, >= 0;
/// empty: nothing. Throws Error for no parts.
///
/// `model` is of the data alone; `prior` adds to it (estimate_scatter.h). A parameter is determined
/// by the data if its interval is at most widest_beside_prior times the prior's own, and else
/// ParameterInterval::by_prior. Of one that is not, and has no prior, an end that the data bound
/// stays (open_ends()).
ResidualIntervals residual_intervals(const std::vector<ParameterInfo>& infos, const VecX& scaled,
                                     QuadraticModel model, const std::vector<CostPart>& parts,
                                     double residual_count, double confidence,
                                     const VecX& systematic = {}, const PriorTerm& prior = {});

/// Half of an interval over its standard deviation, for that dispersion: Student's t of the parts
/// where their scatter made it, and else the normal distribution's.
double residual_quantile(const ResidualCertainty& certainty);

/// What of such a cost is a unit of minus the logarithm of a likelihood: cluster_dispersion() of
/// the parts, but not below what the stated noise makes, 2 / residual_count. Where parts do not
/// tell (a single one, or one that decides alone) that times max(1, cost): residuals are then taken
/// to be independent.
double residual_dispersion(const std::vector<CostPart>& parts, double cost, double residual_count);

}  // namespace weft
