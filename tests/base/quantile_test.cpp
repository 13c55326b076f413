#include "weft/base/quantile.h"

#include <gtest/gtest.h>

namespace weft::quantile_test {
namespace {

TEST(Quantile, IsAnEntryOfTheData) {
  EXPECT_EQ(quantile({3, 1, 2}, 0.5), 2);
  EXPECT_EQ(quantile({4, 3, 1, 2}, 0.5), 3);
  EXPECT_EQ(quantile({5, 4, 3, 1, 2}, 0.2), 2);
}

TEST(Quantile, ReachesFromTheLeastToTheLargest) {
  EXPECT_EQ(quantile({3, 1, 2}, 0), 1);
  EXPECT_EQ(quantile({3, 1, 2}, 1), 3);
  EXPECT_EQ(quantile({7}, 0.95), 7);
}

TEST(Quantile, OfNothingIsZero) { EXPECT_EQ(quantile({}, 0.5), 0); }

}  // namespace
}  // namespace weft::quantile_test
