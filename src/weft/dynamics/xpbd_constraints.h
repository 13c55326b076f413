#pragma once
/// The constraints of XPBD: what a strain gives to the local system of equation 3 of Larionov et
/// al. (2022), and the derivatives of that by a direction of the positions. Templates over the
/// scalar T, double for one constraint or Lanes for kLanes of them.
///
/// A kind K of constraint has
/// - kVertices, kRows: vertices of the stencil, rows of C;
/// - Rest<T>: what is fixed, with weight(), the area that the constraint stands for;
/// - Law: the stiffness, see below;
/// - strain(rest, x): an object with value() = C, mobility(w) = grad C^T diag(w) grad C for the
///   inverse masses w of the vertices, pull(l) = grad C l by vertices, and turning(l), the sums of
///   the absolute entries of the rows of l . Hessian of C, by vertices;
/// - change(rest, strain, dx): the derivatives of these three along dx, by the same names.
#include <array>

#include "weft/dynamics/xpbd.h"
#include "weft/strain/shear.h"
#include "weft/strain/triangle_curvature.h"

namespace weft::xpbd {

template <class T, std::size_t N>
using Rows = std::array<T, N>;

/// Symmetric matrices of one or three rows.
template <class T, std::size_t N>
struct Symmetric;
template <class T>
struct Symmetric<T, 1> {
  T m;
  Rows<T, 1> operator*(const Rows<T, 1>& a) const { return {m * a[0]}; }
};
template <class T>
struct Symmetric<T, 3> {
  T xx, yx, yy, zx, zy, zz;
  Rows<T, 3> operator*(const Rows<T, 3>& a) const {
    return {xx * a[0] + yx * a[1] + zx * a[2], yx * a[0] + yy * a[1] + zy * a[2],
            zx * a[0] + zy * a[1] + zz * a[2]};
  }
};

/// L D L^T of a positive definite matrix.
template <class T, std::size_t N>
class Factor;
template <class T>
class Factor<T, 1> {
 public:
  explicit Factor(const Symmetric<T, 1>& a) : inverse_(broadcast<T>(1) / a.m) {}
  Rows<T, 1> solve(const Rows<T, 1>& b) const { return {inverse_ * b[0]}; }

 private:
  T inverse_;
};
template <class T>
class Factor<T, 3> {
 public:
  explicit Factor(const Symmetric<T, 3>& a) {
    const T one = broadcast<T>(1);
    i0_ = one / a.xx;
    l10_ = a.yx * i0_;
    l20_ = a.zx * i0_;
    const T m21 = a.zy - l20_ * a.yx;
    i1_ = one / (a.yy - l10_ * a.yx);
    l21_ = m21 * i1_;
    i2_ = one / (a.zz - l20_ * a.zx - l21_ * m21);
  }
  Rows<T, 3> solve(const Rows<T, 3>& b) const {
    const T y1 = b[1] - l10_ * b[0];
    const T y2 = b[2] - l20_ * b[0] - l21_ * y1;
    const T x2 = i2_ * y2;
    const T x1 = i1_ * y1 - l21_ * x2;
    return {i0_ * b[0] - l10_ * x1 - l20_ * x2, x1, x2};
  }

 private:
  T i0_, i1_, i2_, l10_, l20_, l21_;
};

template <class T, std::size_t N>
inline Rows<T, N> negative(Rows<T, N> a) {
  for (T& entry : a) entry = -entry;
  return a;
}

/// An orthotropic block: energy 1/2 A C^T k C. The local system is (mobility + alpha) dl = - (C +
/// alpha l) with alpha = k^-1 / (h^2 A).
class BlockLaw {
 public:
  BlockLaw(const OrthotropicSheet& sheet, double step)
      : k00_(sheet.c00), k01_(sheet.c01), k11_(sheet.c11), k22_(sheet.c22) {
    const double hh = step * step, determinant = k00_ * k11_ - k01_ * k01_;
    a00_ = k11_ / (hh * determinant);
    a01_ = -k01_ / (hh * determinant);
    a11_ = k00_ / (hh * determinant);
    a22_ = 1 / (hh * k22_);
    hh_ = hh;
  }

