/// Friction of the cords that pull clips: its direction, and fits that find it.
#include "weft/estimate/cord_friction.h"

#include <gtest/gtest.h>

#include <cmath>

#include "common/gradient_check.h"
#include "common/temporary_folder.h"
#include "weft/base/error.h"
#include "weft/base/random.h"
#include "weft/estimate/mechanical_fit.h"
#include "weft/estimate/mechanical_rig.h"

namespace weft::cord_friction_test {
namespace {

using Trials = std::vector<std::shared_ptr<const MechanicalTrial>>;

std::vector<Clip> path(const std::vector<double>& x, double noise = 0) {
  Rng rng(3);
  std::vector<Clip> frames;
  for (const double at : x) {
    Clip clip;
    clip.position = Vec3(at, 0.02, 0);
    for (double& coordinate : clip.position) coordinate += noise * rng.normal();
    frames.push_back(clip);
  }
  return frames;
}

TEST(WaysOfClip, GoIntoAFrameAndOutOfAStandstill) {
  // Rest, two steps forth, a stand, two steps back, rest.
  const Points ways = ways_of_clip(path({0, 0, 0, 1e-3, 2e-3, 2e-3, 1e-3, 0, 0, 0}));
  const double expected[] = {0, 0, 1, 1, 1, -1, -1, -1, 0, 0};
  for (Eigen::Index k = 0; k < ways.cols(); ++k)
    EXPECT_NEAR((ways.col(k) - Vec3(expected[k], 0, 0)).norm(), 0, 1e-12) << "frame " << k;
  EXPECT_EQ(ways_of_clip(path({0.1})).norm(), 0);
  EXPECT_EQ(ways_of_clip({}).cols(), 0);
}

TEST(WaysOfClip, SeeStepsThatAreSmallerThanTheNoise) {
  const double noise = 12.5e-6, step = 2.5e-5;
  std::vector<double> x{0};
  for (int i = 1; i <= 12; ++i) x.push_back(i * step);
  for (int i = 12; i >= 1; --i) x.push_back(i * step);
  const Points ways = ways_of_clip(path(x, noise));
  for (Eigen::Index k = 1; k < ways.cols(); ++k) {
    // Just at the turn it cannot be told.
    if (k >= 11 && k <= 14) continue;
    EXPECT_NEAR(ways(0, k), k <= 12 ? 1 : -1, 0.05) << "frame " << k;
  }
  // A clip at rest stays at rest, whatever its noise.
  EXPECT_EQ(ways_of_clip(path(std::vector<double>(40, 0.0), noise)).norm(), 0);
}

/// Two clips that are pulled apart along their own x axes and let go again, in steps of 25 um, with
/// the second turned about y, its motion with it.
MechanicalCapture pulled_apart(double noise, std::uint64_t seed) {
  Rng rng(seed);
  MechanicalCapture capture;
  capture.clip_noise = noise;
  capture.frame_count = 26;
  for (const double side : {-1.0, 1.0}) {
    MechanicalFixture& fixture = capture.fixtures.emplace_back();
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(side > 0 ? 0.7 : 0.0, Vec3::UnitY()));
    for (int k = 0; k < capture.frame_count; ++k) {
      Clip clip;
      clip.rotation = turn;
      const int step = k <= 12 ? k : 25 - k;
      clip.position = turn * Vec3(side * (0.05 + 25e-6 * step), 0, 0);
      for (double& coordinate : clip.position) coordinate += 12.5e-6 * rng.normal();
      fixture.frames.push_back(clip);
    }
  }
  return capture;
}

// Where the noise is stated a way has no component that the noise alone makes, and the clips turn
// in the same frame; each by itself, some do not.
TEST(WaysOfClips, AreAlongTheClipsAxesAndTurnTogether) {
  int apart = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const MechanicalCapture capture = pulled_apart(12.5e-6, seed);
    const std::vector<Points> ways = ways_of_clips(capture);
    ASSERT_EQ(ways.size(), 2u);
    const Vec3 axis = capture.fixtures[1].frames[0].rotation * Vec3::UnitX();
    for (Eigen::Index k = 1; k < 26; ++k) {
      // Beside the turn it may look like a standstill.
      if (k < 11 || k > 14) {
        EXPECT_EQ(ways[0](0, k), k < 13 ? -1 : 1) << "seed " << seed << ", frame " << k;
      }
      EXPECT_NEAR((ways[1].col(k) + ways[0](0, k) * axis).norm(), 0, 1e-12);
      EXPECT_EQ(ways[0](0, k), std::round(ways[0](0, k)));
    }
    const std::vector<Points> alone = ways_of_clips(pulled_apart(0, seed));
    for (std::size_t c = 0; c < 2; ++c)
      EXPECT_EQ(alone[c], ways_of_clip(pulled_apart(0, seed).fixtures[c].frames));
    if (alone[0](0, 13) * alone[1](0, 13) > 0) ++apart;
  }
  EXPECT_GT(apart, 0);
}

