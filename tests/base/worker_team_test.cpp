#include "weft/base/worker_team.h"

#include <gtest/gtest.h>

#include <numeric>

namespace weft::worker_team_test {
namespace {

TEST(WorkerTeam, RunsEachTaskOfEachRoundOnce) {
  for (const int threads : {1, 2, 4}) {
    WorkerTeam team(threads);
    std::vector<int> runs(7, 0);
    const auto add = [&](std::size_t i) { runs[i] += static_cast<int>(i) + 1; };
    const int rounds = 2000;
    for (int round = 0; round < rounds; ++round) team.run(runs.size(), add);
    for (std::size_t i = 0; i < runs.size(); ++i)
      EXPECT_EQ(runs[i], rounds * (static_cast<int>(i) + 1)) << threads << " threads, task " << i;
  }
}

TEST(WorkerTeam, ARoundSeesWhatTheOneBeforeWrote) {
  WorkerTeam team(2);
  std::vector<long> values(16, 1), sums(16, 0);
  for (int round = 0; round < 500; ++round) {
    team.run(16,
             [&](std::size_t i) { sums[i] = std::accumulate(values.begin(), values.end(), 0L); });
    team.run(16, [&](std::size_t i) { values[i] = sums[15 - i] % 1000 + 1; });
  }
  EXPECT_EQ(std::count(values.begin(), values.end(), values[0]), 16);
}

TEST(WorkerTeam, EndsWithoutHavingWorked) {
  for (int i = 0; i < 20; ++i) WorkerTeam team(2);
}

}  // namespace
}  // namespace weft::worker_team_test
