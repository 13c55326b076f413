#pragma once
/// The hinges of a cell of a grid whose lines run along u and v, all cells alike, where no
/// stiffness couples curvatures: each hinge is a spring of its own.
///
/// Vertices 0 to 3 are the cell's corners, counter-clockwise in (u, v); 4 and 5 stand for those
/// beyond the sides 0-1 and 3-0, which meet at corner 0, 6 and 7 for those beyond 2-3 and 1-2,
/// which meet at corner 2: two sides and the corner between them are a bending element (bending.h).
/// Hinges: side 0-1 with the apexes 3 and 4, and so on, and the diagonal 1-3, which both elements
/// have in common.
#include <array>
#include <utility>

#include "weft/strain/triangle_curvature.h"

namespace weft {

struct CellStencil {
  static constexpr std::size_t vertices = 8;
  static constexpr std::size_t hinges = 5;
  static constexpr std::size_t diagonal = 2;  ///< the hinge of both elements

  /// Vertices x0 ... x3 of a hinge (dihedral_angle.h).
  static constexpr std::array<std::size_t, 4> hinge(std::size_t j) {
    constexpr std::array<std::array<std::size_t, 4>, hinges> kHinges{
        {{0, 1, 3, 4}, {3, 0, 1, 5}, {1, 3, 0, 2}, {2, 3, 1, 6}, {1, 2, 3, 7}}};
    return kHinges[j];
  }

  /// (row, column) of the blocks off the diagonal: all pairs that a hinge couples.
  static constexpr std::array<std::array<std::size_t, 2>, 18> pairs{{{1, 0},
                                                                     {2, 0},
                                                                     {2, 1},
                                                                     {3, 0},
                                                                     {3, 1},
                                                                     {3, 2},
                                                                     {4, 0},
                                                                     {4, 1},
                                                                     {4, 3},
                                                                     {5, 0},
                                                                     {5, 1},
                                                                     {5, 3},
                                                                     {6, 1},
                                                                     {6, 2},
                                                                     {6, 3},
                                                                     {7, 1},
                                                                     {7, 2},
                                                                     {7, 3}}};
  /// Of a pair among them, row > column.
  static constexpr std::size_t pair_index(std::size_t row, std::size_t column) {
    std::size_t k = 0;
    while (pairs[k][0] != row || pairs[k][1] != column) ++k;
    return k;
  }
};

/// Blocks of the lower triangle by the vertices of a cell.
template <class T>
struct CellHessian {
  std::array<SymmetricMatrix3<T>, CellStencil::vertices> diagonal;
  std::array<Matrix3<T>, CellStencil::pairs.size()> lower;