/// Two clips that go apart along y by `first` in two frames, then along x in steps of 0.2 mm.
MechanicalCapture around_a_corner(double first) {
  MechanicalCapture capture;
  capture.clip_noise = 12.5e-6;
  capture.frame_count = 8;
  for (const double side : {-1.0, 1.0}) {
    MechanicalFixture& fixture = capture.fixtures.emplace_back();
    for (int k = 0; k < capture.frame_count; ++k) {
      Clip clip;
      clip.position =
          side * Vec3(2e-4 * std::max(0, k - 2), 0.05 + 0.5 * first * std::min(k, 2), 0);
      fixture.frames.push_back(clip);
    }
  }
  return capture;
}

// A little more than noise, but not enough to say whereto, for all clips alike: neither a way nor a
// standstill.
TEST(WaysOfClips, AreNoneWhereTheyCannotBeTold) {
  const auto second = [](double first, Eigen::Index frame) {
    return Vec3(ways_of_clips(around_a_corner(first))[1].col(frame));
  };
  for (const double first : {2e-5, 8e-5, 2e-4}) EXPECT_EQ(second(first, 3), Vec3(1, 0, 0));
  EXPECT_EQ(second(2e-4, 1), Vec3(0, 1, 0));
  EXPECT_EQ(second(2e-4, 2), Vec3(0, 1, 0));
  EXPECT_EQ(second(8e-5, 1), Vec3::Zero());
  EXPECT_EQ(second(8e-5, 2), Vec3::Zero());
  EXPECT_EQ(second(2e-5, 1), Vec3::Zero());
  EXPECT_EQ(second(2e-5, 2), Vec3(1, 0, 0));  // out of a standstill
}

Fabric plain_fabric() {
  Fabric fabric = Fabric::with_defaults("test", "stvk-diagonal");
  fabric.areal_density = 0.2;
  fabric.set("weft_stretch", 300);
  fabric.set("warp_stretch", 150);
  fabric.set("shear", 30);
  return fabric;
}

/// A rig with cords whose loop is twice `friction` wide, its cloth on another mesh than the fits'.
MechanicalCapture measured(RigTest test, double friction) {
  RigOptions options;
  options.steps = 4;
  options.point_lines = 4;
  options.mesh.cells = 5;
  options.noise.cord_friction = 2 * friction;
  return simulate_rig(test, plain_fabric(), options).capture;
}

std::shared_ptr<const MechanicalTrial> ready(const MechanicalCapture& capture) {
  MechanicalOptions options;
  options.cells = 3;
  return prepare_mechanical(capture, options);
}

MechanicalCapture first_frames(MechanicalCapture capture, int count) {
  capture.frame_count = count;
  for (MechanicalFixture& fixture : capture.fixtures) {
    fixture.frames.resize(static_cast<std::size_t>(count));
    fixture.forces = Points(fixture.forces.leftCols(count));
  }
  return capture;
}

MechanicalCostOptions with(CordFriction friction, MechanicalForces forces = MechanicalForces::all) {
  MechanicalCostOptions options;
  options.cord_friction = friction;
  options.forces = forces;
  return options;
}

/// The capture without `friction` along the ways, whatever of it it had.
MechanicalCapture without(const MechanicalTrial& trial, double friction) {
  MechanicalCapture capture = trial.capture;
  const std::vector<Points> ways = ways_of_clips(capture);
  for (std::size_t c = 0; c < ways.size(); ++c) capture.fixtures[c].forces -= friction * ways[c];
  return capture;
}

