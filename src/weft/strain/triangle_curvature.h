#pragma once
/// Curvatures from the dihedral angles at the hinges of a stencil of six vertices (bend).
///
/// TriangleStencil: the curvature of a triangle from the angles at its three edges.
///
/// The curvature of a surface made of flat triangles sits on its edges: an edge of length l with
/// the unit normal n in the plane of the fabric and the angle theta adds theta l n n^T to the
/// integral of the curvature tensor. A triangle takes half of each of its edges:
///
///     K = 1 / (2 A) sum_j theta_j l_j n_j n_j^T     (1/m, on the undeformed fabric)
///
/// with components (K_uu, K_vv, sqrt(2) K_uv), so that their squares add up to |K|^2 = tr(K K).
/// Where the vertices lie on a surface of constant small curvature, K is that curvature in any
/// lattice of equal triangles. Each component is a linear function of three angles, hence
///
///     gradient of C_k = sum_j R_kj grad theta_j,   Hessian = sum_j R_kj Hess theta_j.
///
/// Vertices 0, 1, 2 of the triangle, counter-clockwise in (u, v), and 3 + j, the apex
/// across the edge from j to j + 1. Positive where the sheet is hollow on the front.
///
/// EdgeStencil: the angles at both ends of an edge between two cells of a grid, and those of one of
/// the cells over its diagonals. The edge goes from 0 to 1; on its left, counter-clockwise in (u,
/// v), is the cell 0, 1, 4, 2, on its right 1, 0, 3, 5. Hinges: the edge with the apexes 2 and 3
/// beside its start, the same with 4 and 5 beside its end, the left cell over the diagonals 0-4 and
/// 1-2. The first two count by their mean, which one of them alone must not turn over when it
/// passes 180 degrees: the second is taken in the turn that is next to the first, then both in the
/// one in which the mean is within (-pi, pi]. So C^2 is continuous but where the two are half a
/// turn apart, which bends of a sheet do not come near, and C jumps where the mean passes 180
/// degrees.
#include <numbers>

#include "weft/strain/dihedral_angle.h"

namespace weft {

namespace detail {
/// Vertices of hinge j in the stencil of the triangle.
constexpr std::array<std::size_t, 4> hinge_vertices(std::size_t j) {
  return {j, (j + 1) % 3, (j + 2) % 3, 3 + j};
}
}  // namespace detail

struct TriangleStencil {
  static constexpr std::size_t hinges = 3;
  static constexpr std::array<std::size_t, 4> hinge(std::size_t j) {
    return detail::hinge_vertices(j);
  }
  template <class T>
  static void choose_turns(std::array<T, hinges>& /*angles*/) {}
};

struct EdgeStencil {
  static constexpr std::size_t hinges = 4;
  static constexpr std::array<std::size_t, 4> hinge(std::size_t j) {
    constexpr std::array<std::array<std::size_t, 4>, hinges> kHinges{
        {{0, 1, 2, 3}, {0, 1, 4, 5}, {0, 4, 2, 1}, {1, 2, 0, 4}}};
    return kHinges[j];
  }
  template <class T>
  static void choose_turns(std::array<T, hinges>& angles) {
    const T half = broadcast<T>(std::numbers::pi), turn = broadcast<T>(2 * std::numbers::pi);
    T &first = angles[0], &second = angles[1];
    second = second - turn_beyond(second - first, half);
    const T back = turn_beyond(first + second, turn);
    first = first - back;
    second = second - back;
  }

 private:
  /// A turn with the sign of `angle`, where that is beyond `bound` to either side; else zero.
  template <class T>
  static T turn_beyond(const T& angle, const T& bound) {
    const T turn = broadcast<T>(2 * std::numbers::pi);
    return select(angle > bound, turn, select(angle < -bound, -turn, broadcast<T>(0)));
  }
};

/// The linear map from angles (rad) to curvature components (1/m): row k, column j. A column is
/// zero where there is no angle (an edge on the rim); the vertices of that hinge are then any.
template <class T = double, class Stencil = TriangleStencil>
struct CurvatureMap {
  std::array<std::array<T, Stencil::hinges>, 3> r;

