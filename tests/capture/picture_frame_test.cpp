#include "weft/capture/picture_frame.h"

#include <gtest/gtest.h>

#include <cmath>

namespace weft::picture_frame_test {
namespace {

constexpr double kSide = 0.2;

// A bar has the direction (cos, sin) of half the angle at the pulled corner: the diagonal is the
// two of them.
TEST(PictureFrame, DisplacementIsTheDiagonalsGrowth) {
  for (const double degrees : {-80.0, -30.0, 0.0, 20.0, 60.0, 80.0}) {
    const double corner = (90 - degrees) * kDegree;
    const double diagonal = (Vec2(1, 0) + Vec2(std::cos(corner), std::sin(corner))).norm() * kSide;
    EXPECT_NEAR(frame_displacement(kSide, degrees * kDegree), diagonal - std::sqrt(2.0) * kSide,
                1e-15)
        << degrees;
  }
  EXPECT_NEAR(most_frame_shear, 80 * kDegree, 1e-15);
}

TEST(PictureFrame, ShearIsTheInverseOfDisplacement) {
  for (const double shear : {-1.3, -0.4, 0.0, 1e-6, 0.5, 1.3})
    EXPECT_NEAR(frame_shear(kSide, frame_displacement(kSide, shear)), shear, 1e-14);
}

TEST(PictureFrame, ThreadsKeepTheirLengthAndAddUpToTheDiagonal) {
  for (const double shear : {-1.0, -0.1, 0.0, 0.3, 1.2}) {
    const FrameThreads threads = frame_threads(shear);
    const Vec3 u = threads.along.col(0), v = threads.along.col(1);
    EXPECT_NEAR(u.norm(), 1, 1e-15);
    EXPECT_NEAR(v.norm(), 1, 1e-15);
    EXPECT_NEAR(u.dot(v), std::sin(shear), 1e-15);
    EXPECT_NEAR(u.cross(v).z(), std::cos(shear), 1e-15);  // not turned over
    const double diagonal = std::sqrt(2.0) + frame_displacement(1, shear);
    EXPECT_NEAR((u + v - Vec3(diagonal, 0, 0)).norm(), 0, 1e-14);
  }
}

TEST(PictureFrame, RatesAreDerivatives) {
  constexpr double kStep = 1e-5;
  for (const double shear : {-1.0, 0.0, 0.7}) {
    const auto difference = [&](const auto& f) {
      return (f(shear + kStep) - f(shear - kStep)) / (2 * kStep);
    };
    EXPECT_NEAR(frame_displacement_rate(kSide, shear),
                difference([](double s) { return frame_displacement(kSide, s); }), 1e-10);
    const Eigen::Matrix<double, 3, 2> rate =
        (frame_threads(shear + kStep).along - frame_threads(shear - kStep).along) / (2 * kStep);
    EXPECT_LT((frame_threads(shear).rate - rate).norm(), 1e-9);
  }
}

}  // namespace
}  // namespace weft::picture_frame_test
