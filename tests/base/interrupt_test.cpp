#include "weft/base/interrupt.h"

#include <gtest/gtest.h>

#include <csignal>

namespace weft::interrupt_test {
namespace {

TEST(InterruptGuard, TurnsASignalIntoAFlagForItsLifetime) {
  EXPECT_FALSE(interrupted());
  {
    const InterruptGuard guard;
    EXPECT_FALSE(interrupted());
    std::raise(SIGINT);
    EXPECT_TRUE(interrupted());
  }
  EXPECT_FALSE(interrupted());
  {
    const InterruptGuard guard;
    std::raise(SIGTERM);
    EXPECT_TRUE(interrupted());
  }
}

TEST(InterruptGuardDeathTest, ASecondSignalEndsTheProcess) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  const auto raise_twice = [] {
    const InterruptGuard guard;
    std::raise(SIGINT);
    std::raise(SIGINT);
  };
  EXPECT_EXIT(raise_twice(), testing::KilledBySignal(SIGINT), "");
}

TEST(InterruptGuardDeathTest, RestoresWhatWasThereBefore) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  const auto raise_after = [] {
    { const InterruptGuard guard; }
    std::raise(SIGINT);
  };
  EXPECT_EXIT(raise_after(), testing::KilledBySignal(SIGINT), "");
}

}  // namespace
}  // namespace weft::interrupt_test
