/// Overhang tests beside the heavy elastica.
#include <gmock/gmock.h>

#include <cmath>

#include "common/gradient_check.h"
#include "estimate/closed_forms.h"
#include "weft/capture/standard_test.h"
#include "weft/estimate/computed_overhang.h"
#include "weft/estimate/content_hash.h"
#include "weft/estimate/curve_fit.h"
#include "weft/estimate/mechanical_fit.h"

namespace weft::overhang_test {
namespace {

using ::testing::HasSubstr;

constexpr double kMembrane = 3000, kBend = 2e-5;  // N/m, N m
constexpr double kDensity = 0.2;                  // kg/m^2
constexpr double kWeight = 9.81 * kDensity;       // N/m^2

MechanicalCapture test_of(const VecX& lengths, double grain_angle = 0, double width = 0.02) {
  OverhangTest test;
  test.lengths = lengths;
  test.deviation = overhang_deviation(lengths);
  MechanicalCapture capture = overhang_capture({0, width, kDensity, grain_angle}, test);
  capture.name = "overhang";
  return capture;
}
MechanicalCapture test_of(double length, double grain_angle = 0, double width = 0.02) {
  return test_of(VecX::Constant(1, length), grain_angle, width);
}

std::shared_ptr<const MechanicalTrial> trial_of(const MechanicalCapture& capture, int cells = 6) {
  MechanicalOptions options;
  options.cells = cells;
  return prepare_mechanical(capture, options);
}

double computed(const MechanicalCapture& capture, const Fabric& fabric, int cells = 6) {
  return simulate_mechanical({trial_of(capture, cells)}, fabric)[0][0].overhang;
}

/// Of the elastica with any law.
double elastica_overhang(const BendLaw& law) {
  const auto above = [&](double length) {
    const ElasticaProfile profile = heavy_elastica(law, kWeight, length);
    const Vec2 tip = profile.at.col(profile.at.cols() - 1);
    return std::atan2(-tip.y(), tip.x()) > kCantileverAngle;
  };
  double low = 0.005, high = 0.2;
  for (int i = 0; i < 40; ++i) {
    const double middle = 0.5 * (low + high);
    (above(middle) ? high : low) = middle;
  }
  return low;
}

// A strip 4 times as long as wide, without Poisson effect: what the cells leave falls with them.
TEST(Overhang, OfEverySheetIsThatOfTheElastica) {
  const double expected = overhang_of_rigidity(kWeight, kBend);
  for (const auto& [fabric, strip] : test::elastic_cases(kMembrane, kBend)) {
    if (fabric.model == "springs") continue;
    const double coarse = computed(test_of(expected, 0, 0.01), fabric, 4) / expected - 1;
    const double fine = computed(test_of(expected, 0, 0.01), fabric, 8) / expected - 1;
    EXPECT_LT(std::abs(coarse), 0.01) << fabric.model;
    EXPECT_LT(std::abs(fine), 0.004) << fabric.model;
  }
}

// Readings decide nothing but where the mesh is made for.
TEST(Overhang, DoesNotDependOnWhatWasRead) {
  const Fabric fabric = test::elastic_cases(kMembrane, kBend)[3].fabric;
  const double expected = overhang_of_rigidity(kWeight, kBend);
  for (const double factor : {0.5, 0.9, 1.3, 3.0})
    EXPECT_NEAR(computed(test_of(factor * expected), fabric), expected, 0.01 * expected) << factor;
}

// A stiffening curve, and friction that counts from flat.
TEST(Overhang, FollowsTheLawOfTheBend) {
  Fabric fabric = test::elastic_cases(kMembrane, kBend)[5].fabric;
  ASSERT_EQ(fabric.model, "stvk-diagonal");
  const StiffnessCurve curve(Vec2(0, 30), Vec2(1e-5, 8e-5));
  fabric.set_curve("weft_bend", curve);
  const double stiffening = elastica_overhang({curve});
  EXPECT_NEAR(computed(test_of(0.05), fabric), stiffening, 0.005 * stiffening);
  fabric.set_curve("weft_bend", StiffnessCurve(kBend));
  for (const char* row : {"weft_bend_friction", "weft_bend_friction_scale"}) fabric.include(row);
  fabric.set("weft_bend_friction", 2e-4);
  fabric.set("weft_bend_friction_scale", 3);
  const double rubbing = elastica_overhang({StiffnessCurve(kBend), 2e-4, 3});
  EXPECT_GT(rubbing, 1.08 * overhang_of_rigidity(kWeight, kBend));
  EXPECT_NEAR(computed(test_of(0.05), fabric), rubbing, 0.005 * rubbing);
}

/// Orthotropic, of bends that differ by several times.
Fabric orthotropic() {
  Fabric fabric = test::elastic_cases(kMembrane, kBend)[3].fabric;
  fabric.set("bend_uu", 4e-5);
  fabric.set("bend_vv", 1e-5);
  fabric.set("bend_twist", 8e-6);
  return fabric;
}

// The compliance of a narrow strip at an angle to the threads, whose edges are free of moments:
// c^4 / D11 + s^4 / D22 + c^2 s^2 / D66. It twists, for D11 and D22 differ; the clamp, and that
// twisted cloth has to stretch, keep wider ones from it.
TEST(Overhang, OfABiasStripHasTheTwist) {
  const double rigidity = 4 / (1 / 4e-5 + 1 / 1e-5 + 1 / 8e-6);
  const double expected = overhang_of_rigidity(kWeight, rigidity);
  const auto off = [&](double width) {
    return computed(test_of(expected, 45 * kDegree, width), orthotropic()) / expected - 1;
  };
  const double narrow = off(0.001), wider = off(0.002);
  EXPECT_NEAR(narrow, 0, 0.01);
  EXPECT_GT(wider, narrow);
  EXPECT_NEAR(2 * narrow - wider, 0, 0.005);
}

// The same of a strip along the weft of a plate with Poisson effect: narrow, its edges curl and
// D11 - D12^2 / D22 is left; wide, it bends as a cylinder, D11.
TEST(Overhang, OfANarrowStripHasTheEdgesCurled) {
  Fabric fabric = orthotropic();
  fabric.set("bend_uv", 1.2e-5);
  const double rigidity = 4e-5 - 1.2e-5 * 1.2e-5 / 1e-5;
  const double strip = overhang_of_rigidity(kWeight, rigidity),
               plate = overhang_of_rigidity(kWeight, 4e-5);
  EXPECT_NEAR(computed(test_of(strip, 0, 0.001), fabric), strip, 0.015 * strip);
  const double wide = computed(test_of(plate, 0, 0.2), fabric);
  EXPECT_GT(wide, strip + 0.85 * (plate - strip));
  EXPECT_LT(wide, plate);
}

// The slope over the length is a difference of equilibria, to some 1e-6.
TEST(Overhang, DerivativesAreThoseOfDifferences) {
  auto cases = test::elastic_cases(kMembrane, kBend);
  cases.pop_back();
  cases.push_back({orthotropic(), {}});
  for (const auto& [fabric, strip] : cases) {
    const double grain = fabric.model == "stvk" ? 30 * kDegree : 0;
    const auto trial = trial_of(test_of(0.05, grain), 3);
    const VecX scale = fabric.values.cwiseMax(1e-12);
    const auto overhang = [&](const VecX& relative) {
      Fabric other = fabric;
      other.values = fabric.values + relative.cwiseProduct(scale);
      return simulate_mechanical({trial}, other)[0][0].overhang;
    };
    const MechanicalFrame frame =
        simulate_mechanical({trial}, fabric, MechanicalDerivatives::all)[0][0];
    ASSERT_EQ(frame.overhang_derivative.size(), fabric.values.size());
    VecX analytic = frame.overhang_derivative.cwiseProduct(scale), numeric = analytic;
    for (Eigen::Index p = 0; p < numeric.size(); ++p) {
      if (std::abs(analytic[p]) < 1e-9) continue;  // next to none: damping, a missing coupling
      numeric[p] = testing::derivative(overhang, VecX(VecX::Zero(scale.size())),
                                       VecX(VecX::Unit(scale.size(), p)), 1e-2);
    }
    // A step across a knot of its bend errs by as much as the step's part of the slopes' jump.
    const double tolerance = fabric.model == "piecewise-linear" ? 1e-3 : 1e-5;
    EXPECT_TRUE(testing::near(analytic, numeric, tolerance)) << fabric.model;
  }
}

TEST(Overhang, FitFindsTheBendOfTheElastica) {
  const double overhang = overhang_of_rigidity(kWeight, kBend);
  const Vec3 readings(overhang - 5e-4, overhang + 7e-4, overhang - 2e-4);
  Fabric start = test::elastic_cases(kMembrane, kBend)[3].fabric;
  start.set("bend_uu", 3e-4);
  MechanicalFitOptions options;
  options.first_cells = FirstCells::as_given;
  const MechanicalProblem problem({trial_of(test_of(readings), 8)}, start, {"bend_uu"});
  EXPECT_EQ(problem.residual_count(), 3);
  const MechanicalFitResult fit = fit_mechanical(problem, start, options);
  // B goes with the third power of the length, of which the cells leave 0.4 %.
  EXPECT_NEAR(fit.fabric.value("bend_uu"), kBend, 0.015 * kBend);
  // What is left is the scatter: 2 of 3 times its own variance.
  EXPECT_NEAR(fit.cost, 2.0 / 3, 1e-6);
  ASSERT_EQ(fit.intervals.size(), 1u);
  EXPECT_TRUE(fit.intervals[0].determined);
  EXPECT_LT(fit.intervals[0].lower, kBend);
  EXPECT_GT(fit.intervals[0].upper, kBend);
  EXPECT_LT(fit.evaluations, 15u);
}

// Half of a range: of one reading the noise decides, dB / B = 3 dL / L.
TEST(Overhang, IntervalOfOneReadingIsItsDeviation) {
  const double overhang = overhang_of_rigidity(kWeight, kBend);
  const Fabric start = test::elastic_cases(kMembrane, kBend)[3].fabric;
  const MechanicalProblem problem({trial_of(test_of(overhang), 3)}, start, {"bend_uu"});
  const MechanicalFitResult fit = fit_mechanical(problem, start);
  const double half = 0.5 * std::log(fit.intervals[0].upper / fit.intervals[0].lower);
  EXPECT_NEAR(half, 1.6449 * 3 * 1e-3 / overhang, 0.02 * half);
}

TEST(Overhang, StripsOfThreeDirectionsGoTogether) {
  const Fabric truth = orthotropic();
  std::vector<std::shared_ptr<const MechanicalTrial>> trials;
  for (const double angle : {0.0, 90.0, 45.0})
    trials.push_back(
        trial_of(test_of(computed(test_of(0.05, angle * kDegree), truth, 4), angle * kDegree), 4));
  Fabric start = truth;
  for (const char* name : {"bend_uu", "bend_vv", "bend_twist"}) start.set(name, 2e-5);
  const MechanicalFitResult fit =
      fit_mechanical(MechanicalProblem(trials, start, {"bend_uu", "bend_vv", "bend_twist"}), start);
  for (const char* name : {"bend_uu", "bend_vv", "bend_twist"})
    // The meshes are made for other lengths than the truth's, 0.05 m.
    EXPECT_NEAR(fit.fabric.value(name), truth.value(name), 0.02 * truth.value(name)) << name;
}

TEST(Overhang, OfEachReadingIsCompared) {
  const auto trial = trial_of(test_of(Vec2(0.04, 0.05)), 3);
  const auto frames = simulate_mechanical({trial}, orthotropic())[0];
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_EQ(frames[0].overhang, frames[1].overhang);
  const MechanicalEvaluation evaluation = compare_mechanical(*trial, frames);
  ASSERT_TRUE(evaluation.overhang);
  EXPECT_NEAR(evaluation.overhang->measured, 0.045, 1e-15);
  EXPECT_EQ(evaluation.overhang->computed, frames[0].overhang);
  EXPECT_NEAR(evaluation.frames[1].overhang, frames[0].overhang - 0.05, 1e-15);
  const double first = evaluation.frames[0].overhang, second = evaluation.frames[1].overhang;
  EXPECT_NEAR(evaluation.overhang->rms, std::sqrt((first * first + second * second) / 2), 1e-15);
  // The strip of the picture overhangs by the mean.
  const MaterialPoints line = middle_line(trial->capture, trial->stages[0].mesh, frames[0].x);
  EXPECT_NEAR(profile_arc(line)[line.cols() - 1], 0.045, 1e-4);
  EXPECT_NEAR(line.col(0).norm(), 0, 1e-12);
}

TEST(Overhang, StartsFromAnEarlierShapeComeToTheSame) {
  const auto trial = trial_of(test_of(Vec2(0.04, 0.05)), 3);
  Fabric other = orthotropic();
  other.set("bend_uu", 5e-5);
  const MechanicalFrames near = simulate_mechanical({trial}, other);
  const double from_near =
      simulate_mechanical({trial}, orthotropic(), MechanicalDerivatives::none, 1, &near)[0][1]
          .overhang;
  EXPECT_NEAR(from_near, simulate_mechanical({trial}, orthotropic())[0][1].overhang, 1e-9);
}

TEST(Overhang, SaysWhereThereIsNone) {
  // 0.9 mm would do, but strips are at least 1 mm long.
  Fabric fabric = test::elastic_cases(kMembrane, kBend)[3].fabric;
  fabric.set("bend_uu", 1e-8);
  MechanicalCapture capture = test_of(1.2e-3, 0, 1e-3);
  capture.areal_density = 10;
  const MechanicalProblem problem({trial_of(capture, 3)}, fabric, {"bend_uu"});
  std::string reason;
  EXPECT_FALSE(std::isfinite(problem.cost(problem.scaled(fabric), &reason)));
  EXPECT_THAT(reason, HasSubstr("overhang: no overhang of 0.001 to 10 m at which the strip reaches "
                                "41.5 degrees"));
}

TEST(Overhang, IsATestOfTheBendAlongItsStrip) {
  using enum IsolatedStrain;
  EXPECT_EQ(isolated_strain(test_of(0.05)), weft_bend);
  EXPECT_EQ(isolated_strain(test_of(0.05, 90 * kDegree)), warp_bend);
  EXPECT_EQ(isolated_strain(test_of(0.05, 20 * kDegree)), weft_bend);
  for (const double angle : {45.0, -45.0, 135.0})
    EXPECT_EQ(isolated_strain(test_of(0.05, angle * kDegree)), diagonal_bend) << angle;
}

// One number a curve is no reason for a second control point.
TEST(Overhang, OneReadingIsAConstantBend) {
  Fabric start = test::elastic_cases(kMembrane, kBend)[5].fabric;
  start.set("weft_bend", 1e-5);
  CurveFitOptions options;
  options.shape = CurveShape::subdivided;
  const CurveFitResult fit =
      fit_curves({trial_of(test_of(0.05), 3)}, start, {"weft_bend"}, options);
  EXPECT_EQ(fit.fit.fabric.value_count("weft_bend"), 1);
  const double expected = rigidity_of_overhang(kWeight, 0.05);
  EXPECT_NEAR(fit.fit.fabric.value("weft_bend"), expected, 0.05 * expected);
}

TEST(Overhang, OtherReadingsAreAnotherTrial) {
  const auto hash_of = [](const MechanicalCapture& capture) {
    ContentHash hash;
    add_trial(hash, *trial_of(capture, 3));
    return hash.hex();
  };
  const MechanicalCapture capture = test_of(Vec2(0.04, 0.05));
  MechanicalCapture other = capture;
  other.overhang->lengths = Vec2(0.041, 0.049);
  EXPECT_NE(hash_of(other), hash_of(capture));
  other = capture;
  other.overhang->angle = 0.7;
  EXPECT_NE(hash_of(other), hash_of(capture));
  other = capture;
  other.overhang->deviation = 2e-3;
  EXPECT_NE(hash_of(other), hash_of(capture));
}

}  // namespace
}  // namespace weft::overhang_test
