#include "weft/estimate/point_groups.h"

#include <gtest/gtest.h>

#include "weft/base/random.h"

namespace weft::point_groups_test {
namespace {

// 17 x 17 points, some of them left out: the fields' directions are orthonormal, and what is the
// same for all points is in them whole.
TEST(PointGroups, SumsAreOrthonormal) {
  const TriangleMesh mesh = make_swatch(0.1, 0.2, 17, 17);
  std::vector<char> left_out(17 * 17, 0);
  for (std::size_t i = 0; i < 40; ++i) left_out[i] = 1;
  const PointGroups groups(mesh.material, left_out);
  EXPECT_EQ(groups.points(), 17 * 17 - 40);
  EXPECT_GT(groups.groups(), 50);
  EXPECT_LE(groups.groups(), 64);
  const MatX all = MatX::Identity(3 * groups.groups(), 3 * groups.groups());
  const MatX directions = groups.spread(all);
  EXPECT_LT((directions.transpose() * directions - all).norm(), 1e-12);
  Rng rng(1);
  MatX rows(3 * groups.points(), 2);
  for (double& entry : rows.reshaped()) entry = rng.normal();
  EXPECT_LT((groups.sums(rows) - directions.transpose() * rows).norm(), 1e-12);
  const VecX same = VecX::Ones(3 * groups.points());
  EXPECT_LT((groups.spread(groups.sums(same)) - same).norm(), 1e-12);
}

TEST(PointGroups, NoPointsAreNoGroups) {
  const PointGroups none;
  EXPECT_EQ(none.points(), 0);
  EXPECT_EQ(none.groups(), 0);
  EXPECT_EQ(none.sums(MatX(0, 3)).rows(), 0);
  EXPECT_EQ(none.spread(MatX(0, 3)).rows(), 0);
}

}  // namespace
}  // namespace weft::point_groups_test
