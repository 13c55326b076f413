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
#include <numbers>

#include "weft/strain/lanes.h"

namespace weft {

/// The angle in (-pi, pi] of the vector (cosine, sine), which need not have unit length but must
/// not be zero. Error at most 3 units in the last place; the same for a double and for Lanes.
template <class T>
inline T angle_of(const T& sine, const T& cosine) {
  // The angle to the nearer axis or, where that is above pi / 8, to the diagonal: one division, and
  // a short polynomial suffices.
  const T zero = broadcast<T>(0);
  const T s = absolute(sine), c = absolute(cosine);
  const auto steep = s > c;
  const T low = select(steep, c, s), high = select(steep, s, c);
  const auto diagonal = low > broadcast<T>(std::numbers::sqrt2 - 1) * high;
  const T t = select(diagonal, low - high, low) / select(diagonal, low + high, high);
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
  const T z = t * t, z2 = z * z, z4 = z2 * z2;
  const auto pair = [&](std::size_t i) { return kPolynomial[i] + kPolynomial[i + 1] * z; };
  const T last = pair(8) + kPolynomial[10] * z2;
  const T polynomial = (pair(0) + z2 * pair(2)) + z4 * ((pair(4) + z2 * pair(6)) + z4 * last);
  const T near = select(diagonal, broadcast<T>(std::numbers::pi / 4), zero) + t * polynomial;
  const T right = select(steep, std::numbers::pi / 2 - near, near);
  const T angle = select(cosine < zero, std::numbers::pi - right, right);
  return select(sine < zero, -angle, angle);
}

/// One triangle's share in the derivatives of the angle; names as in the derivation above.
template <class T>
struct HingeSide {
  Vector3<T> p;
  T t;
  T f;
};

template <class T>
struct DihedralAngle {
  T value;  ///< rad
  HingeSide<T> a, b;
  Vector3<T> c;
  T length;  ///< of the edge

  /// Gradient by x0 ... x3, 1/m.
  std::array<Vector3<T>, 4> gradient() const {
    const Vector3<T> along = a.t * a.p + b.t * b.p;
    return {along - (a.p + b.p), -along, a.p, b.p};
  }
  /// The vectors q of both sides.
  Vector3<T> q_a() const { return length * cross(a.p, c); }
  Vector3<T> q_b() const { return length * cross(c, b.p); }
};

namespace detail {

template <class T>
struct HingeShape {
  Vector3<T> e, to_a, to_b, normal_a, normal_b;
  T ee, aa, bb;               // squares of the edge and of the normals
  decltype(T{} < T{}) valid;  // not degenerate
  T length;                   // of the edge; 1 where degenerate
};

template <class T>
inline HingeShape<T> hinge_shape(const Vector3<T>& x0, const Vector3<T>& x1, const Vector3<T>& x2,
                                 const Vector3<T>& x3) {
  HingeShape<T> h;
  h.e = x1 - x0;
  h.to_a = x2 - x0;
  h.to_b = x3 - x0;
  h.normal_a = cross(h.e, h.to_a);
  h.normal_b = cross(h.to_b, h.e);
  h.ee = dot(h.e, h.e);
  h.aa = dot(h.normal_a, h.normal_a);
  h.bb = dot(h.normal_b, h.normal_b);
  const T least = broadcast<T>(1e-20) * h.ee;
  h.valid = both(h.aa > least * dot(h.to_a, h.to_a), h.bb > least * dot(h.to_b, h.to_b));
  h.length = square_root(select(h.valid, h.ee, broadcast<T>(1)));
  return h;
}

/// (N_B x N_A) . e / |e| = |e| N_B . (x2 - x0), as both normals are across e.
template <class T>
inline T angle_of(const HingeShape<T>& h) {
  return weft::angle_of(select(h.valid, h.length * dot(h.normal_b, h.to_a), broadcast<T>(0)),
                        select(h.valid, dot(h.normal_a, h.normal_b), broadcast<T>(1)));
}

}  // namespace detail

/// The value alone, the same as that of dihedral_angle().
template <class T>
inline T dihedral_angle_value(const Vector3<T>& x0, const Vector3<T>& x1, const Vector3<T>& x2,
                              const Vector3<T>& x3) {
  return detail::angle_of(detail::hinge_shape(x0, x1, x2, x3));
}

/// The value and what its derivatives are built of; positions in m.
template <class T>
inline DihedralAngle<T> dihedral_angle(const Vector3<T>& x0, const Vector3<T>& x1,
                                       const Vector3<T>& x2, const Vector3<T>& x3) {
  const T zero = broadcast<T>(0), one = broadcast<T>(1);
  const auto h = detail::hinge_shape(x0, x1, x2, x3);
  // Where the hinge is degenerate, these are finite or zero, and so is everything.
  const T inverse_length = one / h.length;
  const T inverse_squared = inverse_length * inverse_length;
  const T inverse_areas = select(h.valid, h.length / (h.aa * h.bb), zero);
  const T half = broadcast<T>(0.5) * inverse_squared * inverse_squared;
  DihedralAngle<T> out;
  out.value = detail::angle_of(h);
  out.a = {(inverse_areas * h.bb) * h.normal_a, dot(h.to_a, h.e) * inverse_squared, half * h.aa};
  out.b = {(inverse_areas * h.aa) * h.normal_b, dot(h.to_b, h.e) * inverse_squared, half * h.bb};
  out.c = select(h.valid, inverse_squared, zero) * h.e;
  out.length = h.length;
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
inline HingeSideProducts<T> side_products(const Vector3<T>& p, const Vector3<T>& q,
                                          const Vector3<T>& c, const T& factor) {
  const Vector3<T> minus_p = (-factor) * p;
  return {symmetric_outer(minus_p, q), outer(minus_p, c)};
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

/// The Hessian of the angle, times `factor`. (Always inlined: blocks that are not used are not
/// computed.)
template <class T>
[[gnu::always_inline]] inline HingeHessian<T> hinge_hessian(const DihedralAngle<T>& angle,
                                                            const T& factor) {
  const T one = broadcast<T>(1);
  const auto a = detail::side_products(angle.a.p, angle.q_a(), angle.c, factor);
  const auto b = detail::side_products(angle.b.p, angle.q_b(), angle.c, factor);
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
