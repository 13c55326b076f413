#include "weft/optics/float_lanes.h"

#include <gtest/gtest.h>

#include <vector>

namespace weft::float_lanes_test {
namespace {

/// kFloatLanes rows of ten floats, 100 row + column, not in order in memory.
class Table {
 public:
  Table() {
    for (int k = 0; k < kFloatLanes; ++k)
      for (int column = 0; column < 10; ++column)
        row(k)[column] = static_cast<float>(100 * k + column);
  }
  float* row(int k) {
    return &values_[static_cast<std::size_t>(10 * (k % 2 == 0 ? k : kFloatLanes - k))];
  }
  template <class Pointer>
  std::array<Pointer, kFloatLanes> rows() {
    std::array<Pointer, kFloatLanes> result;
    for (int k = 0; k < kFloatLanes; ++k) result[static_cast<std::size_t>(k)] = row(k);
    return result;
  }

 private:
  std::vector<float> values_ = std::vector<float>(10 * kFloatLanes);
};

TEST(FloatLanes, ColumnsOfATableAreALaneARow) {
  Table table;
  const auto columns = load_columns(table.rows<const float*>(), 3);
  for (int k = 0; k < kFloatLanes; ++k)
    for (int i = 0; i < 4; ++i)
      EXPECT_EQ(columns[static_cast<std::size_t>(i)][k], static_cast<float>(100 * k + 3 + i));
}

TEST(FloatLanes, ColumnsAreWrittenWhereTheyAreRead) {
  Table table;
  const auto column = [](int i) {
    return float_lanes([&](int k) { return static_cast<float>(-10 * k - i); });
  };
  store_columns(table.rows<float*>(), 5, column(0), column(1), column(2), column(3));
  for (int k = 0; k < kFloatLanes; ++k)
    for (int i = 0; i < 10; ++i) {
      const bool written = i >= 5 && i < 9;
      EXPECT_EQ(table.row(k)[i], static_cast<float>(written ? -10 * k - (i - 5) : 100 * k + i));
    }
}

TEST(FloatLanes, PairsAreNeighboursInATable) {
  std::vector<float> table(50);
  for (std::size_t i = 0; i < table.size(); ++i) table[i] = static_cast<float>(i * i);
  const IntLanes at = int_lanes([](int k) { return (k * 13 + 5) % 49; });
  const auto [here, next] = load_pairs(table.data(), at);
  for (int k = 0; k < kFloatLanes; ++k) {
    EXPECT_EQ(here[k], static_cast<float>(at[k] * at[k]));
    EXPECT_EQ(next[k], static_cast<float>((at[k] + 1) * (at[k] + 1)));
  }
}

TEST(FloatLanes, EvenAndOddOnesOfTwoPacks) {
  const IntLanes first = int_lanes([](int k) { return k; });
  const auto [even, odd] = even_and_odd(first, first + kFloatLanes);
  for (int k = 0; k < kFloatLanes; ++k) {
    EXPECT_EQ(even[k], 2 * k);
    EXPECT_EQ(odd[k], 2 * k + 1);
  }
}

TEST(FloatLanes, AllAndAnyOfAMask) {
  for (int set = 0; set < kFloatLanes; ++set) {
    const IntLanes one = int_lanes([&](int k) { return k == set ? -1 : 0; });
    EXPECT_TRUE(any_of(one));
    EXPECT_FALSE(all_of(one));
    EXPECT_FALSE(all_of(~one));
  }
  EXPECT_TRUE(all_of(IntLanes{} - 1));
  EXPECT_FALSE(any_of(IntLanes{}));
}

}  // namespace
}  // namespace weft::float_lanes_test
