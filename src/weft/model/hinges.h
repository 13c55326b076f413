#pragma once
/// Bending by hinges: what lattices bend by, in which much cloth is animated, on a grid of their
/// cells. At every edge between two cells, with l the mean of their widths across it,
///
///     K = (theta_1 + theta_2) / (2 l),     1/2 B A K^2,   A = l times the edge's length,
///
/// theta_1, theta_2 the angles at its two ends; and for each cell the angles over both diagonals,
/// of length d, sqrt(2) K_12 = sqrt(2) theta_12 / d, each with half of the cell's area and the
/// rigidity of the twist.
///
/// The same plate as bending.h where curvature is even. One angle an edge is less than one at each
/// of its ends: a bend that changes along the edge from cell to cell costs less here, one that
/// changes its sign nothing. Cloth whose folds are a few cells wide is softer by that.
///
/// On the rim there are no hinges, but those that end there count whole: a hem has no bend of its
/// own.
#include <vector>

#include "weft/mesh/triangle_mesh.h"
#include "weft/strain/triangle_curvature.h"

namespace weft {

/// Components: the bend across the edge, then the twist of the cell on its left over both
/// diagonals, where this element has it: the areas are zero otherwise.
struct HingeElement {
  std::array<int, 6> vertices;  ///< EdgeStencil; where there is no second cell some are repeated
  CurvatureMap<double, EdgeStencil> map;  ///< 1/m
  std::array<double, 3> areas;            ///< m^2, one a component
};

/// One an inner edge, and one more for a cell whose twist none of its edges has. Throws Error
/// unless the mesh is a grid (grid_cells.h).
std::vector<HingeElement> hinge_elements(const TriangleMesh& mesh);

}  // namespace weft
