#pragma once
/// How the bend of a mesh is measured.
///
/// A flat sheet of flexural rigidity B without Poisson effect stores 1/2 B |K|^2 per area, with
/// |K|^2 = K_uu^2 + K_vv^2 + 2 K_uv^2. Here each bending element of area A stores 1/2 B A |K|^2
/// with K from three dihedral angles (triangle_curvature.h).
///
/// Why not 1/2 sum_e w_e B theta_e^2, a weight an edge? Because no such sum is this plate. The
/// moments that a constant moment M puts on the edges, l_e n^T M n, are the only ones in
/// equilibrium at every vertex, and w_e theta_e has them only where theta_e is proportional to n^T
/// K n. Elsewhere the vertices give way between each other until they are: with w = l^2 / (A_1 +
/// A_2) an alternating grid bends like a plate of rigidity 0.83 B and Poisson's ratio -0.2, with
/// weights that are exact for vertices on a cylinder like one of 0.75 B and -1/3; on a uniform grid
/// bend and twist are coupled. The tip of a heavy cantilever sinks 20 to 50 % too far with
/// both, on any resolution.
///
/// **Grids** (every triangle is half of a rectangle; rectangles may differ): a quarter of each
/// rectangle belongs to each of its corners, whose element has the bends of the two grid lines
/// through the corner and the twist of the rectangle. Lines turn where two rectangles meet:
///
///     K_11 = 2 theta_1 / (b + c),     K_12 = theta_12 / l,
///
/// theta_1 the angle between (corner, right, up) and (corner, left, up), b and c the distances to
/// right and left; theta_12 that of the rectangle over its diagonal of length l, from right to up.
/// These are the second differences of a plate: exact for K constant, and its forces vanish at
/// every vertex. How the rectangles are split into triangles does not matter. Where all are equal
/// two opposite corners of each stand for the other two as well.
///
/// **Other meshes**: one element a triangle, with the angles at its three edges; dE/dtheta_e = l_e
/// n^T B (K_1 + K_2) n / 2 has exact moments, too. Twist: where triangles mirror each other (a ring
/// that is split alternately) K_t is exact on the mean only; it differs from K by -+ K_uv I, so
/// that twist would store 4 K_uv^2 instead of 2. The component K_uv has therefore a factor sqrt(m),
/// 1/4 <= m <= 1, one number for the mesh: as near as it may to what makes the energy of a constant
/// twist right. m = 1 in lattices of equal triangles, where all is exact. (m also is what resists a
/// checkerboard of vertices that mirror, which is why it does not go to zero.)
///
/// Rim: what has one side only has no angle; the energy is minimized over it (a free edge carries
/// no moment), which projects K.
#include <vector>

#include "weft/mesh/triangle_mesh.h"
#include "weft/strain/triangle_curvature.h"

namespace weft {

/// Stencil as in triangle_curvature.h: of a grid, the corner, its neighbours right and up, and the
/// vertices below the corner, across the diagonal and left of the corner.
struct BendingElement {
  std::array<int, 6> vertices;
  CurvatureMap<double> map;  ///< 1/m, with the factor of the twist
  double area;               ///< m^2
  /// What an angle at each edge on the rim would add to the curvature components, per 1/m.
  std::vector<Vec3> rim;
};

/// What becomes of the angles on the rim.
enum class RimAngles {
  projected,  ///< minimized over for a law without Poisson effect: `map` holds the projection
  open,       ///< left out of `map`; the law minimizes over multiples of `rim` itself
};

/// Their areas add up to that of the mesh, which is valid.
std::vector<BendingElement> bending_elements(const TriangleMesh& mesh,
                                             RimAngles rim = RimAngles::projected);

}  // namespace weft
