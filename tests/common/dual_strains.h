#pragma once
/// The strains from their definitions, over any number type (dual.h): written apart from the
/// library's formulas, to check those.
#include <array>

#include "common/dual.h"

namespace weft::testing {

/// w_u and w_v: the linear map that takes the edges of the undeformed triangle, with corners p, to
/// those of the deformed one, by Cramer's rule.
template <class T>
std::array<DualVector<T>, 2> thread_vectors(const std::array<Vec2, 3>& p,
                                            const std::array<DualVector<T>, 3>& x) {
  // Differences of coordinates in T: the library's are rounded to double, which its tolerance has.
  const auto difference = [&](std::size_t i, int c) { return T(p[i][c]) - T(p[0][c]); };
  const T determinant = difference(1, 0) * difference(2, 1) - difference(2, 0) * difference(1, 1);
  const DualVector<T> a = x[1] - x[0], b = x[2] - x[0];
  const T inverse = T(1.0) / determinant;
  return {(inverse * difference(2, 1)) * a - (inverse * difference(1, 1)) * b,
          (inverse * difference(1, 0)) * b - (inverse * difference(2, 0)) * a};
}

/// The angle by which half-plane B is turned about the edge x0 x1, out of the continuation of
/// half-plane A, towards the front: the perpendiculars from the edge to the apexes x2 (A) and x3
/// (B) span it.
template <class T>
T hinge_angle(const DualVector<T>& x0, const DualVector<T>& x1, const DualVector<T>& x2,
              const DualVector<T>& x3) {
  const DualVector<T> e = (T(1.0) / length(x1 - x0)) * (x1 - x0);
  const auto perpendicular = [&](const DualVector<T>& apex) {
    const DualVector<T> to = apex - x0;
    return to - dot(to, e) * e;
  };
  const DualVector<T> a = perpendicular(x2), b = perpendicular(x3);
  const DualVector<T> front = cross(e, a);
  return atan2(dot(b, front), -dot(b, a));
}

/// Curvature that the angles at the edges j (from corner j to j + 1) of a triangle with corners p
/// give it: 1 / (2 A) sum_j theta_j l_j n_j n_j^T, as (K_uu, K_vv, sqrt(2) K_uv) by columns: what
/// one radian at each edge adds.
inline Mat3 curvature_by_angle(const std::array<Vec2, 3>& p) {
  const Vec2 s = p[1] - p[0], t = p[2] - p[0];
  const double area = 0.5 * std::abs(s.x() * t.y() - s.y() * t.x());
  Mat3 out;
  for (std::size_t j = 0; j < 3; ++j) {
    const Vec2 edge = p[(j + 1) % 3] - p[j];
    const Vec2 across = Vec2(edge.y(), -edge.x()) / edge.norm();
    const Eigen::Matrix2d k = edge.norm() / (2 * area) * across * across.transpose();
    out.col(static_cast<Eigen::Index>(j)) = Vec3(k(0, 0), k(1, 1), std::sqrt(2.0) * k(0, 1));
  }
  return out;
}

}  // namespace weft::testing
