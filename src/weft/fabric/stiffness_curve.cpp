#include "weft/fabric/stiffness_curve.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "weft/base/error.h"

namespace weft {
namespace {

using Powers = Eigen::Vector4d;

Powers powers(double t) { return {1, t, t * t, t * t * t}; }

/// Integrals from 0 to t of u^p (s + u) du.
Powers energy_powers(double s, double t) {
  Powers out;
  double power = t;
  for (int p = 0; p < 4; ++p, power *= t) out[p] = power * (s / (p + 1) + t / (p + 2));
  return out;
}

double half_difference(double a, double b) { return 0.5 * (b - a) * (b + a); }

/// Row i: d slope_i / d values.
MatX slopes(const VecX& knots, const VecX& values) {
  const Eigen::Index n = knots.size();
  const auto chord = [&](Eigen::Index i) -> Eigen::RowVectorXd {
    Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(n);
    row[i] = -1 / (knots[i + 1] - knots[i]);
    row[i + 1] = -row[i];
    return row;
  };
  // Of the parabola through three knots, at the first one.
  const auto at_end = [](double near, double far, const Eigen::RowVectorXd& near_chord,
                         const Eigen::RowVectorXd& far_chord) -> Eigen::RowVectorXd {
    return ((2 * near + far) * near_chord - near * far_chord) / (near + far);
  };
  MatX out(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double left = i > 0 ? knots[i] - knots[i - 1] : 0;
    const double right = i + 1 < n ? knots[i + 1] - knots[i] : 0;
    if (n == 2)
      out.row(i) = chord(0);
    else if (i == 0)
      out.row(i) = at_end(right, knots[2] - knots[1], chord(0), chord(1));
    else if (i + 1 == n)
      out.row(i) = at_end(left, knots[n - 2] - knots[n - 3], chord(n - 2), chord(n - 3));
    else
      out.row(i) = (left * chord(i) + right * chord(i - 1)) / (left + right);
    const double slope = out.row(i).dot(values);
    const Eigen::RowVectorXd unit = Eigen::RowVectorXd::Unit(n, i);
    if (i > 0 && slope * left > 3 * values[i]) out.row(i) = 3 / left * unit;
    if (i + 1 < n && slope * right < -3 * values[i]) out.row(i) = -3 / right * unit;
  }
  return out;
}

}  // namespace

StiffnessCurve::StiffnessCurve(const VecX& knots, const VecX& values) : knots_(knots) {
  if (knots.size() < 1 || knots.size() > kMostKnots)
    throw Error(
        fmt::format("a stiffness curve has {} knots; valid: 1 to {}", knots.size(), kMostKnots));
  for (Eigen::Index i = 0; i < knots.size(); ++i) {
    if (!std::isfinite(knots[i]))
      throw Error(fmt::format("strain {} of a stiffness curve is not finite", knots[i]));
    if (i > 0 && !(knots[i] > knots[i - 1]))
      throw Error(fmt::format("strains of a stiffness curve must increase; {} follows {}", knots[i],
                              knots[i - 1]));
  }
  set_values(values);
}

StiffnessCurve::StiffnessCurve(double constant)
    : StiffnessCurve(VecX::Zero(1), VecX::Constant(1, constant)) {}

void StiffnessCurve::set_values(const Eigen::Ref<const VecX>& values) {
  const Eigen::Index n = knots_.size();
  if (values.size() != n)
    throw Error(fmt::format("a stiffness curve has {} strains and {} values", n, values.size()));
  for (Eigen::Index i = 0; i < n; ++i)
    if (!(values[i] >= 0 && std::isfinite(values[i])))
      throw Error(
          fmt::format("value {} of a stiffness curve is not a finite number >= 0", values[i]));
  values_ = values;
  if (n == 1) return;
  const MatX slope = slopes(knots_, values_);
  basis_.resize(n * (n - 1), 4);
  coefficients_.resize(4, n - 1);
  integrals_.setZero(n, n);
  for (Eigen::Index i = 0; i + 1 < n; ++i) {
    const double h = knots_[i + 1] - knots_[i];
    const VecX left = VecX::Unit(n, i), m0 = slope.row(i), m1 = slope.row(i + 1);
    const VecX chord = (VecX::Unit(n, i + 1) - left) / h;
    auto basis = basis_.middleRows(n * i, n);
    basis.col(0) = left;
    basis.col(1) = m0;
    basis.col(2) = (3 * chord - 2 * m0 - m1) / h;
    basis.col(3) = (m0 + m1 - 2 * chord) / (h * h);
    coefficients_.col(i) = basis.transpose() * values_;
    integrals_.col(i + 1) = integrals_.col(i) + basis * energy_powers(knots_[i], h);
  }
  // From knot 0 to from 0.
  energies_ = VecX::Zero(n);
  VecX zero(n);
  energy_by_values(0, zero);
  integrals_.colwise() -= zero;
  energies_ = integrals_.transpose() * values_;
}

Eigen::Index StiffnessCurve::segment(double strain) const {
  Eigen::Index i = 0;
  while (i + 2 < knots_.size() && strain > knots_[i + 1]) ++i;
  return i;
}

double StiffnessCurve::stiffness(double strain) const {
  const Eigen::Index last = knots_.size() - 1;
  if (strain <= knots_[0] || last == 0) return values_[0];
  if (strain >= knots_[last]) return values_[last];
  const Eigen::Index i = segment(strain);
  return coefficients_.col(i).dot(powers(strain - knots_[i]));
}

double StiffnessCurve::slope(double strain) const {
  const Eigen::Index last = knots_.size() - 1;
  if (last == 0 || strain <= knots_[0] || strain >= knots_[last]) return 0;
  const Eigen::Index i = segment(strain);
  const double t = strain - knots_[i];
  return coefficients_(1, i) + t * (2 * coefficients_(2, i) + 3 * t * coefficients_(3, i));
}

StiffnessCurve::Response StiffnessCurve::respond(double strain) const {
  const Eigen::Index last = knots_.size() - 1;
  if (last == 0) {
    const double k = values_[0];
    return {0.5 * k * strain * strain, k * strain, k};
  }
  if (strain <= knots_[0] || strain >= knots_[last]) {
    const Eigen::Index end = strain <= knots_[0] ? 0 : last;
    const double k = values_[end];
    return {energies_[end] + k * half_difference(knots_[end], strain), k * strain, k};
  }
  const Eigen::Index i = segment(strain);
  const double t = strain - knots_[i];
  const Powers a = coefficients_.col(i);
  const double k = a.dot(powers(t));
  const double slope = a[1] + t * (2 * a[2] + 3 * t * a[3]);
  return {energies_[i] + a.dot(energy_powers(knots_[i], t)), k * strain, k + slope * strain};
}

void StiffnessCurve::stiffness_by_values(double strain, Eigen::Ref<VecX> derivative) const {
  const Eigen::Index n = knots_.size(), last = n - 1;
  if (last == 0 || strain <= knots_[0] || strain >= knots_[last]) {
    derivative.setZero();
    derivative[last == 0 || strain <= knots_[0] ? 0 : last] = 1;
    return;
  }
  const Eigen::Index i = segment(strain);
  derivative.noalias() = basis_.middleRows(n * i, n) * powers(strain - knots_[i]);
}

void StiffnessCurve::energy_by_values(double strain, Eigen::Ref<VecX> derivative) const {
  const Eigen::Index n = knots_.size(), last = n - 1;
  if (last == 0) {
    derivative[0] = 0.5 * strain * strain;
    return;
  }
  if (strain <= knots_[0] || strain >= knots_[last]) {
    const Eigen::Index end = strain <= knots_[0] ? 0 : last;
    derivative = integrals_.col(end);
    derivative[end] += half_difference(knots_[end], strain);
    return;
  }
  const Eigen::Index i = segment(strain);
  derivative = integrals_.col(i);
  derivative.noalias() +=
      basis_.middleRows(n * i, n) * energy_powers(knots_[i], strain - knots_[i]);
}

StiffnessCurve StiffnessCurve::resampled(const VecX& knots) const {
  VecX values(knots.size());
  for (Eigen::Index i = 0; i < knots.size(); ++i) values[i] = stiffness(knots[i]);
  return {knots, values};
}

}  // namespace weft
