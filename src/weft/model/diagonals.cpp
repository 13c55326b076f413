#include "weft/model/diagonals.h"

#include <Eigen/LU>
#include <numbers>

#include "weft/mesh/grid_cells.h"
#include "weft/strain/triangle_shape.h"

namespace weft {
namespace {

/// From the coefficients of w_u and w_v.
DiagonalElement element_of(const std::array<int, 4>& vertices, const std::array<double, 4>& du,
                           const std::array<double, 4>& dv, double area) {
  DiagonalElement element{vertices, {}, {}, area};
  for (std::size_t i = 0; i < 4; ++i) {
    element.rising[i] = (du[i] + dv[i]) / std::numbers::sqrt2;
    element.falling[i] = (du[i] - dv[i]) / std::numbers::sqrt2;
  }
  return element;
}

/// Bilinear over the cell, at its centre: means of opposite sides.
DiagonalElement element_of(const TriangleMesh& mesh, const GridCell& cell) {
  const auto corner = [&](std::size_t i) -> Vec2 { return mesh.material.col(cell[i]); };
  Eigen::Matrix2d sides;
  sides.col(0) = 0.5 * (corner(1) - corner(0) + corner(2) - corner(3));
  sides.col(1) = 0.5 * (corner(3) - corner(0) + corner(2) - corner(1));
  const Eigen::Matrix2d inverse = sides.inverse();
  constexpr std::array<double, 4> kFirst{-0.5, 0.5, 0.5, -0.5}, kSecond{-0.5, -0.5, 0.5, 0.5};
  std::array<double, 4> du{}, dv{};
  for (std::size_t i = 0; i < 4; ++i) {
    du[i] = kFirst[i] * inverse(0, 0) + kSecond[i] * inverse(1, 0);
    dv[i] = kFirst[i] * inverse(0, 1) + kSecond[i] * inverse(1, 1);
  }
  return element_of(cell, du, dv, sides.determinant());
}

DiagonalElement element_of(const TriangleMesh& mesh, const std::array<int, 3>& t) {
  const auto shape =
      triangle_shape(mesh.material.col(t[0]), mesh.material.col(t[1]), mesh.material.col(t[2]));
  const auto du = shape.du(), dv = shape.dv();
  return element_of({t[0], t[1], t[2], t[2]}, {du[0], du[1], du[2], 0}, {dv[0], dv[1], dv[2], 0},
                    shape.area);
}

}  // namespace

std::vector<DiagonalElement> diagonal_elements(const TriangleMesh& mesh) {
  std::vector<DiagonalElement> elements;
  for (const GridCell& cell : grid_cells(mesh)) elements.push_back(element_of(mesh, cell));
  if (elements.empty())
    for (const auto& triangle : mesh.triangles) elements.push_back(element_of(mesh, triangle));
  return elements;
}

}  // namespace weft
