/// Fits that know the noise of the clips.
#include "weft/estimate/force_weights.h"

#include <gtest/gtest.h>

#include <cmath>

#include "common/gradient_check.h"
#include "weft/base/random.h"
#include "weft/dynamics/clip_poses.h"
#include "weft/estimate/cord_friction.h"
#include "weft/estimate/mechanical_fit.h"
#include "weft/estimate/mechanical_rig.h"

namespace weft::force_weights_test {
namespace {

using Trials = std::vector<std::shared_ptr<const MechanicalTrial>>;

Clip clip_of(const Vec2& size) {
  Clip clip;
  clip.region.upper = size;
  return clip;
}

// Turns move the ends of a clip, half of its longer side from its centre, by the noise.
TEST(PoseDeviations, TurnsMoveTheEndsOfAClipByItsNoise) {
  const VecX found = pose_deviations({clip_of({0.08, 0.01}), clip_of({0.02, 0.1})}, 1e-5);
  ASSERT_EQ(found.size(), 12);
  EXPECT_EQ(found.segment<3>(0), Vec3::Constant(1e-5));
  EXPECT_TRUE(found.segment<3>(3).isApprox(Vec3::Constant(1e-5 / 0.04), 1e-14));
  EXPECT_EQ(found.segment<3>(6), Vec3::Constant(1e-5));
  EXPECT_TRUE(found.segment<3>(9).isApprox(Vec3::Constant(1e-5 / 0.05), 1e-14));
}

MechanicalOptions coarse_mesh() {
  MechanicalOptions options;
  options.cells = 3;
  options.pattern = GridPattern::uniform;
  return options;
}

Fabric stiff_fabric() {
  Fabric fabric = Fabric::with_defaults("stiff", "stvk-diagonal");
  fabric.areal_density = 0.3;
  fabric.set("weft_stretch", 12000);
  fabric.set("warp_stretch", 9000);
  fabric.set("shear", 40);
  return fabric;
}

/// What the rig would be told to do, with forces computed on the fit's own mesh, friction along the
/// ways of the exact clips, and noise.
std::shared_ptr<const MechanicalTrial> on_own_mesh(RigTest test, std::uint64_t seed,
                                                   double cord_friction = 0,
                                                   const Fabric& fabric = stiff_fabric()) {
  RigOptions options;
  options.steps = 8;
  MechanicalCapture capture = rig_layout(test, fabric, options);
  const auto frames = simulate_mechanical({prepare_mechanical(capture, coarse_mesh())}, fabric)[0];
  Rng rng(seed);
  const auto noise = [&](double deviation) {
    return Vec3(deviation * Vec3(rng.normal(), rng.normal(), rng.normal()));
  };
  const std::vector<Points> ways = ways_of_clips(capture, 1e-9);
  capture.clip_noise = 12.5e-6;
  if (cord_friction > 0) capture.drive = ClipDrive::cords;
  for (std::size_t c = 0; c < capture.fixtures.size(); ++c) {
    MechanicalFixture& fixture = capture.fixtures[c];
    fixture.forces.resize(3, capture.frame_count);
    for (int k = 0; k < capture.frame_count; ++k) {
      const auto frame = static_cast<std::size_t>(k);
      fixture.forces.col(k) = frames[frame].forces.col(static_cast<Eigen::Index>(c)) + noise(3e-3) +
                              cord_friction * ways[c].col(k);
      Clip& clip = fixture.frames[frame];
      const double half_length = 0.5 * (clip.region.upper - clip.region.lower).maxCoeff();
      const Vec3 turn = noise(capture.clip_noise / half_length);
      clip.position += noise(capture.clip_noise);
      clip.rotation = Eigen::AngleAxisd(turn.norm(), turn.normalized()) * clip.rotation;
    }
  }
  return prepare_mechanical(capture, coarse_mesh());
}

/// Tests of the stiff fabric, whose clips go some 0.4 mm in stretch, its truth on another mesh.
Trials measured(const std::vector<RigTest>& tests, std::uint64_t seed, double cord_friction = 0) {
  RigOptions options;
  options.steps = 8;
  options.point_lines = 4;
  options.mesh.cells = 3;
  options.noise.cord_friction = 2 * cord_friction;
  options.seed = seed;
  Trials trials;
  for (const RigTest test : tests)
    trials.push_back(
        prepare_mechanical(simulate_rig(test, stiff_fabric(), options).capture, coarse_mesh()));
  return trials;
}

// At what made the measurement the mean square of what is weighed is 1, in every test.
TEST(ForceWeights, DifferencesAreAsLargeAsTheirNoise) {
  const Fabric truth = stiff_fabric();
  for (const RigTest test : {RigTest::weft_stretch, RigTest::shear}) {
    double weighed = 0, plain = 0, count = 0;
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      MechanicalProblem problem({on_own_mesh(test, seed)}, truth, {"weft_stretch"});
      ASSERT_TRUE(problem.has_clip_noise());
      const VecX x = problem.scaled(truth);
      plain += problem.cost(x) / 3;
      problem.weigh_by(problem.force_weights(x));
      weighed += problem.cost(x) / 3;
      count += problem.residual_count();
    }
    EXPECT_GT(plain, 100) << name_of(test);
    EXPECT_NEAR(weighed, 1, 4 * std::sqrt(2 / count)) << name_of(test);
  }
}

TEST(ForceWeights, AreHeldWhileTheFabricChanges) {
  Fabric fabric = stiff_fabric();
  MechanicalProblem problem(measured({RigTest::shear}, 1, 0.05), fabric, {"weft_stretch", "shear"});
  const VecX x = problem.scaled(fabric);
  const std::string before = problem.fingerprint();
  problem.weigh_by(problem.force_weights(x));
  EXPECT_NE(problem.fingerprint(), before);
  fabric.set("weft_stretch", 14000);
  const VecX there = problem.scaled(fabric);
  const auto found = problem.linearize(there);
  EXPECT_NEAR(found.model.cost, problem.cost(there), 1e-9 * found.model.cost);
  const VecX numeric =
      testing::numeric_gradient([&](const VecX& at) { return problem.cost(at); }, there, 1e-4);
  EXPECT_TRUE(testing::near(found.model.gradient, numeric, 1e-4));
}

TEST(ForceWeights, AreThoseOfTheEndOfAFit) {
  const Fabric truth = stiff_fabric();
  const Trials trials = measured({RigTest::weft_stretch, RigTest::warp_stretch}, 2);
  const std::vector<std::string> free{"weft_stretch", "warp_stretch"};
  Fabric start = truth;
  for (const std::string& name : free) start.set(name, 5 * truth.value(name));
  const MechanicalProblem problem(trials, start, free);
  const MechanicalFitResult fit = fit_mechanical(problem, start);
  const ForceWeights expected = problem.force_weights(problem.scaled(fit.fabric));
  ASSERT_EQ(fit.weights.size(), 2u);
  EXPECT_TRUE(
      fit.weights[1][3].shared.by_errors().isApprox(expected[1][3].shared.by_errors(), 1e-2));
  // With the weights of the start forces weigh up to five times less.
  EXPECT_LT(fit.cost_first, 0.8 * fit.cost);
  EXPECT_NEAR(fit.cost, 1, 0.3);
  EXPECT_EQ(assess_mechanical(problem, fit.fabric).fabric.values, fit.fabric.values);
  for (const ParameterInterval& p : fit.intervals) {
    EXPECT_LT(p.lower, truth.value(p.name));
    EXPECT_GT(p.upper, truth.value(p.name));
    EXPECT_NEAR(p.value, truth.value(p.name), 0.02 * truth.value(p.name));
  }
}

// A pose that is off by 0.0125 mm hides it in the forces along the way of a stretch; it is not to
// be denied for what the other directions seem to say.
TEST(ForceWeights, DoNotDenyTheFrictionOfTheCords) {
  const Fabric truth = stiff_fabric();
  const RigTest tests[] = {RigTest::weft_stretch, RigTest::warp_stretch, RigTest::shear};
  int held = 0;
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    Trials trials;
    for (const RigTest test : tests)
      trials.push_back(on_own_mesh(test, 10 * seed + static_cast<std::uint64_t>(test), 0.05));
    const MechanicalProblem problem(trials, truth, {"weft_stretch", "warp_stretch", "shear"});
    const MechanicalFitResult fit = fit_mechanical(problem, truth);
    ASSERT_EQ(fit.cord_friction.size(), 3u);
    for (const CordFrictionEstimate& friction : fit.cord_friction) {
      const ParameterInterval& p = friction.interval;
      if (p.lower <= 0.05 && p.upper >= 0.05) ++held;
      if (tests[friction.trial] == RigTest::shear)
        EXPECT_NEAR(p.value, 0.05, 0.01) << "seed " << seed;
      else
        EXPECT_GT(p.upper, 0.05) << p.name << ", seed " << seed;
    }
  }
  EXPECT_GE(held, 5);
}