  /// Derivative of sum_k factor[k] C_k by angle j.
  T moment(const std::array<T, 3>& factor, std::size_t j) const {
    return r[0][j] * factor[0] + r[1][j] * factor[1] + r[2][j] * factor[2];
  }
};

template <class T, class Stencil>
struct StencilCurvature {
  std::array<T, 3> value;  ///< components, 1/m
  std::array<DihedralAngle<T>, Stencil::hinges> angles;
};
/// K_uu, K_vv, sqrt(2) K_uv times the map's factor.
template <class T>
using TriangleCurvature = StencilCurvature<T, TriangleStencil>;

namespace detail {
/// The components from the angles at the hinges, whose turns are still to be chosen.
template <class T, class Stencil>
inline std::array<T, 3> components(const CurvatureMap<T, Stencil>& map,
                                   std::array<T, Stencil::hinges> angles) {
  Stencil::choose_turns(angles);
  std::array<T, 3> out;
  for (std::size_t k = 0; k < 3; ++k) {
    out[k] = map.r[k][0] * angles[0];
    for (std::size_t j = 1; j < Stencil::hinges; ++j) out[k] = out[k] + map.r[k][j] * angles[j];
  }
  return out;
}
}  // namespace detail

/// The components alone, the same as those of stencil_curvature().
template <class T, class Stencil>
inline std::array<T, 3> stencil_curvature_value(const CurvatureMap<T, Stencil>& map,
                                                const std::array<Vector3<T>, 6>& x) {
  std::array<T, Stencil::hinges> angles;
  for (std::size_t j = 0; j < Stencil::hinges; ++j) {
    const auto v = Stencil::hinge(j);
    angles[j] = dihedral_angle_value(x[v[0]], x[v[1]], x[v[2]], x[v[3]]);
  }
  return detail::components(map, angles);
}

template <class T, class Stencil>
inline StencilCurvature<T, Stencil> stencil_curvature(const CurvatureMap<T, Stencil>& map,
                                                      const std::array<Vector3<T>, 6>& x) {
  StencilCurvature<T, Stencil> out;
  std::array<T, Stencil::hinges> angles;
  for (std::size_t j = 0; j < Stencil::hinges; ++j) {
    const auto v = Stencil::hinge(j);
    out.angles[j] = dihedral_angle(x[v[0]], x[v[1]], x[v[2]], x[v[3]]);
    angles[j] = out.angles[j].value;
  }
  out.value = detail::components(map, angles);
  return out;
}

template <class T>
inline TriangleCurvature<T> triangle_curvature(const CurvatureMap<T>& map,
                                               const std::array<Vector3<T>, 6>& x) {
  return stencil_curvature(map, x);
}

/// Sum over the components of factor[k] times the gradient of component k, by vertex.
template <class T, class Stencil>
inline std::array<Vector3<T>, 6> curvature_gradient(const CurvatureMap<T, Stencil>& map,
                                                    const StencilCurvature<T, Stencil>& curvature,
                                                    const std::array<T, 3>& factor) {
  std::array<Vector3<T>, 6> out{};
  for (std::size_t j = 0; j < Stencil::hinges; ++j) {
    const T moment = map.moment(factor, j);
    const auto v = Stencil::hinge(j);
    const auto g = curvature.angles[j].gradient();
    for (std::size_t i = 0; i < 4; ++i) out[v[i]] = out[v[i]] + moment * g[i];
  }
  return out;
}

/// Blocks of the lower triangle by the six vertices: diagonal ones, and the others in the order
/// (1,0), (2,0), (2,1), (3,0) ... (5,4).
template <class T>
struct CurvatureHessian {
  std::array<SymmetricMatrix3<T>, 6> diagonal;
  std::array<Matrix3<T>, 15> lower;

