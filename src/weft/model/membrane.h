#pragma once
/// In-plane energy of a triangle, 1/2 area (k_u C_u^2 + k_v C_v^2 + k_s C_s^2) and its damping, as
/// a function of the six numbers (w_u, w_v). Positions enter linearly (triangle_shape.h), so that
/// the blocks of the Hessian by vertices are combinations of three 3 x 3 matrices.
#include "weft/strain/shear.h"
#include "weft/strain/stretch.h"

namespace weft::detail {

/// Stiffness k, damping kd and rate of a strain: energy 1/2 k C^2 + 1/2 kd (rate C - h)^2 / rate.
struct DampedStiffness {
  double k = 0;
  double kd = 0;
  double rate = 0;  ///< 0: kd has no effect

  /// Second derivative of the energy by C.
  double total() const { return k + kd * rate; }
  /// First derivative by C.
  template <class T>
  T tension(const T& c, const T& history) const {
    const T elastic = total() * c;
    return rate > 0 ? T(elastic - kd * history) : elastic;
  }
  template <class T>
  T energy(const T& c, const T& history) const {
    const T elastic = 0.5 * k * c * c;
    if (!(rate > 0)) return elastic;
    const T speed = rate * c - history;
    return elastic + (0.5 * kd / rate) * speed * speed;
  }
};

template <class T>
struct MembraneStrains {
  DeformationGradient<T> w;
  Stretch<T> u, v;
  T shear;
};

template <class T>
inline MembraneStrains<T> membrane_strains(const TriangleShape<T>& shape, const Vector3<T>& x0,
                                           const Vector3<T>& x1, const Vector3<T>& x2) {
  MembraneStrains<T> s;
  s.w = deformation_gradient(shape, x0, x1, x2);
  s.u = stretch(s.w.wu);
  s.v = stretch(s.w.wv);
  s.shear = shear(s.w);
  return s;
}

/// Derivatives of the energy density by the three strains, N/m.
template <class T>
struct MembraneTension {
  T u, v, s;
};

/// Derivative of the energy density by w_u and w_v.
template <class T>
struct MembraneGradient {
  Vector3<T> u, v;
};

template <class T>
inline MembraneGradient<T> membrane_gradient(const MembraneStrains<T>& c,
                                             const MembraneTension<T>& tension) {
  return {tension.u * c.u.direction + tension.s * c.w.wv,
          tension.v * c.v.direction + tension.s * c.w.wu};
}

/// Second derivatives of the energy density; `uv` has rows for w_u and columns for w_v.
template <class T>
struct MembraneHessian {
  SymmetricMatrix3<T> uu, vv;
  Matrix3<T> uv;
};

/// Second derivatives of the energy density by the three strains, N/m.
template <class T>
struct MembraneStiffness {
  T u, v, s;
};

/// The stiffness that comes with the squares of the gradients: positive semi-definite.
template <class T>
inline MembraneHessian<T> gauss_newton(const MembraneStrains<T>& c, const MembraneStiffness<T>& k) {
  return {k.u * outer(c.u.direction) + k.s * outer(c.w.wv),
          k.v * outer(c.v.direction) + k.s * outer(c.w.wu), outer(k.s * c.w.wv, c.w.wu)};
}

template <class T>
inline void add_to_diagonal(const T& value, SymmetricMatrix3<T>& a) {
  a.m[0] = a.m[0] + value;
  a.m[2] = a.m[2] + value;
  a.m[5] = a.m[5] + value;
}

template <class T>
inline void add_to_diagonal(const T& value, Matrix3<T>& a) {
  for (const std::size_t i : {0U, 4U, 8U}) a.m[i] = a.m[i] + value;
}

/// a += s b b^T.
template <class T>
inline void add_outer(const T& s, const Vector3<T>& b, SymmetricMatrix3<T>& a) {
  a = a + s * outer(b);
}

/// a += s b c^T.
template <class T>
inline void add_outer(const T& s, const Vector3<T>& b, const Vector3<T>& c, Matrix3<T>& a) {
  const Matrix3<T> o = outer(s * b, c);
  for (std::size_t i = 0; i < 9; ++i) a.m[i] = a.m[i] + o.m[i];
}

template <class T>
inline MembraneHessian<T> exact_hessian(const MembraneStrains<T>& c,
                                        const MembraneTension<T>& tension,
                                        const MembraneStiffness<T>& k) {
  MembraneHessian<T> h = gauss_newton(c, k);
  const T su = tension.u * c.u.inverse_length, sv = tension.v * c.v.inverse_length;
  add_to_diagonal(su, h.uu);
  add_outer(T(-su), c.u.direction, h.uu);
  add_to_diagonal(sv, h.vv);
  add_outer(T(-sv), c.v.direction, h.vv);
  add_to_diagonal(tension.s, h.uv);
  return h;
}

/// The symmetric matrix [[a, c], [c, b]] with its negative eigenvalues set to zero, in place.
template <class T>
inline void project(T& a, T& b, T& c) {
  const T zero = broadcast<T>(0), half = broadcast<T>(0.5);
  const T mean = half * (a + b), difference = half * (a - b);
  const T radius = square_root(difference * difference + c * c);
  const T high = mean + radius, low = mean - radius;
  const T high_part = select(high > zero, high, zero), low_part = select(low > zero, low, zero);
  const T middle = half * (high_part + low_part);
  const T scale = select(radius > zero, half * (high_part - low_part) / radius, zero);
  a = middle + scale * difference;
  b = middle - scale * difference;
  c = scale * c;
}

/// A positive semi-definite Hessian near the exact one.
///
/// The 6 x 6 matrix falls apart. Across the triangle's plane it is the stress,
/// [[t_u / |w_u|, t_s], [t_s, t_v / |w_v|]], whose negative part is what compression without
/// buckling would be: it is projected exactly. In the plane (4 x 4) the exact matrix is kept
/// wherever it is positive semi-definite (found by its pivots): all of tension and moderate shear.
/// Elsewhere it is the Gauss-Newton part plus the stiffness against turning in the plane, if that
/// is positive: strains are small against 1, so that turning is the one direction which stress can
/// make negative. Where w_u and w_v are parallel the plane is not defined; the parts of both
/// stretches under tension are kept there.
template <class T>
inline MembraneHessian<T> projected_hessian(const MembraneStrains<T>& c,
                                            const MembraneTension<T>& tension,
                                            const MembraneStiffness<T>& k) {
  const T zero = broadcast<T>(0), one = broadcast<T>(1), ks = k.s;
  const T su = tension.u * c.u.inverse_length, sv = tension.v * c.v.inverse_length;
  const T length_u = c.u.value + one, length_v = c.v.value + one;
  const T squares = length_u * length_u + length_v * length_v;

  const Vector3<T> area_vector = cross(c.w.wu, c.w.wv);
  const T area_squared = dot(area_vector, area_vector);
  const auto plane = area_squared > broadcast<T>(1e-16) * squares * squares;
  const T area = square_root(select(plane, area_squared, one));
  const Vector3<T> normal = select(plane, one / area, zero) * area_vector;
  const Vector3<T> tu = cross(normal, c.u.direction), tv = cross(normal, c.v.direction);

  // In the plane, with w_u = (length_u, 0) and w_v = (p, q): pivots of the exact matrix.
  const T p = c.shear * c.u.inverse_length, q = area * c.u.inverse_length;
  const T np = p * c.v.inverse_length, nq = q * c.v.inverse_length;
  const T a11 = k.u + ks * p * p, a12 = ks * p * q, a13 = ks * p * length_u + tension.s;
  const T a22 = su + ks * q * q, a23 = ks * q * length_u, a24 = tension.s;
  const T a33 = (k.v - sv) * np * np + sv + ks * length_u * length_u;
  const T a34 = (k.v - sv) * np * nq, a44 = (k.v - sv) * nq * nq + sv;
  const T l2 = a12 / a11, l3 = a13 / a11;
  const T b22 = a22 - l2 * a12, b23 = a23 - l2 * a13, b33 = a33 - l3 * a13;
  const auto positive2 = b22 > zero;
  const T inverse22 = one / select(positive2, b22, one);
  const T c33 = b33 - b23 * b23 * inverse22, c34 = a34 - b23 * a24 * inverse22;
  const T c44 = a44 - a24 * a24 * inverse22;
  const auto positive3 = c33 > zero;
  const T d44 = c44 - c34 * c34 / select(positive3, c33, one);
  const auto exact = plane & positive2 & positive3 & (d44 > zero);

  const T turning =
      (tension.u * length_u + tension.v * length_v + (tension.s + tension.s) * c.shear) /
      select(plane, squares * squares, one);
  const T turn = select(plane & (turning > zero), turning, zero);
  T across_u = su, across_v = sv, across_uv = tension.s;
  project(across_u, across_v, across_uv);

  MembraneHessian<T> h = gauss_newton(c, k);
  add_outer(select(exact, su, turn * length_u * length_u), tu, h.uu);
  add_outer(select(exact, sv, turn * length_v * length_v), tv, h.vv);
  const T in_plane = select(exact, tension.s, zero);
  add_to_diagonal(in_plane, h.uv);
  add_outer(select(exact, zero, turn * length_u * length_v), tu, tv, h.uv);
  add_outer(across_u, normal, h.uu);
  add_outer(across_v, normal, h.vv);
  add_outer(T(across_uv - in_plane), normal, normal, h.uv);

  const T no_plane_u = select(plane | (su < zero), zero, su);
  const T no_plane_v = select(plane | (sv < zero), zero, sv);
  add_to_diagonal(no_plane_u, h.uu);
  add_outer(T(-no_plane_u), c.u.direction, h.uu);
  add_to_diagonal(no_plane_v, h.vv);
  add_outer(T(-no_plane_v), c.v.direction, h.vv);
  return h;
}

/// Blocks of the Hessian by the positions, lower triangle.
template <class T>
struct TriangleHessian {
  SymmetricMatrix3<T> b00, b11, b22;
  Matrix3<T> b10, b20, b21;
};

/// Block (i, j) = du_i du_j uu + du_i dv_j uv + dv_i du_j uv^T + dv_i dv_j vv, times the area. The
/// blocks of vertex 0 follow from those of 1 and 2: a translation costs nothing.
template <class T>
inline TriangleHessian<T> by_vertices(const TriangleShape<T>& shape, const MembraneHessian<T>& h) {
  const T u1 = shape.area * shape.du1, v1 = shape.area * shape.dv1;
  const T u2 = shape.area * shape.du2, v2 = shape.area * shape.dv2;
  const SymmetricMatrix3<T> cross_part = {{h.uv.m[0] + h.uv.m[0], h.uv.m[3] + h.uv.m[1],
                                           h.uv.m[4] + h.uv.m[4], h.uv.m[6] + h.uv.m[2],
                                           h.uv.m[7] + h.uv.m[5], h.uv.m[8] + h.uv.m[8]}};
  TriangleHessian<T> out;
  out.b11 = (u1 * shape.du1) * h.uu + (u1 * shape.dv1) * cross_part + (v1 * shape.dv1) * h.vv;
  out.b22 = (u2 * shape.du2) * h.uu + (u2 * shape.dv2) * cross_part + (v2 * shape.dv2) * h.vv;
  const T uu = u2 * shape.du1, uv = u2 * shape.dv1, vu = v2 * shape.du1, vv = v2 * shape.dv1;
  const Matrix3<T> symmetric = (uu * h.uu + vv * h.vv).full();
  const Matrix3<T> full11 = out.b11.full(), full22 = out.b22.full();
  for (std::size_t r = 0; r < 3; ++r)
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t i = 3 * r + c;
      out.b21.m[i] = symmetric.m[i] + uv * h.uv.m[i] + vu * h.uv.m[3 * c + r];
    }
  for (std::size_t r = 0; r < 3; ++r)
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t i = 3 * r + c;
      out.b10.m[i] = -(full11.m[i] + out.b21.m[3 * c + r]);
      out.b20.m[i] = -(full22.m[i] + out.b21.m[i]);
    }
  constexpr std::size_t kRow[6] = {0, 1, 1, 2, 2, 2}, kColumn[6] = {0, 0, 1, 0, 1, 2};
  for (std::size_t i = 0; i < 6; ++i) {
    const std::size_t rc = 3 * kRow[i] + kColumn[i];
    out.b00.m[i] = -(out.b10.m[rc] + out.b20.m[rc]);
  }
  return out;
}

}  // namespace weft::detail
