#include "weft/model/elements.h"

#include <algorithm>

namespace weft::detail {
namespace {

BlockPattern make_pattern(const TriangleMesh& mesh, const std::vector<CellBends>& cells,
                          const std::vector<BendingElement>& bending,
                          const std::vector<HingeElement>& hinges,
                          const std::vector<DiagonalElement>& diagonals) {
  BlockPattern pattern(mesh.vertex_count());
  // Each triangle is contained in one of these.
  for (const CellBends& cell : cells)
    for (const auto& [row, column] : CellStencil::pairs)
      pattern.add_element(std::array{cell.vertices[row], cell.vertices[column]});
  if (cells.empty())
    for (const BendingElement& element : bending) pattern.add_element(element.vertices);
  for (const HingeElement& element : hinges) pattern.add_element(element.vertices);
  for (const DiagonalElement& element : diagonals) pattern.add_element(element.vertices);
  pattern.finish();
  return pattern;
}

/// Vertices and slots of one element into lane `lane` of `group`.
template <class Group, class Vertices>
void place_vertices(const Vertices& vertices, const BlockPattern& pattern, int lane, Group& group) {
  for (std::size_t i = 0; i < group.vertices.size(); ++i) group.vertices[i][at(lane)] = vertices[i];
  for (std::size_t k = 0; k < group.slots.size(); ++k)
    group.slots[k][at(lane)] = pattern.slot(vertices[kPairs[k][0]], vertices[kPairs[k][1]]);
}

void place(const TriangleMesh& mesh, int triangle, const std::array<double, 3>& shares,
           const Hem& hem, const BlockPattern& pattern, int lane, TriangleGroup& group) {
  std::array<int, 3> v = mesh.triangles[at(triangle)];
  std::sort(v.begin(), v.end());
  place_vertices(v, pattern, lane, group);
  place_triangle(mesh, triangle, v, shares, hem,
                 lane < group.count ? Filling::none : Filling::weightless, lane, group);
}

template <class Element, class Stencil>
void place(const Element& element, const std::array<double, 3>& areas, const BlockPattern& pattern,
           int lane, StencilGroup<Stencil>& group) {
  place_vertices(element.vertices, pattern, lane, group);
  for (std::size_t k = 0; k < 3; ++k)
    for (std::size_t j = 0; j < Stencil::hinges; ++j) group.map.r[k][j][lane] = element.map.r[k][j];
  for (std::size_t k = 0; k < 3; ++k) group.areas[k][lane] = lane < group.count ? areas[k] : 0;
}

void place(const DiagonalElement& element, const BlockPattern& pattern, int lane,
           DiagonalGroup& group) {
  place_vertices(element.vertices, pattern, lane, group);
  for (std::size_t i = 0; i < 4; ++i) {
    group.rising[i][lane] = element.rising[i];
    group.falling[i][lane] = element.falling[i];
  }
  group.area[lane] = lane < group.count ? element.area : 0;
}

/// `count` elements in groups of kLanes; the last group is filled up with the last element.
template <class Group, class Place>
std::vector<Group> groups(int count, const Place& place_one) {
  std::vector<Group> out;
  for (int first = 0; first < count; first += kLanes) {
    Group& group = out.emplace_back();
    group.count = std::min(kLanes, count - first);
    for (int lane = 0; lane < kLanes; ++lane)
      place_one(std::min(first + lane, count - 1), lane, group);
  }
  return out;
}

}  // namespace

std::array<double, 3> areas_by_component(const TriangleMesh& mesh, const BendingElement& element,
                                         const Hem& hem) {
  const int corner = element.vertices[0], right = element.vertices[1], up = element.vertices[2];
  const Vec2 second = hem.area(corner, right) + hem.area(corner, up);
  if (second.isZero(0)) return {element.area, element.area, element.area};
  const auto length = [&](int to) {
    return (mesh.material.col(to) - mesh.material.col(corner)).norm();
  };
  const double share = 2 * element.area / (length(right) * length(up));
  return {element.area + share * second.x(), element.area + share * second.y(), element.area};
}

std::vector<BendingGroup> bending_groups(const std::vector<BendingElement>& elements,
                                         const BlockPattern& pattern) {
  return groups<BendingGroup>(
      static_cast<int>(elements.size()), [&](int t, int lane, BendingGroup& group) {
        const BendingElement& element = elements[at(t)];
        place(element, {element.area, element.area, element.area}, pattern, lane, group);
      });
}

Elements make_elements(const TriangleMesh& mesh, ElementKinds kinds, const Hem& hem) {
  Elements elements;
  std::vector<BendingElement> bending;
  std::vector<HingeElement> hinges;
  std::vector<DiagonalElement> diagonals;
  if (kinds.bends == Bends::of_plate) bending = bending_elements(mesh);
  if (kinds.bends == Bends::of_hinges) hinges = hinge_elements(mesh);
  if (kinds.diagonals == Diagonals::all) diagonals = diagonal_elements(mesh);
  const std::vector<CellBends> cells = cell_bends(bending);
  const BlockPattern pattern = make_pattern(mesh, cells, bending, hinges, diagonals);
  elements.pattern = pattern.matrix();
  elements.columns = pattern.columns();
  elements.diagonal_slots = pattern.diagonal_slots();
  elements.bending_count = static_cast<int>(bending.size() + hinges.size());
  const auto shares = area_shares(mesh);
  elements.triangles =
      groups<TriangleGroup>(mesh.triangle_count(), [&](int t, int lane, TriangleGroup& group) {
        place(mesh, t, shares[at(t)], hem, pattern, lane, group);
      });
  elements.diagonal_count = static_cast<int>(diagonals.size());
  elements.diagonals =
      groups<DiagonalGroup>(elements.diagonal_count, [&](int t, int lane, DiagonalGroup& group) {
        place(diagonals[at(t)], pattern, lane, group);
      });
  elements.bending = groups<BendingGroup>(
      static_cast<int>(bending.size()), [&](int t, int lane, BendingGroup& group) {
        const BendingElement& element = bending[at(t)];
        place(element, areas_by_component(mesh, element, hem), pattern, lane, group);
      });
  elements.hinges =
      groups<HingeGroup>(static_cast<int>(hinges.size()), [&](int t, int lane, HingeGroup& group) {
        place(hinges[at(t)], hinges[at(t)].areas, pattern, lane, group);
      });
  const int first_curvature = 3 * (mesh.triangle_count() + elements.diagonal_count);
  elements.cells = cell_groups(cells, {mesh, bending, shares, hem, first_curvature}, pattern);
  return elements;
}

}  // namespace weft::detail
