#include "weft/vision/strip_profile.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/temporary_folder.h"
#include "weft/base/error.h"
#include "weft/vision/video.h"

namespace weft::strip_profile_test {
namespace {

constexpr int kRows = 300, kColumns = 400;
constexpr double kRadius = 240;
const Vec2 kCentre(0, 280);

/// A bright arc of a circle from the left border, `half` px to both sides, over `sweep` rad, with a
/// dim body below it and a thin fibre that goes on beyond its end.
Image strip_picture(double sweep, double half) {
  Image image = Image::Constant(kRows, kColumns, 0.03f);
  for (int i = 0; i < kRows; ++i)
    for (int j = 0; j < kColumns; ++j) {
      const Vec2 p = Vec2(j + 0.5, i + 0.5) - kCentre;
      const double angle = std::atan2(p.x(), -p.y()), r = p.norm() - kRadius;
      if (angle < 0 || angle > sweep + 0.2) continue;
      const double width = angle < sweep ? half : 0.6;
      const double line = std::clamp(width + 0.5 - std::abs(r), 0.0, 1.0);
      const bool body = angle < sweep && r < 0 && r > -25;
      image(i, j) = static_cast<float>(std::max({0.03, body ? 0.2 : 0.0, 0.9 * line}));
    }
  return image;
}

TEST(StripProfile, FollowsTheLineToItsEnd) {
  const double sweep = 1.0, half = 4;
  const MaterialPoints found = find_strip_profile(strip_picture(sweep, half));
  double length = 0, furthest = 0;
  for (Eigen::Index i = 0; i < found.cols(); ++i) {
    const Vec2 p = found.col(i) - kCentre;
    furthest = std::max(furthest, std::abs(p.norm() - kRadius));
    if (i > 0) length += (found.col(i) - found.col(i - 1)).norm();
  }
  // The dim body draws the mean a little to its side.
  EXPECT_LT(furthest, 0.7);
  // Two steps, and the blur of 3 px.
  EXPECT_NEAR(length, kRadius * sweep, 11);
}

TEST(StripProfile, BeginsAtAGivenClamp) {
  const Image mirrored = strip_picture(0.9, 4).rowwise().reverse();
  const MaterialPoints found = find_strip_profile(mirrored, {.clamp = Vec2(kColumns - 40, 43)});
  EXPECT_NEAR(found(0, 0), kColumns - 40, 2);
  EXPECT_LT(found(0, found.cols() - 1), kColumns - 160);
}

TEST(StripProfile, RefusesPicturesWithoutAStrip) {
  EXPECT_THROW(find_strip_profile(Image::Constant(60, 80, 0.3f)), Error);
  EXPECT_THROW(find_strip_profile(strip_picture(0.9, 4), {.clamp = Vec2(-3, 10)}), Error);
  EXPECT_THROW(find_strip_profile(strip_picture(0.9, 4), {.blur = -1}), Error);
  EXPECT_THROW(read_grey_image("/nowhere.png"), Error);
}

TEST(GreyImage, IsReadAsItIs) {
  const test::TemporaryFolder folder;
  Image image = Image::Zero(4, 6);
  image(1, 2) = 1;
  write_png(folder.path() / "a.png", image);
  const Image read = read_grey_image(folder.path() / "a.png");
  ASSERT_EQ(read.rows(), 4);
  ASSERT_EQ(read.cols(), 6);
  EXPECT_EQ(read(1, 2), 1);
  EXPECT_EQ(read.sum(), 1);
}

}  // namespace
}  // namespace weft::strip_profile_test