  template <class T>
  struct Solution {
    Factor<T, 3> factor;
    T inverse_weight;
    Rows<T, 3> change;  ///< dl
    Rows<T, 3> after;   ///< l + dl
    const BlockLaw& law;

    /// Derivative of dl by parameter p. `dc`: of C; `dm`: of the mobility, times dl; `dl0`: of l.
    Rows<T, 3> derivative(int p, const Rows<T, 3>& dc, const Rows<T, 3>& dm,
                          const Rows<T, 3>& dl0) const {
      const Rows<T, 3> kept = law.compliance(dl0), own = law.compliance_change(p, after);
      Rows<T, 3> r;
      for (std::size_t i = 0; i < 3; ++i)
        r[i] = -(dc[i] + dm[i] + inverse_weight * (kept[i] + own[i]));
      return factor.solve(r);
    }
  };

  template <class T>
  Solution<T> solve(const T& weight, const Rows<T, 3>& c, Symmetric<T, 3> m,
                    const Rows<T, 3>& l) const {
    const T iw = broadcast<T>(1) / weight;
    m.xx = m.xx + a00_ * iw;
    m.yx = m.yx + a01_ * iw;
    m.yy = m.yy + a11_ * iw;
    m.zz = m.zz + a22_ * iw;
    const Rows<T, 3> kept = compliance(l);
    const Factor<T, 3> factor(m);
    const Rows<T, 3> dl =
        factor.solve({-(c[0] + iw * kept[0]), -(c[1] + iw * kept[1]), -(c[2] + iw * kept[2])});
    return {factor, iw, dl, {l[0] + dl[0], l[1] + dl[1], l[2] + dl[2]}, *this};
  }

  double squared_step() const { return hh_; }
  /// - A k C: what the multiplier, over h^2, is at rest.
  template <class T>
  Rows<T, 3> stress(const T& weight, const Rows<T, 3>& c) const {
    return {-weight * (k00_ * c[0] + k01_ * c[1]), -weight * (k01_ * c[0] + k11_ * c[1]),
            -weight * (k22_ * c[2])};
  }
  template <class T>
  Rows<T, 3> stress_derivative(int p, const T& weight, const Rows<T, 3>& c,
                               const Rows<T, 3>& dc) const {
    Rows<T, 3> s = stress(weight, dc);
    const Rows<T, 3> own = stiffness_change(p, c);
    for (std::size_t i = 0; i < 3; ++i) s[i] = s[i] - weight * own[i];
    return s;
  }

 private:
  template <class T>
  Rows<T, 3> compliance(const Rows<T, 3>& l) const {
    return {a00_ * l[0] + a01_ * l[1], a01_ * l[0] + a11_ * l[1], a22_ * l[2]};
  }
  template <class T>
  static Rows<T, 3> stiffness_change(int p, const Rows<T, 3>& c) {
    const T zero = broadcast<T>(0);
    switch (p) {
      case 0:
        return {c[0], zero, zero};
      case 1:
        return {zero, c[1], zero};
      case 2:
        return {c[1], c[0], zero};
      case 3:
        return {zero, zero, c[2]};
      default:
        return {zero, zero, zero};
    }
  }
  /// d(k^-1) = - k^-1 dk k^-1.
  template <class T>
  Rows<T, 3> compliance_change(int p, const Rows<T, 3>& l) const {
    const Rows<T, 3> a = compliance(stiffness_change(p, compliance(l)));
    return {-hh_ * a[0], -hh_ * a[1], -hh_ * a[2]};
  }

  double k00_, k01_, k11_, k22_;
  double a00_, a01_, a11_, a22_;
  double hh_;
};

/// One stiffness k for all rows: energy 1/2 w k |C|^2. The local system is (I + s mobility) dl =
/// -(s C + l) with s = h^2 w k, which k = 0 does not harm.
class ScalarLaw {
 public:
  /// `parameter`: the index of k in OrthotropicSheet, or -1.
  ScalarLaw(double stiffness, int parameter, double step)
      : k_(stiffness), hh_(step * step), parameter_(parameter) {}

  template <class T, std::size_t N>
  struct Solution {
    Factor<T, N> factor;
    T s, ds;            ///< ds: by the parameter
    Rows<T, N> change;  ///< dl
    Rows<T, N> reach;   ///< C + mobility dl
    int parameter;

