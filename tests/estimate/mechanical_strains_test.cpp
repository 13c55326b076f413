#include "weft/estimate/mechanical_strains.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace weft::mechanical_strains_test {
namespace {

/// A swatch of 4 x 4 cells, held by nothing, with the threads turned by `grain` rad.
MechanicalTrial free_swatch(double grain) {
  MechanicalTrial trial;
  trial.capture.grain_angle = grain;
  trial.capture.frame_count = 1;
  MechanicalStage stage;
  stage.mesh = make_swatch(1, 1, 5, 5);
  stage.frames = {0};
  trial.stages = {stage};
  trial.stage_of_frame = {0};
  return trial;
}

std::vector<MechanicalFrame> placed(const MechanicalTrial& trial, const Eigen::Matrix2d& stretch) {
  MechanicalFrame frame;
  frame.converged = true;
  const MaterialPoints& uv = trial.stages[0].mesh.material;
  frame.x = Points::Zero(3, uv.cols());
  frame.x.topRows<2>() = stretch * uv;
  return {frame};
}

TEST(StrainSamples, AreThoseOfAHomogeneousDeformation) {
  const MechanicalTrial trial = free_swatch(0);
  Eigen::Matrix2d stretch;
  stretch << 1.1, 0.2, 0, 0.95;
  const auto samples = strain_samples(trial, placed(trial, stretch));
  ASSERT_EQ(samples[0].value.size(), 32u);
  EXPECT_NEAR(quantile(samples[0], 0.5), 0.1, 1e-12);
  EXPECT_NEAR(quantile(samples[1], 0.5), std::hypot(0.2, 0.95) - 1, 1e-12);
  EXPECT_NEAR(quantile(samples[2], 0.5), 0.2 / 0.95, 1e-12);
  EXPECT_NEAR(quantile(samples[3], 0.5), 0, 1e-12);
}

// Threads at 45 degrees: a stretch along the swatch shears them.
TEST(StrainSamples, AreAlongTheThreads) {
  const MechanicalTrial trial = free_swatch(std::numbers::pi / 4);
  Eigen::Matrix2d stretch;
  stretch << 1.2, 0, 0, 1;
  const auto samples = strain_samples(trial, placed(trial, stretch));
  const double length = std::sqrt((1.2 * 1.2 + 1) / 2);
  EXPECT_NEAR(quantile(samples[0], 0.5), length - 1, 1e-12);
  EXPECT_NEAR(quantile(samples[1], 0.5), length - 1, 1e-12);
  // w_u . w_v = (1 - 1.44) / 2, |w_u x w_v| = 1.2.
  EXPECT_NEAR(quantile(samples[2], 0.5), -0.22 / 1.2, 1e-12);
}

// A saddle is bent along its diagonals alone, one up and one down.
TEST(StrainSamples, HaveBothDiagonals) {
  constexpr double kTwist = 1e-4;  // 1/m
  const MechanicalTrial trial = free_swatch(0);
  auto frames = placed(trial, Eigen::Matrix2d::Identity());
  const MaterialPoints& uv = trial.stages[0].mesh.material;
  frames[0].x.row(2) = kTwist * uv.row(0).cwiseProduct(uv.row(1));
  const auto samples = strain_samples(trial, frames);
  ASSERT_EQ(samples[5].value.size(), 2 * samples[3].value.size());
  EXPECT_NEAR(quantile(samples[3], 0.5), 0, 1e-3 * kTwist);
  EXPECT_NEAR(quantile(samples[5], 0.25), -kTwist, 1e-3 * kTwist);
  EXPECT_NEAR(quantile(samples[5], 0.75), kTwist, 1e-3 * kTwist);
}

TEST(Quantile, IsOfTheArea) {
  const StrainSample sample{{3, 1, 2}, {1, 1, 8}};
  EXPECT_EQ(quantile(sample, 0.05), 1);
  EXPECT_EQ(quantile(sample, 0.5), 2);
  EXPECT_EQ(quantile(sample, 0.95), 3);
  EXPECT_EQ(quantile({}, 0.5), 0);
}

}  // namespace
}  // namespace weft::mechanical_strains_test
