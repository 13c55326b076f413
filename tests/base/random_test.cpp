#include "weft/base/random.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace weft::random_test {
namespace {

// The first outputs that the Rust crate `rand` tests for its Xoshiro256PlusPlus::seed_from_u64(0).
TEST(Rng, RepeatsThePublishedSequenceOfSeedZero) {
  Rng rng(0);
  for (const std::uint64_t expected :
       {5987356902031041503ULL, 7051070477665621255ULL, 6633766593972829180ULL,
        211316841551650330ULL, 9136120204379184874ULL}) {
    EXPECT_EQ(rng.bits(), expected);
  }
}

TEST(Rng, UniformStaysInItsIntervalAndHasItsMoments) {
  Rng rng(7);
  const int n = 100000;
  double sum = 0, squares = 0;
  for (int i = 0; i < n; ++i) {
    const double x = rng.uniform(-1, 3);
    ASSERT_GE(x, -1);
    ASSERT_LT(x, 3);
    sum += x;
    squares += x * x;
  }
  // Mean 1, standard deviation 4/sqrt(12); 5 standard errors of the mean are 0.018.
  const double mean = sum / n;
  EXPECT_NEAR(mean, 1, 0.018);
  EXPECT_NEAR(squares / n - mean * mean, 16.0 / 12, 0.03);
}

TEST(Rng, NormalHasTheMomentsAndTailsOfTheStandardNormal) {
  Rng rng(11);
  const int n = 200000;
  double sum = 0, squares = 0, fourth = 0;
  int beyond_two = 0;
  for (int i = 0; i < n; ++i) {
    const double x = rng.normal();
    sum += x;
    squares += x * x;
    fourth += x * x * x * x;
    beyond_two += std::abs(x) > 2 ? 1 : 0;
  }
  // Five standard errors: 1/sqrt(n), sqrt(2/n), sqrt(96/n), sqrt(p(1-p)/n).
  EXPECT_NEAR(sum / n, 0, 5 / std::sqrt(n));
  EXPECT_NEAR(squares / n, 1, 5 * std::sqrt(2.0 / n));
  EXPECT_NEAR(fourth / n, 3, 5 * std::sqrt(96.0 / n));
  EXPECT_NEAR(static_cast<double>(beyond_two) / n, 0.0455, 5 * std::sqrt(0.0455 / n));
}

TEST(Rng, StreamsOfOneSeedAreUncorrelated) {
  const int n = 20000;
  for (const std::uint64_t stream : {1ULL, 2ULL, 1000ULL}) {
    Rng a(5, 0), b(5, stream);
    double product = 0;
    for (int i = 0; i < n; ++i) product += a.normal() * b.normal();
    EXPECT_NEAR(product / n, 0, 5 / std::sqrt(n)) << "stream " << stream;
  }
}

// A seeding that only adds the stream to splitmix64's counter makes stream 1 start where stream 0
// is one word further.
TEST(Rng, NeighbouringStreamsShareNoOutputs) {
  std::vector<std::uint64_t> first;
  Rng a(5, 1);
  for (int i = 0; i < 50; ++i) first.push_back(a.bits());
  Rng b(5, 2);
  for (int i = 0; i < 50; ++i) {
    EXPECT_EQ(std::count(first.begin(), first.end(), b.bits()), 0);
  }
}

}  // namespace
}  // namespace weft::random_test
