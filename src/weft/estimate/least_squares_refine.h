#pragma once
#include "weft/estimate/optimize.h"

namespace weft {

/// Search about the end of a least-squares descent. Where cloth snaps, the error of a long motion
/// is rough at a scale far below what the data resolve, and a descent ends in the first dent. What
/// its Gauss-Newton matrix H still tells is how far each direction may go before the error rises as
/// a whole. An evolution strategy samples that ellipsoid: each generation draws `population` points
///
///     x = mean + sigma A z,   A A^T = (H + lambda I)^-1,   z normal,
///
/// moves the mean to the weighted mean of the better half, and adapts sigma by the length of the
/// path of the means (Hansen and Ostermeier 2001, section 3, with the metric kept as it is).
struct RefineOptions {
  int generations = 8;  ///< >= 0
  int population = 10;  ///< >= 4
  /// Rise of the error that the model expects at the first samples, relative to the start; > 0.
  double spread = 0.1;
  double largest_step = 0.1;  ///< standard deviation along any direction, scaled coordinates; > 0
  int threads = 0;            ///< 0: all cores; the result does not depend on it
  std::uint64_t seed = 1;
};
/// After each sample, in order: how many are done, where it was and its error. False stops.
using RefineObserver = std::function<bool(std::size_t done, const VecX& scaled, double error)>;
/// `error` at points of [0, 1]^n; `start_error` is that of the start, `hessian` positive
/// semidefinite, in units of the error. Coordinates are kept inside by reflection. Throws Error for
/// options out of range and sizes that differ.
SearchResult refine(const ErrorFunction& error, const VecX& start, double start_error,
                    const MatX& hessian, const RefineOptions& options = {},
                    const RefineObserver& observer = {});

}  // namespace weft
