#include "weft/fabric/stiffness_curve.h"

#include <gtest/gtest.h>

#include <cmath>

#include "common/gradient_check.h"
#include "weft/base/error.h"

namespace weft::stiffness_curve_test {
namespace {

VecX numbers(std::initializer_list<double> list) {
  VecX out(static_cast<Eigen::Index>(list.size()));
  std::copy(list.begin(), list.end(), out.begin());
  return out;
}

/// Free slopes, a limited one (0.1 between 40 and 50), and one end on each side of zero.
StiffnessCurve smooth() { return {numbers({-0.02, 0.03, 0.07, 0.2}), numbers({40, 70, 60, 90})}; }
StiffnessCurve limited() { return {numbers({0, 0.1, 0.15, 0.3}), numbers({40, 0.1, 50, 0})}; }

/// Integral of k(s) s from 0 to c by the midpoint rule, extrapolated.
double quadrature(const StiffnessCurve& curve, double c) {
  const auto midpoint = [&](int n) {
    double sum = 0;
    for (int i = 0; i < n; ++i) {
      const double s = c * (i + 0.5) / n;
      sum += curve.stiffness(s) * s;
    }
    return sum * c / n;
  };
  return (4 * midpoint(20000) - midpoint(10000)) / 3;
}

TEST(StiffnessCurve, PassesThroughItsControlValuesAndIsConstantBeyond) {
  const StiffnessCurve curve = smooth();
  for (int i = 0; i < curve.size(); ++i)
    EXPECT_NEAR(curve.stiffness(curve.knots()[i]), curve.values()[i], 1e-12);
  EXPECT_EQ(curve.stiffness(-0.5), 40);
  EXPECT_EQ(curve.stiffness(0.5), 90);
  EXPECT_EQ(curve.slope(0.5), 0);
  EXPECT_EQ(StiffnessCurve(7).stiffness(-3), 7);
  EXPECT_EQ(StiffnessCurve(7).respond(0.2).energy, 0.5 * 7 * 0.2 * 0.2);
}

TEST(StiffnessCurve, TwoKnotsAreAStraightLine) {
  const StiffnessCurve curve(numbers({0, 0.2}), numbers({10, 50}));
  for (const double c : {0.01, 0.05, 0.1, 0.19})
    EXPECT_NEAR(curve.stiffness(c), 10 + 200 * c, 1e-12);
}

TEST(StiffnessCurve, EnergyAndTangentBelongToTheStress) {
  for (const StiffnessCurve& curve : {smooth(), limited()})
    for (const double c : {-0.3, -0.01, 0.0, 0.02, 0.05, 0.12, 0.17, 0.25, 0.4}) {
      const auto r = curve.respond(c);
      EXPECT_NEAR(r.stress, curve.stiffness(c) * c, 1e-14);
      // The midpoint rule errs by 1e-9 where k has a kink.
      EXPECT_NEAR(r.energy, quadrature(curve, c), 1e-8 * std::abs(r.energy) + 1e-15) << c;
      EXPECT_NEAR(r.tangent, curve.stiffness(c) + curve.slope(c) * c, 1e-12);
    }
  for (const double c : {-0.01, 0.02, 0.05, 0.12}) {
    const auto stress = [&](const VecX& at) { return smooth().respond(at[0]).stress; };
    EXPECT_NEAR(smooth().respond(c).tangent,
                testing::derivative(stress, numbers({c}), numbers({1}), 1e-4), 1e-7);
  }
}

TEST(StiffnessCurve, NeverNegative) {
  const StiffnessCurve curve = limited();
  double least = 1;
  for (int i = 0; i <= 3000; ++i) least = std::min(least, curve.stiffness(1e-4 * i));
  EXPECT_GE(least, -1e-12);
  // The free slope at 0.1 would be 532, and k fall to -0.6 before it; 3 k / h is the limit.
  EXPECT_NEAR(curve.slope(0.1), 3 * 0.1 / 0.1, 1e-12);
}

TEST(StiffnessCurve, DerivativesByTheControlValues) {
  for (const StiffnessCurve& curve : {smooth(), limited()})
    for (const double c : {-0.3, 0.01, 0.05, 0.12, 0.17, 0.25, 0.4}) {
      VecX stiffness(4), energy(4);
      curve.stiffness_by_values(c, stiffness);
      curve.energy_by_values(c, energy);
      const auto at = [&](const VecX& values) { return StiffnessCurve(curve.knots(), values); };
      for (int j = 0; j < 4; ++j) {
        if (curve.values()[j] == 0) continue;  // a difference would need a negative value
        const VecX unit = VecX::Unit(4, j);
        const double step = 1e-3 * curve.values()[j];
        EXPECT_NEAR(stiffness[j],
                    testing::derivative([&](const VecX& v) { return at(v).stiffness(c); },
                                        curve.values(), unit, step),
                    1e-8);
        EXPECT_NEAR(energy[j],
                    testing::derivative([&](const VecX& v) { return at(v).respond(c).energy; },
                                        curve.values(), unit, step),
                    1e-9);
      }
      EXPECT_NEAR(stiffness.dot(curve.values()), curve.stiffness(c), 1e-12 * 90);
    }
}

TEST(StiffnessCurve, SubdivisionKeepsTheShape) {
  const StiffnessCurve constant = StiffnessCurve(30).resampled(numbers({0, 0.1, 0.2}));
  const StiffnessCurve line =
      StiffnessCurve(numbers({0, 0.2}), numbers({10, 50})).resampled(numbers({0, 0.05, 0.1, 0.2}));
  // k = 10 + 1000 c^2
  const StiffnessCurve parabola = StiffnessCurve(numbers({0, 0.05, 0.2}), numbers({10, 12.5, 50}))
                                      .resampled(numbers({0, 0.02, 0.05, 0.16, 0.2}));
  for (const double c : {-0.1, 0.03, 0.07, 0.15, 0.3}) {
    EXPECT_NEAR(constant.stiffness(c), 30, 1e-12);
    EXPECT_NEAR(parabola.stiffness(c), 10 + 1000 * std::pow(std::clamp(c, 0.0, 0.2), 2), 1e-12);
    EXPECT_NEAR(line.stiffness(c), 10 + 200 * std::clamp(c, 0.0, 0.2), 1e-12);
  }
  // A knot more in a curve: only slopes near it change. Where k turns from rising to falling
  // within two segments, by up to 2.2 % of the curve's range here.
  const StiffnessCurve more = smooth().resampled(numbers({-0.02, 0.03, 0.05, 0.07, 0.13, 0.2}));
  for (int i = 0; i <= 100; ++i) {
    const double c = -0.02 + 0.0022 * i;
    EXPECT_NEAR(more.stiffness(c), smooth().stiffness(c), 0.03 * 50) << c;
  }
}

TEST(StiffnessCurve, RejectsWhatIsNoCurve) {
  EXPECT_THROW(StiffnessCurve(numbers({0, 0}), numbers({1, 2})), Error);
  EXPECT_THROW(StiffnessCurve(numbers({0, 1}), numbers({1})), Error);
  EXPECT_THROW(StiffnessCurve(numbers({0, 1}), numbers({1, -1})), Error);
  EXPECT_THROW(StiffnessCurve(numbers({0, NAN}), numbers({1, 1})), Error);
  EXPECT_THROW(StiffnessCurve(VecX(), VecX()), Error);
  EXPECT_THROW(StiffnessCurve(VecX::LinSpaced(9, 0, 1), VecX::Ones(9)), Error);
}

}  // namespace
}  // namespace weft::stiffness_curve_test