/// Many points of a stretch test on a mesh like that of its fit, and no friction.
RigOptions many_points() {
  RigOptions options;
  options.steps = 8;
  options.point_lines = 15;
  options.mesh.cells = 3;
  options.mesh.pattern = GridPattern::uniform;
  options.noise.cord_friction = 0;
  return options;
}

// Hundreds of points know how far two clips have moved apart better than the clips do, where they
// are compared beside the forces: the stretch is then known better than from forces alone.
TEST(ForceWeights, PointsTellWhereClipsAre) {
  const Fabric truth = stiff_fabric();
  RigOptions options = many_points();
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    options.seed = seed;
    const auto made = simulate_rig(RigTest::weft_stretch, truth, options);
    const Trials trials{prepare_mechanical(made.capture, made.geometry, coarse_mesh())};
    const auto deviation = [&](MechanicalResiduals kind) {
      MechanicalCostOptions cost;
      cost.residuals = kind;
      MechanicalProblem problem(trials, truth, {"weft_stretch"}, cost);
      const VecX x = problem.scaled(truth);
      problem.weigh_by(problem.force_weights(x));
      const auto found = problem.linearize(x);
      // Noise as stated, also where all poses are wrong.
      EXPECT_NEAR(found.model.cost, 1, 4 * std::sqrt(2 / problem.residual_count())) << seed;
      return 1 / std::sqrt(0.5 * problem.residual_count() * found.model.hessian(0, 0));
    };
    EXPECT_LT(deviation(MechanicalResiduals::both), 0.8 * deviation(MechanicalResiduals::forces))
        << seed;
  }
}

