#pragma once
/// The elements of a ClothModel in groups of kLanes, and the pattern of the Hessian with the place
/// of each element's blocks in it.
#include <array>
#include <vector>

#include "weft/mesh/triangle_mesh.h"
#include "weft/strain/dihedral_angle.h"
#include "weft/strain/triangle_shape.h"

namespace weft::detail {

/// Where the 3 x 3 blocks of a vertex' columns start in the values of the lower triangle. Column
/// 3 v has `length` entries, columns 3 v + 1 and 3 v + 2 one and two fewer (the triangle's corner).
struct ColumnLayout {
  int start;
  int length;
};

/// kLanes triangles. Vertices of each are in ascending order, so that all their blocks lie below
/// the diagonal. Groups are filled up with copies of the last element that have no weight.
struct TriangleGroup {
  int count;  ///< elements that are not filling
  std::array<std::array<int, kLanes>, 3> vertices;
  std::array<std::array<int, kLanes>, 3> slots;  ///< blocks (1,0), (2,0), (2,1)
  TriangleShape<Lanes> shape;
};

/// kLanes hinges. `slots` of the blocks (1,0), (2,0), (2,1), (3,0), (3,1), (3,2); where the row's
/// vertex comes before the column's, the block is written transposed and its slot is ~slot.
struct HingeGroup {
  int count;
  std::array<std::array<int, kLanes>, 4> vertices;
  std::array<std::array<int, kLanes>, 6> slots;
  Lanes weight;
};

/// Pairs (row, column) of the off-diagonal blocks of an element, in the order of `slots`.
inline constexpr std::array<std::array<int, 2>, 6> kPairs = {
    {{1, 0}, {2, 0}, {2, 1}, {3, 0}, {3, 1}, {3, 2}}};

struct Elements {
  std::vector<TriangleGroup> triangles;
  std::vector<HingeGroup> hinges;
  SparseMatrix pattern;
  std::vector<ColumnLayout> columns;  ///< one a vertex
  std::vector<int> diagonal_slots;
};

Elements make_elements(const TriangleMesh& mesh, const std::vector<Hinge>& hinges,
                       const VecX& hinge_weights);

}  // namespace weft::detail
