#include "weft/estimate/profile.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "weft/base/error.h"

namespace weft {
namespace {

constexpr double kLargestFirstStep = 0.15;
// Of another coordinate from one point to the start of the next: what the past says of a bend in
// the way ends somewhere.
constexpr double kMostFollowed = 0.15;
constexpr double kSmallRise = 0.25;       // of the threshold: the next step is twice as long
constexpr double kLeastStep = 1.0 / 8;    // of the first; shorter steps are not tried
constexpr double kLeastReduction = 0.01;  // of the threshold, by a step of a search
constexpr double kDamping = 1e-9;         // of the model's largest diagonal entry

void check(const VecX& estimate, int parameter, double dispersion, const ProfileOptions& options) {
  if (parameter < 0 || parameter >= estimate.size())
    throw Error(
        fmt::format("profile: parameter {} is not in [0, {}]", parameter, estimate.size() - 1));
  if (!(estimate.minCoeff() >= 0) || !(estimate.maxCoeff() <= 1))
    throw Error("profile: the estimate is not in [0, 1]");
  if (!(dispersion > 0) || !std::isfinite(dispersion))
    throw Error(fmt::format("profile: the dispersion {} is not a positive number", dispersion));
  if (!(options.threshold > 0) || !(options.first_step > 0) || options.most_points < 1)
    throw Error("profile: threshold, first_step and most_points must be above 0");
}

class Profiler {
 public:
  Profiler(const LinearizeFunction& linearize, const CostFunction& cost, const VecX& estimate,
           int parameter, double dispersion, const ProfileOptions& options,
           const ProfileObserver& observer)
      : linearize_(linearize),
        cost_(cost),
        estimate_(estimate),
        parameter_(parameter),
        dispersion_(dispersion),
        options_(options),
        observer_(observer),
        model_(linearize(estimate)),
        search_(options.least_squares) {
    if (!std::isfinite(model_.cost)) throw Error("profile: the estimate cannot be evaluated");
    // The solver's tolerance is a part of the cost, which near the interval's ends is this one.
    const double most = options.threshold * dispersion;
    search_.cost_tolerance = kLeastReduction * most / (model_.cost + most);
  }

  Profile run() {
    Profile result;
    result.parameter = parameter_;
    const Side below = follow(-1), above = follow(1);
    result.points.assign(below.points.rbegin(), below.points.rend());
    result.points.push_back({estimate_, 0});
    result.points.insert(result.points.end(), above.points.begin(), above.points.end());
    result.lower = below.limit;
    result.upper = above.limit;
    result.lower_end = below.end;
    result.upper_end = above.end;
    return result;
  }

 private:
  struct Side {
    std::vector<ProfilePoint> points;  ///< outwards
    double limit = 0;
    ProfileEnd end = ProfileEnd::most_points;
  };

  double value_of(const ProfilePoint& point) const { return point.x[parameter_]; }

  Side follow(int sign) {
    Side side;
    ProfilePoint before{estimate_, 0}, at = before;
    double step = options_.first_step;
    const auto ended = [&](ProfileEnd end) {
      side.end = end;
      side.limit = end == ProfileEnd::crossed ? crossing(before, at) : value_of(at);
      return side;
    };
    while (static_cast<int>(side.points.size()) < options_.most_points) {
      if (stopped_) return ended(ProfileEnd::stopped);
      const double value = std::clamp(value_of(at) + sign * step, 0.0, 1.0);
      if (value == value_of(at)) return ended(ProfileEnd::range);
      const LeastSquaresResult found = held_at(value, start(before, at, value));
      if (!std::isfinite(found.cost)) {
        step *= 0.5;
        if (step < kLeastStep * options_.first_step) return ended(ProfileEnd::infinite);
        continue;
      }
      side.points.push_back({found.x, (found.cost - model_.cost) / dispersion_,
                             found.end != LeastSquaresEnd::max_iterations});
      stopped_ = observer_ && !observer_(side.points.back());
      before = std::exchange(at, side.points.back());
      if (at.rise > options_.threshold) return ended(ProfileEnd::crossed);
      if (at.rise < kSmallRise * options_.threshold) step *= 2;
    }
    const bool at_the_end = value_of(at) == (sign < 0 ? 0.0 : 1.0);
    return ended(at_the_end ? ProfileEnd::range : ProfileEnd::most_points);
  }

