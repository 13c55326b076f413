#pragma once
/// Stretch along one thread direction (Baraff and Witkin 1998, section 4.2):
///
///     C = |w| - 1,   dC/dw = n = w / |w|,   d2C/dw2 = (I - n n^T) / |w|,
///
/// with w = w_u for the weft and w_v for the warp. By vertices, with d_i the coefficient of x_i in
/// w: gradient d_i n, Hessian block (i, j) = d_i d_j (I - n n^T) / |w|.
///
/// Where w = 0 (the triangle has collapsed along that thread) the direction is not defined: the
/// gradient and the Hessian are taken as zero there, C = -1.
#include "weft/strain/triangle_shape.h"

namespace weft {

template <class T>
struct Stretch {
  T value;               ///< |w| - 1
  Vector3<T> direction;  ///< n
  T inverse_length;      ///< 1 / |w|, or 0
};

template <class T>
inline Stretch<T> stretch(const Vector3<T>& w) {
  const T length = square_root(dot(w, w));
  const T zero = broadcast<T>(0), one = broadcast<T>(1);
  const T inverse = select(length > zero, one / length, zero);
  return {length - one, inverse * w, inverse};
}

enum class Thread { weft, warp };

/// All derivatives by the positions; `x0`, `x1`, `x2` in m.
inline TriangleStrain stretch_strain(const TriangleShape<double>& shape, Thread thread,
                                     const Vec3& x0, const Vec3& x1, const Vec3& x2) {
  const auto w = deformation_gradient(shape, to_vector3(x0), to_vector3(x1), to_vector3(x2));
  const Stretch<double> s = stretch(thread == Thread::weft ? w.wu : w.wv);
  const auto d = thread == Thread::weft ? shape.du() : shape.dv();
  const Vec3 n = to_eigen(s.direction);
  const Mat3 across = s.inverse_length * (Mat3::Identity() - n * n.transpose());
  TriangleStrain out;
  out.value = s.value;
  for (int i = 0; i < 3; ++i) {
    const double di = d[static_cast<std::size_t>(i)];
    out.gradient.segment<3>(3 * i) = di * n;
    for (int j = 0; j < 3; ++j)
      out.hessian.block<3, 3>(3 * i, 3 * j) = di * d[static_cast<std::size_t>(j)] * across;
  }
  return out;
}

}  // namespace weft
