#pragma once
/// The cells of a grid, and the edges of a mesh.
#include <array>
#include <map>
#include <utility>
#include <vector>

#include "weft/mesh/triangle_mesh.h"

namespace weft {

/// The smaller vertex first.
using MeshEdge = std::pair<int, int>;
MeshEdge mesh_edge(int a, int b);

/// For each edge, the vertices that are opposite to it.
std::map<MeshEdge, std::vector<int>> edge_apexes(const TriangleMesh& mesh);

/// What rounding of the coordinates may leave of the cosine of a right angle, and between points
/// that are the same, in lengths of a cell.
inline constexpr double grid_rounding = 1e-9;

/// Corners of a rectangle, in counter-clockwise order in (u, v).
using GridCell = std::array<int, 4>;

/// The rectangles of which a valid mesh consists, each of two triangles; empty if there are others.
std::vector<GridCell> grid_cells(const TriangleMesh& mesh);

/// What parts of its area each triangle's vertices stand for; they add up to 1. Of a grid a half at
/// the right angle and a quarter elsewhere, so that each cell is shared equally by its corners;
/// otherwise a third.
std::vector<std::array<double, 3>> area_shares(const TriangleMesh& mesh);

}  // namespace weft
