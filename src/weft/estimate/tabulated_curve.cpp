#include "weft/estimate/tabulated_curve.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "weft/base/error.h"
#include "weft/estimate/least_squares.h"

namespace weft {
namespace {

constexpr int kMostCurveSteps = 50;
constexpr int kLeastPointsHalved = 3;  // of an interval that is halved

VecX residuals(const StiffnessCurve& curve, const VecX& strain, const VecX& stress) {
  VecX r(strain.size());
  for (Eigen::Index i = 0; i < r.size(); ++i) r[i] = curve.respond(strain[i]).stress - stress[i];
  return r;
}

/// Gauss and Newton: the stress is linear in the values but where a slope is limited.
StiffnessCurve fitted(StiffnessCurve curve, const VecX& strain, const VecX& stress) {
  const Eigen::Index n = curve.size();
  VecX row(n);
  for (int iteration = 0; iteration < kMostCurveSteps; ++iteration) {
    const VecX r = residuals(curve, strain, stress);
    MatX normal = MatX::Zero(n, n);
    VecX gradient = VecX::Zero(n);
    for (Eigen::Index i = 0; i < strain.size(); ++i) {
      curve.stiffness_by_values(strain[i], row);
      row *= strain[i];
      normal += row * row.transpose();
      gradient += r[i] * row;
    }
    normal.diagonal().array() += 1e-12 * normal.diagonal().maxCoeff();
    const VecX values = curve.values();
    const VecX far = VecX::Constant(n, 1e3 * (values.maxCoeff() + 1e-300));
    const VecX step = minimize_in_box(normal, gradient, -values, far);
    double part = 1;
    StiffnessCurve next = curve;
    for (; part > 1e-6; part /= 2) {
      next.set_values((values + part * step).cwiseMax(0));
      if (residuals(next, strain, stress).squaredNorm() <= r.squaredNorm()) break;
    }
    if (part <= 1e-6) break;
    curve = next;
    if (step.norm() < 1e-10 * values.norm()) break;
  }
  return curve;
}

/// With a knot more; the same where no interval has enough points.
VecX refined(const StiffnessCurve& curve, const VecX& strain, const VecX& stress) {
  const VecX& knots = curve.knots();
  const VecX r = residuals(curve, strain, stress);
  VecX sums = VecX::Zero(knots.size() - 1), counts = sums;
  for (Eigen::Index i = 0; i < strain.size(); ++i) {
    Eigen::Index k = 0;
    while (k + 2 < knots.size() && strain[i] > knots[k + 1]) ++k;
    sums[k] += r[i] * r[i];
    counts[k] += 1;
  }
  for (Eigen::Index k = 0; k < sums.size(); ++k)
    if (counts[k] < kLeastPointsHalved) sums[k] = -1;
  Eigen::Index worst = 0;
  if (sums.maxCoeff(&worst) < 0) return knots;
  VecX more(knots.size() + 1);
  more << knots.head(worst + 1), 0.5 * (knots[worst] + knots[worst + 1]),
      knots.tail(knots.size() - worst - 1);
  return more;
}

}  // namespace

TabulatedCurveFit fit_tabulated_curve(const VecX& signed_strain, const VecX& signed_stress,
                                      int knots) {
  if (knots < 1 || knots > StiffnessCurve::kMostKnots)
    throw Error(
        fmt::format("curve: {} knots; valid is 1 to {}", knots, StiffnessCurve::kMostKnots));
  if (signed_strain.size() != signed_stress.size() || signed_strain.size() < knots)
    throw Error(fmt::format("curve: {} strains and {} stresses for {} knots", signed_strain.size(),
                            signed_stress.size(), knots));
  const VecX strain = signed_strain.cwiseAbs();
  const VecX stress = (signed_strain.array() < 0).select(-signed_stress, signed_stress);
  const double most = strain.maxCoeff();
  if (!(most > 0)) throw Error("curve: all strains are zero");
  const double constant = std::max(1e-300, strain.dot(stress) / strain.squaredNorm());
  StiffnessCurve curve(constant);
  if (knots > 1) curve = fitted({Vec2(0, most), Vec2(constant, constant)}, strain, stress);
  while (curve.size() < knots) {
    const VecX more = refined(curve, strain, stress);
    if (more.size() == curve.knots().size()) break;
    curve = fitted(curve.resampled(more), strain, stress);
  }
  TabulatedCurveFit fit;
  fit.curve = curve;
  fit.rms = std::sqrt(residuals(curve, strain, stress).squaredNorm() /
                      static_cast<double>(strain.size()));
  fit.relative = fit.rms / stress.cwiseAbs().maxCoeff();
  return fit;
}

}  // namespace weft
