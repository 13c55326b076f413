#include "weft/objective/fold_metric.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "weft/base/error.h"
#include "weft/base/random.h"

namespace weft::fold_metric_test {
namespace {

constexpr float kHalfTurn = std::numbers::pi_v<float>;
// More sums of ones than a byte holds; the columns no multiple of a vector's length.
constexpr int kRows = 307, kColumns = 165;

FrameFeatures random_features(std::uint64_t seed) {
  Rng random(seed);
  FrameFeatures features;
  features.angles = {Image(kRows, kColumns), Image::Ones(kRows, kColumns),
                     Mask::Ones(kRows, kColumns)};
  features.fold_mask = Mask(kRows, kColumns);
  features.silhouette = Mask(kRows, kColumns);
  for (int y = 0; y < kRows; ++y)
    for (int x = 0; x < kColumns; ++x) {
      features.angles.angle(y, x) = float(random.uniform(-kHalfTurn / 2, kHalfTurn / 2));
      features.angles.valid(y, x) = random.uniform() < 0.8 ? 1 : 0;
      features.fold_mask(y, x) = random.uniform() < 0.5 ? 1 : 0;
      features.silhouette(y, x) = random.uniform() < 0.6 ? 1 : 0;
    }
  return features;
}

TEST(FoldMetric, IdenticalFramesHaveNoError) {
  const FrameFeatures features = random_features(1);
  const FrameError error = compare(features, features.angles, features.silhouette);
  EXPECT_EQ(error.fold, 0);
  EXPECT_EQ(error.silhouette, 0);
  EXPECT_EQ(error.mask_pixels, features.fold_mask.cast<int>().sum());
  EXPECT_EQ(error.overlap_pixels, (features.fold_mask * features.angles.valid).cast<int>().sum());
}

TEST(FoldMetric, ATurnOfAllStripesCostsItsSquareAPixel) {
  const FrameFeatures features = random_features(2);
  for (const float turn : {0.01f, 0.2f, -0.7f, 1.5f, 1.7f, -3.0f}) {
    AngleMap turned = features.angles;
    for (float& angle : turned.angle.reshaped()) angle = orientation_difference(angle, -turn);
    const FrameError error = compare(features, turned, features.silhouette);
    const double wrapped = double(orientation_difference(turn, 0.0f));
    const double expected = error.overlap_pixels * wrapped * wrapped;
    EXPECT_NEAR(error.fold, expected, 1e-5 * expected + 1e-6) << turn;
  }
}

TEST(FoldMetric, FollowsEquations5To8) {
  const FrameFeatures measured = random_features(3), simulated = random_features(4);
  double fold = 0, silhouette = 0, overlap = 0;
  for (int y = 0; y < kRows; ++y)
    for (int x = 0; x < kColumns; ++x) {
      silhouette += measured.silhouette(y, x) != simulated.silhouette(y, x);
      if (!measured.fold_mask(y, x) || !measured.angles.valid(y, x) ||
          !simulated.angles.valid(y, x))
        continue;
      ++overlap;
      const double d =
          std::remainder(double(measured.angles.angle(y, x)) - double(simulated.angles.angle(y, x)),
                         std::numbers::pi);
      fold += d * d;
    }
  const FrameError error = compare(measured, simulated.angles, simulated.silhouette);
  EXPECT_NEAR(error.fold, fold, 1e-5 * fold);
  EXPECT_EQ(error.silhouette, silhouette);
  EXPECT_EQ(error.overlap_pixels, overlap);
  EXPECT_NEAR(error.total(0.1), fold + 0.1 * silhouette, 1e-5 * fold);
}

TEST(FoldMetric, ShiftedSilhouetteCountsBothSides) {
  FrameFeatures features = random_features(5);
  features.silhouette.setZero();
  features.silhouette.block(5, 6, 10, 12).setOnes();
  Mask moved = Mask::Zero(kRows, kColumns);
  moved.block(5, 9, 10, 12).setOnes();
  EXPECT_EQ(compare(features, features.angles, moved).silhouette, 2 * 3 * 10);
}

TEST(FoldMetric, RefusesFramesOfDifferentSizes) {
  const FrameFeatures features = random_features(6);
  AngleMap small = features.angles;
  small.angle.conservativeResize(kRows - 1, kColumns);
  EXPECT_THROW(compare(features, small, features.silhouette), Error);
  EXPECT_THROW(compare(features, features.angles, Mask::Zero(kRows, kColumns + 1)), Error);
}

}  // namespace
}  // namespace weft::fold_metric_test
