#pragma once
/// Central finite differences as a judge of analytic derivatives.
///
/// With a step h the difference (f(x + h d) - f(x - h d)) / 2h errs by a truncation term of order
/// h^2 f''' and by rounding of order eps |f| / h. `derivative` takes the steps h and h / 2 and
/// removes the h^2 term (Richardson), which leaves h^4 f^(5) and about 4 eps |f| / h. For a
/// function with length scale L (it changes by its own size over L) the sum is smallest near h = L
/// eps^(1/5) ~ 1e-3 L, where it is about 1e-12 |f| / L. The checks allow `kTolerance` = 1e-8 of the
/// largest entry: four digits of room for functions that are not benign, and six digits below any
/// wrong sign, factor or term.
#include <gtest/gtest.h>

#include <algorithm>

#include "weft/base/types.h"

namespace weft::testing {

inline constexpr double kTolerance = 1e-8;

/// d f(x + s direction) / ds at s = 0. `f` takes a VecX and returns a VecX or a double.
template <class F>
auto derivative(const F& f, const VecX& x, const VecX& direction, double step) {
  const auto central = [&](double h) {
    const VecX ahead = x + h * direction, behind = x - h * direction;
    return decltype(f(x))((f(ahead) - f(behind)) / (2 * h));
  };
  const auto coarse = central(step);
  const auto fine = central(0.5 * step);
  return decltype(f(x))((4 * fine - coarse) / 3);
}

/// Gradient of a scalar function, entry by entry.
template <class F>
VecX numeric_gradient(const F& f, const VecX& x, double step) {
  VecX gradient(x.size());
  for (Eigen::Index i = 0; i < x.size(); ++i)
    gradient[i] = derivative(f, x, VecX::Unit(x.size(), i), step);
  return gradient;
}

/// Jacobian of a vector function, column by column.
template <class F>
MatX numeric_jacobian(const F& f, const VecX& x, double step) {
  MatX jacobian;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const VecX column = derivative(f, x, VecX::Unit(x.size(), i), step);
    if (i == 0) jacobian.resize(column.size(), x.size());
    jacobian.col(i) = column;
  }
  return jacobian;
}

/// Entries differ by at most `tolerance` times the largest entry of either (or `floor`, if larger,
/// where both may vanish).
inline ::testing::AssertionResult near(const MatX& analytic, const MatX& numeric,
                                       double tolerance = kTolerance, double floor = 0) {
  if (analytic.rows() != numeric.rows() || analytic.cols() != numeric.cols())
    return ::testing::AssertionFailure() << "different shapes";
  if (!analytic.allFinite() || !numeric.allFinite())
    return ::testing::AssertionFailure() << "not finite";
  if (analytic.size() == 0) return ::testing::AssertionSuccess();
  const double scale =
      std::max({analytic.cwiseAbs().maxCoeff(), numeric.cwiseAbs().maxCoeff(), floor});
  Eigen::Index row = 0, column = 0;
  const double difference = (analytic - numeric).cwiseAbs().maxCoeff(&row, &column);
  if (difference <= tolerance * scale) return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure()
         << "entry (" << row << ", " << column << "): " << analytic(row, column) << " against "
         << numeric(row, column) << ", off by " << difference / scale << " of the largest entry";
}

}  // namespace weft::testing
