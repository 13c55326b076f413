#include "weft/estimate/variability.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>

#include "weft/base/dense.h"
#include "weft/base/error.h"
#include "weft/base/parallel.h"
#include "weft/estimate/linearize_trial.h"

namespace weft {
namespace {

/// The rise of the outermost errors that is sought, and what is accepted.
constexpr double kWantedRise = 0.015, kLeastRise = 0.0075, kMostRise = 0.05;

void check(const VariabilityOptions& options) {
  if (!(options.smallest_window > 0 && options.smallest_window <= options.first_window &&
        options.first_window <= options.largest_window))
    throw Error("variability: windows must be positive and in order");
  if (options.samples < 5 || options.samples % 2 == 0)
    throw Error("variability: samples must be odd and at least 5");
  if (!(options.significance > 0) || !(options.rise > 0))
    throw Error("variability: significance and rise must be positive");
}

struct Interval {
  double lower, upper;
};

struct QuadraticFit {
  Vec3 coefficients = Vec3::Zero();
  double noise = 0;
  double minimum = 0;       ///< r at which the quadratic is smallest in the interval
  double significance = 0;  ///< rise over the interval, in its standard errors
  double at(double r) const { return coefficients.dot(Vec3(1, r, r * r)); }
};

/// Where q is smallest (or, with `sign` -1, largest) in the interval.
double extremum(const Vec3& q, const Interval& interval, double sign) {
  const auto value = [&](double r) { return sign * q.dot(Vec3(1, r, r * r)); };
  double best = value(interval.lower) < value(interval.upper) ? interval.lower : interval.upper;
  if (sign * q[2] > 0) {
    const double vertex = -0.5 * q[1] / q[2];
    if (vertex > interval.lower && vertex < interval.upper) best = vertex;
  }
  return best;
}

QuadraticFit fit_quadratic(const std::vector<double>& r, const std::vector<double>& error,
                           const Interval& interval) {
  const auto count = static_cast<Eigen::Index>(r.size());
  const double scale = std::max(-interval.lower, interval.upper);
  Eigen::MatrixX3d design(count, 3);
  VecX values(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const double t = r[static_cast<std::size_t>(i)] / scale;
    design.row(i) << 1, t, t * t;
    values[i] = error[static_cast<std::size_t>(i)];
  }
  const Vec3 c = least_squares_solution(design, values);
  QuadraticFit fit;
  fit.coefficients = Vec3(c[0], c[1] / scale, c[2] / (scale * scale));
  fit.noise = std::sqrt((design * c - values).squaredNorm() / double(count - 3));
  fit.minimum = extremum(fit.coefficients, interval, 1);
  const double maximum = extremum(fit.coefficients, interval, -1);
  const double low = fit.minimum / scale, high = maximum / scale;
  const Vec3 rise(0, high - low, high * high - low * low);
  const Mat3 covariance = (design.transpose() * design).inverse();
  const double standard_error = fit.noise * std::sqrt(rise.dot(covariance * rise));
  const double height = fit.at(maximum) - fit.at(fit.minimum);
  // Rounding alone makes a perfect parabola's noise about 1e-16 of its height.
  fit.significance = height > 0 ? height / std::max(standard_error, 1e-12 * height) : 0;
  return fit;
}

/// Distance from the minimum at which the quadratic has risen by `rise` of it.
double distance_of_rise(const QuadraticFit& fit, const Interval& interval, double rise) {
  const double target = rise * fit.at(fit.minimum);
  const double slope = fit.coefficients[1] + 2 * fit.coefficients[2] * fit.minimum;
  const double c2 = fit.coefficients[2];
  const bool inside = fit.minimum > interval.lower && fit.minimum < interval.upper;
  if (target <= 0) return kInfinity;
  if (inside) return std::sqrt(target / c2);
  const double outward = std::abs(slope);  // the minimum is at an end: q rises away from it
  const double root = outward * outward + 4 * c2 * target;
  if (root < 0 || (outward == 0 && c2 <= 0)) return kInfinity;
  return 2 * target / (outward + std::sqrt(root));
}

class Perturbation {
 public:
  Perturbation(const ParameterInfo& info, double value, const ParameterError& error,
               const VariabilityOptions& options)
      : info_(info), value_(value), error_(error), options_(options) {
    curve_.name = info.name;
    const double scaled = to_scaled(info, value);
    curve_.at_lower = scaled < at_bound_distance;
    curve_.at_upper = scaled > 1 - at_bound_distance;
    curve_.variability_percent = kInfinity;
  }

  PerturbationCurve run() {
    if (value_ == 0) {
      curve_.warning = fmt::format("{} is 0: a relative change of it means nothing", info_.name);
      return std::move(curve_);
    }
    limits_ = {std::max(-0.9, info_.lower / value_ - 1), info_.upper / value_ - 1};
    if (curve_.at_lower) limits_.lower = 0;
    if (curve_.at_upper) limits_.upper = 0;
    middle_ = error_at(0);
    if (!std::isfinite(middle_)) {
      curve_.warning = fmt::format("{}: the simulation diverges at the estimate", info_.name);
      return std::move(curve_);
    }
    fit_over(find_window());
    describe();
    return std::move(curve_);
  }

 private:
  double error_at(double r) {
    const auto known = known_.find(r);
    if (known != known_.end()) return known->second;
    const double value = std::clamp(value_ * (1 + r), info_.lower, info_.upper);
    const double error = error_(value);
    return known_[r] = std::isnan(error) ? kInfinity : error;
  }

  Interval window(double w) const {
    return {std::max(-w, limits_.lower), std::min(w, limits_.upper)};
  }

