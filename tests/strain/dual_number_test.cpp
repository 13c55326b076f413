/// Strains, gradients and Hessians against dual numbers.
///
/// Tolerance: 1e-12 of the largest entry. The library computes in double; its rounding of some 20
/// eps = 5e-15 grows by the loss of digits where edges are much longer than the triangle is high
/// (up to 100 in these states; beyond, by the factor that is given).
#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "common/dual_strains.h"
#include "common/gradient_check.h"
#include "weft/base/random.h"
#include "weft/strain/dihedral_angle.h"
#include "weft/strain/shear.h"
#include "weft/strain/stretch.h"
#include "weft/strain/triangle_curvature.h"

namespace weft::dual_number_test {
namespace {

using testing::differentiate;
using testing::near;
using testing::point_of;
using testing::ScalarDerivatives;

constexpr double kDigits = 1e-12;

Vec3 point(const VecX& x, int i) { return x.segment<3>(3 * i); }

void expect_same(const ScalarDerivatives& expected, double value, const MatX& gradient,
                 const MatX& hessian, double tolerance = kDigits) {
  EXPECT_NEAR(value, expected.value, tolerance * std::max(1.0, std::abs(expected.value)));
  EXPECT_TRUE(near(gradient, expected.gradient, tolerance));
  EXPECT_TRUE(near(hessian, expected.hessian, tolerance));
}

using Corners = std::array<Vec2, 3>;

Corners random_corners(Rng& rng) {
  const Vec2 p(rng.normal(), rng.normal());
  return {p, p + 0.02 * Vec2(1 + 0.3 * rng.normal(), 0.3 * rng.normal()),
          p + 0.02 * Vec2(0.3 * rng.normal(), 1 + 0.3 * rng.normal())};
}

/// Nearly flat, strongly deformed, squeezed to a hundredth of its width, sheared until the threads
/// are nearly parallel.
std::vector<VecX> triangle_states(const Corners& p, Rng& rng) {
  const auto state = [&](const Eigen::Matrix<double, 3, 2>& f, double noise) {
    VecX x(9);
    for (int i = 0; i < 3; ++i)
      x.segment<3>(3 * i) = f * (p[static_cast<std::size_t>(i)] - p[0]) +
                            0.02 * noise * Vec3(rng.normal(), rng.normal(), rng.normal());
    return x;
  };
  Eigen::Matrix<double, 3, 2> flat, narrow, parallel;
  flat << 1, 0, 0, 1, 0, 0;
  narrow << 0.01, 0, 0, 1, 0, 0;
  parallel << 1, 0.999, 0, 0.03, 0, 0.03;
  return {state(flat, 0.01), state(flat, 0.5), state(narrow, 1e-3), state(parallel, 1e-3)};
}

TEST(DualNumbers, DifferentiateWhatIsKnown) {
  // atan2(y, x) sqrt(x) / y at (4, 3): written out by hand.
  const auto f = [](const auto& v) { return atan2(v[1], v[0]) * sqrt(v[0]) / v[1]; };
  const double x = 4, y = 3, t = std::atan2(y, x), q = x * x + y * y;
  const ScalarDerivatives d = differentiate(f, (VecX(2) << x, y).finished());
  EXPECT_DOUBLE_EQ(d.value, t * 2 / 3);
  EXPECT_DOUBLE_EQ(d.gradient[0], -y / q * 2 / 3 + t / (2 * 2 * 3));
  EXPECT_DOUBLE_EQ(d.gradient[1], x / q * 2 / 3 - t * 2 / 9);
  // d/dx of the second: (y^2 - x^2) / q^2 sqrt(x) / y + x / (2 q sqrt(x) y) + sqrt(x) / (q y)
  // - t / (2 sqrt(x) y^2).
  EXPECT_NEAR(d.hessian(0, 1),
              (y * y - x * x) / (q * q) * 2 / 3 + x / (2 * q * 2 * 3) + 2 / (q * y) - t / (4 * 9),
              1e-16);
}

TEST(DualNumbers, Stretch) {
  Rng rng(21);
  for (int k = 0; k < 10; ++k) {
    const Corners p = random_corners(rng);
    const auto shape = triangle_shape(p[0], p[1], p[2]);
    for (const VecX& x : triangle_states(p, rng))
      for (const Thread thread : {Thread::weft, Thread::warp}) {
        const auto strain = [&](const auto& v) {
          const auto w = testing::thread_vectors<std::decay_t<decltype(v[0])>>(
              p, {point_of(v, 0), point_of(v, 1), point_of(v, 2)});
          return length(w[thread == Thread::weft ? 0 : 1]) - 1.0;
        };
        const TriangleStrain s =
            stretch_strain(shape, thread, point(x, 0), point(x, 1), point(x, 2));
        expect_same(differentiate(strain, x), s.value, s.gradient, s.hessian);
      }
  }
}

TEST(DualNumbers, Shear) {
  Rng rng(22);
  for (int k = 0; k < 10; ++k) {
    const Corners p = random_corners(rng);
    const auto shape = triangle_shape(p[0], p[1], p[2]);
    const auto strain = [&](const auto& v) {
      const auto w = testing::thread_vectors<std::decay_t<decltype(v[0])>>(
          p, {point_of(v, 0), point_of(v, 1), point_of(v, 2)});
      return dot(w[0], w[1]);
    };
    for (const VecX& x : triangle_states(p, rng)) {
      const TriangleStrain s = shear_strain(shape, point(x, 0), point(x, 1), point(x, 2));
      expect_same(differentiate(strain, x), s.value, s.gradient, s.hessian);
    }
  }
}

/// A hinge bent by `theta` whose triangles have the heights `high` and 0.7, turned at random.
VecX bent_hinge(Rng& rng, double theta, double high) {
  const Eigen::Quaterniond turn =
      Eigen::Quaterniond(rng.normal(), rng.normal(), rng.normal(), rng.normal()).normalized();
  VecX x(12);
  x << 0, 0, 0, 1.2, 0, 0, 0.4, high, 0, 1.5, -0.7 * std::cos(theta), 0.7 * std::sin(theta);
  for (int i = 0; i < 4; ++i) x.segment<3>(3 * i) = turn * Vec3(point(x, i));
  return x;
}

TEST(DualNumbers, DihedralAngle) {
  Rng rng(23);
  const auto strain = [](const auto& v) {
    return testing::hinge_angle(point_of(v, 0), point_of(v, 1), point_of(v, 2), point_of(v, 3));
  };
  for (const double high : {0.9, 0.1, 1e-2, 1e-4})
    for (const double theta : {0.0, 1e-8, 0.4, -1.3, 2.2, -3.0, 3.14, -3.14159}) {
      const VecX x = bent_hinge(rng, theta, high);
      const HingeStrain s =
          dihedral_angle_strain(point(x, 0), point(x, 1), point(x, 2), point(x, 3));
      expect_same(differentiate(strain, x), s.value, s.gradient, s.hessian,
                  kDigits * std::max(1.0, 1e-2 / high));
    }
}

using detail::hinge_vertices;

/// All blocks as a symmetric matrix.
MatX dense(const CurvatureHessian<double>& h) {
  MatX out(18, 18);
  for (std::size_t row = 0; row < 6; ++row)
    for (std::size_t column = 0; column <= row; ++column) {
      const auto r = static_cast<Eigen::Index>(3 * row), c = static_cast<Eigen::Index>(3 * column);
      const Mat3 block = row == column ? to_eigen(h.diagonal[row].full())
                                       : to_eigen(h.lower[h.index(row, column)]);
      out.block<3, 3>(r, c) = block;
      out.block<3, 3>(c, r) = block.transpose();
    }
  return out;
}

TEST(DualNumbers, TriangleCurvature) {
  Rng rng(24);
  for (int k = 0; k < 5; ++k) {
    const Corners p = random_corners(rng);
    const Mat3 by_angle = testing::curvature_by_angle(p);
    CurvatureMap<double> map;
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c)
        map.r[static_cast<std::size_t>(r)][static_cast<std::size_t>(c)] = by_angle(r, c);
    // The triangle and its neighbours, mirrored at the middles of its edges; then crumpled.
    for (const double noise : {1e-4, 0.1, 0.4}) {
      VecX x(18);
      for (std::size_t i = 0; i < 6; ++i) {
        const Vec2 at = i < 3 ? p[i] : Vec2(p[i - 3] + p[(i - 2) % 3] - p[(i - 1) % 3]);
        x.segment<3>(static_cast<Eigen::Index>(3 * i)) =
            Vec3(at.x() - p[0].x(), at.y() - p[0].y(), 0) +
            0.02 * noise * Vec3(rng.normal(), rng.normal(), rng.normal());
      }
      std::array<Vector3<double>, 6> corners;
      for (int i = 0; i < 6; ++i) corners[static_cast<std::size_t>(i)] = to_vector3(point(x, i));
      const auto curvature = triangle_curvature(map, corners);
      for (std::size_t component = 0; component < 3; ++component) {
        const auto strain = [&](const auto& v) {
          std::decay_t<decltype(v[0])> sum = 0.0;
          for (std::size_t j = 0; j < 3; ++j)
            sum = sum + by_angle(static_cast<Eigen::Index>(component), Eigen::Index(j)) *
                            testing::hinge_angle(point_of(v, j), point_of(v, (j + 1) % 3),
                                                 point_of(v, (j + 2) % 3), point_of(v, 3 + j));
          return sum;
        };
        std::array<double, 3> factor{};
        factor[component] = 1;
        const auto g = curvature_gradient(map, curvature, factor);
        VecX gradient(18);
        for (int i = 0; i < 6; ++i)
          gradient.segment<3>(3 * i) = to_eigen(g[static_cast<std::size_t>(i)]);
        CurvatureHessian<double> hessian{};
        add_curvature_hessian(map, curvature, factor, hessian);
        expect_same(differentiate(strain, x), curvature.value[component], gradient, dense(hessian));
      }
    }
  }
}

}  // namespace
}  // namespace weft::dual_number_test
