#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <numbers>

#include "common/gradient_check.h"
#include "weft/base/random.h"
#include "weft/strain/dihedral_angle.h"
#include "weft/strain/shear.h"
#include "weft/strain/stretch.h"

namespace weft::strain_test {
namespace {

using testing::near;
using testing::numeric_gradient;
using testing::numeric_jacobian;

constexpr double kPi = std::numbers::pi;

VecX random_vector(Rng& rng, Eigen::Index size, double scale) {
  VecX x(size);
  for (auto& value : x) value = scale * rng.normal();
  return x;
}

Vec3 point(const VecX& x, int i) { return x.segment<3>(3 * i); }

/// Checks value, gradient and Hessian of `strain` (VecX -> struct with those members) at `x`, whose
/// features are of size `length`.
template <class F>
void expect_consistent(const F& strain, const VecX& x, double length) {
  const auto s = strain(x);
  const double step = 1e-3 * length;
  EXPECT_TRUE(
      near(s.gradient, numeric_gradient([&](const VecX& y) { return strain(y).value; }, x, step)));
  EXPECT_TRUE(
      near(s.hessian,
           numeric_jacobian([&](const VecX& y) -> VecX { return strain(y).gradient; }, x, step),
           testing::kTolerance, 1 / (length * length)));
  EXPECT_TRUE(near(s.hessian, s.hessian.transpose(), 1e-13));
}

TriangleShape<double> random_shape(Rng& rng) {
  const Vec2 p0(rng.normal(), rng.normal());
  return triangle_shape(p0, p0 + Vec2(1 + 0.3 * rng.normal(), 0.3 * rng.normal()),
                        p0 + Vec2(0.3 * rng.normal(), 1 + 0.3 * rng.normal()));
}

TEST(TriangleShape, ReproducesAHomogeneousDeformation) {
  Rng rng(1);
  const Vec2 p[3] = {{0.1, 0.2}, {0.7, 0.1}, {0.3, 0.9}};
  const auto shape = triangle_shape(p[0], p[1], p[2]);
  EXPECT_NEAR(shape.area, 0.5 * (0.6 * 0.7 - 0.2 * -0.1), 1e-15);
  Eigen::Matrix<double, 3, 2> f;
  for (int i = 0; i < 6; ++i) f(i) = rng.normal();
  Vec3 x[3];
  for (int i = 0; i < 3; ++i) x[i] = f * p[i] + Vec3(1, 2, 3);
  const auto w = deformation_gradient(shape, to_vector3(x[0]), to_vector3(x[1]), to_vector3(x[2]));
  EXPECT_LT((to_eigen(w.wu) - f.col(0)).norm(), 1e-13);
  EXPECT_LT((to_eigen(w.wv) - f.col(1)).norm(), 1e-13);
  // The orientation of the triangle does not matter.
  const auto turned = triangle_shape(p[0], p[2], p[1]);
  EXPECT_DOUBLE_EQ(turned.area, shape.area);
  EXPECT_DOUBLE_EQ(turned.du2, shape.du1);
}

TEST(Stretch, DerivativesAgreeWithDifferences) {
  Rng rng(2);
  for (int k = 0; k < 20; ++k) {
    const auto shape = random_shape(rng);
    const VecX x = random_vector(rng, 9, 1);
    for (const Thread thread : {Thread::weft, Thread::warp}) {
      const auto strain = [&](const VecX& y) {
        return stretch_strain(shape, thread, point(y, 0), point(y, 1), point(y, 2));
      };
      const double length = std::min(1.0, strain(x).value + 1);
      expect_consistent(strain, x, length);
    }
  }
}

TEST(Stretch, IsTheRelativeElongation) {
  const auto shape = triangle_shape({0, 0}, {0.02, 0}, {0, 0.03});
  const Vec3 o(0, 0, 0), a(0.022, 0, 0), b(0, 0, 0.027);
  EXPECT_NEAR(stretch_strain(shape, Thread::weft, o, a, b).value, 0.1, 1e-14);
  EXPECT_NEAR(stretch_strain(shape, Thread::warp, o, a, b).value, -0.1, 1e-14);
}

TEST(Stretch, CollapsedTriangleHasNoGradient) {
  const auto shape = triangle_shape({0, 0}, {1, 0}, {0, 1});
  const Vec3 o(1, 2, 3);
  const TriangleStrain s = stretch_strain(shape, Thread::weft, o, o, Vec3(0, 0, 0));
  EXPECT_EQ(s.value, -1);
  EXPECT_TRUE(s.gradient.isZero(0));
  EXPECT_TRUE(s.hessian.isZero(0));
}

TEST(Shear, DerivativesAgreeWithDifferences) {
  Rng rng(3);
  for (int k = 0; k < 20; ++k) {
    const auto shape = random_shape(rng);
    expect_consistent(
        [&](const VecX& y) { return shear_strain(shape, point(y, 0), point(y, 1), point(y, 2)); },
        random_vector(rng, 9, 1), 1);
  }
}

TEST(Shear, IsTheSineOfTheShearAngle) {
  const auto shape = triangle_shape({0, 0}, {1, 0}, {0, 1});
  const double angle = 0.3;  // the warp is turned towards the weft, both keep their length
  EXPECT_NEAR(
      shear_strain(shape, Vec3::Zero(), Vec3(1, 0, 0), Vec3(std::sin(angle), std::cos(angle), 0))
          .value,
      std::sin(angle), 1e-15);
}

TEST(AngleOf, AgreesWithTheLibraryInAllQuadrants) {
  double worst = 0;
  for (int i = -4000; i <= 4000; ++i) {
    const double angle = kPi * i / 4000;
    const double s = 3 * std::sin(angle), c = 3 * std::cos(angle);
    const double expected = std::atan2(s, c);
    const double ulp = std::nextafter(std::abs(expected), 10.0) - std::abs(expected);
    worst = std::max(worst, std::abs(angle_of(s, c) - expected) / ulp);
  }
  EXPECT_LE(worst, 4);
  for (const double tiny : {1e-3, 1e-9, 1e-100}) {
    EXPECT_NEAR(angle_of(tiny, 1.0) / tiny, std::atan2(tiny, 1.0) / tiny, 1e-15);
    EXPECT_DOUBLE_EQ(angle_of(-tiny, -1.0), std::atan2(-tiny, -1.0));
  }
  EXPECT_EQ(angle_of(0.0, 1.0), 0);
  EXPECT_DOUBLE_EQ(angle_of(0.0, -1.0), kPi);
}

TEST(AngleOf, IsTheSameInLanes) {
  for (double angle = -3.1; angle < 3.1; angle += 0.1) {
    const Lanes s = broadcast<Lanes>(std::sin(angle)), c = broadcast<Lanes>(std::cos(angle));
    EXPECT_EQ(angle_of(s, c)[kLanes - 1], angle_of(std::sin(angle), std::cos(angle)));
  }
}

/// A hinge bent by `theta`, with the edge along x, apexes of different height and foot, then moved
/// rigidly.
VecX bent_hinge(double theta, const Eigen::Quaterniond& turn = Eigen::Quaterniond::Identity()) {
  const double half = 0.5 * theta;
  VecX x(12);
  x.segment<3>(0) = Vec3(0, 0, 0);
  x.segment<3>(3) = Vec3(1.2, 0, 0);
  x.segment<3>(6) = Vec3(0.4, 0.9 * std::cos(half), 0.9 * std::sin(half));
  x.segment<3>(9) = Vec3(1.5, -0.7 * std::cos(half), 0.7 * std::sin(half));
  for (int i = 0; i < 4; ++i)
    x.segment<3>(3 * i) = turn * Vec3(x.segment<3>(3 * i)) + Vec3(1, -2, 3);
  return x;
}

HingeStrain hinge(const VecX& x) {
  return dihedral_angle_strain(point(x, 0), point(x, 1), point(x, 2), point(x, 3));
}

TEST(DihedralAngle, ValueAloneIsTheSame) {
  Rng rng(21);
  for (int k = 0; k < 50; ++k) {
    std::array<Vector3<double>, 4> x;
    for (auto& p : x) p = {rng.normal(), rng.normal(), k == 0 ? 0 : rng.normal()};
    if (k == 1) x[3] = x[0];
    EXPECT_EQ(dihedral_angle_value(x[0], x[1], x[2], x[3]),
              dihedral_angle(x[0], x[1], x[2], x[3]).value);
  }
}

TEST(DihedralAngle, IsTheAngleByWhichTheHingeIsBent) {
  Rng rng(4);
  for (const double theta : {0.0, 1e-12, 1e-6, 0.5, 1.5, 2.5, 3.14, kPi - 1e-6}) {
    const Eigen::Quaterniond turn =
        Eigen::Quaterniond(rng.normal(), rng.normal(), rng.normal(), rng.normal()).normalized();
    // Coordinates of size 4 are rounded to 4e-16.
    EXPECT_NEAR(hinge(bent_hinge(theta, turn)).value, theta, 1e-14) << theta;
    EXPECT_NEAR(hinge(bent_hinge(-theta, turn)).value, -theta, 1e-14) << theta;
  }
}

TEST(DihedralAngle, DerivativesAgreeWithDifferences) {
  Rng rng(5);
  for (const double theta : {0.0, 1e-9, 0.3, -0.8, 1.7, -2.6, 3.1, -3.1})
    expect_consistent(hinge, bent_hinge(theta), 0.5);
  int checked = 0;
  while (checked < 30) {
    const VecX x = random_vector(rng, 12, 1);
    // Differences must not cross the jump at pi, and need triangles that are not nearly degenerate.
    if (std::abs(hinge(x).value) > 3 || hinge(x).gradient.norm() > 5) continue;
    expect_consistent(hinge, x, 0.2);
    ++checked;
  }
}

TEST(DihedralAngle, DerivativesAreContinuousAcrossPi) {
  const HingeStrain below = hinge(bent_hinge(kPi - 1e-7)), above = hinge(bent_hinge(kPi + 1e-7));
  EXPECT_NEAR(below.value - above.value, 2 * kPi, 1e-6);
  EXPECT_TRUE(near(below.gradient, above.gradient, 1e-6));
  EXPECT_TRUE(near(below.hessian, above.hessian, 1e-6));
}

TEST(DihedralAngle, RigidMotionLeavesItAlone) {
  const VecX x = bent_hinge(0.7);
  const HingeStrain s = hinge(x);
  for (int axis = 0; axis < 3; ++axis) {
    VecX translation(12), rotation(12), rotated_gradient(12);
    for (int i = 0; i < 4; ++i) {
      translation.segment<3>(3 * i) = Vec3::Unit(axis);
      rotation.segment<3>(3 * i) = Vec3::Unit(axis).cross(point(x, i));
      rotated_gradient.segment<3>(3 * i) =
          Vec3::Unit(axis).cross(Vec3(s.gradient.segment<3>(3 * i)));
    }
    EXPECT_NEAR(s.gradient.dot(translation), 0, 1e-13);
    EXPECT_NEAR(s.gradient.dot(rotation), 0, 1e-13);
    EXPECT_LT((s.hessian * translation).norm(), 1e-13);
    // The gradient turns with the hinge.
    EXPECT_LT((s.hessian * rotation - rotated_gradient).norm(), 1e-12);
  }
}

TEST(DihedralAngle, TurnsSignWithTheEdgeOrTheApexes) {
  const VecX x = bent_hinge(0.7);
  const auto value = [&](int a, int b, int c, int d) {
    return dihedral_angle_strain(point(x, a), point(x, b), point(x, c), point(x, d)).value;
  };
  EXPECT_NEAR(value(1, 0, 3, 2), 0.7, 1e-14);
  EXPECT_NEAR(value(1, 0, 2, 3), -0.7, 1e-14);
  EXPECT_NEAR(value(0, 1, 3, 2), -0.7, 1e-14);
}

TEST(DihedralAngle, DegenerateHingesAreZero) {
  const Vec3 o(0, 0, 0), e(1, 0, 0), a(0.3, 1, 0.2), b(0.3, -1, 0);
  for (const HingeStrain& s : {dihedral_angle_strain(o, o, a, b),        // no edge
                               dihedral_angle_strain(o, e, 0.4 * e, b),  // apex on the edge
                               dihedral_angle_strain(o, e, o, b),        // apex on a vertex
                               dihedral_angle_strain(o, e, a, 3 * e),    // apex on the line
                               dihedral_angle_strain(o, o, o, o)}) {
    EXPECT_EQ(s.value, 0);
    EXPECT_TRUE(s.gradient.isZero(0));
    EXPECT_TRUE(s.hessian.isZero(0));
  }
}

TEST(DihedralAngle, CrushedTrianglesStayFinite) {
  for (const double height : {1e-3, 1e-6, 1e-9, 1e-11, 1e-13}) {
    const HingeStrain s =
        dihedral_angle_strain({0, 0, 0}, {1, 0, 0}, {0.5, height, 0}, {0.5, -0.5, 0.5});
    EXPECT_TRUE(s.gradient.allFinite() && s.hessian.allFinite()) << height;
  }
}

}  // namespace
}  // namespace weft::strain_test
