/// The synthetic rig: what it is told to do, its forces and its noise.
#include "weft/estimate/mechanical_rig.h"

#include <gtest/gtest.h>

#include <cmath>

#include "common/temporary_folder.h"
#include "weft/base/error.h"

namespace weft::mechanical_rig_test {
namespace {

Fabric soft_fabric() {
  Fabric fabric = Fabric::with_defaults("soft", "stvk-diagonal");
  fabric.areal_density = 0.2;
  fabric.set("weft_stretch", 200);
  fabric.set("warp_stretch", 400);
  fabric.set("shear", 30);
  return fabric;
}

RigOptions small_rig() {
  RigOptions options;
  options.steps = 2;
  options.point_lines = 5;
  options.mesh.cells = 5;
  return options;
}

RigOptions without_noise(RigOptions options) {
  options.noise = {0, 0, 0, 0};
  return options;
}

TEST(RigLayout, LoadsAndUnloadsThroughTheSameFrames) {
  RigOptions options = small_rig();
  options.loops = 2;
  const MechanicalCapture capture = rig_layout(RigTest::warp_stretch, soft_fabric(), options);
  ASSERT_EQ(capture.frame_count, 9);  // 0, 1/2, 1, 1, 1/2, 1/2, 1, 1, 1/2
  const auto& top = capture.fixtures[1].frames;
  EXPECT_EQ(top[1].position, top[4].position);
  EXPECT_EQ(top[2].position, top[3].position);
  EXPECT_EQ(top[2].position, top[7].position);
  // 10 N on 0.1 m: 100 N/m at a strain of 0.25, found in steps of 0.0003.
  EXPECT_NEAR(top[2].position.y() - top[0].position.y(), 0.5 * 0.25 * 0.09, 0.5 * 0.0003 * 0.09);
}

TEST(RigLayout, AllTestsHaveClipsThatFit) {
  for (const RigTest test : rig_tests()) {
    EXPECT_EQ(rig_test_from_name(name_of(test)), test);
    const MechanicalCapture capture = rig_layout(test, soft_fabric(), small_rig());
    EXPECT_NO_THROW(prepare_mechanical(capture, small_rig().mesh)) << name_of(test);
  }
  EXPECT_THROW(rig_test_from_name("pull"), Error);
}

// Strained evenly, the cloth of 90 mm would answer with its stiffness times the width; the bars
// keep it from contracting, which it would not do anyway (no Poisson effect), and gravity adds its
// weight.
TEST(SimulateRig, ForceOfAStretchIsThatOfAnEvenStrain) {
  const RigMeasurement made =
      simulate_rig(RigTest::weft_stretch, soft_fabric(), without_noise(small_rig()));
  const double elongation = 0.3;
  const double green = elongation + 0.5 * elongation * elongation;
  const double expected = (1 + elongation) * 200 * green * 0.1;
  const Vec3 force = made.capture.fixtures[1].forces.col(2);
  EXPECT_NEAR(force.x(), expected, 2e-3 * expected);  // a sag of a millimetre
  EXPECT_NEAR(force.z(), 0.5 * 0.2 * 9.81 * 0.01, 1e-6);
  EXPECT_EQ(made.capture.fixtures[1].forces.col(1), made.capture.fixtures[1].forces.col(4));
}

TEST(SimulateRig, FrictionOfTheCordsIsALoop) {
  RigOptions options = without_noise(small_rig());
  options.noise.cord_friction = 0.1;
  const RigMeasurement made = simulate_rig(RigTest::weft_stretch, soft_fabric(), options);
  for (std::size_t i = 0; i < 2; ++i) {
    const Points& forces = made.capture.fixtures[i].forces;
    // The one bar moves along -x, the other along +x; at rest there is none.
    for (const int up : {1, 2}) {  // and down again at frames 4 and 3
      const Vec3 loop = forces.col(up) - forces.col(5 - up);
      EXPECT_NEAR((loop - Vec3(i == 0 ? -0.1 : 0.1, 0, 0)).norm(), 0, 1e-12);
    }
    EXPECT_EQ(forces.col(0), made.true_forces[i].col(0));
  }
}

RigOptions with_known_forces() {
  RigOptions options = small_rig();
  options.stretch_drive = StretchDrive::known_forces;
  return options;
}

TEST(RigLayout, KnownForcesGoInStepsWithoutTheRest) {
  const MechanicalCapture capture =
      rig_layout(RigTest::warp_stretch, soft_fabric(), with_known_forces());
  ASSERT_EQ(capture.frame_count, 4);  // 1/2, 1, 1, 1/2
  EXPECT_FALSE(capture.fixtures[0].loaded());
  ASSERT_EQ(capture.fixtures[1].cords.size(), 2u);
  for (const FixtureCord& cord : capture.fixtures[1].cords) {
    EXPECT_NEAR(cord.tensions[1], 5, 0.02);  // 10 N by two cords, at a strain found in steps
    EXPECT_NEAR(cord.tensions[0], 0.5 * cord.tensions[1], 1e-12);
    EXPECT_EQ(cord.tensions[3], cord.tensions[0]);
  }
  // Tests of shear and bend stay as they are.
  for (const RigTest test : {RigTest::shear, RigTest::weft_bend})
    EXPECT_FALSE(rig_layout(test, soft_fabric(), with_known_forces()).has_loaded());
}

// The bar goes as far as the stiffness along the weft says, whose strain is Green's.
TEST(SimulateRig, KnownForcesPullTheBarAsFarAsTheClothGives) {
  const RigMeasurement made =
      simulate_rig(RigTest::weft_stretch, soft_fabric(), without_noise(with_known_forces()));
  EXPECT_EQ(made.capture.fixtures[0].forces.cols(), 0);
  EXPECT_EQ(made.capture.drive, ClipDrive::rigid);
  for (const int frame : {0, 1}) {
    const auto at = static_cast<std::size_t>(frame);
    const double pull = 2 * made.capture.fixtures[1].cords[0].tensions[frame];
    const Clip &held = made.true_clips[0][at], &bar = made.true_clips[1][at];
    const double length = (bar.position - held.position).norm() - 0.005;
    const double e = length / 0.09 - 1;
    EXPECT_NEAR((1 + e) * 200 * (e + 0.5 * e * e) * 0.1, pull, 5e-3 * pull) << frame;
    // The bar weighs 0.02 N, and half of the cloth 0.01 N: it hangs lower than the other one.
    EXPECT_LT(bar.position.z(), -1e-4);
    EXPECT_GT(bar.position.z(), -2e-3);
    EXPECT_EQ(made.capture.fixtures[1].frames[at].position, bar.position);
  }
}

TEST(SimulateRig, KnownForcesHaveNoiseInThePosesAlone) {
  RigOptions options = with_known_forces();
  options.steps = 4;
  const RigMeasurement noisy = simulate_rig(RigTest::weft_stretch, soft_fabric(), options);
  EXPECT_EQ(noisy.capture.clip_noise, 75e-6 / 6);
  Vec6 squares = Vec6::Zero();
  for (std::size_t k = 0; k < 8; ++k)
    squares +=
        pose_difference(noisy.capture.fixtures[1].frames[k], noisy.true_clips[1][k]).cwiseAbs2();
  // 24 numbers of each kind: within a factor of 1.6 with 99.9 % of chance.
  EXPECT_NEAR(std::log(std::sqrt(squares.head<3>().sum() / 24) / 12.5e-6), 0, std::log(1.6));
  EXPECT_NEAR(std::log(std::sqrt(squares.tail<3>().sum() / 24) / (12.5e-6 / 0.05)), 0,
              std::log(1.6));
}

TEST(SimulateRig, NoiseIsAsStated) {
  RigOptions options = small_rig();
  options.steps = 1;
  options.loops = 1;
  options.point_lines = 40;
  const RigMeasurement exact =
      simulate_rig(RigTest::weft_stretch, soft_fabric(), without_noise(options));
  options.noise.cord_friction = 0;
  const RigMeasurement noisy = simulate_rig(RigTest::weft_stretch, soft_fabric(), options);
  EXPECT_EQ(exact.capture.clip_noise, 0);
  EXPECT_EQ(noisy.capture.clip_noise, 75e-6 / 6);
  double squares = 0;
  for (std::size_t k = 0; k < 3; ++k)
    squares += (noisy.geometry.frames[k] - exact.geometry.frames[k]).squaredNorm();
  const double count = 3 * 3 * 1600;
  // The standard deviation of a standard deviation from n numbers: 1 / sqrt(2 n).
  EXPECT_NEAR(std::sqrt(squares / count), 75e-6, 75e-6 * 4 / std::sqrt(2 * count));
  for (std::size_t i = 0; i < 2; ++i) {
    const Points error = noisy.capture.fixtures[i].forces - noisy.true_forces[i];
    EXPECT_LT(error.cwiseAbs().maxCoeff(), 5 * 3e-3);
    EXPECT_GT(error.norm(), 1e-3);
    EXPECT_LT((noisy.capture.fixtures[i].frames[0].position -
               exact.capture.fixtures[i].frames[0].position)
                  .cwiseAbs()
                  .maxCoeff(),
              5 * 12.5e-6);
  }
  const RigMeasurement again = simulate_rig(RigTest::weft_stretch, soft_fabric(), options);
  EXPECT_EQ(again.capture.fixtures[0].forces, noisy.capture.fixtures[0].forces);
  EXPECT_EQ(again.geometry.frames[1], noisy.geometry.frames[1]);
}

TEST(MakeRigCapture, IsAMechanicalCapture) {
  const test::TemporaryFolder folder;
  Fabric fabric = soft_fabric();
  fabric.set("weft_bend", 1e-4);  // (D / (rho g))^(1/3) = 37 mm: smooth on this mesh
  fabric.set("warp_bend", 1e-4);
  fabric.set("diagonal_bend", 1e-4);
  RigOptions options = small_rig();
  options.mesh.cells = 10;
  const MechanicalCapture capture =
      make_rig_capture(folder.path() / "bend", RigTest::warp_bend, fabric, options);
  EXPECT_EQ(capture.name, "soft_bend_warp");
  ASSERT_EQ(capture.fixtures.size(), 1u);
  EXPECT_EQ(capture.fixtures[0].forces.cols(), 0);
  EXPECT_NEAR(capture.fixtures[0].frames[1].region.upper.y(), 0.02, 1e-12);
  const MeasuredGeometry geometry = read_geometry(capture);
  EXPECT_EQ(geometry.mesh.vertex_count(), 25);
  EXPECT_LT(geometry.frames[1].row(2).minCoeff(), -0.01);  // hangs over the edge
  // What made it explains it, on another mesh.
  const auto trial = prepare_mechanical(capture, options.mesh);
  const auto frames = simulate_mechanical({trial}, read_fabric(*capture.truth));
  EXPECT_LT(compare_mechanical(*trial, frames[0]).distance.rms, 3e-4);
}

TEST(RigLayout, RefusesWhatItCannotPlan) {
  Fabric fabric = soft_fabric();
  RigOptions options = small_rig();
  options.steps = 0;
  EXPECT_THROW(rig_layout(RigTest::shear, fabric, options), Error);
  options = small_rig();
  options.largest_overhang = 0.1;
  EXPECT_THROW(rig_layout(RigTest::weft_bend, fabric, options), Error);
  options = small_rig();
  options.noise.clips = 0.02;  // more than a capture can state
  EXPECT_THROW(rig_layout(RigTest::weft_stretch, fabric, options), Error);
  fabric.areal_density.reset();
  EXPECT_THROW(rig_layout(RigTest::shear, fabric, small_rig()), Error);
  Fabric table = Fabric::with_defaults("table", "piecewise-linear");
  table.areal_density = 0.2;
  EXPECT_THROW(rig_layout(RigTest::shear, table, small_rig()), Error);
}

}  // namespace
}  // namespace weft::mechanical_rig_test
