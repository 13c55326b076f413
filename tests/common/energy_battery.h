#pragma once
/// What every energy of the cloth must satisfy, whatever its formula: the battery that a new model
/// is run through. An energy is given as a triple (value, gradient, Hessian) of functions of the
/// flat vector of positions.
///
/// Tolerances: differences as in gradient_check.h. Invariants are sums over the elements of terms
/// that cancel; each term carries a rounding error of eps times its size, so that they hold to
/// `kRounding` = 1e-11 of the size of the terms (1e5 eps: room for a few thousand elements and for
/// positions of size 1 m that differ by 1 mm).
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <functional>

#include "common/gradient_check.h"
#include "weft/base/dense.h"

namespace weft::testing {

inline constexpr double kRounding = 1e-11;

struct Energy {
  std::function<double(const VecX&)> value;
  std::function<VecX(const VecX&)> gradient;
  std::function<MatX(const VecX&)> hessian;            ///< exact, both triangles
  std::function<MatX(const VecX&)> projected_hessian;  ///< positive semi-definite, both triangles
};

/// Both triangles from the lower one.
inline MatX from_lower(const SparseMatrix& lower) {
  const MatX dense = MatX(lower).triangularView<Eigen::Lower>();
  return dense + dense.transpose() - MatX(dense.diagonal().asDiagonal());
}

/// `x` moved rigidly: turned by `rotation` about the origin, then shifted.
inline VecX moved(const VecX& x, const Mat3& rotation, const Vec3& shift) {
  VecX out(x.size());
  for (Eigen::Index i = 0; i < x.size(); i += 3)
    out.segment<3>(i) = rotation * x.segment<3>(i) + shift;
  return out;
}

/// Force = - gradient of the energy; `step` in m, well below the size of the elements.
inline void expect_gradient(const Energy& energy, const VecX& x, double step) {
  EXPECT_TRUE(near(energy.gradient(x), numeric_gradient(energy.value, x, step)));
}

/// Hessian = derivative of the gradient, and symmetric.
inline void expect_hessian(const Energy& energy, const VecX& x, double step) {
  const MatX hessian = energy.hessian(x);
  EXPECT_TRUE(near(hessian, numeric_jacobian(energy.gradient, x, step)));
}

/// Value, gradient and Hessian go along with a rigid motion; translation and rotation cost nothing
/// to first order.
inline void expect_rigid_invariance(const Energy& energy, const VecX& x) {
  const Mat3 rotation =
      Eigen::AngleAxisd(1.1, Vec3(0.3, -0.8, 0.52).normalized()).toRotationMatrix();
  const VecX y = moved(x, rotation, Vec3(0.2, -0.1, 0.4));
  EXPECT_NEAR(energy.value(y), energy.value(x), kRounding * std::abs(energy.value(x)) + 1e-18);
  const VecX g = energy.gradient(x);
  EXPECT_TRUE(near(energy.gradient(y), moved(g, rotation, Vec3::Zero()), 1e3 * kRounding, 1e-9));
  Vec3 force = Vec3::Zero(), torque = Vec3::Zero();
  for (Eigen::Index i = 0; i < x.size(); i += 3) {
    force += g.segment<3>(i);
    torque += x.segment<3>(i).head<3>().cross(g.segment<3>(i).head<3>());
  }
  EXPECT_LT(force.norm(), kRounding * g.lpNorm<1>() + 1e-15);
  EXPECT_LT(torque.norm(), kRounding * g.lpNorm<1>() + 1e-15);
}

/// No eigenvalue of the projected Hessian below zero, up to rounding of the largest.
inline void expect_positive_semidefinite(const MatX& hessian) {
  ASSERT_TRUE(hessian.allFinite());
  const VecX values = symmetric_eigen(hessian).values;  // ascending
  EXPECT_GE(values[0], -1e-13 * values[values.size() - 1]);
}

}  // namespace weft::testing