  template <std::size_t kRow, std::size_t kColumn>
  Matrix3<T>& block() {
    return lower[CellStencil::pair_index(kRow, kColumn)];
  }
};

/// Derivatives of the energy of a hinge by its angle, J.
template <class T>
struct HingeLaw {
  T moment, stiffness;
};

namespace detail {

/// a + b and a + b^T, in place.
template <class T>
inline void add_to(Matrix3<T>& a, const Matrix3<T>& b) {
  for (std::size_t i = 0; i < 9; ++i) a.m[i] = a.m[i] + b.m[i];
}
template <class T>
inline void add_transposed(Matrix3<T>& a, const Matrix3<T>& b) {
  for (std::size_t r = 0; r < 3; ++r)
    for (std::size_t c = 0; c < 3; ++c) a.m[3 * r + c] = a.m[3 * r + c] + b.m[3 * c + r];
}

/// The vertex whose blocks follow from the others: all hinges have it, and a translation costs
/// nothing.
inline constexpr std::size_t kFollowing = 1;

template <std::size_t kVertex, class T>
inline void put(const SymmetricMatrix3<T>& block, CellHessian<T>& to) {
  if constexpr (kVertex >= 4)  // one hinge alone has it
    to.diagonal[kVertex] = block;
  else if constexpr (kVertex != kFollowing)
    to.diagonal[kVertex] = to.diagonal[kVertex] + block;
}
template <std::size_t kRow, std::size_t kColumn, class T>
inline void put(const Matrix3<T>& block, CellHessian<T>& to) {
  if constexpr (kRow == kFollowing || kColumn == kFollowing)
    return;
  else if constexpr (kRow >= 4)
    to.template block<kRow, kColumn>() = block;
  else if constexpr (kRow > kColumn)
    add_to(to.template block<kRow, kColumn>(), block);
  else
    add_transposed(to.template block<kColumn, kRow>(), block);
}

/// The blocks of a hinge: stiffness gradient gradient^T and, with kExact, moment Hessian.
template <bool kExact, std::size_t kHinge, class T>
inline void put_hinge(const DihedralAngle<T>& angle, const HingeLaw<T>& law, CellHessian<T>& to) {
  constexpr auto v = CellStencil::hinge(kHinge);
  const auto g = angle.gradient();
  std::array<Vector3<T>, 4> s;
  for (std::size_t i = 0; i < 4; ++i) s[i] = law.stiffness * g[i];
  const auto own = [&](std::size_t i) {
    return SymmetricMatrix3<T>{{s[i].x * g[i].x, s[i].y * g[i].x, s[i].y * g[i].y, s[i].z * g[i].x,
                                s[i].z * g[i].y, s[i].z * g[i].z}};
  };
  const auto between = [&](std::size_t i, std::size_t j, const Matrix3<T>& exact) {
    Matrix3<T> block = outer(s[i], g[j]);
    add_to(block, exact);
    return block;
  };
  if constexpr (kExact) {
    const HingeHessian<T> h = hinge_hessian(angle, law.moment);
    put<v[0]>(own(0) + h.b00, to);
    put<v[1]>(own(1) + h.b11, to);
    put<v[2]>(own(2) + h.b22, to);
    put<v[3]>(own(3) + h.b33, to);
    put<v[1], v[0]>(between(1, 0, h.b10), to);
    put<v[2], v[0]>(between(2, 0, h.b20), to);
    put<v[2], v[1]>(between(2, 1, h.b21), to);
    put<v[3], v[0]>(between(3, 0, h.b30), to);
    put<v[3], v[1]>(between(3, 1, h.b31), to);
  } else {
    put<v[0]>(own(0), to);
    put<v[1]>(own(1), to);
    put<v[2]>(own(2), to);
    put<v[3]>(own(3), to);
    put<v[1], v[0]>(outer(s[1], g[0]), to);
    put<v[2], v[0]>(outer(s[2], g[0]), to);
    put<v[2], v[1]>(outer(s[2], g[1]), to);
    put<v[3], v[0]>(outer(s[3], g[0]), to);
    put<v[3], v[1]>(outer(s[3], g[1]), to);
  }
  put<v[3], v[2]>(outer(s[3], g[2]), to);
}

/// A transposed block, which is not copied.
template <class T>
struct Transposed {
  const Matrix3<T>& of;
};
template <class T>
inline const T& entry(const Matrix3<T>& a, std::size_t r, std::size_t c) {
  return a.m[3 * r + c];
}
template <class T>
inline const T& entry(const Transposed<T>& a, std::size_t r, std::size_t c) {
  return a.of.m[3 * c + r];
}
template <class T>
inline const T& entry(const SymmetricMatrix3<T>& a, std::size_t r, std::size_t c) {
  return r > c ? a.m[r * (r + 1) / 2 + c] : a.m[c * (c + 1) / 2 + r];
}

/// - (a + b ...).
template <class T, class... Blocks>
inline void set_to_minus_sum(Matrix3<T>& to, const Blocks&... blocks) {
  for (std::size_t r = 0; r < 3; ++r)
    for (std::size_t c = 0; c < 3; ++c) to.m[3 * r + c] = -(entry(blocks, r, c) + ...);
}
template <class T, class... Blocks>
inline void set_to_minus_sum(SymmetricMatrix3<T>& to, const Blocks&... blocks) {
  for (std::size_t r = 0; r < 3; ++r)
    for (std::size_t c = 0; c <= r; ++c) to.m[r * (r + 1) / 2 + c] = -(entry(blocks, r, c) + ...);
}

/// The row and the column of the vertex kFollowing.
template <class T>
inline void follow(CellHessian<T>& h) {
  static_assert(kFollowing == 1);
  auto& d = h.diagonal;
  const auto b = [&](std::size_t row, std::size_t column) -> Matrix3<T>& {
    return h.lower[CellStencil::pair_index(row, column)];
  };
  const auto turned = [&](std::size_t row, std::size_t column) {
    return Transposed<T>{b(row, column)};
  };
  set_to_minus_sum(b(4, 1), d[4], b(4, 0), b(4, 3));
  set_to_minus_sum(b(5, 1), d[5], b(5, 0), b(5, 3));
  set_to_minus_sum(b(6, 1), d[6], b(6, 2), b(6, 3));
  set_to_minus_sum(b(7, 1), d[7], b(7, 2), b(7, 3));
  set_to_minus_sum(b(1, 0), d[0], b(2, 0), b(3, 0), b(4, 0), b(5, 0));
  set_to_minus_sum(b(2, 1), d[2], b(2, 0), turned(3, 2), turned(6, 2), turned(7, 2));
  set_to_minus_sum(b(3, 1), d[3], b(3, 0), b(3, 2), turned(4, 3), turned(5, 3), turned(6, 3),
                   turned(7, 3));
  set_to_minus_sum(d[1], turned(1, 0), b(2, 1), b(3, 1), b(4, 1), b(5, 1), b(6, 1), b(7, 1));
}

}  // namespace detail

template <class T>
using CellAngles = std::array<DihedralAngle<T>, CellStencil::hinges>;

template <class T>
inline CellAngles<T> cell_angles(const std::array<Vector3<T>, CellStencil::vertices>& x) {
  const auto angle = [&](std::size_t j) {
    const auto v = CellStencil::hinge(j);
    return dihedral_angle(x[v[0]], x[v[1]], x[v[2]], x[v[3]]);
  };
  return {angle(0), angle(1), angle(2), angle(3), angle(4)};
}

/// The Hessian of the energy of a cell's hinges; without kExact its positive semi-definite part
/// that comes with the squares of the gradients.
template <bool kExact, class T>
inline void cell_hessian(const CellAngles<T>& angles,
                         const std::array<HingeLaw<T>, CellStencil::hinges>& laws,
                         CellHessian<T>& hessian) {
  constexpr T zero{};
  for (std::size_t i = 0; i < 4; ++i) hessian.diagonal[i].m.fill(zero);
  for (std::size_t k = 0; k < 6; ++k) hessian.lower[k].m.fill(zero);
  [&]<std::size_t... j>(std::index_sequence<j...>) {
    (detail::put_hinge<kExact, j>(angles[j], laws[j], hessian), ...);
  }
  (std::make_index_sequence<CellStencil::hinges>());
  detail::follow(hessian);
}

}  // namespace weft
