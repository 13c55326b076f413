#include "weft/model/hinges.h"

#include <algorithm>
#include <map>
#include <numbers>
#include <set>

#include "weft/base/error.h"
#include "weft/mesh/grid_cells.h"

namespace weft {
namespace {

/// The cell, turned so that it begins at `a`.
GridCell turned(GridCell cell, int a) {
  std::rotate(cell.begin(), std::ranges::find(cell, a), cell.end());
  return cell;
}

double distance(const TriangleMesh& mesh, int a, int b) {
  return (mesh.material.col(a) - mesh.material.col(b)).norm();
}

/// `left` begins with the edge.
HingeElement twist_of(const TriangleMesh& mesh, const GridCell& left) {
  HingeElement element{{left[0], left[1], left[3], left[0], left[2], left[1]}, {}, {}};
  const double diagonal = distance(mesh, left[0], left[2]);
  element.map.r[1][2] = element.map.r[2][3] = std::numbers::sqrt2 / diagonal;
  const double cell = distance(mesh, left[0], left[1]) * distance(mesh, left[1], left[2]);
  element.areas = {0, 0.5 * cell, 0.5 * cell};
  return element;
}

/// `right` begins with the other end of the edge.
void add_bend(const TriangleMesh& mesh, const GridCell& left, const GridCell& right,
              HingeElement& element) {
  element.vertices[3] = right[2];
  element.vertices[5] = right[3];
  const double across =
      0.5 * (distance(mesh, left[1], left[2]) + distance(mesh, right[1], right[2]));
  element.map.r[0][0] = element.map.r[0][1] = 0.5 / across;
  element.areas[0] = across * distance(mesh, left[0], left[1]);
}

}  // namespace

std::vector<HingeElement> hinge_elements(const TriangleMesh& mesh) {
  const std::vector<GridCell> cells = grid_cells(mesh);
  if (cells.empty())
    throw Error("bending by hinges needs a grid: a mesh of rectangles, each of two triangles");
  std::map<MeshEdge, std::vector<const GridCell*>> sides;
  for (const GridCell& cell : cells)
    for (std::size_t k = 0; k < 4; ++k)
      sides[mesh_edge(cell[k], cell[(k + 1) % 4])].push_back(&cell);
  std::set<const GridCell*> twisted;
  std::vector<HingeElement> elements;
  for (const auto& [edge, beside] : sides) {
    if (beside.size() < 2) continue;
    // On the left the cell whose twist no edge has yet.
    const bool swap = twisted.contains(beside[0]);
    const GridCell &left = *beside[swap ? 1 : 0], &right = *beside[swap ? 0 : 1];
    const auto at = static_cast<std::size_t>(std::ranges::find(left, edge.first) - left.begin());
    const bool forward = left[(at + 1) % 4] == edge.second;
    const int from = forward ? edge.first : edge.second, to = forward ? edge.second : edge.first;
    const GridCell left_turned = turned(left, from);
    HingeElement element = twist_of(mesh, left_turned);
    if (!twisted.insert(&left).second) element.areas = {};
    add_bend(mesh, left_turned, turned(right, to), element);
    elements.push_back(element);
  }
  for (const GridCell& cell : cells)
    if (!twisted.contains(&cell)) elements.push_back(twist_of(mesh, cell));
  return elements;
}

}  // namespace weft
