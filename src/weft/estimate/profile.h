#pragma once
/// The profile of one parameter: how the cost rises when it is held beside its estimate and all the
/// others follow to their best. Where the way on which they follow bends, or the cost is not a
/// parabola, an interval from derivatives at the estimate is too narrow on one side and too wide on
/// the other; the profile is neither. (Likelihood-ratio intervals; "MINOS" in particle physics.)
///
///     rise(v) = (min over x with x_p = v of cost(x) - cost(estimate)) / dispersion,
///
/// which is minus the logarithm of a likelihood ratio (uncertainty.h); the interval is where it is
/// at most t^2 / 2, with t the quantile that an interval of derivatives takes. For a parabola both
/// are the same.
#include <functional>
#include <vector>

#include "weft/estimate/least_squares.h"
#include "weft/estimate/uncertainty.h"

namespace weft {

struct ProfileOptions {
  ProfileOptions() {
    least_squares.max_iterations = 12;
    least_squares.step_tolerance = 0;
    least_squares.initial_damping = 1e-8;
  }
  double threshold = 1.353;  ///< rise at the ends of the interval: 1.645^2 / 2, 90 %; > 0
  double first_step = 0.05;  ///< from the estimate, scaled coordinate, > 0; half the interval, say
  int most_points = 6;       ///< to either side, >= 1
  /// Of the others, at each point; its cost_tolerance is overwritten: a search goes on while a step
  /// lowers the rise by a hundredth of the threshold.
  LeastSquaresOptions least_squares;
};

/// For a parameter whose interval by derivatives is `half_width` wide to either side (scaled
/// coordinate), `quantile` standard deviations: the threshold of that, and a first step of half of
/// the interval, `least_step` (> 0) to 0.15.
ProfileOptions profile_options(double quantile, double half_width, double least_step);
/// The same of a video, with the quantile of its confidence and number of clusters and a least step
/// that passes over the roughness of its cost, 0.02.
ProfileOptions profile_options(const Uncertainty& uncertainty, double half_width);
inline constexpr double least_profile_step_of_video = 0.02;

struct ProfilePoint {
  VecX x;           ///< scaled coordinates, the parameter's among them
  double rise = 0;  ///< below 0: the estimate is not the least there is
  /// Whether the search of the others came to its end; else the rise may be less.
  bool searched_out = true;
};

/// How a side of a profile ends.
enum class ProfileEnd {
  crossed,      ///< the rise passes the threshold: an end of the interval
  range,        ///< it stays below to the end of the range
  most_points,  ///< it stays below for as many points as may be
  infinite,     ///< it stays below up to where the cost is infinite
  stopped       ///< by the observer
};

struct Profile {
  int parameter = 0;
  std::vector<ProfilePoint> points;  ///< by the parameter's value, rising; the estimate among them
  /// Scaled coordinate where the rise passes the threshold, between two points by a parabola; the
  /// last point for another end.
  double lower = 0, upper = 1;
  ProfileEnd lower_end = ProfileEnd::crossed, upper_end = ProfileEnd::crossed;
};

/// After each point; false stops, with the sides as far as they are.
using ProfileObserver = std::function<bool(const ProfilePoint&)>;

/// About `estimate`, within [0, 1] for each coordinate. Each point starts where the two before lead
/// (the first: where the quadratic model does) and the next is twice as far where the rise is small
/// yet. A point whose cost is infinite is tried again half as far, down to an eighth of the first
/// step. Throws Error for a parameter or options out of range, a dispersion that is not positive,
/// and an estimate of infinite cost.
Profile profile(const LinearizeFunction& linearize, const CostFunction& cost, const VecX& estimate,
                int parameter, double dispersion, const ProfileOptions& options = {},
                const ProfileObserver& observer = {});

}  // namespace weft
