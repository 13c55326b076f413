#pragma once
/// The diagonals of a mesh: elements with energy 1/2 area k (C_rising^2 + C_falling^2), C the
/// elongation along either diagonal (strain/diagonal.h), and its damping.
///
/// **Grids**: one element a cell, with the mean of w_u and w_v over it, those of its centre:
///
///     w_rising = (w_u + w_v) / sqrt 2,     w_falling = (w_u - w_v) / sqrt 2,
///
/// which for a square cell of side h are the vectors between its opposite corners over h sqrt 2.
///
/// Why not one a triangle? It has one of its cell's diagonals, and would take the other from its
/// own two legs. Where the cell is folded over that other diagonal, which costs the threads
/// nothing, the angle between the legs closes and their sum grows: the fold locks, and which of
/// the two folds does so depends on how the cell happens to be split.
///
/// **Other meshes**: one a triangle all the same.
#include <vector>

#include "weft/mesh/triangle_mesh.h"
#include "weft/model/hessian_kind.h"
#include "weft/model/membrane.h"
#include "weft/strain/diagonal.h"

namespace weft {

struct DiagonalElement {
  std::array<int, 4> vertices;            ///< of a triangle, the last one twice
  std::array<double, 4> rising, falling;  ///< w = sum of these times x_i, 1/m
  double area;                            ///< m^2
};

/// Their areas add up to that of the mesh, which is valid.
std::vector<DiagonalElement> diagonal_elements(const TriangleMesh& mesh);

namespace detail {

/// Second derivative of the energy density by w: k n n^T + t / |w| (I - n n^T), for the tension t
/// and the stiffness k (N/m). The projected one leaves out what resists turning where the tension
/// is negative, which damping alone can make it.
template <class T>
inline SymmetricMatrix3<T> diagonal_hessian(const Stretch<T>& c, const T& tension, double stiffness,
                                            HessianKind kind) {
  const T zero = broadcast<T>(0);
  T across = tension * c.inverse_length;
  if (kind == HessianKind::positive_semidefinite) across = select(across > zero, across, zero);
  SymmetricMatrix3<T> h = (broadcast<T>(stiffness) - across) * outer(c.direction);
  add_to_diagonal(across, h);
  return h;
}

}  // namespace detail
}  // namespace weft
