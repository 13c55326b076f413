#pragma once
#include <vector>

#include "weft/estimate/uncertainty.h"
#include "weft/fabric/parameter.h"

namespace weft {

struct ResidualIntervals {
  std::vector<ParameterInterval> intervals;
  MatX correlation;      ///< scaled coordinates; NaN where not determined
  double condition = 0;  ///< of the Gauss-Newton matrix
};

/// Intervals of a least-squares estimate whose residuals were divided by their noise and whose cost
/// is the mean of their squares: the jackknife over `parts` (uncertainty.h), which measures what
/// the model lacks, but at least as wide as the stated noise makes them, the diagonal of (J^T
/// J)^-1. Parameters at a bound towards which the cost falls are held. `infos`: of the parameters,
/// in the order of `scaled`, the estimate in coordinates scaled to [0, 1]. `systematic`: added to
/// the half widths, scaled coordinates, >= 0; empty: nothing. With fewer than two parts: no
/// intervals.
ResidualIntervals residual_intervals(const std::vector<ParameterInfo>& infos, const VecX& scaled,
                                     const QuadraticModel& model,
                                     const std::vector<CostPart>& parts, std::size_t residual_count,
                                     double confidence, const VecX& systematic = {});

}  // namespace weft