// A sheet that is hardly taut goes slack within the noise of its clips: of what poses do there a
// derivative at the measured ones says little.
TEST(ForceWeights, ClipsAreWhereTheyMostProbablyAre) {
  const Fabric truth = stiff_fabric();
  RigOptions options = many_points();
  options.noise.clips = 4e-5;
  MechanicalCostOptions cost;
  cost.residuals = MechanicalResiduals::both;
  double linear = 0, found = 0, count = 0;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    options.seed = seed;
    const auto made = simulate_rig(RigTest::weft_stretch, truth, options);
    MechanicalProblem problem({prepare_mechanical(made.capture, made.geometry, coarse_mesh())},
                              truth, {"weft_stretch"}, cost);
    const VecX x = problem.scaled(truth);
    problem.weigh_by(problem.force_weights(x, nullptr, MechanicalProblem::ClipPlaces::as_weighed));
    EXPECT_EQ(problem.weights()[0][0].moves.size(), 0);
    linear += problem.cost(x) / 4;
    problem.weigh_by(problem.force_weights(x));
    const double here = problem.cost(x);
    found += here / 4;
    count += problem.residual_count();
    // There they stay: what three steps leave is little beside the 100 that they gain.
    problem.weigh_by(problem.force_weights(x));
    EXPECT_NEAR(problem.cost(x), here, 3 / problem.residual_count()) << seed;
    // Also while the fabric changes, of which the derivatives are.
    EXPECT_GT(problem.weights()[0][5].moves.norm(), 0.5);
    const VecX there = x.array() + 0.01;
    const VecX numeric =
        testing::numeric_gradient([&](const VecX& at) { return problem.cost(at); }, there, 1e-4);
    EXPECT_TRUE(testing::near(problem.linearize(there).model.gradient, numeric, 1e-4)) << seed;
  }
  const double scatter = std::sqrt(2 / count);
  EXPECT_GT(linear, 1 + 6 * scatter);
  EXPECT_NEAR(found, 1, 4 * scatter);
}

