#include "weft/mesh/annulus.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "weft/base/error.h"

namespace weft::annulus_test {
namespace {

TEST(Annulus, IsAValidMeshOfTheRightArea) {
  for (const GridPattern pattern : {GridPattern::alternating, GridPattern::uniform}) {
    const TriangleMesh mesh = make_annulus({0.1, 0.12, 0.15}, 48, pattern);
    validate(mesh, "annulus");
    EXPECT_EQ(mesh.vertex_count(), 3 * 48);
    EXPECT_EQ(mesh.triangle_count(), 2 * 2 * 48);
    double area = 0;
    for (int t = 0; t < mesh.triangle_count(); ++t) area += material_area(mesh, t);
    // Regular polygons of 48 corners.
    const double polygon = 24 * std::sin(2 * std::numbers::pi / 48);
    EXPECT_NEAR(area, polygon * (0.15 * 0.15 - 0.1 * 0.1), 1e-12);
  }
}

TEST(Annulus, RefusesWhatIsNoRing) {
  EXPECT_THROW(make_annulus({0.1}, 48), Error);
  EXPECT_THROW(make_annulus({0.1, 0.1}, 48), Error);
  EXPECT_THROW(make_annulus({0, 0.1}, 48), Error);
  EXPECT_THROW(make_annulus({0.1, 0.2}, 7), Error);
  EXPECT_NO_THROW(make_annulus({0.1, 0.2}, 7, GridPattern::uniform));
}

}  // namespace
}  // namespace weft::annulus_test
