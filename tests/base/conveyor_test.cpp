#include "weft/base/conveyor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <numeric>
#include <stdexcept>

namespace weft::conveyor_test {
namespace {

TEST(Conveyor, CarriesEveryItemInOrder) {
  for (const int threads : {1, 2}) {
    for (const std::size_t items : {1, 3}) {
      std::vector<int> used;
      Conveyor<int> conveyor(threads, items, [&](int& item) { used.push_back(item); });
      for (int i = 0; i < 1000; ++i) conveyor.put([&](int& item) { item = i; });
      conveyor.finish();
      std::vector<int> expected(1000);
      std::iota(expected.begin(), expected.end(), 0);
      EXPECT_EQ(used, expected) << threads << " threads, " << items << " items";
    }
  }
}

TEST(Conveyor, UsesAnItemOnAnotherThreadWhileTheNextIsFilled) {
  std::atomic<bool> second_filled{false};
  bool used_after = false;
  Conveyor<int> conveyor(2, 2, [&](int& item) {
    if (item != 1) return;
    second_filled.wait(false);  // for ever, if both were one thread
    used_after = true;
  });
  conveyor.put([](int& item) { item = 1; });
  conveyor.put([&](int& item) {
    item = 2;
    second_filled = true;
    second_filled.notify_all();
  });
  conveyor.finish();
  EXPECT_TRUE(used_after);
}

TEST(Conveyor, FillsTheSameItemsAgain) {
  for (const int threads : {1, 2}) {
    Conveyor<std::vector<int>> conveyor(threads, 2, [](std::vector<int>&) {});
    std::vector<const std::vector<int>*> filled;
    for (int i = 0; i < 10; ++i)
      conveyor.put([&](std::vector<int>& item) { filled.push_back(&item); });
    conveyor.finish();
    std::sort(filled.begin(), filled.end());
    const auto last = std::unique(filled.begin(), filled.end());
    EXPECT_EQ(last - filled.begin(), threads) << threads << " threads";
  }
}

TEST(Conveyor, ThrowsWhatTheUseThrew) {
  for (const int threads : {1, 2}) {
    int used = 0;
    const auto fail_at_third = [&](int& item) {
      if (item == 3) throw std::runtime_error("the third");
      ++used;
    };
    Conveyor<int> conveyor(threads, 2, fail_at_third);
    const auto carry = [&] {
      for (int i = 1; i < 100; ++i) conveyor.put([&](int& item) { item = i; });
      conveyor.finish();
    };
    EXPECT_THROW(carry(), std::runtime_error) << threads << " threads";
    EXPECT_EQ(used, 2) << threads << " threads";
  }
}

TEST(Conveyor, EndsWithoutHavingFinished) {
  for (int i = 0; i < 20; ++i) {
    std::vector<int> used;
    {
      Conveyor<int> conveyor(2, 4, [&](int& item) { used.push_back(item); });
      for (int k = 0; k < 4; ++k) conveyor.put([&](int& item) { item = k; });
    }
    // Some may have been dropped: those are the last ones.
    for (std::size_t k = 0; k < used.size(); ++k) EXPECT_EQ(used[k], static_cast<int>(k));
  }
}

}  // namespace
}  // namespace weft::conveyor_test
