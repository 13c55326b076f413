#include "weft/model/bending.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

namespace weft {
namespace {

constexpr double kLeastTwistFactor = 0.25;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

/// (n_u^2, n_v^2, sqrt(2) n_u n_v): n n^T as a vector with the same norm.
Vec3 squared(const Vec2& n) {
  return {n.x() * n.x(), n.y() * n.y(), std::numbers::sqrt2 * n.x() * n.y()};
}

using Edge = std::pair<int, int>;

Edge edge(int a, int b) { return {std::min(a, b), std::max(a, b)}; }

/// For each edge, the vertices that are opposite to it.
std::map<Edge, std::vector<int>> apexes(const TriangleMesh& mesh) {
  std::map<Edge, std::vector<int>> out;
  for (const auto& t : mesh.triangles)
    for (std::size_t j = 0; j < 3; ++j) out[edge(t[j], t[(j + 1) % 3])].push_back(t[(j + 2) % 3]);
  return out;
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

BendingElement make_element(const TriangleMesh& mesh, int triangle, RimAngles rim,
                            const std::map<Edge, std::vector<int>>& all_apexes) {
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
    const auto& opposite = all_apexes.at(edge(a, b));
    if (opposite.size() == 2) {
      element.vertices[3 + j] = opposite[0] == apex ? opposite[1] : opposite[0];
      map.col(static_cast<Eigen::Index>(j)) = length / (2 * element.area) * direction;
    } else {
      element.vertices[3 + j] = a;
      element.rim.push_back(direction);
    }
  }
  if (rim == RimAngles::projected) project_out(element.rim, map);
  for (std::size_t k = 0; k < 3; ++k)
    for (std::size_t j = 0; j < 3; ++j)
      element.map.r[k][j] = map(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(j));
  return element;
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
  const auto all_apexes = apexes(mesh);
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