    Rows<T, N> derivative(int p, const Rows<T, N>& dc, const Rows<T, N>& dm,
                          const Rows<T, N>& dl0) const {
      Rows<T, N> r;
      for (std::size_t i = 0; i < N; ++i) {
        r[i] = -(s * (dc[i] + dm[i]) + dl0[i]);
        if (p == parameter) r[i] = r[i] - ds * reach[i];
      }
      return factor.solve(r);
    }
  };

  template <class T, std::size_t N>
  Solution<T, N> solve(const T& weight, const Rows<T, N>& c, const Symmetric<T, N>& m,
                       const Rows<T, N>& l) const {
    const T ds = hh_ * weight, s = k_ * ds;
    const Factor<T, N> factor(plus_identity(s, m));
    Rows<T, N> r;
    for (std::size_t i = 0; i < N; ++i) r[i] = -(s * c[i] + l[i]);
    const Rows<T, N> dl = factor.solve(r);
    Rows<T, N> reach = m * dl;
    for (std::size_t i = 0; i < N; ++i) reach[i] = reach[i] + c[i];
    return {factor, s, ds, dl, reach, parameter_};
  }

  double squared_step() const { return hh_; }
  template <class T, std::size_t N>
  Rows<T, N> stress(const T& weight, const Rows<T, N>& c) const {
    Rows<T, N> s;
    for (std::size_t i = 0; i < N; ++i) s[i] = -k_ * weight * c[i];
    return s;
  }
  template <class T, std::size_t N>
  Rows<T, N> stress_derivative(int p, const T& weight, const Rows<T, N>& c,
                               const Rows<T, N>& dc) const {
    Rows<T, N> s = stress(weight, dc);
    if (p == parameter_)
      for (std::size_t i = 0; i < N; ++i) s[i] = s[i] - weight * c[i];
    return s;
  }

 private:
  template <class T>
  static Symmetric<T, 1> plus_identity(const T& s, const Symmetric<T, 1>& m) {
    return {broadcast<T>(1) + s * m.m};
  }
  template <class T>
  static Symmetric<T, 3> plus_identity(const T& s, const Symmetric<T, 3>& m) {
    const T one = broadcast<T>(1);
    return {one + s * m.xx, s * m.yx, one + s * m.yy, s * m.zx, s * m.zy, one + s * m.zz};
  }

  double k_, hh_;
  int parameter_;
};

namespace detail {

/// grad C of the Green strain is made of w_u and w_v, so that the mobility is made of their scalar
/// products and three sums over the vertices, and is linear in the former.
template <class T>
inline Symmetric<T, 3> green_mobility(const TriangleShape<T>& shape, const std::array<T, 3>& w,
                                      const T& uu, const T& uv, const T& vv) {
  const auto du = shape.du(), dv = shape.dv();
  const T a0 = w[0] * du[0], a1 = w[1] * du[1], a2 = w[2] * du[2];
  const T suu = a0 * du[0] + a1 * du[1] + a2 * du[2];
  const T suv = a0 * dv[0] + a1 * dv[1] + a2 * dv[2];
  const T svv = w[0] * dv[0] * dv[0] + w[1] * dv[1] * dv[1] + w[2] * dv[2] * dv[2];
  const T cross_term = suv * uv;
  return {suu * uu,
          cross_term,
          svv * vv,
          suu * uv + suv * uu,
          suv * vv + svv * uv,
          suu * vv + (cross_term + cross_term) + svv * uu};
}

template <class T>
inline std::array<Vector3<T>, 3> green_pull(const TriangleShape<T>& shape, const Vector3<T>& wu,
                                            const Vector3<T>& wv, const Rows<T, 3>& l) {
  const Vector3<T> by_u = l[0] * wu + l[2] * wv, by_v = l[1] * wv + l[2] * wu;
  const Vector3<T> one = shape.du1 * by_u + shape.dv1 * by_v;
  const Vector3<T> two = shape.du2 * by_u + shape.dv2 * by_v;
  return {-(one + two), one, two};
}

}  // namespace detail

/// The Green strain of a triangle, (E_uu, E_vv, 2 E_uv).
struct GreenTriangle {
  static constexpr std::size_t kVertices = 3, kRows = 3;
  using Law = BlockLaw;

