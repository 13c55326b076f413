#include "weft/capture/lens.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <vector>

namespace weft::lens_test {
namespace {

constexpr LensDistortion kLens{-0.25, 0.08, 2e-3, -1.5e-3, 0.01};

Mat3 example_matrix(double skew) {
  return (Mat3() << 500, skew, 165.3, 0, 520, 118.9, 0, 0, 1).finished();
}

Pinhole example_camera(const Mat3& k) {
  const Mat3 rotation = (Eigen::AngleAxisd(0.3, Vec3(1, 2, 3).normalized())).toRotationMatrix();
  Projection projection;
  projection << k * rotation, k * Vec3(0.1, 0.2, 2);
  // Any scale, any sign.
  return {-7 * projection, Vec3::Zero(), "camera"};
}

TEST(CameraMatrix, IsRecoveredFromAProjection) {
  for (const double skew : {0.0, 3.0}) {
    const Mat3 k = example_matrix(skew);
    EXPECT_NEAR((camera_matrix(example_camera(k)) - k).norm(), 0, 1e-9);
  }
}

TEST(Distort, AgreesWithOpenCv) {
  const Mat3 k = example_matrix(0);
  const cv::Matx33d camera(k(0, 0), 0, k(0, 2), 0, k(1, 1), k(1, 2), 0, 0, 1);
  const std::vector<double> coefficients{kLens.k1, kLens.k2, kLens.p1, kLens.p2, kLens.k3};
  for (const Vec2& point : {Vec2(0, 0), Vec2(0.3, -0.2), Vec2(-0.33, 0.24), Vec2(0.1, 0.25)}) {
    const std::vector<cv::Point3d> world{{2 * point.x(), 2 * point.y(), 2}};
    std::vector<cv::Point2d> expected;
    cv::projectPoints(world, cv::Vec3d(0, 0, 0), cv::Vec3d(0, 0, 0), camera, coefficients,
                      expected);
    const Vec3 ideal = k * point.homogeneous();
    const Vec2 found = distort(k, kLens, ideal.head<2>());
    EXPECT_NEAR(found.x(), expected[0].x, 1e-9);
    EXPECT_NEAR(found.y(), expected[0].y, 1e-9);
  }
}

TEST(Undistort, StraightensAnImageOfSmoothLight) {
  const Mat3 k = example_matrix(0);
  const auto light = [](const Vec2& pixel) {
    return 0.5 + 0.25 * std::sin(pixel.x() / 15) + 0.25 * std::cos(pixel.y() / 11);
  };
  // What a lens shows at q is the light of the ideal pixel p with distort(p) = q: by fixed point.
  const auto ideal_pixel = [&](const Vec2& q) {
    Vec2 p = q;
    for (int i = 0; i < 20; ++i) p += q - distort(k, kLens, p);
    return p;
  };
  Image seen(240, 320);
  for (int i = 0; i < 240; ++i) {
    for (int j = 0; j < 320; ++j) {
      seen(i, j) = static_cast<float>(light(ideal_pixel(Vec2(j + 0.5, i + 0.5))));
    }
  }
  const Image straight = undistort(seen, example_camera(k), kLens);
  double worst = 0, moved = 0;
  for (int i = 0; i < 240; ++i) {
    for (int j = 0; j < 320; ++j) {
      const Vec2 p(j + 0.5, i + 0.5);
      const Vec2 q = distort(k, kLens, p);
      moved = std::max(moved, (p - q).norm());
      if (q.x() < 1 || q.x() > 319 || q.y() < 1 || q.y() > 239) continue;
      worst = std::max(worst, std::abs(static_cast<double>(straight(i, j)) - light(p)));
    }
  }
  EXPECT_GT(moved, 5) << "the lens must do something";
  // Bilinear interpolation errs by the second derivative / 8 in each axis, 0.25 / 11^2 / 8 and
  // 0.25 / 15^2 / 8: 4e-4; remap's fractions of 1/32 px add at most half a step of the slope,
  // 0.25 (1/11 + 1/15) / 64 = 6e-4. Half a pixel of wrong convention would be 1e-2.
  EXPECT_LT(worst, 1.1e-3);
}

}  // namespace
}  // namespace weft::lens_test
