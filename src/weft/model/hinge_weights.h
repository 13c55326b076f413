#pragma once
#include <vector>

#include "weft/mesh/triangle_mesh.h"

namespace weft {

/// Weights (dimensionless) of the hinges, in the order of `hinges`, such that the hinges together
/// store the energy of a sheet: 1/2 sum_e w_e B theta_e^2 = 1/2 B kappa^2 area for a cylinder of
/// small curvature kappa in any direction, with B the flexural rigidity (N m).
///
/// The plain choice w = l^2 / (A_1 + A_2), l the edge and A_1, A_2 the areas of its triangles, does
/// so for a mesh of equilateral triangles (w = 2 / sqrt(3)). On a grid of squares halved by
/// diagonals it does so for cylinders along the grid only: a diagonal (w = 2) turns by sqrt(2) h
/// K_xy, an axis edge (w = 1) by h K_xx, so that a cylinder at 45 degrees stores 1.5 kappa^2
/// instead of 1. With w = 1 throughout the sum is h^2 (K_xx^2 + K_yy^2 + 2 K_xy^2), which is right
/// for all.
///
/// So each triangle asks for the three weights that bring its share, half of each of its hinges,
/// nearest to 1/2 B kappa^2 of its own area over all directions of the cylinder (least squares; a
/// pull of 1e-4 towards the plain weights; no weight below a tenth of the plain one), and a hinge
/// takes the mean of what its two triangles ask for. A triangle does not look at its neighbours: it
/// takes the triangle across its longest edge for itself turned by half a turn (as in a grid cell),
/// those across the other edges for its mirror images.
///
/// Energy over the exact one, all directions, interior of a grid (measured; plain weights in
/// brackets):
///   alternating grid, squares or rectangles     1.00           (1.00 to 1.50; to 3.3 for 1:3)
///   the same, vertices jittered by 0.2 cells    0.99 to 1.03   (1.12 to 1.67)
///   equilateral                                 1.00           (1.00)
///   uniform grid, along the axes                1.00           (1.00)
///   uniform grid, other directions              0.50 to 2.50   (0.75 to 3.00)
/// On the uniform pattern an axis hinge turns by h (K_xx + K_xy): no weights remove the coupling of
/// bend and twist that this brings. Use the alternating pattern.
VecX hinge_weights(const TriangleMesh& mesh, const std::vector<Hinge>& hinges);

}  // namespace weft