  template <class T>
  struct Rest {
    TriangleShape<T> shape;
    const T& weight() const { return shape.area; }
  };

  template <class T>
  struct Strain {
    const TriangleShape<T>& shape;
    Vector3<T> wu, wv;
    T uu, uv, vv;
    Rows<T, 3> value() const {
      const T half = broadcast<T>(0.5), one = broadcast<T>(1);
      return {half * (uu - one), half * (vv - one), uv};
    }
    Symmetric<T, 3> mobility(const std::array<T, 3>& w) const {
      return detail::green_mobility(shape, w, uu, uv, vv);
    }
    std::array<Vector3<T>, 3> pull(const Rows<T, 3>& l) const {
      return detail::green_pull(shape, wu, wv, l);
    }
    /// Block (i, j) is (du_i du_j l_0 + dv_i dv_j l_1 + (du_i dv_j + dv_i du_j) l_2) I.
    std::array<T, 3> turning(const Rows<T, 3>& l) const {
      const auto du = shape.du(), dv = shape.dv();
      std::array<T, 3> out;
      for (std::size_t i = 0; i < 3; ++i) {
        const T a = du[i] * l[0] + dv[i] * l[2], b = dv[i] * l[1] + du[i] * l[2];
        out[i] = absolute(T(a * du[0] + b * dv[0])) + absolute(T(a * du[1] + b * dv[1])) +
                 absolute(T(a * du[2] + b * dv[2]));
      }
      return out;
    }
  };

  template <class T>
  struct Change {
    const TriangleShape<T>& shape;
    Vector3<T> wu, wv;
    T uu, uv, vv;
    Rows<T, 3> value() const {
      const T half = broadcast<T>(0.5);
      return {half * uu, half * vv, uv};
    }
    Symmetric<T, 3> mobility(const std::array<T, 3>& w) const {
      return detail::green_mobility(shape, w, uu, uv, vv);
    }
    std::array<Vector3<T>, 3> pull(const Rows<T, 3>& l) const {
      return detail::green_pull(shape, wu, wv, l);
    }
  };

  template <class T>
  static Strain<T> strain(const Rest<T>& rest, const std::array<Vector3<T>, 3>& x) {
    const auto w = deformation_gradient(rest.shape, x[0], x[1], x[2]);
    return {rest.shape, w.wu, w.wv, dot(w.wu, w.wu), shear(w), dot(w.wv, w.wv)};
  }
  template <class T>
  static Change<T> change(const Rest<T>& rest, const Strain<T>& s,
                          const std::array<Vector3<T>, 3>& dx) {
    const auto w = deformation_gradient(rest.shape, dx[0], dx[1], dx[2]);
    const T uu = dot(s.wu, w.wu), vv = dot(s.wv, w.wv);
    return {rest.shape, w.wu, w.wv, uu + uu, dot(s.wu, w.wv) + dot(s.wv, w.wu), vv + vv};
  }
};

/// `angle` in (-pi, pi] plus the multiple of 2 pi that brings it within pi of `last`.
template <class T>
inline T unwrapped(const T& angle, const T& last) {
  const T pi = broadcast<T>(M_PI), turn = broadcast<T>(2 * M_PI);
  T out = angle;
  // Twice: a hinge may have gone around once more.
  for (int k = 0; k < 2; ++k) {
    out = select(last - out > pi, out + turn, out);
    out = select(out - last > pi, out - turn, out);
  }
  return out;
}

/// The angle of a hinge less a rest angle. The angle knows its past: where one side passes through
/// the other, at 180 degrees, it goes on growing, and so does the moment that opens the hinge (the
/// angle of the shape alone would change its sign there, and the fold stay closed).
///
/// Derivative of its gradient along dx (names as in strain/dihedral_angle.h): a triangle's share in
/// the gradient of vertex i is L_i p. With D = sum_i L_i dx_i and E = dx_1 - dx_0,
///
///     dp = - q (p . D) - c (p . E) - p (q . D),   dt = c . D + 2 f q . E,   dL = (dt, -dt, 0).
template <class T>
inline std::array<Vector3<T>, 4> dihedral_gradient_change(const DihedralAngle<T>& angle,
                                                          const std::array<Vector3<T>, 4>& dx) {
  const Vector3<T> edge = dx[1] - dx[0];
  const auto side = [&](const HingeSide<T>& s, const Vector3<T>& q, const Vector3<T>& apex) {
    const Vector3<T> d = apex - dx[0] - s.t * edge;
    const T qd = dot(q, d), qe = dot(q, edge);
    struct {
      Vector3<T> p;
      T t;
    } out{-(dot(s.p, d) * q + dot(s.p, edge) * angle.c + qd * s.p),
          dot(angle.c, d) + (s.f + s.f) * qe};
    return out;
  };
  const auto a = side(angle.a, angle.q_a(), dx[2]), b = side(angle.b, angle.q_b(), dx[3]);
  const Vector3<T> along = a.t * angle.a.p + angle.a.t * a.p + b.t * angle.b.p + angle.b.t * b.p;
  return {along - (a.p + b.p), -along, a.p, b.p};
}

namespace detail {
/// An estimate: the Hessian of the angle is made of products as large as those of the gradients.
template <class T>
inline std::array<T, 4> hinge_turning(const std::array<Vector3<T>, 4>& gradient, const T& l) {
  std::array<T, 4> size;
  T sum = broadcast<T>(0);
  for (std::size_t i = 0; i < 4; ++i) {
    size[i] = square_root(dot(gradient[i], gradient[i]));
    sum = sum + size[i];
  }
  for (T& s : size) s = l * sum * s;
  return size;
}
}  // namespace detail

struct DihedralHinge {
  static constexpr std::size_t kVertices = 4, kRows = 1;
  using Law = ScalarLaw;