// Of a sheet that is hardly taut a move of a clip is what folds it: were that told from less than
// all points, a fit would take for stiffness what the clip has done, and be too sure of it. So the
// derivative with clips held is that of the cost with clips found anew for each fabric.
TEST(ForceWeights, PointsTellOfStiffnessOnlyWhatClipsDoNot) {
  Fabric fabric = stiff_fabric();
  for (const char* row : {"weft_bend", "warp_bend", "diagonal_bend"}) fabric.set(row, 1e-6);
  RigOptions options = many_points();
  options.mesh.cells = 8;
  options.noise.clips = 4e-5;
  const auto made = simulate_rig(RigTest::weft_stretch, fabric, options);
  MechanicalCostOptions cost;
  cost.residuals = MechanicalResiduals::both;
  MechanicalProblem problem({prepare_mechanical(made.capture, made.geometry, options.mesh)}, fabric,
                            {"weft_stretch"}, cost);
  const auto least_cost = [&](const VecX& at) {
    for (int k = 0; k < 4; ++k) problem.weigh_by(problem.force_weights(at));
    return problem.cost(at);
  };
  const VecX x = problem.scaled(fabric);
  const double step = 0.02 / std::log(problem.info(0).upper / problem.info(0).lower);  // 2 %
  const double numeric = (least_cost(x.array() + step) - least_cost(x.array() - step)) / (2 * step);
  least_cost(x);
  const auto found = problem.linearize(x);
  // Of the slope that one standard deviation of the stiffness makes.
  const double scale = std::sqrt(2 / problem.residual_count() * found.model.hessian(0, 0));
  EXPECT_NEAR(found.model.gradient[0], numeric, 0.05 * scale);
}

// Clips of a stretch test that seem to be off sideways shear the computed cloth, and not the real
// one: compared where they were measured to be, every frame would say that nothing resists shear.
TEST(ForceWeights, ASmoothShearIsNotPulledDownByClipsThatAreOffSideways) {
  Fabric truth = stiff_fabric();
  truth.set_curve("shear", StiffnessCurve(VecX{{0, 0.1, 0.2}}, VecX{{400, 400, 400}}));
  const std::vector<std::string> free{"shear_1", "shear_2", "shear_3"};
  MechanicalCostOptions cost;
  cost.smooth = {"shear"};
  double as_measured = 0, moved = 0;  // means of what is normal with deviation 1 at the truth
  const int drawings = 4;
  for (std::uint64_t seed = 1; seed <= drawings; ++seed) {
    MechanicalProblem problem({on_own_mesh(RigTest::weft_stretch, seed, 0, truth)}, truth, free,
                              cost);
    const VecX x = problem.scaled(truth);
    const auto score = [&](MechanicalProblem::ClipPlaces places) {
      problem.weigh_by(problem.force_weights(x, nullptr, places));
      const QuadraticModel model = problem.linearize(x).model;
      return -std::sqrt(0.5 * problem.residual_count() / model.hessian.sum()) *
             model.gradient.sum();
    };
    as_measured += score(MechanicalProblem::ClipPlaces::as_weighed) / drawings;
    moved += score(MechanicalProblem::ClipPlaces::most_probable) / drawings;
  }
  EXPECT_LT(as_measured, -2);
  EXPECT_NEAR(moved, 0, 3 / std::sqrt(drawings));
}