// The cost with the friction taken off by hand is one of fabric and friction; what the problem
// says of it are its value, gradient and matrix at the best friction.
TEST(CordFriction, DerivativesAreThoseOfTheCost) {
  const auto trial = ready(measured(RigTest::shear, 0.05));
  Fabric wrong = plain_fabric();
  wrong.set("shear", 40);
  const std::vector<std::string> free{"weft_stretch", "shear"};
  const MechanicalForces forces = MechanicalForces::along_clips;
  const MechanicalProblem problem({trial}, wrong, free, with(CordFriction::as_captured, forces));
  ASSERT_EQ(problem.with_friction(), std::vector<std::size_t>{0});
  const VecX x = problem.scaled(wrong);
  const auto found = problem.linearize(x);
  ASSERT_GT(found.friction[0], 0.01);
  EXPECT_NEAR(found.model.cost, problem.cost(x), 1e-9 * found.model.cost);
  // Friction follows the fabric.
  const VecX numeric =
      testing::numeric_gradient([&](const VecX& at) { return problem.cost(at); }, x, 1e-4);
  EXPECT_TRUE(testing::near(found.model.gradient, numeric, 1e-4));

  const auto at_friction = [&](double friction) {
    return MechanicalProblem({ready(without(*trial, friction))}, wrong, free,
                             with(CordFriction::none, forces))
        .linearize(x)
        .model;
  };
  const double best = found.friction[0], step = 0.01;
  const QuadraticModel here = at_friction(best), more = at_friction(best + step),
                       less = at_friction(best - step);
  EXPECT_NEAR(here.cost, found.model.cost, 1e-9 * here.cost);
  VecX gradient = VecX::Zero(3);
  MatX hessian = MatX::Zero(3, 3);
  for (const CostPart& part : found.parts) {
    gradient += part.gradient;
    hessian += part.hessian;
  }
  const ParameterInfo info = problem.friction_info(0);
  const double range = info.upper - info.lower;
  EXPECT_NEAR(gradient[2], 0, 1e-9 * hessian(2, 2));  // at its best
  EXPECT_NEAR((more.cost - less.cost) / (2 * step), 0, 1e-6 * here.cost / step);
  const double curvature = (more.cost - 2 * here.cost + less.cost) / (step * step);
  EXPECT_NEAR(hessian(2, 2) / (range * range), curvature, 1e-4 * curvature);
  const VecX mixed = (more.gradient - less.gradient) / (2 * step);
  EXPECT_TRUE(testing::near(VecX(hessian.col(2).head(2) / range), mixed, 1e-6));
  // The search's matrix is what is left when the friction follows.
  const MatX complement =
      here.hessian - hessian.col(2).head(2) * hessian.row(2).head(2) / hessian(2, 2);
  EXPECT_TRUE(found.model.hessian.isApprox(complement, 1e-9));
}

TEST(CordFriction, IsFoundWithTheFabric) {
  Trials trials;
  for (const RigTest test : {RigTest::weft_stretch, RigTest::warp_stretch, RigTest::shear})
    trials.push_back(ready(measured(test, 0.05)));
  EXPECT_EQ(trials[0]->capture.drive, ClipDrive::cords);
  const Fabric truth = plain_fabric();
  Fabric start = truth;
  const std::vector<std::string> free{"weft_stretch", "warp_stretch", "shear"};
  for (const std::string& name : free) start.set(name, 3 * truth.value(name));
  const MechanicalFitResult with_it = fit_mechanical(MechanicalProblem(trials, start, free), start);
  ASSERT_EQ(with_it.cord_friction.size(), 3u);
  for (const CordFrictionEstimate& friction : with_it.cord_friction) {
    const ParameterInterval& p = friction.interval;
    EXPECT_EQ(p.name, trials[friction.trial]->capture.name);
    EXPECT_NEAR(p.value, 0.05, 0.01) << p.name;
    EXPECT_TRUE(p.determined);
    EXPECT_LE(p.lower, p.value);
    EXPECT_GE(p.upper, p.value);
    EXPECT_LT(p.upper - p.lower, 0.04);
  }
  EXPECT_EQ(with_it.intervals.size(), free.size());
  EXPECT_EQ(with_it.certainty.correlation.rows(), 3);
  for (const std::string& name : free)
    EXPECT_NEAR(with_it.fabric.value(name), truth.value(name), 0.05 * truth.value(name)) << name;
  const MechanicalFitResult without_it =
      fit_mechanical(MechanicalProblem(trials, start, free, with(CordFriction::none)), start);
  EXPECT_TRUE(without_it.cord_friction.empty());
  EXPECT_LT(with_it.cost, 0.3 * without_it.cost);
}