  template <class T>
  struct Rest {
    T factor;  ///< of the stiffness
    T angle;   ///< rad
    T last;    ///< the angle at the last evaluation, 0 at first, rad
    const T& weight() const { return factor; }
  };
  template <class T>
  struct Strain {
    DihedralAngle<T> angle;
    std::array<Vector3<T>, 4> gradient;
    T unwrapped, rest;
    Rows<T, 1> value() const { return {unwrapped - rest}; }
    Symmetric<T, 1> mobility(const std::array<T, 4>& w) const {
      T sum = w[0] * dot(gradient[0], gradient[0]);
      for (std::size_t i = 1; i < 4; ++i) sum = sum + w[i] * dot(gradient[i], gradient[i]);
      return {sum};
    }
    std::array<Vector3<T>, 4> pull(const Rows<T, 1>& l) const {
      return {l[0] * gradient[0], l[0] * gradient[1], l[0] * gradient[2], l[0] * gradient[3]};
    }
    std::array<T, 4> turning(const Rows<T, 1>& l) const {
      return detail::hinge_turning(gradient, absolute(l[0]));
    }
  };
  template <class T>
  struct Change {
    const Strain<T>& at;
    T dvalue;
    std::array<Vector3<T>, 4> dgradient;
    Rows<T, 1> value() const { return {dvalue}; }
    Symmetric<T, 1> mobility(const std::array<T, 4>& w) const {
      T sum = w[0] * dot(at.gradient[0], dgradient[0]);
      for (std::size_t i = 1; i < 4; ++i) sum = sum + w[i] * dot(at.gradient[i], dgradient[i]);
      return {sum + sum};
    }
    std::array<Vector3<T>, 4> pull(const Rows<T, 1>& l) const {
      return {l[0] * dgradient[0], l[0] * dgradient[1], l[0] * dgradient[2], l[0] * dgradient[3]};
    }
  };

  template <class T>
  static Strain<T> strain(const Rest<T>& rest, const std::array<Vector3<T>, 4>& x) {
    const auto angle = dihedral_angle(x[0], x[1], x[2], x[3]);
    return {angle, angle.gradient(), unwrapped(angle.value, rest.last), rest.angle};
  }
  template <class T>
  static void remember(const Strain<T>& strain, Rest<T>& rest) {
    rest.last = strain.unwrapped;
  }
  template <class T>
  static void forget(Rest<T>& rest) {
    rest.last = broadcast<T>(0);
  }
  template <class T>
  static Change<T> change(const Rest<T>&, const Strain<T>& s, const std::array<Vector3<T>, 4>& dx) {
    T value = dot(s.gradient[0], dx[0]);
    for (std::size_t i = 1; i < 4; ++i) value = value + dot(s.gradient[i], dx[i]);
    return {s, value, dihedral_gradient_change(s.angle, dx)};
  }
};

/// The curvature of a triangle, three rows that are linear in the angles at its edges.
struct TriangleBend {
  static constexpr std::size_t kVertices = 6, kRows = 3;
  using Law = ScalarLaw;

