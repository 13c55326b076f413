#include "weft/vision/angle_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "vision/gratings.h"
#include "weft/base/error.h"
#include "weft/base/random.h"

namespace weft::angle_map_test {
namespace {

using testing::Grating;
using testing::make_grating;
using testing::make_rings;

constexpr double kPi = std::numbers::pi;
constexpr double kDegree = kPi / 180;
const Mask kEverywhere(0, 0);

struct AngleError {
  double rms = 0;    ///< degrees
  double valid = 0;  ///< fraction of the pixels looked at
};

/// Over directions all around, away from the borders.
AngleError grating_error(Grating grating, const AngleMapOptions& options = {}) {
  constexpr int size = 112, border = 34;
  AngleMapper mapper(size, size, options);
  double squares = 0, count = 0, looked = 0;
  for (int k = 0; k < 9; ++k) {
    grating.angle = (-88 + 20.3 * k) * kDegree;
    grating.phase = 0.37 * k;
    const AngleMap& map =
        mapper.compute(make_grating(size, size, grating, std::uint64_t(k + 1)), kEverywhere);
    for (int y = border; y < size - border; ++y)
      for (int x = border; x < size - border; ++x) {
        ++looked;
        if (map.valid(y, x) == 0) continue;
        const double e =
            double(orientation_difference(map.angle(y, x), float(grating.angle))) / kDegree;
        squares += e * e;
        ++count;
      }
  }
  return {std::sqrt(squares / count), count / looked};
}

TEST(AngleMap, FindsTheDirectionOfCleanGratings) {
  // What is left is the Gaussian cut off at 0.3 %: 0.08 degrees for sines; a square's edges sampled
  // at 8 points a pixel add to it.
  for (const double period : {8.0, 10.0, 13.0, 17.0, 21.0, 25.0, 32.0})
    for (const bool square : {false, true}) {
      const AngleError error = grating_error({.period = period, .square = square});
      EXPECT_LT(error.rms, square ? 0.15 : 0.1) << "period " << period << " square " << square;
      EXPECT_GT(error.valid, 0.999);
    }
}

TEST(AngleMap, KeepsWithinAFifthOfADegreeUnderNoise) {
  for (const double period : {10.0, 17.0, 25.0})
    for (const double contrast : {1.0, 0.5, 0.2})
      for (const bool square : {false, true}) {
        const AngleError error = grating_error(
            {.period = period, .contrast = contrast, .square = square, .noise = contrast / 50});
        EXPECT_LT(error.rms, 0.2) << "period " << period << " contrast " << contrast;
        EXPECT_GT(error.valid, 0.99);
      }
}

TEST(AngleMap, AWiderBlurTakesMoreNoise) {
  AngleMapOptions wide;
  wide.blur_sigma = 6;
  for (const double period : {10.0, 17.0, 21.0}) {
    const Grating noisy{.period = period, .square = true, .noise = 0.05};
    const double rms = grating_error(noisy, wide).rms;
    EXPECT_LT(rms, 0.2) << "period " << period;
    EXPECT_LT(rms, grating_error(noisy).rms);
  }
}

TEST(AngleMap, PlacesDirectionsWhereTheyAre) {
  // Circles: the stripes run at right angles to the radius, through every direction and the wrap.
  // The error grows where the direction turns within the blur; 60 px away it has fallen to this.
  constexpr int size = 200;
  const double cx = 93.3, cy = 108.1;
  AngleMapper mapper(size, size);
  const AngleMap& map = mapper.compute(make_rings(size, size, cx, cy, 15), kEverywhere);
  double worst = 0;
  for (int y = 30; y < size - 30; ++y)
    for (int x = 30; x < size - 30; ++x) {
      const double dx = x + 0.5 - cx, dy = y + 0.5 - cy;
      if (std::hypot(dx, dy) < 45) continue;
      ASSERT_EQ(map.valid(y, x), 1);
      const float expected = float(std::atan2(dx, -dy));
      worst = std::max(worst, std::abs(double(orientation_difference(map.angle(y, x), expected))));
    }
  EXPECT_LT(worst / kDegree, 1.0);
}

TEST(AngleMap, AngleStaysInItsInterval) {
  AngleMapper mapper(64, 64);
  for (const double angle : {-kPi / 2, kPi / 2, kPi / 2 - 1e-4, 0.0, -0.3}) {
    const AngleMap& map = mapper.compute(make_grating(64, 64, {.angle = angle}), kEverywhere);
    EXPECT_LE(double(map.angle.maxCoeff()), kPi / 2 + 1e-6);
    EXPECT_GT(double(map.angle.minCoeff()), -kPi / 2 - 1e-6);
  }
}

TEST(AngleMap, TurnsWithThePicture) {
  // A quarter turn clockwise moves pixel (x, y) to (n - 1 - y, x) and adds a right angle.
  constexpr int n = 96;
  const Image image = make_rings(n, n, -20, 30, 17);
  Image turned(n, n);
  Mask region = Mask::Zero(n, n), turned_region = Mask::Zero(n, n);
  region.block(10, 8, 70, 80).setOnes();
  for (int y = 0; y < n; ++y)
    for (int x = 0; x < n; ++x) {
      turned(x, n - 1 - y) = image(y, x);
      turned_region(x, n - 1 - y) = region(y, x);
    }
  AngleMapper mapper(n, n), turned_mapper(n, n);
  const AngleMap& map = mapper.compute(image, region);
  const AngleMap& after = turned_mapper.compute(turned, turned_region);
  for (int y = 0; y < n; ++y)
    for (int x = 0; x < n; ++x) {
      ASSERT_EQ(map.valid(y, x), after.valid(x, n - 1 - y));
      if (map.valid(y, x) == 0) continue;
      const float expected = map.angle(y, x) + float(kPi / 2);
      ASSERT_NEAR(orientation_difference(after.angle(x, n - 1 - y), expected), 0, 1e-4);
    }
}

TEST(AngleMap, DoesNotLookOutsideTheRegion) {
  constexpr int n = 96;
  Mask region = Mask::Zero(n, n);
  for (int y = 0; y < n; ++y)
    for (int x = 0; x < n; ++x) region(y, x) = std::hypot(x - 50, y - 45) < 38 ? 1 : 0;
  Image image = make_grating(n, n, {.angle = 0.3});
  AngleMapper mapper(n, n), other(n, n);
  const AngleMap& map = mapper.compute(image, region);
  Rng random(3);
  for (int y = 0; y < n; ++y)
    for (int x = 0; x < n; ++x)
      if (region(y, x) == 0) image(y, x) = float(random.uniform());
  const AngleMap& changed = other.compute(image, region);
  EXPECT_TRUE((map.angle == changed.angle).all());
  EXPECT_TRUE((map.valid == changed.valid).all());
  EXPECT_TRUE((map.valid <= region).all());
  EXPECT_GT(map.valid.cast<int>().sum(), 0.9 * region.cast<int>().sum());
}

TEST(AngleMap, KeepsTheDirectionUpToTheRim) {
  constexpr int n = 128;
  Mask region = Mask::Zero(n, n);
  region.block(20, 24, 90, 80).setOnes();
  for (const double angle : {0.0, 0.2, -0.5, kPi / 2}) {
    AngleMapper mapper(n, n);
    const Image image = make_grating(n, n, {.angle = angle, .square = true});
    const AngleMap& map = mapper.compute(image, region);
    double squares = 0, count = 0;
    for (int y = 0; y < n; ++y)
      for (int x = 0; x < n; ++x)
        if (map.valid(y, x) != 0) {
          const double e = double(orientation_difference(map.angle(y, x), float(angle))) / kDegree;
          squares += e * e;
          ++count;
        }
    // A silhouette that acts as an edge would turn the rim by 45 degrees or more: 20 degrees rms
    // here.
    EXPECT_LT(std::sqrt(squares / count), 3.0) << angle;
  }
}

TEST(AngleMap, ShadingAndExposureDropOut) {
  constexpr int n = 128;
  const Image image = make_grating(n, n, {.angle = 0.1, .square = true});
  Image shaded = image;
  for (int x = 0; x < n; ++x) shaded.col(x) *= float(0.05 + 0.25 * x / n);  // by 6 over the width
  AngleMapper mapper(n, n), shaded_mapper(n, n);
  const AngleMap& map = mapper.compute(image, kEverywhere);
  const AngleMap& other = shaded_mapper.compute(shaded, kEverywhere);
  double squares = 0;
  for (int y = 30; y < n - 30; ++y)
    for (int x = 30; x < n - 30; ++x) {
      ASSERT_EQ(other.valid(y, x), 1);
      squares +=
          std::pow(double(orientation_difference(map.angle(y, x), other.angle(y, x))) / kDegree, 2);
    }
  EXPECT_LT(std::sqrt(squares / ((n - 60) * (n - 60))), 0.2);
  // Exposure alone changes rounding only.
  const Image dim = 0.125f * image;
  EXPECT_TRUE(((shaded_mapper.compute(dim, kEverywhere).angle - map.angle).abs() < 1e-4f).all());
}

TEST(AngleMap, HasNoAngleWithoutStripes) {
  constexpr int n = 96;
  AngleMapper mapper(n, n);
  EXPECT_EQ(mapper.compute(Image::Constant(n, n, 0.4f), kEverywhere).valid.cast<int>().sum(), 0);
  Image noise(n, n);
  Rng random(5);
  for (float& value : noise.reshaped()) value = float(0.5 + 0.05 * random.normal());
  EXPECT_LT(mapper.compute(noise, kEverywhere).valid.cast<double>().mean(), 0.1);
  // Half of the picture in shadow, with little noise in it.
  Image half = make_grating(n, n, {.square = true, .noise = 0.01});
  half.rightCols(n / 2) = 0.02f + 0.1f * (noise.rightCols(n / 2) - 0.5f);
  const AngleMap& map = mapper.compute(half, kEverywhere);
  EXPECT_LT(map.valid.rightCols(n / 2 - 12).cast<double>().mean(), 0.1);
  EXPECT_GT(map.valid.block(20, 10, n - 40, n / 2 - 30).cast<double>().mean(), 0.99);
}

TEST(AngleMap, HasNoAngleWhereTwoDirectionsMeet) {
  constexpr int n = 96;
  Image image = make_grating(n, n, {.angle = kPi / 4});
  image.rightCols(n / 2) = make_grating(n, n, {.angle = -kPi / 4}).rightCols(n / 2);
  AngleMapper mapper(n, n);
  const AngleMap& map = mapper.compute(image, kEverywhere);
  EXPECT_LT(map.valid.block(30, n / 2 - 2, n - 60, 4).cast<double>().mean(), 0.2);
  EXPECT_GT(map.valid.block(30, 20, n - 60, 10).cast<double>().mean(), 0.99);
}

TEST(AngleMap, RemembersNothingOfTheFrameBefore) {
  constexpr int n = 96;
  Mask large = Mask::Ones(n, n), small = Mask::Zero(n, n);
  small.block(30, 20, 40, 50).setOnes();
  const Image first = make_grating(n, n, {.angle = 1}), second = make_grating(n, n, {.angle = 0.2});
  AngleMapper used(n, n), fresh(n, n);
  used.compute(first, large);
  const AngleMap& map = used.compute(second, small);
  const AngleMap& expected = fresh.compute(second, small);
  EXPECT_TRUE((map.angle == expected.angle).all());
  EXPECT_TRUE((map.strength == expected.strength).all());
  EXPECT_TRUE((map.valid == expected.valid).all());
  // No pixel inside its rim.
  Mask thin = Mask::Zero(n, n);
  thin.block(35, 10, 2, 70).setOnes();
  const AngleMap& of_thin = used.compute(second, thin);
  EXPECT_EQ(of_thin.valid.cast<int>().sum(), 0);
  EXPECT_EQ(of_thin.strength.abs().maxCoeff(), 0);
  used.compute(second, small);
  EXPECT_EQ(used.compute(second, Mask::Zero(n, n)).valid.cast<int>().sum(), 0);
  EXPECT_EQ(used.compute(second, Mask::Zero(n, n)).angle.abs().maxCoeff(), 0);
}

TEST(AngleMap, RefusesWrongSizesAndOptions) {
  AngleMapper mapper(20, 10);
  EXPECT_NO_THROW(mapper.compute(Image::Zero(10, 20), kEverywhere));
  EXPECT_THROW(mapper.compute(Image::Zero(20, 10), kEverywhere), Error);
  EXPECT_THROW(mapper.compute(Image::Zero(10, 20), Mask::Ones(10, 19)), Error);
  const auto refused = [](auto change) {
    AngleMapOptions options;
    change(options);
    EXPECT_THROW(AngleMapper(20, 10, options), Error);
  };
  refused([](AngleMapOptions& o) { o.kernel_radius = 1; });
  refused([](AngleMapOptions& o) { o.kernel_radius = 65; });
  refused([](AngleMapOptions& o) { o.blur_sigma = 0; });
  refused([](AngleMapOptions& o) { o.blur_sigma = std::numeric_limits<double>::quiet_NaN(); });
  refused([](AngleMapOptions& o) { o.energy_threshold = -0.1; });
  refused([](AngleMapOptions& o) { o.coherence_threshold = 1.1; });
  EXPECT_THROW(AngleMapper(0, 10), Error);
}

TEST(OrientationDifference, WrapsToHalfATurn) {
  const float right = float(kPi / 2);
  EXPECT_NEAR(orientation_difference(right, -right + 0.01f), -0.01, 1e-6);
  EXPECT_NEAR(orientation_difference(-right + 0.01f, right), 0.01, 1e-6);
  EXPECT_NEAR(orientation_difference(0.3f, 0.1f), 0.2, 1e-6);
  EXPECT_NEAR(orientation_difference(1.5f, -1.5f), 3.0 - kPi, 1e-6);
  EXPECT_GT(orientation_difference(0.0f, right), 0);  // half a turn is + pi/2, never - pi/2
  Rng random(7);
  for (int k = 0; k < 1000; ++k) {
    const float a = float(random.uniform(-kPi / 2, kPi / 2));
    const float b = float(random.uniform(-kPi / 2, kPi / 2));
    const float d = orientation_difference(a, b);
    EXPECT_LE(std::abs(double(d)), kPi / 2 + 1e-6);
    EXPECT_NEAR(std::sin(2 * double(d)), std::sin(2 * (double(a) - double(b))), 1e-5);
    EXPECT_NEAR(std::cos(2 * double(d)), std::cos(2 * (double(a) - double(b))), 1e-5);
    // The same from further away, where it takes another way.
    EXPECT_NEAR(std::cos(2 * double(orientation_difference(a + float(7 * kPi), b))),
                std::cos(2 * double(d)), 1e-4);
  }
}

/// Directions of circles around a point: the gradient's magnitude is 1 / distance.
AngleMap circular_map(int size, double cx, double cy) {
  AngleMap map{Image(size, size), Image::Ones(size, size), Mask::Ones(size, size)};
  for (int y = 0; y < size; ++y)
    for (int x = 0; x < size; ++x) {
      const double turned = std::atan2(x + 0.5 - cx, -(y + 0.5 - cy));
      map.angle(y, x) = orientation_difference(float(turned), 0.0f);
    }
  return map;
}

TEST(GradientMask, FollowsTheCurvatureOfCirclesAcrossTheWrap) {
  constexpr int size = 120;
  const double cx = 60.2, cy = 59.7, threshold = 0.03;
  const Mask mask = gradient_mask(circular_map(size, cx, cy), threshold);
  for (int y = 1; y < size - 1; ++y)
    for (int x = 1; x < size - 1; ++x) {
      const double distance = std::hypot(x + 0.5 - cx, y + 0.5 - cy);
      // Differences over 2 px are within 1 % of the derivative from 10 px on.
      if (distance > 10 && distance < 0.98 / threshold) {
        ASSERT_EQ(mask(y, x), 1) << x << " " << y;
      }
      if (distance > 1.02 / threshold) {
        ASSERT_EQ(mask(y, x), 0) << x << " " << y;
      }
    }
}

TEST(GradientMask, LeavesOutPlanarAndUndefinedParts) {
  AngleMap map = circular_map(60, 30.1, 29.8);
  map.angle.setConstant(float(kPi / 2));
  map.angle.leftCols(20) =
      float(-kPi / 2) + 1e-5f;  // the same direction, on the other side of the wrap
  EXPECT_EQ(gradient_mask(map, 0.01).cast<int>().sum(), 0);

  map = circular_map(60, 30.1, 29.8);
  map.valid.topRows(30).setZero();
  map.angle.topRows(30).setConstant(1.0f);  // must not count as a neighbour
  const Mask mask = gradient_mask(map, 0.05);
  EXPECT_EQ(mask.topRows(30).cast<int>().sum(), 0);
  EXPECT_EQ(mask(30, 2), 0);   // 28 px away: gradient 0.036
  EXPECT_EQ(mask(30, 14), 1);  // 16 px away: gradient 0.063
  EXPECT_THROW(gradient_mask(map, -1), Error);
}

}  // namespace
}  // namespace weft::angle_map_test
