#include "weft/registration/start_shapes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "weft/base/error.h"
#include "weft/registration/stripe_surface.h"

namespace weft::start_shapes_test {
namespace {

Scene hung_by(const std::vector<std::pair<int, Vec3>>& fixtures) {
  Scene scene;
  scene.mesh = make_swatch(0.5, 0.4, 11, 9);
  scene.areal_density = 0.2;
  scene.frame_times = {0};
  for (const auto& [vertex, position] : fixtures) {
    scene.fixtures.push_back({"fixture", vertex, Motion::fixed(position)});
  }
  return scene;
}

TEST(StartShapes, FlatSheetHangsFromItsCorners) {
  const Scene scene = hung_by({{0, {-0.2, 0.1, 1}}, {10, {0.2, 0.1, 1}}});
  const Points x = flat_sheet(scene);
  EXPECT_LT((x.col(0) - Vec3(-0.2, 0.1, 1)).norm(), 1e-12);
  EXPECT_LT((x.col(10) - Vec3(0.2, 0.1, 1)).norm(), 1e-12);
  // Last row, last column: below the right corner by the height of the swatch.
  EXPECT_LT((x.col(98) - Vec3(0.2, 0.1, 0.6)).norm(), 1e-12);
}

TEST(StartShapes, HeldByItsBottomCornersItStillHangsDown) {
  const Scene scene = hung_by({{88, {-0.25, 0, 1}}, {98, {0.25, 0, 1}}});
  const Points x = flat_sheet(scene);
  EXPECT_LT((x.col(0) - Vec3(-0.25, 0, 0.6)).norm(), 1e-12);
}

TEST(StartShapes, OneAndFourFixtures) {
  const Points one = flat_sheet(hung_by({{0, {0, 0, 1}}}));
  EXPECT_LT((one.col(0) - Vec3(0, 0, 1)).norm(), 1e-12);
  EXPECT_LT(one.row(2).maxCoeff(), 1 + 0.35);
  EXPECT_TRUE(one.allFinite());

  const Scene scene =
      hung_by({{0, {0, 0, 0}}, {10, {0.4, 0, 0}}, {88, {0, 0.4, 0}}, {98, {0.4, 0.4, 0.1}}});
  const Points four = flat_sheet(scene);
  for (const PointFixture& fixture : scene.fixtures) {
    EXPECT_LT((four.col(fixture.vertex) - fixture.motion.position(0)).norm(), 1e-12);
  }
  EXPECT_THROW(flat_sheet(hung_by({})), Error);
}

TEST(StartShapes, GenericStartsComeInPairsAndHoldTheFixtures) {
  const Scene scene = hung_by({{0, {-0.2, 0, 1}}, {10, {0.2, 0, 1}}});
  const std::vector<StartShape> starts = generic_starts(scene);
  ASSERT_EQ(starts.size() % 2, 0u);
  ASSERT_GE(starts.size(), 4u);
  std::set<std::string> names;
  const Points flat = flat_sheet(scene);
  for (std::size_t k = 0; k < starts.size(); ++k) {
    names.insert(starts[k].name);
    for (const PointFixture& fixture : scene.fixtures) {
      EXPECT_LT((starts[k].x.col(fixture.vertex) - fixture.motion.position(0)).norm(), 1e-12);
    }
    // Mirror images in the plane of the flat sheet.
    const std::size_t other = k ^ 1u;
    EXPECT_LT(((starts[k].x + starts[other].x) / 2 - flat).cwiseAbs().maxCoeff(), 1e-12);
    EXPECT_GT((starts[k].x - flat).cwiseAbs().maxCoeff(), 0.01);
  }
  EXPECT_EQ(names.size(), starts.size());
  // The bulge takes up what the corners are nearer than the fabric is wide: the row half way down
  // is about 0.5 m long.
  double length = 0;
  for (int c = 0; c < 10; ++c) {
    length += (starts[0].x.col(44 + c + 1) - starts[0].x.col(44 + c)).norm();
  }
  EXPECT_NEAR(length, 0.5, 0.03);
}

}  // namespace
}  // namespace weft::start_shapes_test
