#include "weft/dynamics/retry_pause.h"

#include <gtest/gtest.h>

#include <vector>

namespace weft::retry_pause_test {
namespace {

/// The occasions of so many on which it tries, with each try ending in `success`.
std::vector<int> tries(RetryPause& pause, int occasions, bool success) {
  std::vector<int> on;
  for (int i = 0; i < occasions; ++i) {
    if (!pause.is_due()) continue;
    on.push_back(i);
    pause.note(success);
  }
  return on;
}

TEST(RetryPause, DoublesUpToTheLongestAndEndsWithASuccess) {
  RetryPause pause(8);
  EXPECT_EQ(tries(pause, 31, false), (std::vector{0, 2, 6, 14, 22, 30}));
  EXPECT_EQ(tries(pause, 11, true), (std::vector{7, 8, 9, 10}));
  EXPECT_EQ(tries(pause, 4, false), (std::vector{0, 2}));
}

}  // namespace
}  // namespace weft::retry_pause_test
