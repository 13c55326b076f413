#include "weft/vision/silhouette.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <string>
#include <vector>

#include "weft/base/error.h"
#include "weft/base/random.h"
#include "weft/mesh/mesh_io.h"
#include "weft/vision/video.h"

namespace weft::silhouette_test {
namespace {

constexpr int kWidth = 320, kHeight = 240;
constexpr double kPeriod = 13;

/// A hung cloth with a sagging top edge, slanted sides and stripes that bend.
struct Scene {
  double bright = 0.6, dark = 0.04;
  double background = 0.002,
         slope = 0;    ///< level, and its change over the frame's width and height
  double shadow = -1;  ///< level of a patch without stripes; < 0: none
  double noise = 0;
};

bool cloth_at(double x, double y) {
  const double left = 70 - 0.06 * (y - 40), right = 250 + 0.09 * (y - 40);
  const double across = std::clamp((x - left) / (right - left), 0.0, 1.0);
  const double top = 38 + 34 * std::sin(std::numbers::pi * across);
  const double bottom = 203 + 5 * std::sin(7 * across);
  return x > left && x < right && y > top && y < bottom;
}

double light_at(const Scene& scene, double x, double y) {
  if (!cloth_at(x, y)) {
    const double u = x / kWidth, v = y / kHeight;
    return scene.background + scene.slope * (u + 0.5 * v - u * u);
  }
  if (scene.shadow >= 0 && std::hypot((x - 150) / 1.6, y - 95) < 16) return scene.shadow;
  const double shade = 0.65 + 0.35 * std::cos((x - 100) / 40);
  const double stripe = std::sin(2 * std::numbers::pi * (y + 4 * std::sin(x / 30)) / kPeriod);
  return shade * (stripe > 0 ? scene.bright : scene.dark);
}

struct Picture {
  Image image;
  Mask cloth;
};

Picture make_picture(const Scene& scene, std::uint64_t seed = 1) {
  constexpr int points = 4;
  Rng random(seed);
  Picture picture{Image(kHeight, kWidth), Mask(kHeight, kWidth)};
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) {
      double light = 0;
      int inside = 0;
      for (int k = 0; k < points * points; ++k) {
        const double px = x + (k % points + 0.5) / points;
        const double py = y + (double(k / points) + 0.5) / points;
        light += light_at(scene, px, py);
        inside += cloth_at(px, py) ? 1 : 0;
      }
      light = light / (points * points) + scene.noise * random.normal();
      picture.image(y, x) = float(std::max(light, 0.0));
      picture.cloth(y, x) = 2 * inside >= points * points ? 1 : 0;
    }
  return picture;
}

double overlap(const Mask& a, const Mask& b) {
  return (a * b).cast<double>().sum() / a.max(b).cast<double>().sum();
}

/// First and last cloth pixel along a row.
std::array<int, 2> ends(const Mask& mask, int row) {
  std::array<int, 2> ends{-1, -1};
  for (int x = 0; x < mask.cols(); ++x)
    if (mask(row, x) != 0) {
      if (ends[0] < 0) ends[0] = x;
      ends[1] = x;
    }
  return ends;
}

struct Distances {
  double sides = 0;  ///< mean over rows between the corners and the bottom, px
  double top = 0;    ///< mean over columns of the middle
  double bottom = 0;
};

Distances edge_distances(const Mask& found, const Mask& truth) {
  Distances distances;
  int rows = 0;
  for (int y = 80; y < 190; ++y, ++rows)
    for (std::size_t side = 0; side < 2; ++side)
      distances.sides += 0.5 * std::abs(ends(found, y)[side] - ends(truth, y)[side]);
  distances.sides /= rows;
  const Mask turned_found = found.transpose(), turned_truth = truth.transpose();
  int columns = 0;
  for (int x = 90; x < 230; ++x, ++columns) {
    distances.top += std::abs(ends(turned_found, x)[0] - ends(turned_truth, x)[0]);
    distances.bottom += std::abs(ends(turned_found, x)[1] - ends(turned_truth, x)[1]);
  }
  distances.top /= columns;
  distances.bottom /= columns;
  return distances;
}

void expect_found(const Scene& scene, const std::string& name, double least_overlap,
                  double most_sides, double most_ends) {
  const Picture picture = make_picture(scene);
  const SilhouetteResult result = find_silhouette(picture.image, {kPeriod});
  const Distances distances = edge_distances(result.silhouette, picture.cloth);
  EXPECT_GT(overlap(result.silhouette, picture.cloth), least_overlap) << name;
  EXPECT_LT(distances.sides, most_sides) << name;
  EXPECT_LT(distances.top, most_ends) << name;
  EXPECT_LT(distances.bottom, most_ends) << name;
  EXPECT_GT(result.confidence, 3) << name;
}

TEST(Silhouette, OnADarkBackground) {
  expect_found({}, "clean", 0.985, 1, 1);
  expect_found({.noise = 0.005}, "noise", 0.985, 1, 1);
  expect_found({.dark = 0.02, .shadow = 0.02, .noise = 0.002}, "shadow", 0.985, 1, 1);
}

TEST(Silhouette, OnAMildlyBrightBackground) {
  // Where dark stripes equal the background, the outermost of them cannot be seen: up to half a
  // stripe is lost at the top and bottom.
  expect_found({.dark = 0.04, .background = 0.06, .slope = 0.06, .noise = 0.004}, "brighter", 0.95,
               1.5, 0.5 * kPeriod);
  expect_found({.dark = 0.05, .background = 0.04, .noise = 0.004}, "the same", 0.95, 1.5,
               0.5 * kPeriod);
  expect_found({.dark = 0.02, .background = 0.15, .slope = 0.1, .shadow = 0.03, .noise = 0.01},
               "much brighter", 0.95, 1.5, 0.5 * kPeriod);
}

TEST(Silhouette, DoesNotDependOnExposure) {
  const Picture picture = make_picture({.background = 0.02, .slope = 0.02, .noise = 0.002});
  const Mask once = find_silhouette(picture.image, {kPeriod}).silhouette;
  const Mask half = find_silhouette(Image(0.5f * picture.image), {kPeriod}).silhouette;
  EXPECT_GT(overlap(once, half), 0.999);
}

TEST(Silhouette, ReportsWhenThereIsNoCloth) {
  Rng random(11);
  for (const double level : {0.0, 0.05, 0.2})
    for (const double noise : {0.0, 0.01}) {
      Image image(kHeight, kWidth);
      for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth; ++x)
          image(y, x) =
              float(std::max(0.0, level * (1 + 0.3 * x / kWidth) + noise * random.normal()));
      const SilhouetteResult result = find_silhouette(image, {kPeriod});
      EXPECT_LT(result.confidence, 3) << level << " " << noise;
      EXPECT_EQ(result.silhouette.cast<int>().sum(), 0) << level << " " << noise;
    }
}

