#pragma once
/// How the bend of a mesh is measured.
///
/// A flat sheet of flexural rigidity B without Poisson effect stores 1/2 B |K|^2 per area, with
/// |K|^2 = K_uu^2 + K_vv^2 + 2 K_uv^2. Here each triangle stores 1/2 B A |K_t|^2 with K_t from the
/// dihedral angles at its three edges (triangle_curvature.h).
///
/// Why not 1/2 sum_e w_e B theta_e^2, a weight an edge? Because no such sum is this plate. The
/// moments that a constant moment M puts on the edges, l_e n^T M n, are the only ones in
/// equilibrium at every vertex, and w_e theta_e has them only where theta_e is proportional to n^T
/// K n. Elsewhere the vertices give way between each other until they are: with w = l^2 / (A_1 +
/// A_2) an alternating grid bends like a plate of rigidity 0.83 B and Poisson's ratio -0.2, with
/// weights that are exact for vertices on a cylinder like one of 0.75 B and -1/3; on a uniform grid
/// bend and twist are coupled. The tip of a heavy cantilever sinks 20 to 50 % too far with
/// both, on any resolution. With K_t it is within 1 % from 10 cells on, and exact moments at the
/// vertices follow from dE/dtheta_e = l_e n^T B (K_1 + K_2) n / 2.
///
/// Rim: an edge with one triangle has no angle; the energy is minimized over it (a free edge
/// carries no moment), which projects K_t.
///
/// Twist: where triangles mirror each other (the alternating grid) K_t is exact on the mean only;
/// it differs from K by -+ K_uv I, so that twist would store 4 K_uv^2 instead of 2. The component
/// K_uv has therefore a factor sqrt(m), 1/4 <= m <= 1, one number for the mesh: as near as it may
/// to what makes the energy of a constant twist right. m = 1 in lattices of equal triangles, where
/// all is exact; m = 1/4 on the alternating grid, where a cylinder along the grid is exact and one
/// at 45 degrees stores 1.125 times its energy. (m also is what resists a checkerboard of the
/// vertices there, which is why it does not go to zero, where twist would be exact.)
#include <vector>

#include "weft/mesh/triangle_mesh.h"
#include "weft/strain/triangle_curvature.h"

namespace weft {

/// One triangle with its three neighbours, see triangle_curvature.h.
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

/// One a triangle, in the mesh's order.
std::vector<BendingElement> bending_elements(const TriangleMesh& mesh,
                                             RimAngles rim = RimAngles::projected);

}  // namespace weft
