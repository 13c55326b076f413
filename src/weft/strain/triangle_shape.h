#pragma once
/// Geometry that the membrane strains of a triangle share.
///
/// The deformation maps the fabric's plane to space and is linear in a triangle; its derivatives
/// w_u = dx/du and w_v = dx/dv (Baraff and Witkin 1998, section 4.2, equation 10) are linear in the
/// positions: w_u = sum_i du[i] x_i, w_v = sum_i dv[i] x_i. Both have length 1 where the fabric is
/// not stretched, and du, dv each add up to zero.
#include <array>
#include <cmath>

#include "weft/strain/lanes.h"

namespace weft {

/// Rest shape of a triangle: coefficients in 1/m and area in m^2 (positive for both orientations).
template <class T = double>
struct TriangleShape {
  T du1, du2, dv1, dv2;  ///< of vertices 1 and 2; vertex 0 has minus their sum
  T area;

  std::array<T, 3> du() const { return {-(du1 + du2), du1, du2}; }
  std::array<T, 3> dv() const { return {-(dv1 + dv2), dv1, dv2}; }
};

/// From the material coordinates (m) of the vertices; the area must not be zero.
inline TriangleShape<double> triangle_shape(const Vec2& p0, const Vec2& p1, const Vec2& p2) {
  const Vec2 a = p1 - p0;
  const Vec2 b = p2 - p0;
  const double determinant = a.x() * b.y() - b.x() * a.y();
  return {b.y() / determinant, -a.y() / determinant, -b.x() / determinant, a.x() / determinant,
          0.5 * std::abs(determinant)};
}

template <class T>
struct DeformationGradient {
  Vector3<T> wu, wv;  ///< dimensionless
};

template <class T>
inline DeformationGradient<T> deformation_gradient(const TriangleShape<T>& shape,
                                                   const Vector3<T>& x0, const Vector3<T>& x1,
                                                   const Vector3<T>& x2) {
  const Vector3<T> a = x1 - x0;
  const Vector3<T> b = x2 - x0;
  return {shape.du1 * a + shape.du2 * b, shape.dv1 * a + shape.dv2 * b};
}

/// A strain of a triangle with its derivatives by the nine coordinates x0, x1, x2.
struct TriangleStrain {
  double value;
  Eigen::Matrix<double, 9, 1> gradient;
  Eigen::Matrix<double, 9, 9> hessian;
};

}  // namespace weft
