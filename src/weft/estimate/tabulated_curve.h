#pragma once
#include "weft/fabric/stiffness_curve.h"

namespace weft {

/// A measured curve of stress against strain as a stiffness curve.
struct TabulatedCurveFit {
  StiffnessCurve curve{1.0};
  double rms = 0;       ///< of stress, in its unit
  double relative = 0;  ///< rms over the largest stress in magnitude
};
/// Least squares of k(strain) strain - stress over control values >= 0. `knots` (1 to 8): the
/// first two lie at 0 and the largest strain; each further one halves the interval whose points
/// have the largest sum of squares, as long as at least three points lie in it. Strains of either
/// sign: the curve is over the magnitude, stress odd in the strain. Throws Error for sizes that
/// differ, fewer points than knots, and no strain but zero.
TabulatedCurveFit fit_tabulated_curve(const VecX& strain, const VecX& stress, int knots);

}  // namespace weft
