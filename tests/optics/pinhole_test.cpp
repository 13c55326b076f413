#include "weft/optics/pinhole.h"

#include <gmock/gmock.h>

#include "optics/rigs.h"
#include "weft/base/error.h"

namespace weft::pinhole_test {
namespace {

using ::testing::HasSubstr;
using testing::look_at;

/// Focal length 100 px, middle (320, 240), at the origin, looks along +y, z up.
Projection simple() {
  Projection p;
  p << 100, 320, 0, 0, 0, 240, -100, 0, 0, 1, 0, 0;
  return p;
}

TEST(Pinhole, ProjectsKnownPoints) {
  const Pinhole camera(simple(), {0, 1, 0}, "camera");
  EXPECT_TRUE(camera.project({0, 2, 0}).isApprox(Vec3(320, 240, 2)));
  EXPECT_TRUE(camera.project({1, 2, 0}).isApprox(Vec3(370, 240, 2)));  // right
  EXPECT_TRUE(camera.project({0, 2, 1}).isApprox(Vec3(320, 190, 2)));  // up
  EXPECT_LT(camera.project({0, -3, 0}).z(), 0);
  EXPECT_TRUE(camera.center().isZero(1e-12));
}

TEST(Pinhole, DepthIsInMetresWhateverTheScaleAndSign) {
  for (const double factor : {1.0, 40.0, -0.003}) {
    const Pinhole camera(factor * simple(), {0.1, 2, 0.1}, "camera");
    EXPECT_TRUE(camera.project({1, 2, 0}).isApprox(Vec3(370, 240, 2))) << factor;
    EXPECT_TRUE(camera.projection().isApprox(simple())) << factor;
  }
}

TEST(Pinhole, RayAndUnprojectGoBackThroughThePixel) {
  const Vec3 from(0.3, -1.2, 0.4);
  const Pinhole camera(look_at(from, {0, 0, 0}, 700, {301, 222}), {0, 0, 0}, "camera");
  EXPECT_TRUE(camera.center().isApprox(from, 1e-12));
  for (const Vec2& pixel : {Vec2(301, 222), Vec2(0, 0), Vec2(639.5, 17.25)}) {
    const Vec3 point = camera.unproject(pixel, 1.7);
    EXPECT_TRUE(camera.project(point).isApprox(Vec3(pixel.x(), pixel.y(), 1.7), 1e-12));
    EXPECT_NEAR(camera.ray(pixel).norm(), 1, 1e-12);
    EXPECT_NEAR((point - from).normalized().dot(camera.ray(pixel)), 1, 1e-12);
  }
  EXPECT_TRUE(camera.ray({301, 222}).isApprox((-from).normalized(), 1e-12));
}

template <class Make>
std::string error_of(Make make) {
  try {
    make();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(Pinhole, RejectsWhatIsNoPinhole) {
  Projection singular = simple();
  singular.row(1) = 2 * singular.row(0);
  Projection mirrored = simple();
  mirrored.row(0) = -mirrored.row(0);
  Projection not_finite = simple();
  not_finite(1, 3) = std::nan("");
  const Vec3 front(0, 1, 0);
  const auto made = [&](const Projection& p, const Vec3& point) {
    return error_of([&] { Pinhole(p, point, "projector"); });
  };
  EXPECT_THAT(made(singular, front), HasSubstr("projector: the left 3x3 block"));
  EXPECT_THAT(made(Projection::Zero(), front), HasSubstr("singular"));
  EXPECT_THAT(made(mirrored, front), HasSubstr("mirror image"));
  EXPECT_THAT(made(not_finite, front), HasSubstr("not finite"));
  EXPECT_THAT(made(simple(), {1, 0, 0}), HasSubstr("in the plane"));
  // The point is behind: with the sign turned, the same matrix is a mirror image.
  EXPECT_THAT(made(simple(), {0, -1, 0}), HasSubstr("looks away"));
}

}  // namespace
}  // namespace weft::pinhole_test
