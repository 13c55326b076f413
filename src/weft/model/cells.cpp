#include "weft/model/cells.h"

#include <algorithm>
#include <map>
#include <optional>

#include "weft/model/elements.h"

namespace weft::detail {
namespace {

/// The component of each angle of an element, where none has two angles and the diagonal's is the
/// third; an angle on the rim has any that is left.
std::optional<std::array<int, 3>> components_of_angles(const CurvatureMap<double>& map) {
  const auto has = [&](int k, int j) { return map.r[at(k)][at(j)] != 0; };
  const bool crossed = has(0, 2) || has(1, 0);
  const std::array<int, 3> of = crossed ? std::array{1, 2, 0} : std::array{0, 2, 1};
  for (int k = 0; k < 3; ++k)
    for (int j = 0; j < 3; ++j)
      if (has(k, j) && of[at(j)] != k) return std::nullopt;
  return of;
}

/// The cell of two elements at opposite corners, which are those `first` and `first` + 1.
std::optional<CellBends> cell_of(const BendingElement& a, const BendingElement& b, int first) {
  const auto& v = a.vertices;
  const auto& w = b.vertices;
  if (w[0] != v[4] || w[1] != v[2] || w[2] != v[1] || w[4] != v[0]) return std::nullopt;
  const auto of_a = components_of_angles(a.map), of_b = components_of_angles(b.map);
  if (!of_a || !of_b || a.map.r[2][1] != b.map.r[2][1]) return std::nullopt;
  CellBends cell;
  cell.vertices = {v[0], v[1], v[4], v[2], v[3], v[5], w[3], w[5]};
  const auto factor = [](const BendingElement& e, const std::array<int, 3>& of, std::size_t j) {
    return e.map.r[at(of[j])][j];
  };
  cell.factors = {factor(a, *of_a, 0), factor(a, *of_a, 2), a.map.r[2][1], factor(b, *of_b, 0),
                  factor(b, *of_b, 2)};
  const int c = 3 * first;
  cell.components = {c + (*of_a)[0],     c + (*of_a)[2],     c + 2,
                     c + 3 + (*of_b)[0], c + 3 + (*of_b)[2], c + 5};
  return cell;
}

std::array<int, 3> sorted(std::array<int, 3> triangle) {
  std::sort(triangle.begin(), triangle.end());
  return triangle;
}

/// Numbers of triangles by their vertices in ascending order.
using TriangleNumbers = std::map<std::array<int, 3>, int>;

/// The vertices of a cell's two triangles.
std::array<std::array<int, 3>, 2> halves(const CellBends& cell, bool splits_02) {
  const auto corners = cell_corners(splits_02);
  std::array<std::array<int, 3>, 2> out;
  for (std::size_t t = 0; t < 2; ++t)
    for (std::size_t i = 0; i < 3; ++i) out[t][i] = cell.vertices[corners[t][i]];
  return out;
}

class CellPlacer {
 public:
  CellPlacer(const CellParts& parts, const BlockPattern& pattern)
      : parts_(parts), pattern_(pattern) {
    for (int t = 0; t < parts.mesh.triangle_count(); ++t)
      numbers_[sorted(parts.mesh.triangles[at(t)])] = t;
  }

  bool splits_02(const CellBends& cell) const {
    return numbers_.contains(sorted(halves(cell, true)[0]));
  }
  void place(const CellBends& cell, int lane, CellGroup& group) const {
    const auto l = at(lane);
    const bool filling = lane >= group.count;
    for (std::size_t i = 0; i < cell.vertices.size(); ++i) group.vertices[i][l] = cell.vertices[i];
    place_slots(cell, l, group);
    for (std::size_t j = 0; j < cell.factors.size(); ++j) group.factors[j][lane] = cell.factors[j];
    for (std::size_t s = 0; s < CellBends::strains; ++s) {
      const auto& element = parts_.bending[at(cell.components[s] / 3)];
      const auto areas = areas_by_component(parts_.mesh, element, parts_.hem);
      group.areas[s][lane] = filling ? 0 : areas[at(cell.components[s] % 3)];
      group.components[s][l] = parts_.first_curvature + cell.components[s];
    }
    const auto triangles = halves(cell, group.splits_02);
    for (std::size_t t = 0; t < 2; ++t) place(triangles[t], filling, lane, group.triangles[t]);
  }

 private:
  void place_slots(const CellBends& cell, std::size_t lane, CellGroup& group) const {
    for (std::size_t k = 0; k < CellStencil::pairs.size(); ++k) {
      int row = cell.vertices[CellStencil::pairs[k][0]];
      int column = cell.vertices[CellStencil::pairs[k][1]];
      if (row == column) {
        row = cell.vertices[1];
        column = cell.vertices[0];
      }
      group.slots[k][lane] = pattern_.slot(row, column);
      group.lengths[k][lane] = pattern_.columns()[at(std::min(row, column))].length;
    }
  }
  void place(const std::array<int, 3>& v, bool filling, int lane, CellTriangle& to) const {
    const int t = numbers_.at(sorted(v));
    place_triangle(parts_.mesh, t, v, parts_.shares[at(t)], parts_.hem,
                   filling ? Filling::weightless : Filling::none, lane, to);
    to.components[at(lane)] = 3 * t;
  }

  const CellParts& parts_;
  const BlockPattern& pattern_;
  TriangleNumbers numbers_;
};

}  // namespace

std::vector<CellBends> cell_bends(const std::vector<BendingElement>& elements) {
  std::vector<CellBends> cells;
  for (std::size_t i = 0; i + 1 < elements.size(); i += 2) {
    const auto cell = cell_of(elements[i], elements[i + 1], static_cast<int>(i));
    if (!cell) return {};
    cells.push_back(*cell);
  }
  return 2 * cells.size() == elements.size() ? cells : std::vector<CellBends>();
}

std::vector<CellGroup> cell_groups(const std::vector<CellBends>& cells, const CellParts& parts,
                                   const BlockPattern& pattern) {
  const CellPlacer placer(parts, pattern);
  std::vector<CellGroup> groups;
  for (const bool splits_02 : {true, false}) {
    std::vector<const CellBends*> alike;
    for (const CellBends& cell : cells)
      if (placer.splits_02(cell) == splits_02) alike.push_back(&cell);
    for (std::size_t first = 0; first < alike.size(); first += kLanes) {
      CellGroup& group = groups.emplace_back();
      group.count = static_cast<int>(std::min<std::size_t>(kLanes, alike.size() - first));
      group.splits_02 = splits_02;
      for (int lane = 0; lane < kLanes; ++lane)
        placer.place(*alike[first + at(std::min(lane, group.count - 1))], lane, group);
    }
  }
  // Neighbours follow each other, as their blocks do in memory.
  std::ranges::stable_sort(groups, {}, [](const CellGroup& g) { return g.vertices[0][0]; });
  return groups;
}

}  // namespace weft::detail
