#include "weft/mesh/grid_cells.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace weft {
namespace {

/// The corner of triangle `t` with a right angle.
std::optional<std::size_t> right_angle(const TriangleMesh& mesh, const std::array<int, 3>& t) {
  for (std::size_t j = 0; j < 3; ++j) {
    const Vec2 to_next = mesh.material.col(t[(j + 1) % 3]) - mesh.material.col(t[j]);
    const Vec2 to_last = mesh.material.col(t[(j + 2) % 3]) - mesh.material.col(t[j]);
    if (std::abs(to_next.dot(to_last)) <= grid_rounding * to_next.norm() * to_last.norm()) return j;
  }
  return std::nullopt;
}

}  // namespace

MeshEdge mesh_edge(int a, int b) { return {std::min(a, b), std::max(a, b)}; }

std::map<MeshEdge, std::vector<int>> edge_apexes(const TriangleMesh& mesh) {
  std::map<MeshEdge, std::vector<int>> out;
  for (const auto& t : mesh.triangles)
    for (std::size_t j = 0; j < 3; ++j)
      out[mesh_edge(t[j], t[(j + 1) % 3])].push_back(t[(j + 2) % 3]);
  return out;
}

std::vector<GridCell> grid_cells(const TriangleMesh& mesh) {
  const auto apexes = edge_apexes(mesh);
  std::vector<GridCell> cells;
  std::size_t paired = 0;
  for (const auto& t : mesh.triangles) {
    const auto right = right_angle(mesh, t);
    if (!right) return {};
    const int corner = t[*right], next = t[(*right + 1) % 3], last = t[(*right + 2) % 3];
    const auto& opposite = apexes.at(mesh_edge(next, last));
    if (opposite.size() != 2) return {};
    const int across = opposite[0] == corner ? opposite[1] : opposite[0];
    const Vec2 wanted =
        mesh.material.col(next) + mesh.material.col(last) - mesh.material.col(corner);
    const double diagonal = (mesh.material.col(last) - mesh.material.col(next)).norm();
    if ((mesh.material.col(across) - wanted).norm() > grid_rounding * diagonal) return {};
    ++paired;
    if (corner < across) cells.push_back({corner, next, across, last});
  }
  return paired == 2 * cells.size() ? cells : std::vector<GridCell>{};
}

std::vector<std::array<double, 3>> area_shares(const TriangleMesh& mesh) {
  const double third = 1.0 / 3;
  std::vector<std::array<double, 3>> shares(mesh.triangles.size(), {third, third, third});
  if (grid_cells(mesh).empty()) return shares;
  for (std::size_t t = 0; t < shares.size(); ++t) {
    shares[t] = {0.25, 0.25, 0.25};
    shares[t][right_angle(mesh, mesh.triangles[t]).value()] = 0.5;
  }
  return shares;
}

}  // namespace weft
