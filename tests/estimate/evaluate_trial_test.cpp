#include "weft/estimate/evaluate_trial.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace weft::evaluate_trial_test {
namespace {

struct Tool {};

TEST(ForEachWhileMade, LooksAtEachOnceAndNotBeforeItIsMade) {
  for (const int threads : {1, 2, 4}) {
    for (int round = 0; round < 50; ++round) {
      std::vector<int> made(40, 0), seen(40, 0);
      const std::size_t count = for_each_while_made(
          made.size(), threads, [] { return Tool(); },
          [&](const auto& ready) {
            for (std::size_t i = 0; i < made.size(); ++i) {
              made[i] = static_cast<int>(i) + 1;
              ready();
            }
          },
          [&](Tool&, std::size_t i) { seen[i] += made[i]; });
      EXPECT_EQ(count, made.size());
      EXPECT_EQ(seen, made) << threads << " threads";
    }
  }
}

TEST(ForEachWhileMade, LeavesOutWhatWasNotMade) {
  for (const int threads : {1, 2, 4}) {
    std::vector<int> seen(10, 0);
    const std::size_t count = for_each_while_made(
        seen.size(), threads, [] { return Tool(); },
        [](const auto& ready) {
          for (int i = 0; i < 3; ++i) ready();
        },
        [&](Tool&, std::size_t i) { ++seen[i]; });
    EXPECT_EQ(count, 3u);
    EXPECT_EQ(seen, (std::vector<int>{1, 1, 1, 0, 0, 0, 0, 0, 0, 0})) << threads << " threads";
  }
}

TEST(ForEachWhileMade, ThrowsWhatEitherSideThrows) {
  for (const int threads : {1, 2, 4}) {
    enum class Side { make, look };
    const auto run = [&](Side failing) {
      for_each_while_made(
          10, threads, [] { return Tool(); },
          [&](const auto& ready) {
            for (int i = 0; i < 5; ++i) ready();
            if (failing == Side::make) throw std::runtime_error("make");
          },
          [&](Tool&, std::size_t i) {
            if (failing == Side::look && i == 2) throw std::runtime_error("look");
          });
    };
    EXPECT_THROW(run(Side::make), std::runtime_error) << threads << " threads";
    EXPECT_THROW(run(Side::look), std::runtime_error) << threads << " threads";
  }
}

}  // namespace
}  // namespace weft::evaluate_trial_test