TEST(CordFriction, IsNoneWhereThereIsNone) {
  const auto trial = ready(measured(RigTest::warp_stretch, 0));
  EXPECT_EQ(trial->capture.drive, ClipDrive::rigid);
  const Fabric truth = plain_fabric();
  const std::vector<std::string> free{"warp_stretch"};
  EXPECT_TRUE(MechanicalProblem({trial}, truth, free).with_friction().empty());
  const MechanicalFitResult fit =
      fit_mechanical(MechanicalProblem({trial}, truth, free, with(CordFriction::fitted)), truth);
  ASSERT_EQ(fit.cord_friction.size(), 1u);
  const ParameterInterval& p = fit.cord_friction[0].interval;
  EXPECT_LT(p.value, 0.005);
  EXPECT_EQ(p.lower, 0);
  EXPECT_LT(p.upper, 0.02);
  EXPECT_TRUE(p.determined);
}

// Without unloading it is an offset of the force, which the stiffness can take up in part.
TEST(CordFriction, LoadingAloneLeavesItOpenInTheIntervals) {
  const MechanicalCapture loop = measured(RigTest::warp_stretch, 0.05);
  const MechanicalCapture loading = first_frames(loop, 5);
  const Fabric truth = plain_fabric();
  const auto problem = [&](const MechanicalCapture& capture, CordFriction friction) {
    return MechanicalProblem({ready(capture)}, truth, {"warp_stretch"}, with(friction));
  };
  // What is left of the information about the stiffness.
  const auto left = [&](const MechanicalCapture& capture) {
    const auto curvature = [&](CordFriction friction) {
      const MechanicalProblem p = problem(capture, friction);
      return p.linearize(p.scaled(truth)).model.hessian(0, 0);
    };
    return curvature(CordFriction::fitted) / curvature(CordFriction::none);
  };
  EXPECT_GT(left(loop), 0.95);
  EXPECT_LT(left(loading), 0.4);
  const MechanicalFitResult alone = fit_mechanical(problem(loading, CordFriction::fitted), truth),
                            known = fit_mechanical(
                                problem(without(*ready(loading), 0.05), CordFriction::none), truth);
  EXPECT_GT(alone.intervals[0].half_width, 1.5 * known.intervals[0].half_width);
}

TEST(CordFriction, RefusesWhatMeansNothing) {
  EXPECT_EQ(cord_friction_from_name("auto"), CordFriction::as_captured);
  EXPECT_THROW(cord_friction_from_name("some"), Error);
  MechanicalCostOptions options;
  options.least_way = 0;
  EXPECT_THROW(MechanicalProblem({ready(measured(RigTest::warp_stretch, 0.05))}, plain_fabric(),
                                 {"warp_stretch"}, options),
               Error);
}

TEST(CordFriction, IsSaidByTheCapture) {
  const test::TemporaryFolder folder;
  RigOptions options;
  options.steps = 1;
  options.point_lines = 3;
  options.mesh.cells = 2;
  const Fabric fabric = plain_fabric();
  EXPECT_EQ(make_rig_capture(folder.path() / "a", RigTest::weft_stretch, fabric, options).drive,
            ClipDrive::cords);
  options.noise.cord_friction = 0;
  EXPECT_EQ(make_rig_capture(folder.path() / "b", RigTest::weft_stretch, fabric, options).drive,
            ClipDrive::rigid);
}

}  // namespace
}  // namespace weft::cord_friction_test
