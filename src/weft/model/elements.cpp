#include "weft/model/elements.h"

#include <algorithm>

namespace weft::detail {
namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

/// For each vertex, itself and its larger neighbours in the elements, ascending.
std::vector<std::vector<int>> lower_neighbours(const TriangleMesh& mesh,
                                               const std::vector<BendingElement>& bending) {
  std::vector<std::vector<int>> rows(at(mesh.vertex_count()));
  for (int v = 0; v < mesh.vertex_count(); ++v) rows[at(v)].push_back(v);
  for (const BendingElement& element : bending)  // contains the triangle
    for (const int a : element.vertices)
      for (const int b : element.vertices)
        if (b > a) rows[at(a)].push_back(b);
  for (auto& row : rows) {
    std::sort(row.begin(), row.end());
    row.erase(std::unique(row.begin(), row.end()), row.end());
  }
  return rows;
}

void make_pattern(const std::vector<std::vector<int>>& rows, Elements& elements) {
  const int n = static_cast<int>(rows.size());
  std::vector<Eigen::Triplet<double, int>> entries;
  for (int v = 0; v < n; ++v)
    for (const int row : rows[at(v)])
      for (int c = 0; c < 3; ++c)
        for (int r = row == v ? c : 0; r < 3; ++r)
          entries.emplace_back(3 * row + r, 3 * v + c, 0.0);
  elements.pattern.resize(3 * n, 3 * n);
  elements.pattern.setFromTriplets(entries.begin(), entries.end());
  elements.pattern.makeCompressed();
  for (int v = 0; v < n; ++v) {
    const int start = elements.pattern.outerIndexPtr()[3 * v];
    const int length = elements.pattern.outerIndexPtr()[3 * v + 1] - start;
    elements.columns.push_back({start, length});
    elements.diagonal_slots.insert(elements.diagonal_slots.end(),
                                   {start, start + length, start + 2 * length - 1});
  }
}

/// Where block (row, column) starts; row >= column.
int block_slot(const std::vector<std::vector<int>>& rows, const Elements& elements, int row,
               int column) {
  const auto& list = rows[at(column)];
  const auto found = std::lower_bound(list.begin(), list.end(), row);
  return elements.columns[at(column)].start + 3 * static_cast<int>(found - list.begin());
}

/// Slot of block (row, column), complemented where it lies above the diagonal.
int signed_slot(const std::vector<std::vector<int>>& rows, const Elements& elements, int row,
                int column) {
  // Equal only where a place is not used (triangle_curvature.h): zeros are added to the diagonal.
  return row >= column ? block_slot(rows, elements, row, column)
                       : ~block_slot(rows, elements, column, row);
}

/// Vertices and slots of one element into lane `lane` of `group`.
template <class Group, class Vertices>
void place_vertices(const Vertices& vertices, const std::vector<std::vector<int>>& rows,
                    const Elements& elements, int lane, Group& group) {
  for (std::size_t i = 0; i < group.vertices.size(); ++i) group.vertices[i][at(lane)] = vertices[i];
  for (std::size_t k = 0; k < group.slots.size(); ++k)
    group.slots[k][at(lane)] =
        signed_slot(rows, elements, vertices[kPairs[k][0]], vertices[kPairs[k][1]]);
}

void place(const TriangleMesh& mesh, std::array<int, 3> v,
           const std::vector<std::vector<int>>& rows, const Elements& elements, int lane,
           TriangleGroup& group) {
  std::sort(v.begin(), v.end());
  place_vertices(v, rows, elements, lane, group);
  const auto shape =
      triangle_shape(mesh.material.col(v[0]), mesh.material.col(v[1]), mesh.material.col(v[2]));
  group.shape.du1[lane] = shape.du1;
  group.shape.du2[lane] = shape.du2;
  group.shape.dv1[lane] = shape.dv1;
  group.shape.dv2[lane] = shape.dv2;
  group.shape.area[lane] = lane < group.count ? shape.area : 0;
}

void place(const BendingElement& element, const std::vector<std::vector<int>>& rows,
           const Elements& elements, int lane, BendingGroup& group) {
  place_vertices(element.vertices, rows, elements, lane, group);
  for (std::size_t k = 0; k < 3; ++k)
    for (std::size_t j = 0; j < 3; ++j) group.map.r[k][j][lane] = element.map.r[k][j];
  group.area[lane] = lane < group.count ? element.area : 0;
}

}  // namespace

Elements make_elements(const TriangleMesh& mesh) {
  Elements elements;
  const std::vector<BendingElement> bending = bending_elements(mesh);
  const auto rows = lower_neighbours(mesh, bending);
  make_pattern(rows, elements);
  const int triangle_count = mesh.triangle_count();
  for (int first = 0; first < triangle_count; first += kLanes) {
    TriangleGroup triangles{};
    BendingGroup bends{};
    triangles.count = bends.count = std::min(kLanes, triangle_count - first);
    for (int lane = 0; lane < kLanes; ++lane) {
      const int t = std::min(first + lane, triangle_count - 1);
      place(mesh, mesh.triangles[at(t)], rows, elements, lane, triangles);
      place(bending[at(t)], rows, elements, lane, bends);
    }
    elements.triangles.push_back(triangles);
    elements.bending.push_back(bends);
  }
  return elements;
}

}  // namespace weft::detail
