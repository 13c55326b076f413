#pragma once
#include <functional>
#include <vector>

#include "weft/estimate/evaluation_store.h"
#include "weft/estimate/optimize.h"
#include "weft/estimate/problem.h"

namespace weft {

/// An estimate nearer to a bound of its range than this, in scaled coordinates, lies at it.
inline constexpr double at_bound_distance = 0.01;
/// Whether a parameter lies at a bound towards which the cost of this `gradient` still falls.
inline bool held_at_bound(double scaled, double gradient) {
  return (scaled < at_bound_distance && gradient > 0) ||
         (scaled > 1 - at_bound_distance && gradient < 0);
}

/// Variability (Bhat 2003, section 5): a parameter p is perturbed about the estimate, a quadratic
/// q(r) = c0 + c1 r + c2 r^2 of the relative change r is fitted to the errors by least squares, and
/// the distance from its minimum at which q is 1 % higher is the variability, in percent of p.
///
/// The paper perturbs by up to 0.2 %. There the error of a rendered comparison is rough (pixels
/// flip), and a quadratic fits noise. So the half width w of the perturbations is chosen for each
/// parameter: from `first_window` it is scaled until the outermost errors lie about 1.5 % above the
/// middle (0.75 to 5 %), never below the paper's 0.2 %; then `samples` errors are computed over
/// [-w, w] and w is doubled until the quadratic stands out of the noise: its rise over the window
/// is at least `significance` times its standard error. A parameter for which that does not happen
/// up to `largest_window`, or whose variability is above 100 %, is not determined by the data.
/// Where the estimate lies at a bound only the inner side is sampled.
struct VariabilityOptions {
  double first_window = 0.05;  ///< relative
  double smallest_window = 0.002;
  double largest_window = 2;  ///< the lower side ends at -90 % and at the parameter's bound
  int samples = 9;            ///< at w, the middle included; odd, at least 5
  double significance = 3;
  double rise = 0.01;  ///< of the error, that defines the variability
  int threads = 0;
};

/// The error of a value of one parameter: what variability works on.
using ParameterError = std::function<double(double value)>;
/// One parameter. `value` within [info.lower, info.upper].
PerturbationCurve perturb(const ParameterInfo& info, double value, const ParameterError& error,
                          const VariabilityOptions& options = {});

/// All free parameters of a problem about `fabric`, on all its frames; evaluations go through
/// `store` (may be null). Stops early, with the curves finished so far, when `keep_going` returns
/// false.
std::vector<PerturbationCurve> variability(const Problem& problem, const Fabric& fabric,
                                           const VariabilityOptions& options = {},
                                           EvaluationStore* store = nullptr,
                                           const std::function<bool()>& keep_going = {});

/// The variability of each free parameter to first order, without another evaluation: with
/// `error` E, gradient g and Gauss-Newton matrix H (`model`, as in ProblemLinearization) at the
/// estimate, a change of the search coordinate i alone by s with g_i s + H_ii s^2 / 2 = rise E
/// raises the error by `rise`; in percent of the parameter. g_i counts at a bound towards which the
/// error still falls, and is that of a dent elsewhere, which does not. Infinite where H_ii (and
/// there g_i) or the value is 0. It differs from variability() by what second derivatives and the
/// roughness of the error do. Throws Error unless rise > 0.
VecX variability_from_derivatives(const Problem& problem, const VecX& scaled, double error,
                                  const QuadraticModel& model, double rise = 0.01);

}  // namespace weft
