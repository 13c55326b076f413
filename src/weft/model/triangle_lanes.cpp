#include "weft/model/triangle_lanes.h"

#include <algorithm>

namespace weft::detail {
namespace {

/// Of cloth that stretches along u and v in a triangle of that area: 1, more at a hem.
Vec2 layers_of(const std::array<int, 3>& triangle, double area, const Hem& hem) {
  const auto [a, b, c] = triangle;
  return Vec2::Ones() + (hem.area(a, b) + hem.area(a, c) + hem.area(b, c)) / area;
}

}  // namespace

void place_triangle(const TriangleMesh& mesh, int triangle, const std::array<int, 3>& vertices,
                    const std::array<double, 3>& shares, const Hem& hem, Filling filling, int lane,
                    TriangleLanes& to) {
  const auto [a, b, c] = vertices;
  const auto shape =
      triangle_shape(mesh.material.col(a), mesh.material.col(b), mesh.material.col(c));
  to.shape.du1[lane] = shape.du1;
  to.shape.du2[lane] = shape.du2;
  to.shape.dv1[lane] = shape.dv1;
  to.shape.dv2[lane] = shape.dv2;
  to.shape.area[lane] = filling == Filling::weightless ? 0 : shape.area;
  const Vec2 layers = layers_of(vertices, shape.area, hem);
  to.u_layers[lane] = layers.x();
  to.v_layers[lane] = layers.y();
  const auto& of_mesh = mesh.triangles[static_cast<std::size_t>(triangle)];
  for (std::size_t i = 0; i < 3; ++i) {
    const auto corner = std::ranges::find(of_mesh, vertices[i]) - of_mesh.begin();
    to.shares[i][lane] = shares[static_cast<std::size_t>(corner)];
  }
}

}  // namespace weft::detail