TEST(Silhouette, IgnoresSmallBrightThings) {
  Picture picture = make_picture({.noise = 0.002});
  picture.image.block(10, 290, 12, 12).setConstant(0.9f);
  const SilhouetteResult result = find_silhouette(picture.image, {kPeriod});
  EXPECT_EQ(result.silhouette.block(5, 280, 25, 35).cast<int>().sum(), 0);
  EXPECT_GT(overlap(result.silhouette, picture.cloth), 0.985);
}

TEST(Silhouette, RefusesWrongOptions) {
  EXPECT_THROW(find_silhouette(Image::Zero(20, 20), {1}), Error);
  EXPECT_THROW(find_silhouette(Image::Zero(20, 20), {500}), Error);
  EXPECT_THROW(find_silhouette(Image(0, 0), {17}), Error);
}

/// Camera of data/captures/cotton_waving_A.
Projection bundled_camera() {
  Projection projection;
  projection << 891.159136516144, 343.53024806944643, -14.911809586536997, 491.5784543127535,
      -5.272787254399174, 197.729522039969, -910.2061490829509, 1024.9701138164903,
      -0.026628231404530328, 0.9985586776698873, -0.046599404957928116, 1.5361826697273546;
  return projection;
}

/// Pixels whose centre lies in a projected triangle.
Mask project_silhouette(const ObjMesh& mesh, const Points& x, int width, int height) {
  const Eigen::Matrix3Xd image = bundled_camera() * x.colwise().homogeneous();
  Mask mask = Mask::Zero(height, width);
  for (const auto& triangle : mesh.triangles) {
    std::array<Vec2, 3> corner;
    for (std::size_t k = 0; k < 3; ++k) corner[k] = image.col(triangle[k]).hnormalized();
    const auto cross = [](const Vec2& a, const Vec2& b) { return a.x() * b.y() - a.y() * b.x(); };
    const Vec2 low = corner[0].cwiseMin(corner[1]).cwiseMin(corner[2]);
    const Vec2 high = corner[0].cwiseMax(corner[1]).cwiseMax(corner[2]);
    const double sign = cross(corner[1] - corner[0], corner[2] - corner[0]) < 0 ? -1 : 1;
    for (int y = std::max(0, int(low.y()) - 1); y < std::min<double>(height, high.y() + 1); ++y)
      for (int px = std::max(0, int(low.x()) - 1); px < std::min<double>(width, high.x() + 1);
           ++px) {
        const Vec2 center(px + 0.5, y + 0.5);
        bool inside = true;
        for (std::size_t k = 0; k < 3; ++k)
          inside = inside && sign * cross(corner[(k + 1) % 3] - corner[k], center - corner[k]) >= 0;
        if (inside) mask(y, px) = 1;
      }
  }
  return mask;
}

TEST(Silhouette, OfTheBundledCaptureMatchesItsTrueSurface) {
  const std::filesystem::path folder =
      std::filesystem::path(WEFT_SOURCE_DIR) / "data/captures/cotton_waving_A";
  const Image frame = read_frames(folder / "video.mp4", 1).front();
  const SilhouetteResult result = find_silhouette(frame, {});
  const ObjMesh mesh = read_obj(folder / "truth/rest.obj");
  const PointCache truth = read_pc2(folder / "truth/points.pc2");
  const Mask expected =
      project_silhouette(mesh, truth.frames.front(), int(frame.cols()), int(frame.rows()));
  EXPECT_GT(overlap(result.silhouette, expected), 0.985);
  EXPECT_GT(result.confidence, 20);
}

}  // namespace
}  // namespace weft::silhouette_test
