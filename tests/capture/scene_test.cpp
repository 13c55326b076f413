#include <gmock/gmock.h>

#include "capture/temporary_capture.h"

namespace weft::scene_test {
namespace {

using ::testing::HasSubstr;

TEST(MakeScene, PutsFixturesAtTheirVerticesAndFramesAtTheirTimes) {
  const Capture capture = read_capture(bundled_capture());
  const Scene scene = make_scene(capture, 25, 13, 10, 14);
  EXPECT_EQ(scene.mesh.vertex_count(), 25 * 13);
  EXPECT_EQ(scene.mesh.material.col(25 * 13 - 1), Vec2(0.5, 0.5));
  EXPECT_EQ(scene.areal_density, 0.3);
  EXPECT_EQ(scene.gravity, capture.gravity);
  ASSERT_EQ(scene.fixtures.size(), 2u);
  EXPECT_EQ(scene.fixtures[0].vertex, 0);
  EXPECT_EQ(scene.fixtures[1].vertex, 24);
  EXPECT_EQ(scene.fixtures[1].name, "right corner");
  EXPECT_EQ(scene.fixtures[1].motion.position(0.4), capture.fixtures[1].motion.position(0.4));
  ASSERT_EQ(scene.frame_times.size(), 5u);
  EXPECT_DOUBLE_EQ(scene.frame_times.front(), 10 / 30.0);
  EXPECT_DOUBLE_EQ(scene.frame_times.back(), 14 / 30.0);
  EXPECT_EQ(scene.start.cols(), 0);
}

TEST(MakeScene, FindsFixturesInsideTheSwatch) {
  Capture capture = read_capture(bundled_capture());
  capture.fixtures[0].at = Vec2(0.1, 0.25);
  // Column 1 of 0 to 5, row 2 of 0 to 4.
  EXPECT_EQ(make_scene(capture, 6, 5, 0, 0).fixtures[0].vertex, 2 * 6 + 1);
  capture.fixtures[0].at = Vec2(0.1 + 0.9e-6, 0.25);
  EXPECT_EQ(make_scene(capture, 6, 5, 0, 0).fixtures[0].vertex, 2 * 6 + 1);
}

TEST(MakeScene, RejectsAGridWithoutAVertexAtAFixture) {
  Capture capture = read_capture(bundled_capture());
  capture.fixtures[0].at = Vec2(0.1 + 2e-6, 0.25);
  try {
    make_scene(capture, 6, 5, 0, 0);
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("\"left corner\""));
    EXPECT_THAT(error.what(), HasSubstr("6 x 5"));
    EXPECT_THAT(error.what(), HasSubstr("(0.1, 0.25)"));
  }
}

TEST(MakeScene, RejectsFramesThatTheCaptureLacks) {
  const Capture capture = read_capture(bundled_capture());
  EXPECT_THROW(make_scene(capture, 5, 5, 0, 100), Error);
  EXPECT_THROW(make_scene(capture, 5, 5, -1, 10), Error);
  EXPECT_THROW(make_scene(capture, 5, 5, 11, 10), Error);
  EXPECT_NO_THROW(make_scene(capture, 5, 5, 99, 99));
}

}  // namespace
}  // namespace weft::scene_test