  double relative_rise(double w) {
    const Interval ends = window(w);
    return std::max(error_at(ends.lower), error_at(ends.upper)) / middle_ - 1;
  }

  /// A half width over which the error changes by a few percent.
  double find_window() {
    double w = options_.first_window;
    for (int step = 0; step < 8; ++step) {
      const double rise = relative_rise(w);
      if (rise >= kLeastRise && rise <= kMostRise) break;
      double factor = 4;
      if (rise > 0) factor = std::clamp(std::sqrt(kWantedRise / rise), 0.125, 4.0);
      const double next = std::clamp(w * factor, options_.smallest_window, options_.largest_window);
      if (next == w) break;
      w = next;
    }
    return w;
  }

  bool sample(const Interval& interval) {
    std::vector<double> r;
    for (int k = 0; k < options_.samples; ++k)
      r.push_back(interval.lower +
                  (interval.upper - interval.lower) * k / double(options_.samples - 1));
    if (std::find(r.begin(), r.end(), 0.0) == r.end()) r.push_back(0);
    std::sort(r.begin(), r.end());
    curve_.relative = r;
    curve_.error.clear();
    for (const double change : r) curve_.error.push_back(error_at(change));
    return std::all_of(curve_.error.begin(), curve_.error.end(),
                       [](double e) { return std::isfinite(e); });
  }

  void fit_over(double w) {
    for (;; w *= 2) {
      w = std::min(w, options_.largest_window);
      const Interval interval = window(w);
      if (!sample(interval)) {
        curve_.warning = fmt::format("{}: simulations diverge within {:.3g} % of the estimate",
                                     info_.name, 100 * w);
        return;
      }
      const QuadraticFit fit = fit_quadratic(curve_.relative, curve_.error, interval);
      curve_.quadratic = fit.coefficients;
      curve_.noise = fit.noise;
      if (fit.significance >= options_.significance) {
        curve_.variability_percent = 100 * distance_of_rise(fit, interval, options_.rise);
        return;
      }
      const bool whole = interval.lower == limits_.lower && interval.upper == limits_.upper;
      if (w >= options_.largest_window || whole) return;
    }
  }

  void describe() {
    curve_.determined = curve_.variability_percent <= 100;
    if (!curve_.warning.empty()) return;
    if (curve_.at_lower || curve_.at_upper) {
      curve_.warning = fmt::format(
          "{} lies at the {} bound of its range ({:.4g} {}): the data ask for a value beyond it",
          info_.name, curve_.at_lower ? "lower" : "upper", value_, info_.unit);
    } else if (!curve_.determined) {
      curve_.warning = fmt::format(
          "{} is not determined by the data: changing it by 100 % changes the error by less than "
          "{:.3g} %",
          info_.name, 100 * options_.rise);
    }
  }

  const ParameterInfo& info_;
  double value_;
  const ParameterError& error_;
  const VariabilityOptions& options_;
  Interval limits_{};
  double middle_ = 0;
  std::map<double, double> known_;
  PerturbationCurve curve_;
};

}  // namespace

PerturbationCurve perturb(const ParameterInfo& info, double value, const ParameterError& error,
                          const VariabilityOptions& options) {
  check(options);
  if (!(value >= info.lower && value <= info.upper))
    throw Error(fmt::format("{} = {} {}, valid: {} to {}", info.name, value, info.unit, info.lower,
                            info.upper));
  return Perturbation(info, value, error, options).run();
}

std::vector<PerturbationCurve> variability(const Problem& problem, const Fabric& fabric,
                                           const VariabilityOptions& options,
                                           EvaluationStore* store,
                                           const std::function<bool()>& keep_going) {
  check(options);
  const auto count = static_cast<std::size_t>(problem.dimension());
  std::vector<PerturbationCurve> curves(count);
  std::vector<char> finished(count, 0);
  std::atomic<bool> stop = false;
  parallel_for(count, options.threads, [&](std::size_t i) {
    const auto error = [&](double value) {
      if (keep_going && !keep_going()) stop = true;
      if (stop) return kInfinity;  // ends the curve, which is then dropped
      Fabric changed = fabric;
      changed.values[fabric.value_index(problem.free()[i])] = value;
      return evaluate_stored(problem, changed, 0, "variability", store).evaluation.error;
    };
    const ParameterInfo& info = problem.info(static_cast<int>(i));
    curves[i] = perturb(info, fabric.value(info.name), error, options);
    if (!stop) finished[i] = 1;
  });
  std::vector<PerturbationCurve> result;
  for (std::size_t i = 0; i < count; ++i)
    if (finished[i]) result.push_back(std::move(curves[i]));
  return result;
}

VecX variability_from_derivatives(const Problem& problem, const VecX& scaled, double error,
                                  const QuadraticModel& model, double rise) {
  if (!(rise > 0)) throw Error(fmt::format("variability: rise is {:g}, must be above 0", rise));
  VecX percent = VecX::Constant(problem.dimension(), kInfinity);
  for (int i = 0; i < problem.dimension(); ++i) {
    const double curvature = model.hessian(i, i), gradient = model.gradient[i];
    const double value = from_scaled(problem.info(i), scaled[i]);
    const double slope = held_at_bound(scaled[i], gradient) ? std::abs(gradient) : 0;
    if (!(curvature > 0 || slope > 0) || value == 0) continue;
    // The root of slope s + curvature s^2 / 2 = rise error, without a difference of like numbers.
    const double change =
        2 * rise * error /
        (slope + std::sqrt(slope * slope + 2 * std::max(0.0, curvature) * rise * error));
    percent[i] = 100 * change * scaled_slope(problem.info(i), scaled[i]) / std::abs(value);
  }
  return percent;
}

}  // namespace weft