  /// Where the others are expected with the parameter at `value`.
  VecX start(const ProfilePoint& before, const ProfilePoint& at, double value) const {
    const double way = value - value_of(at);
    VecX change = value_of(at) == value_of(before)
                      ? by_model(way)
                      : VecX((at.x - before.x) * (way / (value_of(at) - value_of(before))));
    change = change.cwiseMax(-kMostFollowed).cwiseMin(kMostFollowed);
    VecX x = (at.x + change).cwiseMax(0).cwiseMin(1);
    x[parameter_] = value;
    return x;
  }

  /// The others at the least of the model at the estimate, with the parameter moved by `way`. Its
  /// gradient is left out: where the estimate is not quite the end of a search, that has others to
  /// go, too, but not along the profile.
  VecX by_model(double way) const {
    std::vector<Eigen::Index> others;
    for (Eigen::Index i = 0; i < estimate_.size(); ++i)
      if (i != parameter_) others.push_back(i);
    VecX change = VecX::Zero(estimate_.size());
    change[parameter_] = way;
    if (others.empty()) return change;
    MatX hessian = model_.hessian(others, others);
    hessian.diagonal().array() += kDamping * model_.hessian.diagonal().maxCoeff();
    const VecX pull = way * model_.hessian.col(parameter_)(others);
    const VecX room = VecX::Constant(pull.size(), kMostFollowed);
    change(others) = minimize_in_box(hessian, pull, -room, room);
    return change;
  }

  LeastSquaresResult held_at(double value, const VecX& x) const {
    VecX lower = VecX::Zero(x.size()), upper = VecX::Ones(x.size());
    lower[parameter_] = upper[parameter_] = value;
    return minimize_least_squares(linearize_, cost_, x, lower, upper, search_);
  }

  /// The root of a rise grows in proportion to the distance where the cost is a parabola.
  double crossing(const ProfilePoint& inside, const ProfilePoint& outside) const {
    const double a = std::sqrt(std::max(0.0, inside.rise)), b = std::sqrt(outside.rise);
    const double part = (std::sqrt(options_.threshold) - a) / (b - a);
    return value_of(inside) + part * (value_of(outside) - value_of(inside));
  }

  const LinearizeFunction& linearize_;
  const CostFunction& cost_;
  const VecX& estimate_;
  int parameter_;
  double dispersion_;
  const ProfileOptions& options_;
  const ProfileObserver& observer_;
  QuadraticModel model_;
  LeastSquaresOptions search_;  ///< of the others
  bool stopped_ = false;
};

}  // namespace

ProfileOptions profile_options(double quantile, double half_width, double least_step) {
  ProfileOptions options;
  options.threshold = 0.5 * quantile * quantile;
  options.first_step = std::clamp(0.5 * half_width, least_step, kLargestFirstStep);
  return options;
}

ProfileOptions profile_options(const Uncertainty& uncertainty, double half_width) {
  return profile_options(
      student_quantile(0.5 + 0.5 * uncertainty.confidence, uncertainty.clusters - 1), half_width,
      least_profile_step_of_video);
}

Profile profile(const LinearizeFunction& linearize, const CostFunction& cost, const VecX& estimate,
                int parameter, double dispersion, const ProfileOptions& options,
                const ProfileObserver& observer) {
  check(estimate, parameter, dispersion, options);
  return Profiler(linearize, cost, estimate, parameter, dispersion, options, observer).run();
}

}  // namespace weft
