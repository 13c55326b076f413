#pragma once
/// The angle between two triangles that share an edge (bend; Baraff and Witkin 1998, section 4.4).
///
/// Vertices: the edge runs from x0 to x1, e = x1 - x0; x2 is the apex of triangle A, on the left of
/// the edge seen from the front, x3 that of triangle B. With the normals N_A = e x (x2 - x0) and
/// N_B = (x3 - x0) x e, both pointing to the front,
///
///     C = theta = atan2( (N_B x N_A) . e / |e|, N_A . N_B )  in (-pi, pi]:
///
/// zero where the hinge is flat, positive where the apexes rise to the front.
///
/// Derivation. Let a triangle with apex x have height h, unit normal n to the front, m the unit
/// vector in its plane from the edge to the apex, and t the position of the apex' foot along the
/// edge (0 at x0, 1 at x1). Moving the apex by d turns the triangle about the edge by n.d / h. A
/// rigid motion must leave theta alone, which fixes the share of x0 and x1. So the triangle
/// contributes
///
///     gradient of vertex i:  L_i p,   p = n / h,   L = (-(1 - t), -t, 1)  for (x0, x1, apex).
///
/// Its derivative follows from those of n, h and t: with s = (-1, 1, 0) for (x0, x1, apex), q = m /
/// h and c = e / |e|^2,
///
///     dh = m . sum_i L_i dx_i,     dn = - sum_i (L_i q + s_i c) (n . dx_i),
///     dt = sum_i ( L_i c + s_i h^2 q / |e|^2 ) . dx_i,        dL = -s dt.
///
/// Together, block (i, j) of the triangle's share of the Hessian is
///
///     - (L_i L_j + s_i s_j f) (p q^T + q p^T) - L_i s_j c p^T - s_i L_j p c^T,  f = h^2 / (2
///     |e|^2).
///
/// (The last term of the derivation is s_i s_j p q^T h^2 / |e|^2, which is not symmetric; its
/// antisymmetric part is the same for both triangles with opposite sign, and is left out of both.)
/// Hence block (2, 3) is zero.
///
/// Degenerate: where the edge has no length, or an apex is on the line of the edge (the sine of the
/// triangle's angle at x0 below 1e-10), the angle is not defined; value, gradient and Hessian are
/// taken as zero. At theta = pi, folded flat onto itself, theta jumps by 2 pi; the derivatives are
/// continuous there.
#include "weft/strain/lanes.h"

namespace weft {

/// The angle in (-pi, pi] of the vector (cosine, sine), which need not have unit length but must
/// not be zero. Error at most 3 units in the last place; the same for a double and for Lanes.
template <class T>
inline T angle_of(const T& sine, const T& cosine) {
  // tan(angle / 8) <= tan(pi / 8), where a short polynomial suffices; halving twice loses no
  // digits.
  const T zero = broadcast<T>(0), one = broadcast<T>(1);
  const T radius = square_root(sine * sine + cosine * cosine);
  const T magnitude = absolute(sine);
  const auto front = cosine >= zero;
  const T c1 = select(front, radius + cosine, magnitude);  // along (cos, sin) of angle / 2
  const T s1 = select(front, magnitude, radius - cosine);
  const T t2 = s1 / (square_root(c1 * c1 + s1 * s1) + c1);
  const T t3 = t2 / (one + square_root(one + t2 * t2));
  // atan(t) / t on [0, tan(pi / 8)] as a polynomial of t^2: interpolation at the 11 Chebyshev
  // nodes, relative error 3.5e-17.
  constexpr double kPolynomial[] = {1.0,
                                    -0.3333333333332844,
                                    0.1999999999885511,
                                    -0.14285714180976467,
                                    0.11111106180455946,
                                    -0.09090773074808414,
                                    0.07689953496306857,
                                    -0.06640233930429408,
                                    0.056883492268090106,
                                    -0.04348052215716462,
                                    0.021135373157693246};
  const T z = t3 * t3;
  T polynomial = broadcast<T>(kPolynomial[10]);
  for (int i = 9; i >= 0; --i) polynomial = polynomial * z + broadcast<T>(kPolynomial[i]);
  const T angle = broadcast<T>(8) * t3 * polynomial;
  return select(sine < zero, -angle, angle);
}

/// One triangle's share in the derivatives of the angle; names as in the derivation above.
template <class T>
struct HingeSide {
  Vector3<T> p, q;
  T t;
  T f;
};

template <class T>
struct DihedralAngle {
  T value;  ///< rad
  HingeSide<T> a, b;
  Vector3<T> c;

