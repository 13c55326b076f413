#include "weft/estimate/homogeneous_strip.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numbers>

#include "common/temporary_folder.h"
#include "weft/base/error.h"
#include "weft/estimate/mechanical_trial.h"
#include "weft/model/friction.h"

namespace weft::homogeneous_strip_test {
namespace {

constexpr double kA11 = 400, kA12 = 60, kA22 = 150, kA66 = 30;

Fabric stvk() {
  Fabric fabric = Fabric::with_defaults("test", "stvk");
  fabric.set("membrane_uu", kA11);
  fabric.set("membrane_uv", kA12);
  fabric.set("membrane_vv", kA22);
  fabric.set("membrane_shear", kA66);
  return fabric;
}

double force_at(const Fabric& fabric, double stretch, double angle = 0,
                StripSides sides = StripSides::free) {
  return HomogeneousStrip(fabric, angle, sides).pull(VecX::Constant(1, stretch))[0].force;
}

// F = stretch (A11 - A12^2 / A22) E with E = (stretch^2 - 1) / 2; held sides: stretch A11 E.
TEST(HomogeneousStrip, StVenantKirchhoffAlongTheThreads) {
  const double stretch = 1.12, green = 0.5 * (stretch * stretch - 1);
  EXPECT_NEAR(force_at(stvk(), stretch), stretch * (kA11 - kA12 * kA12 / kA22) * green, 1e-8);
  EXPECT_NEAR(force_at(stvk(), stretch, 0, StripSides::held), stretch * kA11 * green, 1e-8);
  const StripState state = HomogeneousStrip(stvk()).pull(VecX::Constant(1, stretch))[0];
  EXPECT_NEAR(0.5 * (state.lateral * state.lateral - 1), -kA12 / kA22 * green, 1e-9);
  const double across = std::numbers::pi / 2;
  EXPECT_NEAR(force_at(stvk(), stretch, across), stretch * (kA22 - kA12 * kA12 / kA11) * green,
              1e-8);
}

// The slope at no strain is off-axis lamina theory's: 1 / E = c^4 / E1 + s^4 / E2 + c^2 s^2 (1 / G
// - 2 nu12 / E1), with free shear.
TEST(HomogeneousStrip, SlopeAtAnAngleIsThatOfALamina) {
  const double e1 = kA11 - kA12 * kA12 / kA22, e2 = kA22 - kA12 * kA12 / kA11, nu = kA12 / kA22;
  for (const double degrees : {15.0, 45.0, 60.0}) {
    const double angle = degrees * std::numbers::pi / 180, c = std::cos(angle), s = std::sin(angle);
    const double compliance =
        std::pow(c, 4) / e1 + std::pow(s, 4) / e2 + c * c * s * s * (1 / kA66 - 2 * nu / e1);
    const double h = 1e-5;
    EXPECT_NEAR((force_at(stvk(), 1 + h, angle) - force_at(stvk(), 1 - h, angle)) / (2 * h),
                1 / compliance, 1e-4 / compliance)
        << degrees;
  }
}

// Soft constraints without coupling: force k(e) e with e the relative elongation.
TEST(HomogeneousStrip, CurveOnRelativeElongation) {
  Fabric fabric = Fabric::with_defaults("test", "soft-constraints");
  const StiffnessCurve curve(Vec3(0, 0.1, 0.3), Vec3(50, 80, 400));
  fabric.set_curve("weft_stretch", curve);
  for (const double e : {0.02, 0.15, 0.28})
    EXPECT_NEAR(force_at(fabric, 1 + e), curve.respond(e).stress, 1e-8);
}

// Friction on Green strain: the second Piola-Kirchhoff stress is the spring's and the Dahl
// element's. Forth and back.
TEST(HomogeneousStrip, FrictionGoesAlongWithThePull) {
  Fabric fabric = Fabric::with_defaults("test", "stvk-diagonal");
  fabric.set("weft_stretch", 300);
  fabric.include("weft_stretch_friction");
  fabric.include("weft_stretch_friction_scale");
  fabric.set("weft_stretch_friction", 8);
  fabric.set("weft_stretch_friction_scale", 0.01);
  VecX stretches(4);
  stretches << 1.03, 1.08, 1.05, 1.02;
  HomogeneousStrip strip(fabric);
  for (int run = 0; run < 2; ++run) {  // the second starts from flat again
    const auto states = strip.pull(stretches);
    double green = 0, stress = 0;
    for (int i = 0; i < 4; ++i) {
      const double next = 0.5 * (stretches[i] * stretches[i] - 1);
      stress = detail::respond({8, 0.01}, next, green, stress).stress;
      green = next;
      EXPECT_NEAR(states[static_cast<std::size_t>(i)].force, stretches[i] * (300 * green + stress),
                  1e-7);
    }
  }
}

TEST(HomogeneousStrip, DerivativesAgreeWithDifferences) {
  Fabric fabric = Fabric::with_defaults("test", "stvk-diagonal");
  fabric.set_curve("weft_stretch", {Vec2(0, 0.2), Vec2(200, 500)});
  fabric.set("warp_stretch", 150);
  fabric.set("shear", 40);
  fabric.include("stretch_coupling");
  fabric.set("stretch_coupling", 30);
  for (const char* row : {"weft_stretch_friction", "weft_stretch_friction_scale"})
    fabric.include(row);
  VecX stretches(3);
  stretches << 1.05, 1.1, 1.07;
  const double angle = 0.5;
  HomogeneousStrip strip(fabric, angle);
  HomogeneousStrip::Derivatives derivatives;
  strip.pull(stretches, &derivatives);
  for (Eigen::Index p = 0; p < fabric.values.size(); ++p) {
    const double h = 1e-5 * fabric.values[p];
    VecX values = fabric.values;
    values[p] += h;
    strip.set_parameters(values);
    const auto above = strip.pull(stretches);
    values[p] -= 2 * h;
    strip.set_parameters(values);
    const auto below = strip.pull(stretches);
    for (std::size_t i = 0; i < 3; ++i) {
      const auto row = static_cast<Eigen::Index>(i);
      const double force = (above[i].force - below[i].force) / (2 * h);
      const double lateral = (above[i].lateral - below[i].lateral) / (2 * h);
      // Equilibria are converged to 1e-11 of the stiffness.
      EXPECT_NEAR(derivatives.force(row, p), force, 1e-5 * std::abs(force) + 1e-7) << p;
      EXPECT_NEAR(derivatives.lateral(row, p), lateral, 1e-5 * std::abs(lateral) + 1e-8) << p;
    }
  }
}

// A long strip between jaws, cut at 30 degrees: its middle is the homogeneous one. What the jaws
// keep from contracting and shearing is about a width at each end.
TEST(HomogeneousStrip, IsTheLimitOfALongStripBetweenJaws) {
  const double angle = std::numbers::pi / 6, extension = 0.04;
  const double expected = force_at(stvk(), 1 + extension, angle);
  double error[2];
  for (const int i : {0, 1}) {
    const double width = i == 0 ? 0.01 : 0.005, length = 0.1, depth = 0.005;
    MechanicalCapture capture;
    capture.width = length + 2 * depth;
    capture.height = width;
    capture.areal_density = 0.1;
    capture.grain_angle = angle;
    capture.gravity.setZero();
    capture.frame_count = 1;
    for (const double u : {0.0, length + depth}) {
      MechanicalFixture jaw;
      jaw.frames.resize(1);
      jaw.frames[0].region = {{u, 0}, {u + depth, width}};
      const double pull = u > 0 ? extension * length : 0;
      jaw.frames[0].position = Vec3(u + depth / 2 + pull, width / 2, 0);
      capture.fixtures.push_back(jaw);
    }
    MechanicalOptions options;
    options.cells = 4;
    const auto trial = prepare_mechanical(capture, options);
    const auto frames = simulate_mechanical({trial}, stvk());
    ASSERT_TRUE(frames[0][0].converged);
    error[i] = frames[0][0].forces(0, 1) / width / expected - 1;
  }
  EXPECT_LT(std::abs(error[0]), 0.05);
  EXPECT_LT(std::abs(error[1]), 0.6 * std::abs(error[0]));
}

TEST(FitStrips, RecoversOrthotropicConstantsFromThreeAngles) {
  std::vector<StripTest> tests;
  for (const double degrees : {0.0, 45.0, 90.0}) {
    StripTest test;
    test.grain_angle = degrees * std::numbers::pi / 180;
    test.stretch = VecX::LinSpaced(6, 1.01, 1.06);
    const auto states = HomogeneousStrip(stvk(), test.grain_angle).pull(test.stretch);
    test.force.resize(6);
    test.lateral.resize(6);
    for (int i = 0; i < 6; ++i) {
      test.force[i] = states[static_cast<std::size_t>(i)].force;
      test.lateral[i] = states[static_cast<std::size_t>(i)].lateral;
    }
    test.lateral_noise = 0.01;
    tests.push_back(test);
  }
  Fabric start = stvk();
  for (Eigen::Index i = 0; i < 4; ++i) start.values[i] *= i == 1 ? 1 : 3;
  const StripFit fit =
      fit_strips(tests, start, {"membrane_uu", "membrane_uv", "membrane_vv", "membrane_shear"});
  EXPECT_LT(fit.cost, 1e-6);
  for (Eigen::Index i = 0; i < 4; ++i)
    EXPECT_NEAR(fit.fabric.values[i] / stvk().values[i], 1, 1e-3) << i;
  tests[0].force.conservativeResize(3);
  EXPECT_THROW(fit_strips(tests, start, {"membrane_uu"}), Error);
}

// The tensile test of the KES-F, simulated: its maximum load at the elongation EMT.
TEST(HomogeneousStrip, PullsAFabricOfKesNumbersToItsLoad) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "numbers.toml";
  std::ofstream(path) << "format = \"weft-kes\"\nversion = 1\n"
                         "[weft]\nEMT = 6\nLT = 0.6\nG = 0.8\nB = 0.07\n"
                         "[warp]\nEMT = 4\nLT = 0.8\nG = 1\nB = 0.1\n";
  const Fabric fabric = find_fabric(path.string());
  const double load = 500 * 0.980665;  // gf/cm in N/m
  EXPECT_NEAR(force_at(fabric, 1.06), load, 1e-6);
  EXPECT_NEAR(force_at(fabric, 1.04, std::numbers::pi / 2), load, 1e-6);
}

TEST(HomogeneousStrip, RefusesSprings) {
  EXPECT_THROW(HomogeneousStrip(Fabric::with_defaults("s", "springs")), Error);
}

}  // namespace
}  // namespace weft::homogeneous_strip_test
