#pragma once
#include <array>

#include "weft/mesh/triangle_mesh.h"
#include "weft/model/hem.h"
#include "weft/strain/triangle_shape.h"

namespace weft::detail {

/// What a mesh says of kLanes triangles, each with its vertices in an order of its own.
struct TriangleLanes {
  TriangleShape<Lanes> shape;
  std::array<Lanes, 3> shares;  ///< of the vertices in the area (grid_cells.h): of the drag
  Lanes u_layers, v_layers;     ///< of cloth that stretches along u and v: 1, more at a hem
};

/// Elements that fill a group up have no weight.
enum class Filling { none, weightless };

/// Puts a triangle of `mesh`, by its vertices in any order, into a lane. `shares` are those of
/// its vertices as the mesh has them.
void place_triangle(const TriangleMesh& mesh, int triangle, const std::array<int, 3>& vertices,
                    const std::array<double, 3>& shares, const Hem& hem, Filling filling, int lane,
                    TriangleLanes& to);

}  // namespace weft::detail
