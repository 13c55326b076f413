#include "weft/report/ticks.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "weft/base/random.h"

namespace weft::ticks_test {
namespace {

double number_in(std::string label) {
  if (label.starts_with("−")) label.replace(0, std::string("−").size(), "-");
  return std::stod(label);
}

/// Mantissa in [1, 10).
double mantissa(double value) {
  const double m = value / std::pow(10.0, std::floor(std::log10(value) + 1e-9));
  return m;
}

TEST(LinearTicks, AreNiceInsideTheRangeAndSayWhereTheyStand) {
  Rng rng(7);
  for (int trial = 0; trial < 2000; ++trial) {
    const double centre = rng.uniform(-3, 3) * std::pow(10.0, rng.uniform(-6, 6));
    const double length = std::abs(centre) * std::pow(10.0, rng.uniform(-2, 2)) + 1e-9;
    const double lower = centre - length / 2, upper = centre + length / 2;
    const int most = 3 + static_cast<int>(rng.uniform(0, 8));
    const Ticks ticks = linear_ticks(lower, upper, most);
    ASSERT_GE(ticks.positions.size(), 1u) << lower << " to " << upper;
    ASSERT_LE(ticks.positions.size(), static_cast<std::size_t>(most) + 1);
    ASSERT_EQ(ticks.labels.size(), ticks.positions.size());
    for (std::size_t i = 0; i < ticks.positions.size(); ++i) {
      const double position = ticks.positions[i];
      EXPECT_GE(position, lower - 1e-6 * length);
      EXPECT_LE(position, upper + 1e-6 * length);
      // The label, read as a reader does, is the position: nothing is lost by its rounding.
      EXPECT_NEAR(number_in(ticks.labels[i]) * std::pow(10.0, ticks.exponent), position,
                  1e-9 * std::max(std::abs(lower), std::abs(upper)));
      if (i == 0) continue;
      const double step = position - ticks.positions[i - 1];
      const double m = mantissa(step);
      const double distance = std::min(
          {std::abs(m - 1), std::abs(m - 2), std::abs(m - 2.5), std::abs(m - 5), std::abs(m - 10)});
      // The difference of two positions carries their rounding.
      EXPECT_LT(distance, 1e-12 * std::abs(position) / step * 10 + 1e-6) << step;
    }
  }
}

TEST(LinearTicks, KnownRanges) {
  EXPECT_EQ(linear_ticks(0, 1, 5).labels,
            (std::vector<std::string>{"0.0", "0.2", "0.4", "0.6", "0.8", "1.0"}));
  EXPECT_EQ(linear_ticks(-1.2, 1.2, 3).labels, (std::vector<std::string>{"−1", "0", "1"}));
  EXPECT_EQ(linear_ticks(0, 1, 4).labels,
            (std::vector<std::string>{"0.00", "0.25", "0.50", "0.75", "1.00"}));
}

TEST(LinearTicks, LargeAndSmallNumbersShareAPowerOfTen) {
  const Ticks large = linear_ticks(0, 2e6, 4);
  EXPECT_EQ(large.exponent, 6);
  EXPECT_EQ(large.labels, (std::vector<std::string>{"0.0", "0.5", "1.0", "1.5", "2.0"}));
  const Ticks small = linear_ticks(0, 4e-5, 4);
  EXPECT_EQ(small.exponent, -6);
  EXPECT_EQ(small.labels, (std::vector<std::string>{"0", "10", "20", "30", "40"}));
}

TEST(LinearTicks, IntegersOnlyWhereAsked) {
  for (const double upper : {1.0, 2.0, 3.0, 7.0, 23.0, 99.0}) {
    for (const double position : linear_ticks(0, upper, 10, TickStep::whole).positions) {
      EXPECT_EQ(position, std::round(position));
    }
  }
}

TEST(LinearTicks, NothingForRangesThatAreNone) {
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(linear_ticks(1, 1, 5).positions.empty());
  EXPECT_TRUE(linear_ticks(2, 1, 5).positions.empty());
  EXPECT_TRUE(linear_ticks(0, infinity, 5).positions.empty());
  EXPECT_TRUE(linear_ticks(std::nan(""), 1, 5).positions.empty());
  EXPECT_TRUE(log_ticks(0, 1, 5).positions.empty());
  EXPECT_TRUE(log_ticks(-1, 1, 5).positions.empty());
}

TEST(LogTicks, PowersOfTenOverDecades) {
  const Ticks ticks = log_ticks(1e-7, 1e-2, 10);
  EXPECT_EQ(ticks.labels,
            (std::vector<std::string>{"10⁻⁷", "10⁻⁶", "10⁻⁵", "10⁻⁴", "10⁻³", "10⁻²"}));
  EXPECT_EQ(ticks.minor.size(), 8u * 5);
  EXPECT_EQ(log_ticks(0.1, 100, 10).labels, (std::vector<std::string>{"0.1", "1", "10", "100"}));
}

TEST(LogTicks, AreThinnedOverManyDecades) {
  const Ticks ticks = log_ticks(1e-12, 1e12, 6);
  EXPECT_LE(ticks.positions.size(), 7u);
  for (const double position : ticks.positions) {
    const double exponent = std::log10(position);
    EXPECT_NEAR(exponent / 4, std::round(exponent / 4), 1e-9);
  }
}

TEST(LogTicks, OneTwoFiveOverLessThanTwoDecades) {
  EXPECT_EQ(log_ticks(1, 30, 10).labels, (std::vector<std::string>{"1", "2", "5", "10", "20"}));
}

TEST(LogTicks, LinearOverLessThanHalfADecade) {
  EXPECT_EQ(log_ticks(10, 20, 5).labels,
            (std::vector<std::string>{"10", "12", "14", "16", "18", "20"}));
}

}  // namespace
}  // namespace weft::ticks_test
