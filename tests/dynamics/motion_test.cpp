#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "weft/base/error.h"
#include "weft/dynamics/scene.h"

namespace weft::motion_test {
namespace {

Points columns(std::initializer_list<Vec3> list) {
  Points points(3, static_cast<Eigen::Index>(list.size()));
  Eigen::Index i = 0;
  for (const Vec3& p : list) points.col(i++) = p;
  return points;
}

TEST(Motion, PassesThroughItsSamplesAndRestsOutside) {
  const Motion motion({0.0, 0.5, 0.7, 2.0},
                      columns({{0, 0, 1}, {0.1, 0, 1.2}, {0.3, -1, 0}, {0.2, 5, 2}}));
  EXPECT_TRUE(motion.position(0.5).isApprox(Vec3(0.1, 0, 1.2), 1e-14));
  EXPECT_TRUE(motion.position(0.7).isApprox(Vec3(0.3, -1, 0), 1e-14));
  EXPECT_EQ(motion.position(-3), Vec3(0, 0, 1));
  EXPECT_EQ(motion.position(9), Vec3(0.2, 5, 2));
  EXPECT_EQ(motion.velocity(-1e-9), Vec3::Zero());
  EXPECT_EQ(motion.velocity(2.1), Vec3::Zero());
  EXPECT_EQ(motion.start_time(), 0.0);
  EXPECT_EQ(motion.end_time(), 2.0);
}

TEST(Motion, IsTwiceContinuouslyDifferentiableWithNaturalEnds) {
  const Motion motion({0.0, 0.5, 0.7, 2.0},
                      columns({{0, 0, 1}, {0.1, 0, 1.2}, {0.3, -1, 0}, {0.2, 5, 2}}));
  const double eps = 1e-9;
  for (const double knot : {0.5, 0.7}) {
    EXPECT_LT((motion.velocity(knot - eps) - motion.velocity(knot + eps)).norm(), 1e-6);
    EXPECT_LT((motion.acceleration(knot - eps) - motion.acceleration(knot + eps)).norm(), 1e-5);
  }
  EXPECT_LT(motion.acceleration(0).norm(), 1e-12);
  EXPECT_LT(motion.acceleration(2).norm(), 1e-12);
}

TEST(Motion, VelocityAndAccelerationAreDerivatives) {
  const Motion motion({0.0, 0.5, 0.7, 2.0},
                      columns({{0, 0, 1}, {0.1, 0, 1.2}, {0.3, -1, 0}, {0.2, 5, 2}}));
  const double h = 1e-5;  // central differences: truncation ~ h^2, rounding ~ 1e-16 / h
  for (const double t : {0.1, 0.6, 1.3, 1.9}) {
    const Vec3 v = (motion.position(t + h) - motion.position(t - h)) / (2 * h);
    const Vec3 a = (motion.velocity(t + h) - motion.velocity(t - h)) / (2 * h);
    EXPECT_LT((v - motion.velocity(t)).norm(), 1e-7);
    EXPECT_LT((a - motion.acceleration(t)).norm(), 1e-7);
  }
}

TEST(Motion, ErrorOnASineFallsWithTheFourthPowerOfTheSpacing) {
  // sin(pi t) over whole half periods has natural ends itself.
  auto error = [](int intervals) {
    std::vector<double> times;
    Points positions = Points::Zero(3, intervals + 1);
    for (int i = 0; i <= intervals; ++i) {
      times.push_back(3.0 * i / intervals);
      positions(1, i) = std::sin(M_PI * times.back());
    }
    const Motion motion(times, positions);
    double largest = 0;
    for (double t = 0; t <= 3; t += 0.0013) {
      largest = std::max(largest, std::abs(motion.position(t).y() - std::sin(M_PI * t)));
    }
    return largest;
  };
  EXPECT_NEAR(std::log2(error(30) / error(60)), 4, 0.1);
}

TEST(Motion, EqualSamplesGiveAConstant) {
  const Vec3 p(0.1, -0.7, 1.3);
  const Motion motion({0.0, 0.3, 0.4, 1.0}, columns({p, p, p, p}));
  for (double t = -0.1; t < 1.1; t += 0.01) {
    EXPECT_EQ(motion.position(t), p);
    EXPECT_EQ(motion.velocity(t), Vec3::Zero());
  }
  const Motion fixed = Motion::fixed(p);
  EXPECT_EQ(fixed.position(123), p);
  EXPECT_EQ(fixed.end_time(), std::numeric_limits<double>::infinity());
  EXPECT_EQ(Motion().position(0), Vec3::Zero());
}

TEST(Motion, RejectsBadSamples) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(Motion({}, Points(3, 0)), Error);
  EXPECT_THROW(Motion({0, 1}, Points::Zero(3, 3)), Error);
  EXPECT_THROW(Motion({0, 1, 1}, Points::Zero(3, 3)), Error);
  EXPECT_THROW(Motion({0, 2, 1}, Points::Zero(3, 3)), Error);
  EXPECT_THROW(Motion({0, nan}, Points::Zero(3, 2)), Error);
  EXPECT_THROW(Motion({0, 1}, Points::Constant(3, 2, nan)), Error);
}

}  // namespace
}  // namespace weft::motion_test