  template <class T>
  struct Rest {
    CurvatureMap<T> map;
    T area;
    std::array<T, 3> last;  ///< the angles at the last evaluation, 0 at first, rad
    const T& weight() const { return area; }
  };

  /// Gradients (or their changes) of the three angles, by hinge_vertices().
  template <class T>
  using Gradients = std::array<std::array<Vector3<T>, 4>, 3>;

  /// sum over the vertices of w a_j . b_k for hinges j and k.
  template <class T>
  static T product(const Gradients<T>& a, std::size_t j, const Gradients<T>& b, std::size_t k,
                   const std::array<T, 6>& w) {
    const auto vj = weft::detail::hinge_vertices(j), vk = weft::detail::hinge_vertices(k);
    T sum = broadcast<T>(0);
    for (std::size_t p = 0; p < 4; ++p)
      for (std::size_t q = 0; q < 4; ++q)
        if (vj[p] == vk[q]) sum = sum + w[vj[p]] * dot(a[j][p], b[k][q]);
    return sum;
  }
  /// R m R^T.
  template <class T>
  static Symmetric<T, 3> congruent(const CurvatureMap<T>& map, const Symmetric<T, 3>& m) {
    std::array<Rows<T, 3>, 3> mr;
    for (std::size_t k = 0; k < 3; ++k) mr[k] = m * map.r[k];
    const auto entry = [&](std::size_t i, std::size_t k) {
      return map.r[i][0] * mr[k][0] + map.r[i][1] * mr[k][1] + map.r[i][2] * mr[k][2];
    };
    return {entry(0, 0), entry(1, 0), entry(1, 1), entry(2, 0), entry(2, 1), entry(2, 2)};
  }
  template <class T>
  static std::array<Vector3<T>, 6> spread(const CurvatureMap<T>& map, const Gradients<T>& g,
                                          const Rows<T, 3>& l) {
    std::array<Vector3<T>, 6> out{};
    for (std::size_t j = 0; j < 3; ++j) {
      const T moment = map.r[0][j] * l[0] + map.r[1][j] * l[1] + map.r[2][j] * l[2];
      const auto v = weft::detail::hinge_vertices(j);
      for (std::size_t i = 0; i < 4; ++i) out[v[i]] = out[v[i]] + moment * g[j][i];
    }
    return out;
  }
  template <class T>
  static Rows<T, 3> mapped(const CurvatureMap<T>& map, const Rows<T, 3>& angles) {
    Rows<T, 3> out;
    for (std::size_t k = 0; k < 3; ++k)
      out[k] = map.r[k][0] * angles[0] + map.r[k][1] * angles[1] + map.r[k][2] * angles[2];
    return out;
  }

