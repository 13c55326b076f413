#include "weft/optics/smooth_surface.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <map>

#include "weft/base/error.h"

namespace weft::smooth_surface_test {
namespace {

Points flat_sheet(const TriangleMesh& mesh) {
  Points x(3, mesh.vertex_count());
  for (int v = 0; v < mesh.vertex_count(); ++v)
    x.col(v) = Vec3(mesh.material(0, v), 0.3 * mesh.material(0, v), -mesh.material(1, v));
  return x;
}

/// A cap of a sphere of radius 0.2 m around the origin, about 0.2 m wide.
Points sphere_cap(const TriangleMesh& mesh) {
  Points x(3, mesh.vertex_count());
  for (int v = 0; v < mesh.vertex_count(); ++v)
    x.col(v) = 0.2 * Vec3(mesh.material(0, v) - 0.1, -0.2, 0.1 - mesh.material(1, v)).normalized();
  return x;
}

enum class SurfacePieces { facets, patches };

/// Largest distance from the sphere of the facets' centres or of the patches' samples; the
/// cells along the rim, where normals are one-sided, are left out.
double distance_from_sphere(int side, SurfacePieces pieces) {
  const bool facets = pieces == SurfacePieces::facets;
  const TriangleMesh mesh = make_swatch(0.2, 0.2, side, side);
  SmoothSurface surface(mesh, facets ? 1 : 4);
  surface.evaluate(sphere_cap(mesh));
  Points at = surface.points();
  if (facets) {
    at.resize(3, static_cast<Eigen::Index>(surface.triangles().size()));
    Eigen::Index t = 0;
    for (const auto& [a, b, c] : surface.triangles())
      at.col(t++) =
          (surface.points().col(a) + surface.points().col(b) + surface.points().col(c)) / 3;
  }
  double largest = 0;
  const double inside = 0.1 - 0.2 / (side - 1) + 1e-9;
  for (Eigen::Index k = 0; k < at.cols(); ++k) {
    const double u = 0.2 * at(0, k) / -at(1, k), v = 0.2 * at(2, k) / -at(1, k);
    if (std::abs(u) < inside && std::abs(v) < inside)
      largest = std::max(largest, std::abs(at.col(k).norm() - 0.2));
  }
  return largest;
}

TEST(SmoothSurface, GoesThroughTheVertices) {
  const TriangleMesh mesh = make_swatch(0.2, 0.2, 5, 4);
  const Points x = sphere_cap(mesh);
  SmoothSurface surface(mesh, 3);
  surface.evaluate(x);
  EXPECT_EQ(surface.points().leftCols(mesh.vertex_count()), x);
  EXPECT_EQ(surface.triangles().size(), mesh.triangles.size() * 9);
}

TEST(SmoothSurface, OfAFlatSheetIsFlat) {
  const TriangleMesh mesh = make_swatch(0.3, 0.2, 4, 3);
  SmoothSurface surface(mesh, 4);
  surface.evaluate(flat_sheet(mesh));
  const Vec3 normal = Vec3(0.3, -1, 0).normalized();
  for (Eigen::Index k = 0; k < surface.points().cols(); ++k) {
    EXPECT_NEAR(normal.dot(surface.points().col(k)), 0, 1e-15);
    EXPECT_NEAR(std::abs(normal.dot(surface.normals().col(k))), 1, 1e-12);
  }
}

TEST(SmoothSurface, IsNearerToASphereThanFacets) {
  const double facets = distance_from_sphere(9, SurfacePieces::facets);
  const double patches = distance_from_sphere(9, SurfacePieces::patches);
  EXPECT_LT(patches, 0.1 * facets);
  // At half the edge facets, of second order, keep a quarter of their error, the cubic patches less
  // than an eighth.
  EXPECT_NEAR(distance_from_sphere(17, SurfacePieces::facets) / facets, 0.25, 0.05);
  EXPECT_LT(distance_from_sphere(17, SurfacePieces::patches) / patches, 0.125);
}

TEST(SmoothSurface, HasNoCracks) {
  const TriangleMesh mesh = make_swatch(0.2, 0.2, 4, 4);
  const SmoothSurface surface(mesh, 3);
  // Every edge inside is shared by two triangles that run it in opposite directions; the rim has
  // 4 sides of 3 cells of 3 pieces.
  std::map<std::pair<int, int>, int> uses;
  for (const auto& t : surface.triangles())
    for (int k = 0; k < 3; ++k) ++uses[{t[k], t[(k + 1) % 3]}];
  int rim = 0;
  for (const auto& [edge, count] : uses) {
    EXPECT_EQ(count, 1);
    rim += !uses.contains({edge.second, edge.first});
  }
  EXPECT_EQ(rim, 4 * 3 * 3);
}

TEST(SmoothSurface, NormalsFollowTheWinding) {
  const TriangleMesh mesh = make_swatch(0.2, 0.2, 5, 5);
  SmoothSurface surface(mesh, 2);
  surface.evaluate(sphere_cap(mesh));
  for (const auto& [a, b, c] : surface.triangles()) {
    const Vec3 origin = surface.points().col(a);
    const Vec3 wound =
        Vec3(surface.points().col(b) - origin).cross(Vec3(surface.points().col(c) - origin));
    EXPECT_GT(wound.dot(surface.normals().col(a)), 0);
  }
}

TEST(SmoothSurface, SurvivesCollapsedTriangles) {
  const TriangleMesh mesh = make_swatch(0.2, 0.2, 4, 4);
  SmoothSurface surface(mesh, 3);
  surface.evaluate(Points::Zero(3, mesh.vertex_count()));
  EXPECT_TRUE(surface.points().allFinite());
  EXPECT_TRUE(surface.normals().allFinite());
}

TEST(SmoothSurface, RejectsBadArguments) {
  const TriangleMesh mesh = make_swatch(0.2, 0.2, 4, 4);
  EXPECT_THROW(SmoothSurface(mesh, 0), Error);
  EXPECT_THROW(SmoothSurface(mesh, 17), Error);
  SmoothSurface surface(mesh, 2);
  EXPECT_THROW(surface.evaluate(Points::Zero(3, 15)), Error);
}

}  // namespace
}  // namespace weft::smooth_surface_test
