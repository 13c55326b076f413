#include "weft/model/hinge_weights.h"

namespace weft {
namespace {

double triangle_area(const Vec2& a, const Vec2& b, const Vec2& c) {
  const Vec2 p = b - a, q = c - a;
  return 0.5 * std::abs(p.x() * q.y() - p.y() * q.x());
}

}  // namespace

VecX hinge_weights(const TriangleMesh& mesh, const std::vector<Hinge>& hinges) {
  VecX weights(static_cast<Eigen::Index>(hinges.size()));
  for (std::size_t e = 0; e < hinges.size(); ++e) {
    const auto& v = hinges[e].vertices;
    const auto at = [&](int i) { return Vec2(mesh.material.col(v[static_cast<std::size_t>(i)])); };
    const double area = triangle_area(at(0), at(1), at(2)) + triangle_area(at(0), at(1), at(3));
    weights[static_cast<Eigen::Index>(e)] = (at(1) - at(0)).squaredNorm() / area;
  }
  return weights;
}

}  // namespace weft
