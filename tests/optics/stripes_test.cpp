#include "weft/optics/stripes.h"

#include <gtest/gtest.h>

#include <limits>
#include <numbers>

#include "weft/base/error.h"
#include "weft/optics/stripe_filter.h"

namespace weft::stripes_test {
namespace {

StripePattern square() { return {StripePattern::Profile::square, 20, 4, 0.05}; }
StripePattern sine() { return {StripePattern::Profile::sine, 20, 4, 0.1}; }

TEST(StripePattern, SquareHasTheStatedLevelsAndEdges) {
  const StripePattern pattern = square();
  EXPECT_DOUBLE_EQ(pattern.light(5), 1);      // a quarter period: middle of the bright stripe
  EXPECT_DOUBLE_EQ(pattern.light(15), 0.05);  // middle of the dark one
  EXPECT_NEAR(pattern.light(0), 0.525, 1e-12);
  EXPECT_NEAR(pattern.light(10), 0.525, 1e-12);
  EXPECT_NEAR(pattern.light(-15), 1, 1e-12);
  // The slope at the edge is that of a ramp of period / (pi gain) rows.
  const double h = 1e-4;
  EXPECT_NEAR((pattern.light(h) - pattern.light(-h)) / (2 * h),
              0.95 / (20 / (std::numbers::pi * 4)), 1e-6);
}

TEST(StripePattern, SineIsASine) {
  for (const double y : {0.0, 1.3, 7.0, 12.6, 31.0})
    EXPECT_NEAR(sine().light(y), 0.1 + 0.45 * (1 + std::sin(std::numbers::pi * y / 10)), 1e-12);
}

TEST(StripeFilter, IsTheMeanOfASineOverTheInterval) {
  // The mean of sin over a width w is the sine times sinc(pi w / period).
  const StripeFilter filter(sine());
  for (const double width : {0.5, 3.0, 8.0, 20.0, 33.0})
    for (const double y : {-7.3, 0.0, 2.5, 11.0, 1013.7}) {
      const double a = std::numbers::pi * width / 20;
      const double mean = 0.55 + 0.45 * std::sin(std::numbers::pi * y / 10) * std::sin(a) / a;
      // Linear interpolation in the table: (period / 1024)^2 / 8 times the largest slope, twice,
      // over the width; and the phase of float y.
      EXPECT_NEAR(filter.mean(static_cast<float>(y), static_cast<float>(width)), mean, 1e-4);
    }
}

TEST(StripeFilter, IsTheMeanOfASquareOverTheInterval) {
  const StripePattern pattern = square();
  const StripeFilter filter(pattern);
  for (const double width : {0.3, 2.0, 11.0})
    for (const double y : {0.0, 0.9, 5.0, 9.6, 14.0}) {
      double mean = 0;
      const int steps = 20000;
      for (int k = 0; k < steps; ++k) mean += pattern.light(y + ((k + 0.5) / steps - 0.5) * width);
      EXPECT_NEAR(filter.mean(static_cast<float>(y), static_cast<float>(width)), mean / steps,
                  5e-4);
    }
}

TEST(StripeFilter, ANarrowIntervalGivesTheProfile) {
  const StripeFilter filter(square());
  for (const float y : {-4.0f, 3.0f, 6.5f, 13.0f})
    EXPECT_NEAR(filter.mean(y, 0), square().light(y), 1e-4);
}

TEST(StripeFilter, ManyIntervalsAtOnceAreTheSame) {
  const StripeFilter filter(square());
  const FloatLanes y = float_lanes([](int k) { return 7.3f * static_cast<float>(k) - 11.0f; });
  const FloatLanes width = float_lanes([](int k) { return 0.9f * static_cast<float>(k); });
  const FloatLanes together = filter.mean(y, width);
  for (int k = 0; k < kFloatLanes; ++k) EXPECT_EQ(together[k], filter.mean(y[k], width[k]));
}

TEST(StripeFilter, OfAHugeIntervalOrFarAwayIsWithinTheLight) {
  // Slivers seen edge-on have such footprints; nothing may be read beside the table.
  const StripeFilter filter(square());
  const float infinity = std::numeric_limits<float>::infinity();
  EXPECT_NEAR(filter.mean(3, 1e20f), 0.525, 1e-4);
  EXPECT_NEAR(filter.mean(3, infinity), 0.525, 1e-4);
  for (const float y : {1e12f, -1e12f, 3e38f}) {
    EXPECT_GE(filter.mean(y, 1), 0);
    EXPECT_LE(filter.mean(y, 1), 1.01f);
  }
  filter.mean(infinity, 1);
}

TEST(StripeFilter, RejectsPatternsWithoutMeaning) {
  const auto rejects = [](double period, double gain, double black) {
    EXPECT_THROW(StripeFilter({StripePattern::Profile::square, period, gain, black}), Error);
  };
  rejects(0, 4, 0.05);
  rejects(-20, 4, 0.05);
  rejects(std::numeric_limits<double>::infinity(), 4, 0.05);
  rejects(20, 0, 0.05);
  rejects(20, 4, -0.1);
  rejects(20, 4, 1.1);
}

}  // namespace
}  // namespace weft::stripes_test