  template <class T>
  struct Strain {
    const CurvatureMap<T>& map;
    std::array<DihedralAngle<T>, 3> hinges;
    Gradients<T> g;
    Rows<T, 3> angles;
    Rows<T, 3> value() const { return mapped(map, angles); }
    Symmetric<T, 3> mobility(const std::array<T, 6>& w) const {
      return congruent(map,
                       {product(g, 0, g, 0, w), product(g, 1, g, 0, w), product(g, 1, g, 1, w),
                        product(g, 2, g, 0, w), product(g, 2, g, 1, w), product(g, 2, g, 2, w)});
    }
    std::array<Vector3<T>, 6> pull(const Rows<T, 3>& l) const { return spread(map, g, l); }
    std::array<T, 6> turning(const Rows<T, 3>& l) const {
      std::array<T, 6> out{};
      for (std::size_t j = 0; j < 3; ++j) {
        const T moment = map.r[0][j] * l[0] + map.r[1][j] * l[1] + map.r[2][j] * l[2];
        const auto own = detail::hinge_turning(g[j], absolute(moment));
        const auto v = weft::detail::hinge_vertices(j);
        for (std::size_t i = 0; i < 4; ++i) out[v[i]] = out[v[i]] + own[i];
      }
      return out;
    }
  };
  template <class T>
  struct Change {
    const Strain<T>& at;
    Rows<T, 3> dvalue;
    Gradients<T> dg;
    Rows<T, 3> value() const { return dvalue; }
    Symmetric<T, 3> mobility(const std::array<T, 6>& w) const {
      const auto both = [&](std::size_t j, std::size_t k) {
        return product(dg, j, at.g, k, w) + product(at.g, j, dg, k, w);
      };
      return congruent(at.map, Symmetric<T, 3>{both(0, 0), both(1, 0), both(1, 1), both(2, 0),
                                               both(2, 1), both(2, 2)});
    }
    std::array<Vector3<T>, 6> pull(const Rows<T, 3>& l) const { return spread(at.map, dg, l); }
  };

  template <class T>
  static Strain<T> strain(const Rest<T>& rest, const std::array<Vector3<T>, 6>& x) {
    Strain<T> out{rest.map, {}, {}, {}};
    for (std::size_t j = 0; j < 3; ++j) {
      const auto v = weft::detail::hinge_vertices(j);
      out.hinges[j] = dihedral_angle(x[v[0]], x[v[1]], x[v[2]], x[v[3]]);
      out.g[j] = out.hinges[j].gradient();
      out.angles[j] = unwrapped(out.hinges[j].value, rest.last[j]);
    }
    return out;
  }
  template <class T>
  static void remember(const Strain<T>& strain, Rest<T>& rest) {
    rest.last = strain.angles;
  }
  template <class T>
  static void forget(Rest<T>& rest) {
    rest.last.fill(broadcast<T>(0));
  }
  template <class T>
  static Change<T> change(const Rest<T>& rest, const Strain<T>& s,
                          const std::array<Vector3<T>, 6>& dx) {
    Gradients<T> dg;
    Rows<T, 3> angles;
    for (std::size_t j = 0; j < 3; ++j) {
      const auto v = weft::detail::hinge_vertices(j);
      const std::array<Vector3<T>, 4> d{dx[v[0]], dx[v[1]], dx[v[2]], dx[v[3]]};
      dg[j] = dihedral_gradient_change(s.hinges[j], d);
      angles[j] =
          dot(s.g[j][0], d[0]) + dot(s.g[j][1], d[1]) + dot(s.g[j][2], d[2]) + dot(s.g[j][3], d[3]);
    }
    return {s, mapped(rest.map, angles), dg};
  }
};

/// The elongation of an edge, |x1 - x0| - length, m. No derivative (an edge is no parameter of a
/// sheet).
struct EdgeLength {
  static constexpr std::size_t kVertices = 2, kRows = 1;
  using Law = ScalarLaw;

  template <class T>
  struct Rest {
    T length;  ///< m
    T factor;  ///< of the stiffness
    const T& weight() const { return factor; }
  };
  template <class T>
  struct Strain {
    T elongation;
    Vector3<T> direction;
    T inverse_length;
    Rows<T, 1> value() const { return {elongation}; }
    Symmetric<T, 1> mobility(const std::array<T, 2>& w) const {
      return {(w[0] + w[1]) * dot(direction, direction)};
    }
    std::array<Vector3<T>, 2> pull(const Rows<T, 1>& l) const {
      const Vector3<T> p = l[0] * direction;
      return {-p, p};
    }
    std::array<T, 2> turning(const Rows<T, 1>& l) const {
      const T s = absolute(l[0]) * inverse_length;
      return {s + s, s + s};
    }
  };
  template <class T>
  static Strain<T> strain(const Rest<T>& rest, const std::array<Vector3<T>, 2>& x) {
    const Vector3<T> d = x[1] - x[0];
    const T length = square_root(dot(d, d)), zero = broadcast<T>(0);
    const T inverse = select(length > zero, broadcast<T>(1) / length, zero);
    return {length - rest.length, inverse * d, inverse};
  }
};

}  // namespace weft::xpbd
