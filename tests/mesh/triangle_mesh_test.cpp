#include "weft/mesh/triangle_mesh.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <set>

#include "weft/base/error.h"
#include "weft/base/random.h"

namespace weft::triangle_mesh_test {
namespace {

using ::testing::HasSubstr;

/// u along +x, v along -z: how a swatch hangs before a camera at -y that looks along +y.
Points hanging(const TriangleMesh& mesh) {
  Points x = Points::Zero(3, mesh.vertex_count());
  x.row(0) = mesh.material.row(0);
  x.row(2) = -mesh.material.row(1);
  return x;
}

template <typename Function>
std::string message(Function function) {
  try {
    function();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

class Swatch : public ::testing::TestWithParam<GridPattern> {};

TEST_P(Swatch, CoversItsRectangleOnceWithCounterClockwiseTriangles) {
  const TriangleMesh mesh = make_swatch(0.5, 0.3, 6, 4, GetParam());
  EXPECT_EQ(mesh.vertex_count(), 24);
  EXPECT_EQ(mesh.triangle_count(), 2 * 5 * 3);
  double area = 0;
  for (int t = 0; t < mesh.triangle_count(); ++t) {
    EXPECT_GT(material_area(mesh, t), 0);
    area += material_area(mesh, t);
  }
  EXPECT_NEAR(area, 0.15, 1e-15);
  EXPECT_NO_THROW(validate(mesh, "swatch"));
}

TEST_P(Swatch, NumbersVerticesRowByRow) {
  const TriangleMesh mesh = make_swatch(0.5, 0.3, 6, 4, GetParam());
  EXPECT_EQ(mesh.material.col(0), Vec2(0, 0));
  EXPECT_EQ(mesh.material.col(5), Vec2(0.5, 0));
  EXPECT_EQ(mesh.material.col(18), Vec2(0, 0.3));
  EXPECT_EQ(mesh.material.col(23), Vec2(0.5, 0.3));
  EXPECT_NEAR(mesh.material(0, 7), 0.1, 1e-15);
  EXPECT_NEAR(mesh.material(1, 7), 0.1, 1e-15);
}

TEST_P(Swatch, LumpedAreasAreQuartersOfTheCells) {
  const VecX areas = vertex_areas(make_swatch(0.5, 0.3, 6, 4, GetParam()));
  EXPECT_NEAR(areas.sum(), 0.15, 1e-15);
  EXPECT_NEAR(areas[0], 0.25 * 0.01, 1e-15);
  EXPECT_NEAR(areas[1], 0.5 * 0.01, 1e-15);
  for (const int inner : {7, 8, 13, 16}) EXPECT_NEAR(areas[inner], 0.01, 1e-15);
}

TEST(LumpedAreas, AreThirdsOfTrianglesOffAGrid) {
  TriangleMesh mesh;
  mesh.material = MaterialPoints(2, 4);
  mesh.material << 0, 1, 0.2, 1.1,  //
      0, 0.1, 1, 1.3;
  mesh.triangles = {{0, 1, 2}, {1, 3, 2}};
  const VecX areas = vertex_areas(mesh);
  const double first = material_area(mesh, 0) / 3, second = material_area(mesh, 1) / 3;
  EXPECT_NEAR((areas - Eigen::Vector4d(first, first + second, first + second, second)).norm(), 0,
              1e-15);
}

// Euler: a disc has V - E + F = 1, and 3 F = 2 * inner edges + border edges.
TEST_P(Swatch, HasAHingeAtEachInnerEdge) {
  const TriangleMesh mesh = make_swatch(0.5, 0.3, 6, 4, GetParam());
  const int border = 2 * 5 + 2 * 3;
  const auto result = hinges(mesh);
  EXPECT_EQ(static_cast<int>(result.size()), (3 * mesh.triangle_count() - border) / 2);
  for (const Hinge& hinge : result) {
    const auto& [a, b, c, d] = hinge.vertices;
    const auto signed_area = [&](int i, int j, int k) {
      const Vec2 p = mesh.material.col(j) - mesh.material.col(i);
      const Vec2 q = mesh.material.col(k) - mesh.material.col(i);
      return p.x() * q.y() - p.y() * q.x();
    };
    EXPECT_GT(signed_area(a, b, c), 0) << "the edge runs counter-clockwise in the first triangle";
    EXPECT_LT(signed_area(a, b, d), 0) << "and clockwise in the other";
    std::set<int> distinct(hinge.vertices.begin(), hinge.vertices.end());
    EXPECT_EQ(distinct.size(), 4u);
  }
}

INSTANTIATE_TEST_SUITE_P(Patterns, Swatch,
                         ::testing::Values(GridPattern::alternating, GridPattern::uniform));

TEST(MakeSwatch, PatternsPlaceTheDiagonalsAsTheySay) {
  // (u + v) grows along one diagonal of a square, (u - v) along the other.
  const auto rising_diagonals = [](GridPattern pattern) {
    const TriangleMesh mesh = make_swatch(1, 1, 5, 5, pattern);
    int count = 0;
    for (const Hinge& hinge : hinges(mesh)) {
      const Vec2 edge = mesh.material.col(hinge.vertices[1]) - mesh.material.col(hinge.vertices[0]);
      if (edge.x() * edge.y() > 0) ++count;
    }
    return count;
  };
  EXPECT_EQ(rising_diagonals(GridPattern::uniform), 16);
  EXPECT_EQ(rising_diagonals(GridPattern::alternating), 8);
}

TEST(MakeSwatch, RejectsSizesThatAreNone) {
  EXPECT_THROW(make_swatch(0, 1, 2, 2), Error);
  EXPECT_THROW(make_swatch(1, -1, 2, 2), Error);
  EXPECT_THROW(make_swatch(NAN, 1, 2, 2), Error);
  EXPECT_THROW(make_swatch(1, INFINITY, 2, 2), Error);
  EXPECT_THROW(make_swatch(1, 1, 1, 2), Error);
  EXPECT_THROW(make_swatch(1, 1, 2, 0), Error);
  EXPECT_NO_THROW(make_swatch(1, 1, 2, 2));
}

TEST(Validate, NamesWhatIsWrong) {
  const TriangleMesh good = make_swatch(1, 1, 3, 3);
  const auto says = [](const TriangleMesh& mesh) {
    return message([&] { validate(mesh, "m.obj"); });
  };
  TriangleMesh bad = good;
  bad.triangles[2][1] = 9;
  EXPECT_THAT(says(bad), HasSubstr("m.obj: triangle 2 names vertex 9; there are 9 vertices"));
  bad = good;
  bad.triangles[2][1] = -1;
  EXPECT_THAT(says(bad), HasSubstr("names vertex -1"));
  bad = good;
  std::swap(bad.triangles[3][0], bad.triangles[3][1]);
  EXPECT_THAT(says(bad), HasSubstr("triangle 3 is clockwise"));
  bad = good;
  bad.triangles[0] = {0, 1, 2};
  EXPECT_THAT(says(bad), HasSubstr("triangle 0 has no area"));
  bad = good;
  bad.material(0, 4) = NAN;
  EXPECT_THAT(says(bad), HasSubstr("not a finite number"));
  bad = good;
  bad.material.conservativeResize(2, 10);
  bad.material.col(9) = Vec2(5, 5);
  EXPECT_THAT(says(bad), HasSubstr("vertex 9 belongs to no triangle"));
  bad = good;
  bad.triangles.push_back(bad.triangles[0]);
  EXPECT_THAT(says(bad), HasSubstr("overlap"));
  bad = good;
  bad.triangles.push_back(bad.triangles[0]);
  bad.triangles.push_back(bad.triangles[0]);
  EXPECT_THAT(says(bad), HasSubstr("more than two triangles"));
  bad = good;
  bad.triangles.clear();
  EXPECT_THAT(says(bad), HasSubstr("no triangles"));
}

TEST(VertexNormals, OfAHangingSwatchPointAwayFromItsViewer) {
  const TriangleMesh mesh = make_swatch(0.5, 0.5, 5, 5);
  const Points normals = vertex_normals(mesh, hanging(mesh));
  for (int i = 0; i < mesh.vertex_count(); ++i) {
    EXPECT_NEAR((normals.col(i) - Vec3(0, 1, 0)).norm(), 0, 1e-12);
  }
}

// A swatch wrapped on a cylinder of radius r about the z axis: the exact normal at a vertex is
// radial.
TEST(VertexNormals, OfACylinderAreRadial) {
  const double r = 0.2;
  const TriangleMesh mesh = make_swatch(0.3, 0.3, 31, 31, GridPattern::uniform);
  Points x(3, mesh.vertex_count());
  for (int i = 0; i < mesh.vertex_count(); ++i) {
    const double angle = mesh.material(0, i) / r;
    x.col(i) = Vec3(r * std::cos(angle), r * std::sin(angle), mesh.material(1, i));
  }
  const Points normals = vertex_normals(mesh, x);
  for (int row = 1; row < 30; ++row) {
    for (int column = 1; column < 30; ++column) {
      const int i = row * 31 + column;
      const Vec3 radial(x(0, i) / r, x(1, i) / r, 0);
      EXPECT_NEAR(normals.col(i).norm(), 1, 1e-12);
      EXPECT_NEAR((normals.col(i) - radial).norm(), 0, 1e-3);
    }
  }
}

TEST(MaterialLocator, GivesBackThePointThatItWasAskedFor) {
  for (const GridPattern pattern : {GridPattern::alternating, GridPattern::uniform}) {
    const TriangleMesh mesh = make_swatch(0.5, 0.2, 9, 17, pattern);
    const MaterialLocator locator(mesh);
    Rng rng(3);
    for (int i = 0; i < 2000; ++i) {
      const Vec2 uv(rng.uniform(0, 0.5), rng.uniform(0, 0.2));
      const MaterialLocator::Hit hit = locator.locate(uv);
      const auto& [a, b, c] = mesh.triangles[static_cast<std::size_t>(hit.triangle)];
      const Vec2 found = hit.barycentric[0] * mesh.material.col(a) +
                         hit.barycentric[1] * mesh.material.col(b) +
                         hit.barycentric[2] * mesh.material.col(c);
      ASSERT_NEAR((found - uv).norm(), 0, 1e-14);
      ASSERT_GE(hit.barycentric.minCoeff(), 0);
      ASSERT_NEAR(hit.barycentric.sum(), 1, 1e-14);
    }
  }
}

TEST(MaterialLocator, TakesTheNearestPointForOneOutside) {
  const TriangleMesh mesh = make_swatch(0.5, 0.2, 9, 17);
  const MaterialLocator locator(mesh);
  Rng rng(4);
  for (int i = 0; i < 500; ++i) {
    const Vec2 uv(rng.uniform(-0.5, 1), rng.uniform(-0.5, 0.7));
    // On a rectangle the nearest point is the clamped one.
    const Vec2 nearest(std::clamp(uv.x(), 0.0, 0.5), std::clamp(uv.y(), 0.0, 0.2));
    const MaterialLocator::Hit hit = locator.locate(uv);
    const auto& [a, b, c] = mesh.triangles[static_cast<std::size_t>(hit.triangle)];
    const Vec2 found = hit.barycentric[0] * mesh.material.col(a) +
                       hit.barycentric[1] * mesh.material.col(b) +
                       hit.barycentric[2] * mesh.material.col(c);
    ASSERT_NEAR((found - nearest).norm(), 0, 1e-12) << uv.transpose();
    ASSERT_GE(hit.barycentric.minCoeff(), 0);
  }
}

// An L of three squares: a point in the missing corner has its nearest point on an inner border,
// not in the grid cell where it lies.
TEST(MaterialLocator, FindsTheNearestTriangleOfAMeshWithAMissingCorner) {
  TriangleMesh mesh = make_swatch(2, 2, 21, 21, GridPattern::uniform);
  std::erase_if(mesh.triangles, [&](const auto& triangle) {
    const Vec2 center = (mesh.material.col(triangle[0]) + mesh.material.col(triangle[1]) +
                         mesh.material.col(triangle[2])) /
                        3;
    return center.x() > 1 && center.y() > 1;
  });
  const MaterialLocator locator(mesh);
  const Vec2 uv(1.73, 1.61);
  const MaterialLocator::Hit hit = locator.locate(uv);
  const auto& [a, b, c] = mesh.triangles[static_cast<std::size_t>(hit.triangle)];
  const Vec2 found = hit.barycentric[0] * mesh.material.col(a) +
                     hit.barycentric[1] * mesh.material.col(b) +
                     hit.barycentric[2] * mesh.material.col(c);
  EXPECT_NEAR((found - Vec2(1.73, 1)).norm(), 0, 1e-12);
}

TEST(Interpolate, RepeatsAnAffineMap) {
  const TriangleMesh mesh = make_swatch(0.5, 0.4, 7, 5);
  Eigen::Matrix<double, 3, 2> map;
  map << 1, 2, -0.5, 0.3, 0.7, -1;
  const Points x = (map * mesh.material).colwise() + Vec3(1, 2, 3);
  Rng rng(9);
  MaterialPoints uv(2, 200);
  for (Eigen::Index i = 0; i < uv.cols(); ++i) {
    uv.col(i) = Vec2(rng.uniform(0, 0.5), rng.uniform(0, 0.4));
  }
  const Points found = interpolate(mesh, MaterialLocator(mesh), x, uv);
  const Points expected = (map * uv).colwise() + Vec3(1, 2, 3);
  EXPECT_NEAR((found - expected).cwiseAbs().maxCoeff(), 0, 1e-14);
}

TEST(GridPattern, HasAName) {
  for (const GridPattern pattern : {GridPattern::alternating, GridPattern::uniform})
    EXPECT_EQ(grid_pattern_from_name(name_of(pattern)), pattern);
  EXPECT_NE(name_of(GridPattern::alternating), name_of(GridPattern::uniform));
  EXPECT_THROW(grid_pattern_from_name("crossed"), Error);
}

}  // namespace
}  // namespace weft::triangle_mesh_test
