#pragma once
/// Curvature of a triangle from the dihedral angles at its three edges (bend).
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
/// Stencil: vertices 0, 1, 2 of the triangle, counter-clockwise in (u, v), and 3 + j, the apex
/// across the edge from j to j + 1. Positive where the sheet is hollow on the front.
#include "weft/strain/dihedral_angle.h"

namespace weft {

/// The linear map from angles (rad) to curvature components (1/m): row k, column j. A column is
/// zero where an edge is on the rim; the apex across it is then any vertex of that edge.
template <class T = double>
struct CurvatureMap {
  std::array<std::array<T, 3>, 3> r;
};

template <class T>
struct TriangleCurvature {
  std::array<T, 3> value;  ///< K_uu, K_vv, sqrt(2) K_uv times the map's factor, 1/m
  std::array<DihedralAngle<T>, 3> angles;
};

namespace detail {
/// Vertices of hinge j in the stencil of the triangle.
constexpr std::array<std::size_t, 4> hinge_vertices(std::size_t j) {
  return {j, (j + 1) % 3, (j + 2) % 3, 3 + j};
}
}  // namespace detail

template <class T>
inline TriangleCurvature<T> triangle_curvature(const CurvatureMap<T>& map,
                                               const std::array<Vector3<T>, 6>& x) {
  TriangleCurvature<T> out;
  for (std::size_t j = 0; j < 3; ++j) {
    const auto v = detail::hinge_vertices(j);
    out.angles[j] = dihedral_angle(x[v[0]], x[v[1]], x[v[2]], x[v[3]]);
  }
  for (std::size_t k = 0; k < 3; ++k)
    out.value[k] = map.r[k][0] * out.angles[0].value + map.r[k][1] * out.angles[1].value +
                   map.r[k][2] * out.angles[2].value;
  return out;
}

/// Sum over the components of factor[k] times the gradient of component k, by vertex.
template <class T>
inline std::array<Vector3<T>, 6> curvature_gradient(const CurvatureMap<T>& map,
                                                    const TriangleCurvature<T>& curvature,
                                                    const std::array<T, 3>& factor) {
  std::array<Vector3<T>, 6> out{};
  for (std::size_t j = 0; j < 3; ++j) {
    const T moment = map.r[0][j] * factor[0] + map.r[1][j] * factor[1] + map.r[2][j] * factor[2];
    const auto v = detail::hinge_vertices(j);
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

/// The sum over the components of rank_one[k] gradient gradient^T, rank_one >= 0. Positive
/// semi-definite.
template <class T>
inline CurvatureHessian<T> curvature_gauss_newton(const CurvatureMap<T>& map,
                                                  const TriangleCurvature<T>& curvature,
                                                  const std::array<T, 3>& rank_one) {
  std::array<std::array<Vector3<T>, 4>, 3> g;
  for (std::size_t j = 0; j < 3; ++j) g[j] = curvature.angles[j].gradient();
  std::array<std::array<Vector3<T>, 6>, 3> a{};
  for (std::size_t k = 0; k < 3; ++k)
    for (std::size_t j = 0; j < 3; ++j) {
      const auto v = detail::hinge_vertices(j);
      for (std::size_t i = 0; i < 4; ++i) a[k][v[i]] = a[k][v[i]] + map.r[k][j] * g[j][i];
    }
  CurvatureHessian<T> out;
  for (std::size_t row = 0; row < 6; ++row) {
    const Vector3<T> s0 = rank_one[0] * a[0][row], s1 = rank_one[1] * a[1][row],
                     s2 = rank_one[2] * a[2][row];
    for (std::size_t column = 0; column < row; ++column) {
      const Matrix3<T> o0 = outer(s0, a[0][column]), o1 = outer(s1, a[1][column]),
                       o2 = outer(s2, a[2][column]);
      Matrix3<T>& to = out.lower[out.index(row, column)];
      for (std::size_t i = 0; i < 9; ++i) to.m[i] = o0.m[i] + o1.m[i] + o2.m[i];
    }
    const T half = broadcast<T>(0.5);
    out.diagonal[row] = half * (symmetric_outer(s0, a[0][row]) + symmetric_outer(s1, a[1][row]) +
                                symmetric_outer(s2, a[2][row]));
  }
  return out;
}

/// Adds the sum over the components of factor[k] times the Hessian of component k.
template <class T>
inline void add_curvature_hessian(const CurvatureMap<T>& map, const TriangleCurvature<T>& curvature,
                                  const std::array<T, 3>& factor, CurvatureHessian<T>& hessian) {
  for (std::size_t j = 0; j < 3; ++j) {
    const T moment = map.r[0][j] * factor[0] + map.r[1][j] * factor[1] + map.r[2][j] * factor[2];
    const auto v = detail::hinge_vertices(j);
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
