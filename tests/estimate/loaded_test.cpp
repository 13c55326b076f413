/// Mechanical captures with clips that cords pull with known forces.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "common/gradient_check.h"
#include "weft/estimate/cord_friction.h"
#include "weft/estimate/mechanical_fit.h"
#include "weft/estimate/pose_residuals.h"

namespace weft::loaded_test {
namespace {

constexpr double kFree = 0.1, kWidth = 0.02, kDepth = 0.01;  // m

MechanicalOptions with_cells(int cells) {
  MechanicalOptions options;
  options.cells = cells;
  return options;
}

Fabric stretchy() {
  Fabric fabric = Fabric::with_defaults("test", "stvk");
  fabric.set("membrane_uu", 300);
  fabric.set("membrane_vv", 200);
  fabric.set("membrane_uv", 1e-3);
  fabric.set("membrane_shear", 60);
  for (const char* bend : {"bend_uu", "bend_vv"}) fabric.set(bend, 1e-6);
  fabric.set("bend_uv", 1e-10);
  fabric.set("bend_twist", 5e-7);
  return fabric;
}

/// A strip whose left clip is held and whose right one a weight pulls along x, without gravity.
MechanicalCapture weighed_strip(const VecX& pulls) {
  MechanicalCapture capture;
  capture.name = "strip";
  capture.width = kFree + 2 * kDepth;
  capture.height = kWidth;
  capture.areal_density = 0.1;
  capture.gravity = Vec3::Zero();
  capture.frame_count = static_cast<int>(pulls.size());
  for (const double end : {0.0, 1.0}) {
    MechanicalFixture fixture;
    fixture.name = end > 0 ? "right" : "left";
    Clip clip;
    const double from = end * (kFree + kDepth);
    clip.region = {{from, 0}, {from + kDepth, kWidth}};
    clip.position << clip.region.center().x(), clip.region.center().y(), 0;
    fixture.frames.assign(static_cast<std::size_t>(capture.frame_count), clip);
    fixture.forces.resize(3, 0);
    capture.fixtures.push_back(std::move(fixture));
  }
  FixtureCord cord;
  cord.forces = Points::Zero(3, capture.frame_count);
  cord.forces.row(0) = pulls;
  capture.fixtures[1].cords = {cord};
  return capture;
}

/// The same askew: two cords of unequal pull, one over a pulley, a mass, and gravity.
MechanicalCapture askew_strip(const VecX& pulls) {
  MechanicalCapture capture = weighed_strip(pulls);
  capture.gravity = Vec3(0, 0, -9.81);
  MechanicalFixture& right = capture.fixtures[1];
  right.mass = 2e-3;
  right.cords[0].at = Vec3(0, kWidth / 2, 0);
  FixtureCord cord;
  cord.at = Vec3(0, -kWidth / 2, 0);
  cord.pulley = Vec3(0.4, -0.02, 0.05);
  cord.tensions = 1.3 * pulls;
  right.cords.push_back(cord);
  return capture;
}

/// The capture as `fabric` has it, on a mesh of its own.
MechanicalCapture measured(MechanicalCapture capture, const Fabric& fabric, int cells) {
  const auto trial = prepare_mechanical(capture, with_cells(cells));
  const auto frames = simulate_mechanical({trial}, fabric)[0];
  for (const MechanicalFrame& frame : frames) {
    EXPECT_TRUE(frame.converged);
    for (std::size_t c = 0; c < capture.fixtures.size(); ++c)
      capture.fixtures[c].frames[static_cast<std::size_t>(frame.frame)] = frame.clips[c];
  }
  return capture;
}

// Pull of a strip without Poisson effect: width (1 + e) A (e + e^2 / 2).
TEST(LoadedMechanical, AStripIsAsLongAsItsStretchSays) {
  const Fabric fabric = stretchy();
  VecX strains(3), pulls(3);
  strains << 0.01, 0.05, 0.2;
  for (int k = 0; k < 3; ++k)
    pulls[k] = kWidth * (1 + strains[k]) * 300 * (strains[k] + 0.5 * strains[k] * strains[k]);
  const auto trial = prepare_mechanical(weighed_strip(pulls), with_cells(3));
  const auto frames = simulate_mechanical({trial}, fabric)[0];
  const MechanicalEvaluation e = compare_mechanical(*trial, frames);
  double squares = 0;
  for (int k = 0; k < 3; ++k) {
    const MechanicalFrame& frame = frames[static_cast<std::size_t>(k)];
    ASSERT_TRUE(frame.converged);
    const Vec3 moved = frame.clips[1].position - trial->capture.fixtures[1].frames[0].position;
    // The Poisson effect of 1e-5.
    EXPECT_NEAR(moved.x(), strains[k] * kFree, 1e-5 * strains[k] * kFree + 1e-8) << k;
    EXPECT_LT(moved.tail<2>().norm(), 1e-7);
    EXPECT_NEAR(frame.forces(0, 0), -pulls[k], 1e-6);
    squares += std::pow(strains[k] * kFree, 2);
  }
  EXPECT_EQ(e.pose.count, 3);
  EXPECT_NEAR(e.pose.position_rms, std::sqrt(squares / 3), 1e-6);
  EXPECT_LT(e.pose.rotation_rms, 1e-6);
  EXPECT_EQ(e.force_count, 0);
}

TEST(LoadedMechanical, StartsFromShapesOfOtherCellsAndFabrics) {
  VecX pulls(2);
  pulls << 0.3, 0.6;
  const MechanicalCapture capture = askew_strip(pulls);
  const auto coarse = prepare_mechanical(capture, with_cells(3));
  const auto fine = refined(*coarse);
  const Fabric fabric = stretchy();
  Fabric other = fabric;
  other.set("membrane_uu", 400);
  const MechanicalFrames there = simulate_mechanical({coarse}, other);
  const MechanicalFrames alone = simulate_mechanical({coarse}, fabric);
  const MechanicalFrames near =
      simulate_mechanical({coarse}, fabric, MechanicalDerivatives::none, 1, &there);
  const MechanicalFrames starts = starts_between({coarse}, there, {fine});
  const MechanicalFrames finer =
      simulate_mechanical({fine}, fabric, MechanicalDerivatives::none, 1, &starts);
  const MechanicalFrames fine_alone = simulate_mechanical({fine}, fabric);
  for (std::size_t k = 0; k < 2; ++k) {
    ASSERT_TRUE(near[0][k].converged && finer[0][k].converged);
    // Net forces of 1e-7 N on some N/m.
    EXPECT_LT(pose_difference(near[0][k].clips[1], alone[0][k].clips[1]).norm(), 1e-5);
    EXPECT_LT(pose_difference(finer[0][k].clips[1], fine_alone[0][k].clips[1]).norm(), 1e-5);
  }
}

/// Measured poses that are off by some times their noise.
std::shared_ptr<const MechanicalTrial> trial_off(double clip_noise) {
  VecX pulls(2);
  pulls << 0.3, 0.6;
  MechanicalCapture capture = measured(askew_strip(pulls), stretchy(), 3);
  capture.clip_noise = clip_noise;
  Vec6 off;
  off << 1e-4, -2e-4, 1e-4, 0.01, 0.02, -0.01;
  for (Clip& clip : capture.fixtures[1].frames) clip = moved_clip(clip, off);
  return prepare_mechanical(capture, with_cells(3));
}

TEST(LoadedMechanical, GradientIsThatOfTheCost) {
  const std::vector<std::string> free{"membrane_uu", "membrane_shear", "bend_uu"};
  for (const double noise : {0.0, 2e-5}) {
    Fabric fabric = stretchy();
    fabric.values.head<4>() *= 1.1;
    MechanicalProblem problem({trial_off(noise)}, fabric, free);
    EXPECT_EQ(problem.residual_count(), 12);
    const VecX x = problem.scaled(fabric);
    EXPECT_EQ(problem.has_clip_noise(), noise > 0);
    problem.weigh_by(problem.force_weights(x));
    const auto found = problem.linearize(x);
    EXPECT_NEAR(found.model.cost, problem.cost(x), 1e-6 * found.model.cost);
    const VecX numeric =
        testing::numeric_gradient([&](const VecX& at) { return problem.cost(at); }, x, 1e-3);
    // Poses to 1e-7 N on some N/m, of differences of 1e-4 m.
    EXPECT_TRUE(testing::near(found.model.gradient, numeric, 1e-3)) << noise;
  }
}

// What is wrong with the held clip's position is as wrong with the loaded one's, which has its own
// noise beside: together twice the variance along the pull.
TEST(LoadedMechanical, NoiseOfTheHeldClipGoesAlong) {
  VecX pull(1);
  pull << 0.5;
  MechanicalCapture capture = measured(weighed_strip(pull), stretchy(), 3);
  capture.clip_noise = 2e-5;
  const MechanicalProblem problem({prepare_mechanical(capture, with_cells(3))}, stretchy(),
                                  {"membrane_uu"});
  const ForceWeights weights = problem.force_weights(problem.scaled(stretchy()));
  const MatX& by_errors = weights[0][0].shared.by_errors();
  ASSERT_EQ(by_errors.rows(), 6);
  const MatX covariance = MatX::Identity(6, 6) + by_errors * by_errors.transpose();
  EXPECT_NEAR(covariance(0, 0), 2, 1e-3);
  // Across it the turns of the held clip add their part over the length of the strip.
  EXPECT_GT(covariance(1, 1), 2.5);
}

TEST(LoadedMechanical, FindsTheStretchFromAnotherMesh) {
  VecX pulls(4);
  pulls << 0.1, 0.3, 0.5, 0.8;
  const Fabric truth = stretchy();
  const auto trial = prepare_mechanical(measured(askew_strip(pulls), truth, 6), with_cells(8));
  Fabric start = truth;
  start.set("membrane_uu", 5 * 300);
  const MechanicalProblem problem({trial}, start, {"membrane_uu"});
  MechanicalFitOptions options;
  options.mesh_error = MeshError::included;
  const MechanicalFitResult fit = fit_mechanical(problem, start, options);
  EXPECT_NEAR(fit.fabric.value("membrane_uu"), 300, 3);
  EXPECT_LT(fit.cost, 1e-3 * fit.cost_start);
  ASSERT_EQ(fit.intervals.size(), 1u);
  EXPECT_TRUE(fit.intervals[0].determined);
  EXPECT_TRUE(fit.mesh.unknown.empty()) << fit.mesh.unknown;
  EXPECT_LT(fit.intervals[0].lower, 300);
  EXPECT_GT(fit.intervals[0].upper, 300);
}

TEST(LoadedMechanical, PosesAreComparedWhateverIsAskedFor) {
  for (const auto residuals : {MechanicalResiduals::automatic, MechanicalResiduals::forces,
                               MechanicalResiduals::points, MechanicalResiduals::both}) {
    MechanicalCostOptions options;
    options.residuals = residuals;
    EXPECT_EQ(
        MechanicalProblem({trial_off(0)}, stretchy(), {"membrane_uu"}, options).residual_count(),
        12);
  }
}

TEST(LoadedMechanical, EveryLoadIsInTheFingerprint) {
  const auto trial = trial_off(0);
  const auto fingerprint = [&](const MechanicalCapture& capture) {
    return MechanicalProblem({prepare_mechanical(capture, with_cells(3))}, stretchy(),
                             {"membrane_uu"})
        .fingerprint();
  };
  const std::string before = fingerprint(trial->capture);
  MechanicalCapture changed = trial->capture;
  changed.fixtures[1].cords[1].tensions[1] += 1e-6;
  EXPECT_NE(fingerprint(changed), before);
  changed = trial->capture;
  changed.fixtures[1].mass *= 2;
  EXPECT_NE(fingerprint(changed), before);
  changed = trial->capture;
  changed.fixtures[1].cords[0].at.x() += 1e-6;
  EXPECT_NE(fingerprint(changed), before);
}

TEST(LoadedMechanical, CordsOfLoadedClipsHaveNoFriction) {
  VecX pulls(3);
  pulls << 0.1, 0.2, 0.3;
  MechanicalCapture capture = measured(weighed_strip(pulls), stretchy(), 3);
  capture.drive = ClipDrive::cords;
  for (const Points& ways : ways_of_clips(capture)) EXPECT_EQ(ways.cwiseAbs().maxCoeff(), 0);
  const MechanicalProblem problem({prepare_mechanical(capture, with_cells(3))}, stretchy(),
                                  {"membrane_uu"});
  EXPECT_TRUE(problem.with_friction().empty());
}

}  // namespace
}  // namespace weft::loaded_test
