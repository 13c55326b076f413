#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "weft/base/error.h"
#include "weft/dynamics/scene.h"

namespace weft {

namespace {

void check_samples(const std::vector<double>& times, const Points& positions) {
  if (times.empty()) throw Error("motion: no samples; at least one is needed");
  if (static_cast<std::size_t>(positions.cols()) != times.size()) {
    throw Error(fmt::format("motion: {} times but {} positions", times.size(), positions.cols()));
  }
  for (std::size_t i = 0; i < times.size(); ++i) {
    if (!std::isfinite(times[i])) {
      throw Error(fmt::format("motion: time {} is not a finite number", i));
    }
    if (!positions.col(static_cast<Eigen::Index>(i)).allFinite()) {
      throw Error(fmt::format("motion: position {} (at {} s) is not finite", i, times[i]));
    }
    if (i > 0 && times[i] <= times[i - 1]) {
      throw Error(fmt::format("motion: times must increase, but {} s follows {} s (sample {})",
                              times[i], times[i - 1], i));
    }
  }
}

/// Second derivatives of the natural spline at its samples: a tridiagonal system, by elimination.
Points natural_second_derivatives(const std::vector<double>& times, const Points& positions) {
  const Eigen::Index n = positions.cols();
  Points second = Points::Zero(3, n);
  if (n < 3) return second;
  VecX upper = VecX::Zero(n);  // what elimination leaves above the diagonal
  auto interval = [&](Eigen::Index i) {
    return times[static_cast<std::size_t>(i) + 1] - times[static_cast<std::size_t>(i)];
  };
  for (Eigen::Index i = 1; i + 1 < n; ++i) {
    const double before = interval(i - 1);
    const double after = interval(i);
    const Vec3 slope_change = (positions.col(i + 1) - positions.col(i)) / after -
                              (positions.col(i) - positions.col(i - 1)) / before;
    const double pivot = 2 * (before + after) - before * upper(i - 1);
    upper(i) = after / pivot;
    second.col(i) = (6 * slope_change - before * second.col(i - 1)) / pivot;
  }
  for (Eigen::Index i = n - 2; i >= 1; --i) second.col(i) -= upper(i) * second.col(i + 1);
  return second;
}

}  // namespace

/// p + s (q + s (r + s t)), s seconds after `start`; constant outside the samples.
struct Motion::Cubic {
  double s;
  Vec3 p, q, r, t;
};

Motion::Motion() : Motion({0.0}, Points::Zero(3, 1)) {}

Motion::Motion(std::vector<double> times, Points positions)
    : times_(std::move(times)), positions_(std::move(positions)) {
  check_samples(times_, positions_);
  second_derivatives_ = natural_second_derivatives(times_, positions_);
}

Motion Motion::fixed(const Vec3& position) { return Motion({0.0}, position); }

Motion::Cubic Motion::at(double time) const {
  const Vec3 none = Vec3::Zero();
  if (times_.size() == 1 || time < times_.front()) {
    return {0, positions_.col(0), none, none, none};
  }
  if (time > times_.back()) return {0, positions_.rightCols<1>(), none, none, none};
  const auto after = std::upper_bound(times_.begin(), times_.end(), time);
  const auto i = std::clamp<std::ptrdiff_t>(after - times_.begin() - 1, 0,
                                            static_cast<std::ptrdiff_t>(times_.size()) - 2);
  const double h = times_[static_cast<std::size_t>(i) + 1] - times_[static_cast<std::size_t>(i)];
  const Vec3 a = second_derivatives_.col(i);
  const Vec3 b = second_derivatives_.col(i + 1);
  return {time - times_[static_cast<std::size_t>(i)], positions_.col(i),
          (positions_.col(i + 1) - positions_.col(i)) / h - h / 6 * (2 * a + b), a / 2,
          (b - a) / (6 * h)};
}

Vec3 Motion::position(double time) const {
  const Cubic c = at(time);
  return c.p + c.s * (c.q + c.s * (c.r + c.s * c.t));
}

Vec3 Motion::velocity(double time) const {
  const Cubic c = at(time);
  return c.q + c.s * (2 * c.r + c.s * 3 * c.t);
}

Vec3 Motion::acceleration(double time) const {
  const Cubic c = at(time);
  return 2 * c.r + c.s * 6 * c.t;
}

double Motion::start_time() const { return times_.size() == 1 ? -kInfinity : times_.front(); }

double Motion::end_time() const { return times_.size() == 1 ? kInfinity : times_.back(); }

}  // namespace weft
