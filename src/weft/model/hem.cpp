#include "weft/model/hem.h"

#include <cmath>

#include "weft/base/error.h"

namespace weft::detail {

Hem::Hem(const TriangleMesh& mesh, double width) : vertex_areas_(VecX::Zero(mesh.vertex_count())) {
  if (!(width > 0)) return;
  const char* const refusal = "a hem needs a grid whose sides lie along weft and warp";
  if (grid_cells(mesh).empty()) throw Error(refusal);
  for (const auto& [edge, apexes] : edge_apexes(mesh)) {
    if (apexes.size() != 1) continue;
    const Vec2 along = (mesh.material.col(edge.second) - mesh.material.col(edge.first)).cwiseAbs();
    if (along.minCoeff() > grid_rounding * along.maxCoeff()) throw Error(refusal);
    areas_[edge] = along.x() > along.y() ? Vec2(width * along.x(), 0) : Vec2(0, width * along.y());
    for (const int vertex : {edge.first, edge.second})
      vertex_areas_[vertex] += 0.5 * width * along.maxCoeff();
  }
}

Vec2 Hem::area(int a, int b) const {
  const auto found = areas_.find(mesh_edge(a, b));
  return found == areas_.end() ? Vec2::Zero() : found->second;
}

}  // namespace weft::detail