TEST(ClipMoves, AreWhereAFrameIsComputed) {
  const auto trial = measured({RigTest::shear}, 1)[0];
  MechanicalCapture capture = trial->capture;
  ClipMoves moves(1, std::vector<VecX>(static_cast<std::size_t>(capture.frame_count)));
  Vec6 move;
  move << 1e-4, -2e-4, 1e-4, 1e-3, 2e-3, -1e-3;
  moves[0][3] = VecX::Zero(6 * static_cast<Eigen::Index>(capture.fixtures.size()));
  moves[0][3].segment<6>(6) = move;
  Clip& clip = capture.fixtures[1].frames[3];
  clip = moved_clip(clip, move);
  const auto found = simulate_mechanical({trial}, stiff_fabric(), MechanicalDerivatives::none, 1,
                                         nullptr, &moves),
             expected =
                 simulate_mechanical({prepare_mechanical(capture, coarse_mesh())}, stiff_fabric());
  for (std::size_t k = 0; k < found[0].size(); ++k)
    // Of equilibria to 1e-7 N.
    EXPECT_TRUE(testing::near(found[0][k].forces, expected[0][k].forces, 1e-4)) << k;
}

TEST(MechanicalResiduals, StretchPointsArePointsOfTestsOfStretchAlone) {
  const auto problem = [](const std::vector<RigTest>& tests, MechanicalResiduals residuals) {
    RigOptions options;
    options.steps = 2;
    options.point_lines = 6;
    options.mesh.cells = 3;
    Trials trials;
    for (const RigTest test : tests) {
      const auto made = simulate_rig(test, stiff_fabric(), options);
      trials.push_back(prepare_mechanical(made.capture, made.geometry, coarse_mesh()));
    }
    MechanicalCostOptions cost;
    cost.residuals = residuals;
    return MechanicalProblem(trials, stiff_fabric(), {"shear"}, cost);
  };
  const auto count = [&](RigTest test, MechanicalResiduals residuals) {
    return problem({test}, residuals).residual_count();
  };
  using enum MechanicalResiduals;
  for (const RigTest test : {RigTest::weft_stretch, RigTest::warp_stretch})
    EXPECT_EQ(count(test, stretch_points), count(test, both)) << name_of(test);
  EXPECT_EQ(count(RigTest::shear, stretch_points), count(RigTest::shear, forces));
  EXPECT_EQ(count(RigTest::weft_bend, stretch_points), count(RigTest::weft_bend, points));
  EXPECT_GT(count(RigTest::weft_stretch, both), count(RigTest::weft_stretch, forces));
  // Forces of all captures are the forces' part, also of those without points.
  const std::vector<RigTest> tests{RigTest::weft_stretch, RigTest::shear};
  const MechanicalProblem beside = problem(tests, stretch_points);
  EXPECT_DOUBLE_EQ(beside.force_share(),
                   problem(tests, forces).residual_count() / beside.residual_count());
  EXPECT_EQ(problem({RigTest::shear}, stretch_points).force_share(), 1);
}

TEST(ForceWeights, AreNoneWithoutAStatedNoise) {
  Trials trials = measured({RigTest::weft_stretch}, 1);
  MechanicalCapture exact = trials[0]->capture;
  exact.clip_noise = 0;
  const Fabric truth = stiff_fabric();
  const MechanicalProblem problem({prepare_mechanical(exact, coarse_mesh())}, truth,
                                  {"weft_stretch"});
  EXPECT_FALSE(problem.has_clip_noise());
  EXPECT_TRUE(problem.force_weights(problem.scaled(truth)).empty());
  const MechanicalFitResult fit = fit_mechanical(problem, truth);
  EXPECT_TRUE(fit.weights.empty());
  EXPECT_EQ(fit.cost_first, fit.cost);
}

}  // namespace
}  // namespace weft::force_weights_test
