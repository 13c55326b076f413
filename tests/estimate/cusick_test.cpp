#include "weft/estimate/cusick.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "weft/base/error.h"

namespace weft {
namespace {

constexpr double kPi = std::numbers::pi;

Fabric isotropic(double bend, double poisson) {
  Fabric fabric = Fabric::with_defaults("test", "stvk");
  fabric.set("bend_uu", bend);
  fabric.set("bend_uv", std::max(1e-12, poisson * bend));
  fabric.set("bend_vv", bend);
  fabric.set("bend_twist", 0.5 * (1 - poisson) * bend);
  return fabric;
}

TEST(DrapeCoefficient, IsOneForABoardAndZeroForTheSupport) {
  EXPECT_NEAR(drape_coefficient(kPi * 0.15 * 0.15), 1, 1e-12);
  EXPECT_NEAR(drape_coefficient(kPi * 0.09 * 0.09), 0, 1e-12);
  EXPECT_THROW(drape_coefficient(0.1, {.radius = 0.1, .support = 0.2}), Error);
}

TEST(CountLobes, CountsWhatStandsOut) {
  VecX outline(360);
  for (int folds : {1, 4, 7}) {
    for (int i = 0; i < 360; ++i)
      outline[i] = 0.13 + 0.01 * std::cos(folds * 2 * kPi * i / 360.0 + 0.7) +
                   1e-3 * std::cos(40 * 2 * kPi * i / 360.0);
    EXPECT_EQ(count_lobes(outline), folds);
  }
  EXPECT_EQ(count_lobes(VecX::Constant(360, 0.13)), 0);
}

// A shadow r = 0.12 + 0.01 cos 5 phi has the area pi (0.12^2 + 0.01^2 / 2).
TEST(DrapeShadowOfAMask, MeasuresAreaAndOutline) {
  const double pixel = 5e-4;
  Mask mask = Mask::Zero(600, 640);
  for (int i = 0; i < mask.rows(); ++i)
    for (int j = 0; j < mask.cols(); ++j) {
      const Vec2 p = pixel * Vec2(j - 330.3, i - 290.7);
      mask(i, j) = p.norm() < 0.12 + 0.01 * std::cos(5 * std::atan2(p.y(), p.x()));
    }
  const DrapeShadow shadow = shadow_of(mask, pixel);
  EXPECT_NEAR(shadow.area, kPi * (0.0144 + 0.00005), 2e-5);
  EXPECT_EQ(shadow.lobes, 5);
  EXPECT_NEAR(shadow.outline.maxCoeff(), 0.13, 2 * pixel);
  EXPECT_THROW(shadow_of(Mask::Zero(5, 5), pixel), Error);
  EXPECT_THROW(shadow_of(mask, 0), Error);
}

/// Deflection of the rim of a plate clamped at r = a, free at r = b, under the load q: with w' = t,
/// D (t'' + t' / r - t / r^2) = q (b^2 - r^2) / (2 r), t(a) = 0, t'(b) + nu t(b) / b = 0, by
/// shooting with Runge-Kutta (the equation is linear).
double plate_rim(double a, double b, double q, double d, double nu) {
  constexpr int kSteps = 4000;
  struct End {
    double w, t, s;
  };
  const auto shoot = [&](double s, double load) {
    double w = 0, t = 0;
    const double h = (b - a) / kSteps;
    const auto second = [&](double r, double angle, double slope) {
      return load * (b * b - r * r) / (2 * r * d) - slope / r + angle / (r * r);
    };
    for (int i = 0; i < kSteps; ++i) {
      const double r = a + i * h, m = r + h / 2;
      const double t1 = s, s1 = second(r, t, s);
      const double t2 = s + h / 2 * s1, s2 = second(m, t + h / 2 * t1, t2);
      const double t3 = s + h / 2 * s2, s3 = second(m, t + h / 2 * t2, t3);
      const double t4 = s + h * s3, s4 = second(r + h, t + h * t3, t4);
      w += h * t + h * h / 6 * (s1 + s2 + s3);
      t += h / 6 * (t1 + 2 * t2 + 2 * t3 + t4);
      s += h / 6 * (s1 + 2 * s2 + 2 * s3 + s4);
    }
    return End{w, t, s};
  };
  const End load = shoot(0, q), unit = shoot(1, 0);
  const double s = -(load.s + nu * load.t / b) / (unit.s + nu * unit.t / b);
  return load.w + s * unit.w;
}

TEST(SimulateDrape, AStiffDiscIsARingPlate) {
  // 0.2 mm at the rim: a plate without membrane stress.
  for (const double nu : {0.0, 0.3}) {
    const double density = 0.2, bend = 2e-2;
    DrapeOptions options;
    options.perturbation = 0;
    options.rings = 12;
    const DrapeShape shape = simulate_drape(isotropic(bend, nu), density, options);
    ASSERT_TRUE(shape.converged);
    // d angle / dr = kappa is counted upwards here: the sag is minus the deflection.
    const double expected = plate_rim(0.09, 0.15, density * 9.81, bend, nu);
    const double sag = -shape.x.row(2).rightCols(options.sectors).mean();
    EXPECT_NEAR(sag, std::abs(expected), 0.02 * std::abs(expected)) << nu;
    EXPECT_GT(shape.shadow.coefficient, 0.99);
    EXPECT_EQ(shape.shadow.lobes, 0);
  }
}

TEST(SimulateDrape, ALimpDiscFoldsAndFallsFurther) {
  DrapeOptions options;
  options.rings = 6;
  options.sectors = 48;
  double before = 1;
  for (const double bend : {2e-5, 3e-6}) {
    const DrapeShape shape = simulate_drape(isotropic(bend, 0), 0.15, options);
    EXPECT_TRUE(shape.converged) << bend;
    EXPECT_LT(shape.shadow.coefficient, before - 0.1) << bend;
    EXPECT_GE(shape.shadow.lobes, 2) << bend;
    before = shape.shadow.coefficient;
  }
  EXPECT_GT(before, 0);
}

TEST(SampleDrapes, SeedsGiveTheSameShapesOnAnyNumberOfThreads) {
  DrapeOptions options;
  options.rings = 4;
  options.sectors = 36;
  const auto one = sample_drapes(isotropic(2e-5, 0), 0.15, 2, options, 1);
  const auto two = sample_drapes(isotropic(2e-5, 0), 0.15, 2, options, 2);
  for (std::size_t i = 0; i < 2; ++i) EXPECT_EQ((one[i].x - two[i].x).norm(), 0);
  EXPECT_GT((one[0].x - one[1].x).norm(), 1e-3);
  EXPECT_THROW(sample_drapes(isotropic(2e-5, 0), 0.15, 0, options), Error);
}

}  // namespace
}  // namespace weft
