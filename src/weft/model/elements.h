#pragma once
/// The elements of a model in groups of kLanes, and the pattern of the Hessian with the place
/// of each element's blocks in it.
#include <array>
#include <vector>

#include "weft/model/bending.h"
#include "weft/model/block_pattern.h"
#include "weft/model/cells.h"
#include "weft/model/diagonals.h"
#include "weft/model/hem.h"
#include "weft/model/hinges.h"
#include "weft/model/triangle_lanes.h"

namespace weft::detail {

/// kLanes triangles. Vertices of each are in ascending order, so that all their blocks lie below
/// the diagonal. Groups are filled up with copies of the last element that have no weight.
struct TriangleGroup : TriangleLanes {
  int count;  ///< elements that are not filling
  std::array<std::array<int, kLanes>, 3> vertices;
  std::array<std::array<int, kLanes>, 3> slots;  ///< blocks (1,0), (2,0), (2,1)
};

/// kLanes bending elements. `slots` of the blocks (1,0), (2,0), (2,1), (3,0) ...
/// (5,4), see kPairs; where the row's vertex comes before the column's, the block is written
/// transposed and its slot is ~slot.
template <class Stencil>
struct StencilGroup {
  int count;
  std::array<std::array<int, kLanes>, 6> vertices;
  std::array<std::array<int, kLanes>, 15> slots;
  CurvatureMap<Lanes, Stencil> map;
  std::array<Lanes, 3> areas;  ///< by component
};
using BendingGroup = StencilGroup<TriangleStencil>;  ///< areas differ at a hem
using HingeGroup = StencilGroup<EdgeStencil>;

/// kLanes diagonal elements, with slots as in BendingGroup.
struct DiagonalGroup {
  int count;
  std::array<std::array<int, kLanes>, 4> vertices;
  std::array<std::array<int, kLanes>, 6> slots;
  std::array<Lanes, 4> rising, falling;
  Lanes area;
};

struct Elements {
  std::vector<TriangleGroup> triangles;
  std::vector<DiagonalGroup> diagonals;
  int diagonal_count;                 ///< elements that are not filling
  std::vector<BendingGroup> bending;  ///< or else
  std::vector<HingeGroup> hinges;
  int bending_count;  ///< elements of these that are not filling
  /// The triangles and bending elements of a grid once more, by cells; if there are any, the
  /// pattern has no blocks but theirs, and the slots of `bending` are not to be used.
  std::vector<CellGroup> cells;
  SparseMatrix pattern;
  std::vector<ColumnLayout> columns;  ///< one a vertex
  std::vector<int> diagonal_slots;
};

enum class Diagonals { none, all };
enum class Bends { of_plate, of_hinges };
struct ElementKinds {
  Diagonals diagonals;
  Bends bends;
};
/// Of a sheet without hem, in a pattern that has them.
std::vector<BendingGroup> bending_groups(const std::vector<BendingElement>& elements,
                                         const BlockPattern& pattern);

/// By component, with the hem's on the sides at the element's corner: the line of the rim turns at
/// its vertices, each with half of its two edges.
std::array<double, 3> areas_by_component(const TriangleMesh& mesh, const BendingElement& element,
                                         const Hem& hem);

/// Throws Error for hinges on a mesh that is no grid.
Elements make_elements(const TriangleMesh& mesh, ElementKinds kinds, const Hem& hem);

}  // namespace weft::detail
