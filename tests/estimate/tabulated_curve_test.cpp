#include "weft/estimate/tabulated_curve.h"

#include <gtest/gtest.h>

#include <cmath>

#include "weft/base/error.h"

namespace weft::tabulated_curve_test {
namespace {

TEST(TabulatedCurve, OneKnotIsTheSlopeThroughTheOrigin) {
  const VecX strain = VecX::LinSpaced(20, -1, 2);
  const TabulatedCurveFit fit = fit_tabulated_curve(strain, 3 * strain, 1);
  EXPECT_EQ(fit.curve.size(), 1);
  EXPECT_NEAR(fit.curve.stiffness(0.5), 3, 1e-9);
  EXPECT_LT(fit.relative, 1e-9);
}

TEST(TabulatedCurve, FindsACurveOfItsOwnKind) {
  const StiffnessCurve truth(Vec3(0, 1, 2), Vec3(5, 1, 4));
  const VecX strain = VecX::LinSpaced(41, 0, 2);
  VecX stress(41);
  for (int i = 0; i < 41; ++i) stress[i] = truth.respond(strain[i]).stress;
  const TabulatedCurveFit fit = fit_tabulated_curve(strain, stress, 3);
  EXPECT_LT(fit.relative, 1e-6);
  EXPECT_NEAR(fit.curve.stiffness(1.5), truth.stiffness(1.5), 1e-4);
}

// sigma = 1 - exp(-5 c): each knot takes off error.
TEST(TabulatedCurve, MoreKnotsFitBetter) {
  const VecX strain = VecX::LinSpaced(60, 0, 1.5);
  const VecX stress = 1 - (-5 * strain.array()).exp();
  double before = 1;
  for (int knots = 1; knots <= 5; ++knots) {
    const double now = fit_tabulated_curve(strain, stress, knots).relative;
    EXPECT_LT(now, before) << knots;
    before = now;
  }
  EXPECT_LT(before, 0.02);
}

TEST(TabulatedCurve, ValuesStayAboveZero) {
  const VecX strain = VecX::LinSpaced(30, 0, 1);
  const VecX stress = (strain.array() - 0.5).matrix();
  const TabulatedCurveFit fit = fit_tabulated_curve(strain, stress, 4);
  EXPECT_GE(fit.curve.values().minCoeff(), 0);
  EXPECT_THROW(fit_tabulated_curve(strain, stress.head(3), 2), Error);
  EXPECT_THROW(fit_tabulated_curve(VecX::Zero(5), VecX::Ones(5), 2), Error);
  EXPECT_THROW(fit_tabulated_curve(strain, stress, 9), Error);
}

}  // namespace
}  // namespace weft::tabulated_curve_test
