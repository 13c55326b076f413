#include "weft/model/bending.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <utility>

#include "weft/mesh/grid_cells.h"

namespace weft {
namespace {

constexpr double kLeastTwistFactor = 0.25;

/// (n_u^2, n_v^2, sqrt(2) n_u n_v): n n^T as a vector with the same norm.
Vec3 squared(const Vec2& n) {
  return {n.x() * n.x(), n.y() * n.y(), std::numbers::sqrt2 * n.x() * n.y()};
}

/// Removes from the columns of `map` what the angles on the rim, `directions`, can undo.
void project_out(std::vector<Vec3> directions, Mat3& map) {
  for (std::size_t i = 0; i < directions.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k)
      directions[i] -= directions[k].dot(directions[i]) * directions[k];
    directions[i].normalize();
    map -= directions[i] * (directions[i].transpose() * map);
  }
}

/// Gives `element` the map from angles to curvature components, with what `rim` asks of the angles
/// on the rim, which the element lists already.
void set_map(BendingElement& element, Mat3 map, RimAngles rim) {
  if (rim == RimAngles::projected) project_out(element.rim, map);
  for (std::size_t k = 0; k < 3; ++k)
    for (std::size_t j = 0; j < 3; ++j)
      element.map.r[k][j] = map(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(j));
}

BendingElement make_element(const TriangleMesh& mesh, int triangle, RimAngles rim,
                            const std::map<MeshEdge, std::vector<int>>& all_apexes) {
  const auto& t = mesh.triangles[at(triangle)];
  BendingElement element;
  element.area = material_area(mesh, triangle);
  Mat3 map = Mat3::Zero();
  for (std::size_t j = 0; j < 3; ++j) {
    const int a = t[j], b = t[(j + 1) % 3], apex = t[(j + 2) % 3];
    element.vertices[j] = a;
    const Vec2 along = mesh.material.col(b) - mesh.material.col(a);
    const double length = along.norm();
    const Vec3 direction = squared(Vec2(-along.y(), along.x()) / length);
    const auto& opposite = all_apexes.at(mesh_edge(a, b));
    if (opposite.size() == 2) {
      element.vertices[3 + j] = opposite[0] == apex ? opposite[1] : opposite[0];
      map.col(static_cast<Eigen::Index>(j)) = length / (2 * element.area) * direction;
    } else {
      element.vertices[3 + j] = a;
      element.rim.push_back(direction);
    }
  }
  set_map(element, map, rim);
  return element;
}

/// The cells at each of their sides.
using Sides = std::map<MeshEdge, std::vector<const GridCell*>>;

/// The vertex beyond the side from `corner` to `side`, seen from `cell`: in the cell
/// across, the neighbour of `corner` that is not `side`; none at the rim.
std::optional<int> straight_on(const Sides& sides, const GridCell* cell, int corner, int side) {
  for (const GridCell* other : sides.at(mesh_edge(corner, side))) {
    if (other == cell) continue;
    const auto k = static_cast<std::size_t>(std::ranges::find(*other, corner) - other->begin());
    const int next = (*other)[(k + 1) % 4], last = (*other)[(k + 3) % 4];
    return next == side ? last : next;
  }
  return std::nullopt;
}

BendingElement corner_element(const TriangleMesh& mesh, const Sides& sides, const GridCell& cell,
                              std::size_t k, double share, RimAngles rim) {
  const int corner = cell[k], right = cell[(k + 1) % 4], up = cell[(k + 3) % 4];
  const Vec2 to_right = mesh.material.col(right) - mesh.material.col(corner);
  const Vec2 to_up = mesh.material.col(up) - mesh.material.col(corner);
  const Vec2 n1 = to_right.normalized(), n2 = to_up.normalized();
  BendingElement element;
  element.area = share * to_right.norm() * to_up.norm();
  element.vertices = {corner, right, up, corner, cell[(k + 2) % 4], up};
  Mat3 map = Mat3::Zero();
  const auto add_bend = [&](int side, const Vec2& ahead, const Vec2& n, std::size_t j) {
    if (const auto behind = straight_on(sides, &cell, corner, side)) {
      element.vertices[3 + j] = *behind;
      const double back = (mesh.material.col(*behind) - mesh.material.col(corner)).norm();
      map.col(static_cast<Eigen::Index>(j)) = 2 / (ahead.norm() + back) * squared(n);
    } else {
      element.rim.push_back(squared(n));
    }
  };
  add_bend(right, to_up, n2, 0);
  add_bend(up, to_right, n1, 2);
  map.col(1) = Vec3(2 * n1.x() * n2.x(), 2 * n1.y() * n2.y(),
                    std::numbers::sqrt2 * (n1.x() * n2.y() + n1.y() * n2.x())) /
               (to_right - to_up).norm();
  set_map(element, map, rim);
  return element;
}

/// Turns each cell so that it begins at the same corner as the first. Are all equal then?
bool align(const TriangleMesh& mesh, std::vector<GridCell>& cells) {
  const auto side = [&](const GridCell& cell, std::size_t i) -> Vec2 {
    return mesh.material.col(cell[i + 1]) - mesh.material.col(cell[i]);
  };
  const Vec2 first = side(cells[0], 0), second = side(cells[0], 1);
  const double rounding = grid_rounding * (first.norm() + second.norm());
  const auto differs = [&](const GridCell& cell) {
    return (side(cell, 0) - first).norm() > rounding || (side(cell, 1) - second).norm() > rounding;
  };
  for (GridCell& cell : cells) {
    for (int turn = 0; turn < 3 && differs(cell); ++turn)
      std::rotate(cell.begin(), cell.begin() + 1, cell.end());
    if (differs(cell)) return false;
  }
  return true;
}

std::vector<BendingElement> corner_elements(const TriangleMesh& mesh, std::vector<GridCell> cells,
                                            RimAngles rim) {
  // Two opposite corners are enough where all cells are equal: every vertex off the rim has two.
  const std::size_t step = align(mesh, cells) ? 2 : 1;
  Sides sides;
  for (const GridCell& cell : cells)
    for (std::size_t k = 0; k < 4; ++k)
      sides[mesh_edge(cell[k], cell[(k + 1) % 4])].push_back(&cell);
  std::vector<BendingElement> elements;
  elements.reserve(4 / step * cells.size());
  for (const GridCell& cell : cells)
    for (std::size_t k = 0; k < 4; k += step)
      elements.push_back(
          corner_element(mesh, sides, cell, k, 0.25 * static_cast<double>(step), rim));
  return elements;
}

/// Curvature components that the element sees when its vertices lie on z = u v / sqrt(2), |K| = 1,
/// to first order.
Vec3 seen_twist(const TriangleMesh& mesh, const BendingElement& element) {
  const auto height = [&](const Vec2& p) { return p.x() * p.y() / std::numbers::sqrt2; };
  Vec3 seen = Vec3::Zero();
  const Vec2 origin = mesh.material.col(element.vertices[0]);
  for (std::size_t j = 0; j < 3; ++j) {
    const auto v = detail::hinge_vertices(j);
    std::array<Vector3<double>, 4> flat;
    for (std::size_t i = 0; i < 4; ++i) {
      const Vec2 p = mesh.material.col(element.vertices[v[i]]) - origin;
      flat[i] = {p.x(), p.y(), 0};
    }
    const auto gradient = dihedral_angle(flat[0], flat[1], flat[2], flat[3]).gradient();
    double angle = 0;
    for (std::size_t i = 0; i < 4; ++i) angle += gradient[i].z * height(Vec2(flat[i].x, flat[i].y));
    for (std::size_t k = 0; k < 3; ++k)
      seen[static_cast<Eigen::Index>(k)] += element.map.r[k][j] * angle;
  }
  return seen;
}

/// m of the header: energy of the twist 1 = bends + m twists, over the triangles off the rim.
double twist_factor(const TriangleMesh& mesh, const std::vector<BendingElement>& elements) {
  double bends = 0, twists = 0, area = 0;
  for (const BendingElement& element : elements) {
    const auto& v = element.vertices;
    if (v[3] == v[0] || v[4] == v[1] || v[5] == v[2]) continue;
    const Vec3 seen = seen_twist(mesh, element);
    bends += element.area * seen.head<2>().squaredNorm();
    twists += element.area * seen.z() * seen.z();
    area += element.area;
  }
  if (!(twists > 0)) return 1;
  return std::clamp((area - bends) / twists, kLeastTwistFactor, 1.0);
}

}  // namespace

std::vector<BendingElement> bending_elements(const TriangleMesh& mesh, RimAngles rim) {
  if (auto cells = grid_cells(mesh); !cells.empty())
    return corner_elements(mesh, std::move(cells), rim);
  const auto all_apexes = edge_apexes(mesh);
  std::vector<BendingElement> elements;
  elements.reserve(mesh.triangles.size());
  for (int t = 0; t < mesh.triangle_count(); ++t)
    elements.push_back(make_element(mesh, t, rim, all_apexes));
  const double factor = std::sqrt(twist_factor(mesh, elements));
  for (BendingElement& element : elements) {
    for (double& entry : element.map.r[2]) entry *= factor;
    for (Vec3& direction : element.rim) direction.z() *= factor;
  }
  return elements;
}

}  // namespace weft
