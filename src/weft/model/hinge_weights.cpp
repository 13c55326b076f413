#include "weft/model/hinge_weights.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace weft {
namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

constexpr int kDirections = 12;  // of cylinders; any number above 4 gives the same least squares
constexpr double kRegularization = 1e-4;
constexpr double kLeast = 0.1;  // of the plain weight

/// A triangle seen from one of its edges.
struct Edge {
  double length;
  double height;     ///< of the apex
  double foot;       ///< of the apex along the edge, 0 to 1 between its ends
  double direction;  ///< angle to the u axis, rad, with the apex on the left
};

Edge edge_of(const Vec2& a, const Vec2& b, const Vec2& apex) {
  const Vec2 e = b - a, d = apex - a;
  const double twice_area = e.x() * d.y() - e.y() * d.x();
  if (twice_area < 0) return edge_of(b, a, apex);
  return {e.norm(), twice_area / e.norm(), e.dot(d) / e.squaredNorm(), std::atan2(e.y(), e.x())};
}

/// Angle of the hinge at `edge` when the sheet is bent to a cylinder of curvature 1 along
/// `direction`, to first order. Across the edge lies the triangle's mirror image or, with `turned`,
/// the triangle turned by half a turn.
double hinge_angle(const Edge& edge, double direction, bool turned) {
  const double c = std::cos(direction - edge.direction), s = std::sin(direction - edge.direction);
  const double l = edge.length, h = edge.height, t = edge.foot;
  return h * s * s - l * l * t * (1 - t) / h * c * c + (turned ? l * (2 * t - 1) * s * c : 0);
}

/// Weights that this triangle asks for on its three edges, relative to the plain ones.
Vec3 triangle_factors(const std::array<Edge, 3>& edges) {
  const double area = 0.5 * edges[0].length * edges[0].height;
  const auto longest = std::max_element(
      edges.begin(), edges.end(), [](const Edge& a, const Edge& b) { return a.length < b.length; });
  Eigen::Matrix<double, kDirections, 3> energy;
  for (int d = 0; d < kDirections; ++d)
    for (int k = 0; k < 3; ++k) {
      const Edge& edge = edges[at(k)];
      const double plain = edge.length * edge.length / (2 * area);
      const double angle =
          hinge_angle(edge, std::numbers::pi * d / kDirections, &edge == &*longest);
      energy(d, k) = 0.5 * plain * angle * angle / area;
    }
  // Minimize |energy f - 1|^2 / kDirections + regularization |f - 1|^2 with f >= kLeast.
  const Mat3 normal =
      energy.transpose() * energy / kDirections + kRegularization * Mat3::Identity();
  const Vec3 right = energy.colwise().mean().transpose() + kRegularization * Vec3::Ones();
  Vec3 f = normal.ldlt().solve(right);
  if (f.minCoeff() >= kLeast) return f;
  f = f.cwiseMax(kLeast);
  for (int sweep = 0; sweep < 500; ++sweep)  // coordinate descent: strictly convex, three unknowns
    for (int k = 0; k < 3; ++k)
      f[k] = std::max(kLeast, f[k] + (right[k] - normal.row(k).dot(f)) / normal(k, k));
  return f;
}

}  // namespace

VecX hinge_weights(const TriangleMesh& mesh, const std::vector<Hinge>& hinges) {
  VecX weights(static_cast<Eigen::Index>(hinges.size()));
  const auto factor = [&](int a, int b, int apex) {
    const Vec2 pa = mesh.material.col(a), pb = mesh.material.col(b), pc = mesh.material.col(apex);
    return triangle_factors({edge_of(pa, pb, pc), edge_of(pb, pc, pa), edge_of(pc, pa, pb)})[0];
  };
  for (std::size_t e = 0; e < hinges.size(); ++e) {
    const auto [v0, v1, v2, v3] = hinges[e].vertices;
    const Vec2 p0 = mesh.material.col(v0), p1 = mesh.material.col(v1);
    const double length = (p1 - p0).norm();
    const double heights = edge_of(p0, p1, mesh.material.col(v2)).height +
                           edge_of(p0, p1, mesh.material.col(v3)).height;
    const double plain = 2 * length / heights;
    weights[static_cast<Eigen::Index>(e)] = plain * 0.5 * (factor(v0, v1, v2) + factor(v0, v1, v3));
  }
  return weights;
}

}  // namespace weft
