#include "weft/base/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace weft::parallel_test {
namespace {

TEST(ParallelFor, RunsEachTaskOnce) {
  for (const int threads : {0, 1, 2, 7}) {
    std::vector<int> runs(1000, 0);
    parallel_for(runs.size(), threads, [&](std::size_t i) { ++runs[i]; });
    EXPECT_EQ(runs, std::vector<int>(1000, 1)) << threads << " threads";
  }
  parallel_for(0, 0, [](std::size_t) { FAIL(); });
}

TEST(ParallelFor, OneThreadMeansTheCallingOneInOrder) {
  std::vector<std::size_t> order;
  const auto caller = std::this_thread::get_id();
  parallel_for(5, 1, [&](std::size_t i) {
    EXPECT_EQ(std::this_thread::get_id(), caller);
    order.push_back(i);
  });
  EXPECT_EQ(order, (std::vector<std::size_t>{0, 1, 2, 3, 4}));
}

TEST(ParallelFor, ThrowsTheExceptionOfTheLowestFailingTaskWhateverTheThreads) {
  for (const int threads : {1, 2, 4}) {
    for (int repeat = 0; repeat < 20; ++repeat) {
      try {
        parallel_for(200, threads, [](std::size_t i) {
          if (i >= 37 && i % 2 == 1) throw std::runtime_error(std::to_string(i));
        });
        FAIL() << "nothing was thrown";
      } catch (const std::runtime_error& error) {
        EXPECT_STREQ(error.what(), "37");
      }
    }
  }
}

// While a thread waits for an inner loop it must not start another task of the outer one: tasks
// keep buffers for each thread.
TEST(ParallelFor, InnerLoopsDoNotReenterTheOuterTask) {
  thread_local int depth = 0;
  std::atomic<bool> reentered{false};
  parallel_for(16, 2, [&](std::size_t) {
    if (++depth > 1) reentered = true;
    std::atomic<int> done{0};
    parallel_for(16, 2, [&](std::size_t) { ++done; });
    EXPECT_EQ(done, 16);
    --depth;
  });
  EXPECT_FALSE(reentered);
}

TEST(HardwareThreads, IsAtLeastOne) { EXPECT_GE(hardware_threads(), 1); }

}  // namespace
}  // namespace weft::parallel_test
