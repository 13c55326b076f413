#pragma once
/// What stands on the cells of a grid of equal cells along u and v, two triangles and two bending
/// elements each, in groups of kLanes cells: each vertex is read once, and each block of the
/// Hessian written once a cell.
#include <array>
#include <vector>

#include "weft/model/bending.h"
#include "weft/model/drag.h"
#include "weft/model/hem.h"
#include "weft/model/hessian_kind.h"
#include "weft/model/lane_blocks.h"
#include "weft/model/membrane.h"
#include "weft/model/triangle_lanes.h"
#include "weft/strain/cell_hinges.h"

namespace weft::detail {

/// The bends of one cell; strains 0 to 2 are those of the element at corner 0, hinges 0, 1 and the
/// diagonal, 3 to 5 those at corner 2, hinges 3, 4 and the diagonal.
struct CellBends {
  static constexpr std::size_t strains = 6;
  static constexpr std::array<std::size_t, strains> hinge{0, 1, 2, 3, 4, 2};

  std::array<int, CellStencil::vertices> vertices;
  std::array<double, CellStencil::hinges> factors;  ///< curvature by angle, 1/m; 0 on the rim
  std::array<int, strains> components;              ///< among those of all elements
};

/// Empty unless all elements are those of such a grid, none of whose components has two angles.
std::vector<CellBends> cell_bends(const std::vector<BendingElement>& elements);

/// The corners of the two triangles of a cell, split by the diagonal 0-2 or by the other.
constexpr std::array<std::array<std::size_t, 3>, 2> cell_corners(bool splits_02) {
  if (splits_02) return {{{0, 1, 2}, {0, 2, 3}}};
  return {{{0, 1, 3}, {1, 2, 3}}};
}

/// One of the two triangles of each cell.
struct CellTriangle : TriangleLanes {
  LaneIndices components;  ///< the first of three
};

struct CellGroup {
  int count;       ///< cells that are not filling
  bool splits_02;  ///< as in cell_corners()
  std::array<LaneIndices, CellStencil::vertices> vertices;
  /// Where the blocks of the pairs start in the values of the Hessian, ~ if transposed, and the
  /// lengths of the first of their columns. Of a vertex in two places, on the rim, the block is
  /// zero: any place will do.
  std::array<LaneIndices, CellStencil::pairs.size()> slots, lengths;
  std::array<CellTriangle, 2> triangles;
  std::array<Lanes, CellStencil::hinges> factors;
  std::array<Lanes, CellBends::strains> areas;
  std::array<LaneIndices, CellBends::strains> components;
};

/// What the cells are made of, as that is known for the mesh: shares of the triangles' vertices in
/// their areas, by triangle and vertex; the number of the first component that bends.
struct CellParts {
  const TriangleMesh& mesh;
  const std::vector<BendingElement>& bending;
  const std::vector<std::array<double, 3>>& shares;
  const Hem& hem;
  int first_curvature;
};
/// Groups are of cells that are split alike. `pattern` has the hinges of all cells.
std::vector<CellGroup> cell_groups(const std::vector<CellBends>& cells, const CellParts& parts,
                                   const BlockPattern& pattern);

}  // namespace weft::detail