  /// Gradient by x0 ... x3, 1/m.
  std::array<Vector3<T>, 4> gradient() const {
    const Vector3<T> along = a.t * a.p + b.t * b.p;
    return {along - (a.p + b.p), -along, a.p, b.p};
  }
};

/// The value and what its derivatives are built of; positions in m.
template <class T>
inline DihedralAngle<T> dihedral_angle(const Vector3<T>& x0, const Vector3<T>& x1,
                                       const Vector3<T>& x2, const Vector3<T>& x3) {
  const T zero = broadcast<T>(0), one = broadcast<T>(1);
  const Vector3<T> e = x1 - x0, to_a = x2 - x0, to_b = x3 - x0;
  const Vector3<T> normal_a = cross(e, to_a), normal_b = cross(to_b, e);
  const T ee = dot(e, e), aa = dot(normal_a, normal_a), bb = dot(normal_b, normal_b);
  const T least = broadcast<T>(1e-20) * ee;
  const auto valid = both(aa > least * dot(to_a, to_a), bb > least * dot(to_b, to_b));
  // Where the hinge is degenerate, ones keep the arithmetic finite until everything is set to zero.
  const T length_squared = select(valid, ee, one);
  const T inverse_squared = one / length_squared;
  const T length = square_root(length_squared);
  const T angle = angle_of(select(valid, dot(cross(normal_b, normal_a), e) / length, zero),
                           select(valid, dot(normal_a, normal_b), one));

  const Vector3<T> unit = (one / length) * e;
  const T inverse_aa = select(valid, one / aa, zero), inverse_bb = select(valid, one / bb, zero);
  DihedralAngle<T> out;
  out.value = angle;
  out.a.p = (length * inverse_aa) * normal_a;
  out.b.p = (length * inverse_bb) * normal_b;
  out.a.q = cross(out.a.p, unit);
  out.b.q = cross(unit, out.b.p);
  out.a.t = dot(to_a, e) * inverse_squared;
  out.b.t = dot(to_b, e) * inverse_squared;
  const T half = broadcast<T>(0.5) * inverse_squared * inverse_squared;
  out.a.f = half * aa;
  out.b.f = half * bb;
  out.c = select(valid, inverse_squared, zero) * e;
  return out;
}

/// Blocks of the lower triangle of a Hessian, 1/m^2. Blocks with i = j are symmetric; block (3, 2)
/// is zero.
template <class T>
struct HingeHessian {
  SymmetricMatrix3<T> b00, b11, b22, b33;
  Matrix3<T> b10, b20, b21, b30, b31;
};

namespace detail {

/// The matrices that a triangle's share is a combination of.
template <class T>
struct HingeSideProducts {
  SymmetricMatrix3<T> w;  ///< - factor (p q^T + q p^T)
  Matrix3<T> z;           ///< - factor p c^T
};

template <class T>
inline HingeSideProducts<T> side_products(const HingeSide<T>& side, const Vector3<T>& c,
                                          const T& factor) {
  const Vector3<T> p = (-factor) * side.p;
  return {symmetric_outer(p, side.q), outer(p, c)};
}

enum class Sign { minus, plus };

/// x W + Z^T or x W - Z^T: the blocks between an apex and an end of the edge.
template <Sign kSign, class T>
inline Matrix3<T> apex_block(const HingeSideProducts<T>& s, const T& x) {
  Matrix3<T> out = (x * s.w).full();
  for (std::size_t r = 0; r < 3; ++r)
    for (std::size_t c = 0; c < 3; ++c) {
      T& entry = out.m[3 * r + c];
      if constexpr (kSign == Sign::plus)
        entry = entry + s.z.m[3 * c + r];
      else
        entry = entry - s.z.m[3 * c + r];
    }
  return out;
}

/// Z + Z^T.
template <class T>
inline SymmetricMatrix3<T> twice_symmetric_part(const Matrix3<T>& z) {
  return {{z.m[0] + z.m[0], z.m[3] + z.m[1], z.m[4] + z.m[4], z.m[6] + z.m[2], z.m[7] + z.m[5],
           z.m[8] + z.m[8]}};
}

}  // namespace detail

/// The Hessian of the angle, times `factor`.
template <class T>
inline HingeHessian<T> hinge_hessian(const DihedralAngle<T>& angle, const T& factor) {
  const T one = broadcast<T>(1);
  const auto a = detail::side_products(angle.a, angle.c, factor);
  const auto b = detail::side_products(angle.b, angle.c, factor);
  const auto za = detail::twice_symmetric_part(a.z), zb = detail::twice_symmetric_part(b.z);
  const T ta = angle.a.t, tb = angle.b.t, ra = one - ta, rb = one - tb;
  const T fa = angle.a.f, fb = angle.b.f;
  HingeHessian<T> h;
  h.b22 = a.w;
  h.b33 = b.w;
  h.b00 = (ra * ra + fa) * a.w + ra * za + (rb * rb + fb) * b.w + rb * zb;
  h.b11 = (ta * ta + fa) * a.w + (-ta) * za + (tb * tb + fb) * b.w + (-tb) * zb;
  h.b20 = detail::apex_block<detail::Sign::minus>(a, T(-ra));
  h.b21 = detail::apex_block<detail::Sign::plus>(a, T(-ta));
  h.b30 = detail::apex_block<detail::Sign::minus>(b, T(-rb));
  h.b31 = detail::apex_block<detail::Sign::plus>(b, T(-tb));
  h.b10 = ((ta * ra - fa) * a.w + (tb * rb - fb) * b.w).full();
  for (std::size_t r = 0; r < 3; ++r)
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t rc = 3 * r + c, cr = 3 * c + r;
      h.b10.m[rc] = h.b10.m[rc] + ta * a.z.m[cr] - ra * a.z.m[rc] + tb * b.z.m[cr] - rb * b.z.m[rc];
    }
  return h;
}

/// The angle with its derivatives by the twelve coordinates x0 ... x3.
struct HingeStrain {
  double value;
  Eigen::Matrix<double, 12, 1> gradient;
  Eigen::Matrix<double, 12, 12> hessian;
};

HingeStrain dihedral_angle_strain(const Vec3& x0, const Vec3& x1, const Vec3& x2, const Vec3& x3);

}  // namespace weft
