#pragma once
/// Shear (Baraff and Witkin 1998, section 4.3):
///
///     C = w_u . w_v,   dC/dw_u = w_v,   dC/dw_v = w_u,   d2C/dw_u dw_v = I.
///
/// By vertices: gradient du_i w_v + dv_i w_u, Hessian block (i, j) = (du_i dv_j + dv_i du_j) I. It
/// is a polynomial of the positions, so that nothing is degenerate.
#include "weft/strain/triangle_shape.h"

namespace weft {

template <class T>
inline T shear(const DeformationGradient<T>& w) {
  return dot(w.wu, w.wv);
}

/// All derivatives by the positions; `x0`, `x1`, `x2` in m.
inline TriangleStrain shear_strain(const TriangleShape<double>& shape, const Vec3& x0,
                                   const Vec3& x1, const Vec3& x2) {
  const auto w = deformation_gradient(shape, to_vector3(x0), to_vector3(x1), to_vector3(x2));
  const auto du = shape.du();
  const auto dv = shape.dv();
  TriangleStrain out;
  out.value = shear(w);
  for (std::size_t i = 0; i < 3; ++i) {
    const auto row = static_cast<Eigen::Index>(3 * i);
    out.gradient.segment<3>(row) = du[i] * to_eigen(w.wv) + dv[i] * to_eigen(w.wu);
    for (std::size_t j = 0; j < 3; ++j)
      out.hessian.block<3, 3>(row, static_cast<Eigen::Index>(3 * j)) =
          (du[i] * dv[j] + dv[i] * du[j]) * Mat3::Identity();
  }
  return out;
}

}  // namespace weft
