#include "weft/base/dense.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <random>

namespace weft {
namespace {

Vec3 random_vector(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  return {normal(random), normal(random), normal(random)};
}

TEST(Dense, TurnsOneDirectionToAnotherTheShortestWay) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 100; ++i) {
    const Vec3 from = random_vector(random), to = random_vector(random);
    const Mat3 turn = turn_between(from, to);
    EXPECT_LT((turn * from.normalized() - to.normalized()).norm(), 1e-14);
    EXPECT_LT((turn * turn.transpose() - Mat3::Identity()).norm(), 1e-14);
    const Vec3 axis = from.cross(to);
    EXPECT_LT((turn * axis - axis).norm(), 1e-14 * axis.norm() + 1e-14);
  }
}

TEST(Dense, TurnsADirectionToItsOpposite) {
  std::mt19937_64 random(2);
  for (const double off : {0.0, 1e-9, 1e-7, 1e-5}) {
    const Vec3 from = random_vector(random);
    const Vec3 to = -from + off * from.norm() * from.unitOrthogonal();
    const Mat3 turn = turn_between(from, to);
    // The sum of the two directions has an error of a rounding, over a length of `off`.
    EXPECT_LT((turn * from.normalized() - to.normalized()).norm(), 2e-8) << off;
    EXPECT_LT((turn * turn.transpose() - Mat3::Identity()).norm(), 1e-14) << off;
    EXPECT_GT(turn.determinant(), 0) << off;
  }
}

TEST(Dense, TellsWhichMatricesArePositiveDefinite) {
  std::mt19937_64 random(3);
  int positive = 0;
  for (int i = 0; i < 200; ++i) {
    Eigen::Matrix4d a;
    for (Eigen::Index k = 0; k < a.size(); ++k) a(k) = random_vector(random).x();
    a = Eigen::Matrix4d(a + a.transpose()) + 4 * Eigen::Matrix4d::Identity();
    const bool expected = symmetric_eigen(a).values[0] > 0;
    EXPECT_EQ(is_positive_definite(a), expected) << a;
    positive += expected;
  }
  EXPECT_GT(positive, 20);
  EXPECT_LT(positive, 180);
  EXPECT_FALSE(is_positive_definite(Mat3(Mat3::Zero())));
  EXPECT_FALSE(is_positive_definite(Mat3(Mat3::Constant(kInfinity - kInfinity))));
}

TEST(Dense, CongruenceIsTheFormInOtherCoordinates) {
  MatX a(2, 2), b(2, 3);
  a << 2, 1, 1, 3;
  b << 1, 0, 2, 0, 1, -1;
  MatX expected(3, 3);
  expected << 2, 1, 3, 1, 3, -1, 3, -1, 7;
  EXPECT_LT((congruence(a, b) - expected).norm(), 1e-14);
}

}  // namespace
}  // namespace weft