  static constexpr std::size_t index(std::size_t row, std::size_t column) {
    return row * (row - 1) / 2 + column;
  }
  /// Adds a block whose row may come before its column.
  void add(std::size_t row, std::size_t column, const Matrix3<T>& block) {
    if (row > column) {
      Matrix3<T>& to = lower[index(row, column)];
      for (std::size_t i = 0; i < 9; ++i) to.m[i] = to.m[i] + block.m[i];
    } else {
      Matrix3<T>& to = lower[index(column, row)];
      for (std::size_t r = 0; r < 3; ++r)
        for (std::size_t c = 0; c < 3; ++c) to.m[3 * c + r] = to.m[3 * c + r] + block.m[3 * r + c];
    }
  }
};

namespace detail {
/// Of a diagonal stiffness.
template <class T>
inline std::array<Vector3<T>, 3> stiffness_times(const std::array<T, 3>& k, const Vector3<T>& a,
                                                 const Vector3<T>& b, const Vector3<T>& c) {
  return {k[0] * a, k[1] * b, k[2] * c};
}
template <class T>
inline std::array<Vector3<T>, 3> stiffness_times(const SymmetricMatrix3<T>& k, const Vector3<T>& a,
                                                 const Vector3<T>& b, const Vector3<T>& c) {
  return {k.m[0] * a + k.m[1] * b + k.m[3] * c, k.m[1] * a + k.m[2] * b + k.m[4] * c,
          k.m[3] * a + k.m[4] * b + k.m[5] * c};
}
}  // namespace detail

/// The sum over the components k, l of stiffness_kl gradient_k gradient_l^T. Positive semi-definite
/// where the stiffness is: its entries for (k, l), or its diagonal alone.
template <class T, class Stencil, class Stiffness>
inline CurvatureHessian<T> curvature_gauss_newton(const CurvatureMap<T, Stencil>& map,
                                                  const StencilCurvature<T, Stencil>& curvature,
                                                  const Stiffness& stiffness) {
  std::array<std::array<Vector3<T>, 4>, Stencil::hinges> g;
  for (std::size_t j = 0; j < Stencil::hinges; ++j) g[j] = curvature.angles[j].gradient();
  std::array<std::array<Vector3<T>, 6>, 3> a{};
  for (std::size_t k = 0; k < 3; ++k)
    for (std::size_t j = 0; j < Stencil::hinges; ++j) {
      const auto v = Stencil::hinge(j);
      for (std::size_t i = 0; i < 4; ++i) a[k][v[i]] = a[k][v[i]] + map.r[k][j] * g[j][i];
    }
  CurvatureHessian<T> out;
  for (std::size_t row = 0; row < 6; ++row) {
    const std::array<Vector3<T>, 3> s =
        detail::stiffness_times(stiffness, a[0][row], a[1][row], a[2][row]);
    for (std::size_t column = 0; column < row; ++column) {
      const Matrix3<T> o0 = outer(s[0], a[0][column]), o1 = outer(s[1], a[1][column]),
                       o2 = outer(s[2], a[2][column]);
      Matrix3<T>& to = out.lower[out.index(row, column)];
      for (std::size_t i = 0; i < 9; ++i) to.m[i] = o0.m[i] + o1.m[i] + o2.m[i];
    }
    const T half = broadcast<T>(0.5);
    out.diagonal[row] =
        half * (symmetric_outer(s[0], a[0][row]) + symmetric_outer(s[1], a[1][row]) +
                symmetric_outer(s[2], a[2][row]));
  }
  return out;
}

/// Adds the sum over the components of factor[k] times the Hessian of component k.
template <class T, class Stencil>
inline void add_curvature_hessian(const CurvatureMap<T, Stencil>& map,
                                  const StencilCurvature<T, Stencil>& curvature,
                                  const std::array<T, 3>& factor, CurvatureHessian<T>& hessian) {
  for (std::size_t j = 0; j < Stencil::hinges; ++j) {
    const T moment = map.moment(factor, j);
    const auto v = Stencil::hinge(j);
    const HingeHessian<T> h = hinge_hessian(curvature.angles[j], moment);
    hessian.diagonal[v[0]] = hessian.diagonal[v[0]] + h.b00;
    hessian.diagonal[v[1]] = hessian.diagonal[v[1]] + h.b11;
    hessian.diagonal[v[2]] = hessian.diagonal[v[2]] + h.b22;
    hessian.diagonal[v[3]] = hessian.diagonal[v[3]] + h.b33;
    hessian.add(v[1], v[0], h.b10);
    hessian.add(v[2], v[0], h.b20);
    hessian.add(v[2], v[1], h.b21);
    hessian.add(v[3], v[0], h.b30);
    hessian.add(v[3], v[1], h.b31);
  }
}

}  // namespace weft
