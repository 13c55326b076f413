#include "weft/mesh/grid_cells.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "weft/mesh/grid_lines.h"

namespace weft::grid_cells_test {
namespace {

double area(const TriangleMesh& mesh, const GridCell& cell) {
  double twice = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const Vec2 a = mesh.material.col(cell[i]), b = mesh.material.col(cell[(i + 1) % 4]);
    twice += a.x() * b.y() - b.x() * a.y();
  }
  return 0.5 * twice;
}

TEST(GridCells, EachCellOnceWithCornersCounterClockwise) {
  for (const GridPattern pattern : {GridPattern::alternating, GridPattern::uniform}) {
    const TriangleMesh mesh = make_swatch(0.5, 0.3, 6, 4, pattern);
    const std::vector<GridCell> cells = grid_cells(mesh);
    ASSERT_EQ(cells.size(), 15);
    std::vector<GridCell> corners;
    for (GridCell cell : cells) {
      EXPECT_NEAR(area(mesh, cell), 0.01, 1e-15);
      std::sort(cell.begin(), cell.end());
      EXPECT_EQ(cell, (GridCell{cell[0], cell[0] + 1, cell[0] + 6, cell[0] + 7}));
      corners.push_back(cell);
    }
    std::sort(corners.begin(), corners.end());
    EXPECT_EQ(std::unique(corners.begin(), corners.end()), corners.end());
  }
}

// Lines at unequal distances, and a mesh that lies turned in (u, v).
TEST(GridCells, CellsMayDifferAndLieAskew) {
  TriangleMesh mesh = make_swatch({0, 0.1, 0.4}, {0, 0.2, 0.25, 0.5}, GridPattern::alternating);
  EXPECT_EQ(grid_cells(mesh).size(), 6);
  Eigen::Matrix2d turn;
  turn << 0.8, -0.6, 0.6, 0.8;
  mesh.material = turn * mesh.material;
  EXPECT_EQ(grid_cells(mesh).size(), 6);
}

TEST(GridCells, NoneWhereOneTriangleIsNoHalfOfARectangle) {
  TriangleMesh moved = make_swatch(0.5, 0.3, 6, 4);
  moved.material(0, 8) += 1e-4;
  EXPECT_TRUE(grid_cells(moved).empty());
  TriangleMesh without = make_swatch(0.5, 0.3, 6, 4);
  without.triangles.pop_back();
  EXPECT_TRUE(grid_cells(without).empty());
}

TEST(GridCells, ApexesOfAnEdge) {
  const TriangleMesh mesh = make_swatch(1, 1, 2, 2);
  const auto apexes = edge_apexes(mesh);
  ASSERT_EQ(apexes.size(), 5);
  for (const auto& [edge, opposite] : apexes) {
    EXPECT_LT(edge.first, edge.second);
    const bool inner = edge == mesh_edge(0, 3) || edge == mesh_edge(2, 1);
    EXPECT_EQ(opposite.size(), inner ? 2 : 1);
    for (const int apex : opposite) EXPECT_TRUE(apex != edge.first && apex != edge.second);
  }
}

}  // namespace
}  // namespace weft::grid_cells_test
