#include "weft/optics/render.h"

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <numbers>

#include "optics/rigs.h"
#include "weft/base/error.h"

namespace weft::render_test {
namespace {

using testing::on_plane;
using testing::small_rig;

/// A flat rectangle: u along `right`, v along `down` (unit vectors), around `centre`.
struct Sheet {
  Vec3 centre{0, 0, 0};
  Vec3 right{1, 0, 0};
  Vec3 down{0, 0, -1};
  double width = 0.16, height = 0.12;

  Vec3 normal() const { return right.cross(down).normalized(); }
  Points at(const TriangleMesh& mesh) const {
    Points x(3, mesh.vertex_count());
    for (int v = 0; v < mesh.vertex_count(); ++v)
      x.col(v) = centre + (mesh.material(0, v) - width / 2) * right +
                 (mesh.material(1, v) - height / 2) * down;
    return x;
  }
  TriangleMesh mesh() const { return make_swatch(width, height, 5, 4); }
  /// Within the rectangle, shrunk by `margin` (m).
  bool holds(const Vec3& point, double margin) const {
    const Vec3 d = point - centre;
    return std::abs(d.dot(right)) < width / 2 - margin &&
           std::abs(d.dot(down)) < height / 2 - margin;
  }
};

/// Leaning back and to the side by about 30 degrees, turned in its plane.
Sheet tilted() {
  const Eigen::Matrix3d turn =
      (Eigen::AngleAxisd(0.5, Vec3(0, 0, 1)) * Eigen::AngleAxisd(0.35, Vec3(1, 0, 0)) *
       Eigen::AngleAxisd(0.3, Vec3(0, 1, 0)))
          .toRotationMatrix();
  Sheet sheet;
  sheet.right = turn * sheet.right;
  sheet.down = turn * sheet.down;
  return sheet;
}

/// Several meshes as one, in this order.
struct Assembly {
  TriangleMesh mesh;
  Points x;
  void add(const Sheet& sheet) {
    const TriangleMesh part = sheet.mesh();
    const int before = mesh.vertex_count();
    mesh.material.conservativeResize(2, before + part.vertex_count());
    mesh.material.rightCols(part.vertex_count()) = part.material;
    x.conservativeResize(3, before + part.vertex_count());
    x.rightCols(part.vertex_count()) = sheet.at(part);
    for (const auto& [a, b, c] : part.triangles)
      mesh.triangles.push_back({a + before, b + before, c + before});
  }
};

RenderedFrame render(const Rig& rig, const TriangleMesh& mesh, const Points& x,
                     const RenderOptions& options = {}) {
  Renderer renderer(rig, mesh, options);
  return renderer.render(x);
}

RenderedFrame render(const Rig& rig, const Sheet& sheet, const RenderOptions& options = {}) {
  const TriangleMesh mesh = sheet.mesh();
  return render(rig, mesh, sheet.at(mesh), options);
}

Rig without_stripes() {
  Rig rig = small_rig();
  rig.pattern.black_level = 1;
  return rig;
}

template <class Visit>
void for_each_pixel(const Rig& rig, Visit visit) {
  for (int i = 0; i < rig.height; ++i)
    for (int j = 0; j < rig.width; ++j) visit(i, j, Vec2(j + 0.5, i + 0.5));
}

double rms_difference(const Image& a, const Image& b) {
  return std::sqrt((a - b).cast<double>().square().mean());
}

TEST(Renderer, DepthAndProjectorRowOfATiltedPlane) {
  const Rig rig = small_rig();
  const Sheet sheet = tilted();
  for (const int samples : {1, 2, 3}) {
    RenderOptions options;
    options.projector_row = true;
    options.supersampling = samples;
    const RenderedFrame frame = render(rig, sheet, options);
    int compared = 0;
    for_each_pixel(rig, [&](int i, int j, const Vec2& pixel) {
      const Vec3 point = on_plane(rig.camera.projection(), pixel, sheet.centre, sheet.normal());
      if (!sheet.holds(point, 0)) return;
      if (sheet.holds(point, 2e-3)) {
        ASSERT_EQ(frame.silhouette(i, j), 1);
      }
      if (!frame.silhouette(i, j)) return;
      ++compared;
      // Float: 2^-24 of 1 m and of 220 rows, times the few operations and the gradients.
      ASSERT_NEAR(frame.depth(i, j), rig.camera.project(point).z(), 5e-6);
      ASSERT_NEAR(frame.projector_row(i, j), rig.projector.project(point).y(), 2e-3);
    });
    EXPECT_GT(compared, 3000);
  }
}

TEST(Renderer, IntensityIsLambertsCosine) {
  const Rig rig = without_stripes();
  for (const Sheet& sheet : {Sheet(), tilted()}) {
    const RenderedFrame frame = render(rig, sheet);
    for_each_pixel(rig, [&](int i, int j, const Vec2& pixel) {
      const Vec3 point = on_plane(rig.camera.projection(), pixel, sheet.centre, sheet.normal());
      if (!sheet.holds(point, 3e-3)) return;
      const Vec3 to_projector = (rig.projector.center() - point).normalized();
      const double cosine = std::abs(to_projector.dot(sheet.normal()));
      ASSERT_NEAR(frame.intensity(i, j), 0.8 * (0.05 + cosine), 1e-4);
    });
  }
}

/// Continuous y at which the light of edge `row` (projector) crosses column x of the image of a
/// plane.
double edge_in_image(const Rig& rig, const Sheet& sheet, double x, double row) {
  double top = -200, bottom = 400;  // the projector's row grows downwards
  for (int k = 0; k < 60; ++k) {
    const double y = (top + bottom) / 2;
    const Vec3 point = on_plane(rig.camera.projection(), {x, y}, sheet.centre, sheet.normal());
    (rig.projector.project(point).y() < row ? top : bottom) = y;
  }
  return top;
}

TEST(Renderer, StripeEdgesAreWhereTheLightPlanesMeetTheSurface) {
  const Rig rig = small_rig();
  const Sheet sheet = tilted();
  for (const bool filter : {true, false}) {
    RenderOptions options;
    options.ambient = 0;
    options.filter_stripes = filter;
    options.supersampling = filter ? 2 : 6;
    const RenderedFrame frame = render(rig, sheet, options);
    // Divided by the light without stripes, the level at an edge is the mean of dark and bright.
    const RenderedFrame white = render(without_stripes(), sheet, options);
    const double level = (1 + rig.pattern.black_level) / 2;
    int edges = 0;
    double sum = 0;
    for (int j = 0; j < rig.width; ++j)
      for (int i = 4; i + 2 <= rig.height; ++i) {
        if (!(frame.silhouette.block(i - 4, j, 6, 1) > 0).all()) continue;
        const double above = frame.intensity(i - 1, j) / white.intensity(i - 1, j) - level;
        const double below = frame.intensity(i, j) / white.intensity(i, j) - level;
        if ((above > 0) == (below > 0)) continue;
        const double y = i - 0.5 + above / (above - below);
        const Vec3 seen =
            on_plane(rig.camera.projection(), {j + 0.5, y}, sheet.centre, sheet.normal());
        if (!sheet.holds(seen, 6e-3)) continue;
        const double half = rig.pattern.period / 2;
        const double row = half * std::round(rig.projector.project(seen).y() / half);
        const double error = y - edge_in_image(rig, sheet, j + 0.5, row);
        ASSERT_NEAR(error, 0, 0.05) << "row " << i << " column " << j << " filter " << filter;
        sum += error;
        ++edges;
      }
    EXPECT_GT(edges, 300);
    EXPECT_NEAR(sum / edges, 0, 0.005);
  }
}

TEST(Renderer, SilhouetteHasTheAreaOfTheProjectedPolygon) {
  const Rig rig = small_rig();
  const Sheet sheet = tilted();
  std::array<Vec2, 4> corners;
  for (int k = 0; k < 4; ++k) {
    const double s = k == 1 || k == 2 ? 0.5 : -0.5, t = k >= 2 ? 0.5 : -0.5;
    corners[k] =
        rig.camera
            .project(sheet.centre + s * sheet.width * sheet.right + t * sheet.height * sheet.down)
            .head<2>();
  }
  double area = 0, perimeter = 0;
  for (int k = 0; k < 4; ++k) {
    const Vec2 &a = corners[k], &b = corners[(k + 1) % 4];
    area += (a.x() * b.y() - a.y() * b.x()) / 2;
    perimeter += (b - a).norm();
  }
  for (const int samples : {1, 2, 3, 4}) {
    RenderOptions options;
    options.supersampling = samples;
    const RenderedFrame frame = render(rig, sheet, options);
    // A twentieth of a pixel along the rim: a rim shifted by half a sample would show.
    EXPECT_NEAR(frame.silhouette.cast<double>().sum(), std::abs(area), 0.05 * perimeter) << samples;
  }
}

TEST(Renderer, PartlyCoveredPixelsMixWithTheBackground) {
  Rig rig = without_stripes();
  Sheet sheet;
  sheet.width = 0.1005;  // ends a quarter of a pixel beyond a column: 500 px / m at 1 m
  sheet.centre = Vec3(0.00025, 0, 0);
  RenderOptions options;
  options.supersampling = 4;
  options.background = 0.5;
  const RenderedFrame frame = render(rig, sheet, options);
  const float inside = frame.intensity(60, 104), rim = frame.intensity(60, 105);
  EXPECT_NEAR(rim, 0.25 * inside + 0.75 * 0.5, 1e-3);
  EXPECT_EQ(frame.silhouette(60, 105), 0);
  EXPECT_EQ(frame.depth(60, 105), 0);
  EXPECT_EQ(frame.intensity(60, 106), 0.5f);
}

TEST(Renderer, ASheetCastsItsShadowOnAnother) {
  const Rig rig = without_stripes();
  Sheet back;
  back.width = 0.3, back.height = 0.22;
  Sheet front;
  front.width = 0.05, front.height = 0.06;
  front.centre = Vec3(-0.08, -0.15, 0.02);
  Assembly scene;
  scene.add(back);
  scene.add(front);
  RenderOptions options;
  options.projector_row = true;
  const RenderedFrame frame = render(rig, scene.mesh, scene.x, options);
  options.shadows = false;
  const RenderedFrame lit = render(rig, scene.mesh, scene.x, options);

  const Projection& camera = rig.camera.projection();
  const Vec3 lamp = rig.projector.center();
  const auto shadowed = [&](const Vec2& pixel) {
    const Vec3 point = on_plane(camera, pixel, back.centre, back.normal());
    const double along = (front.centre.y() - point.y()) / (lamp.y() - point.y());
    return front.holds(point + along * (lamp - point), 0);
  };
  int dark = 0;
  for_each_pixel(rig, [&](int i, int j, const Vec2& pixel) {
    if (!(frame.depth(i, j) > 0.95f)) return;  // not the back sheet
    // A texel is a projector pixel, here 0.84 of the camera's; two of them decide.
    const bool expected = shadowed(pixel);
    for (int k = 0; k < 9; ++k)
      if (shadowed(pixel + 2 * Vec2(k / 3 - 1, k % 3 - 1)) != expected) return;
    ASSERT_EQ(std::isnan(frame.projector_row(i, j)), expected) << i << " " << j;
    ASSERT_NEAR(frame.intensity(i, j), expected ? 0.8 * 0.05 : lit.intensity(i, j), 1e-6);
    dark += expected;
  });
  EXPECT_GT(dark, 500);

  // The shadow's right and lower edges, from the light missing in whole rows and columns.
  const auto missing = [&](int i, int j) {
    return (lit.intensity(i, j) - frame.intensity(i, j)) / (lit.intensity(i, j) - 0.04);
  };
  const auto image_of_edge = [&](const Vec3& edge) {
    const double along = (back.centre.y() - lamp.y()) / (edge.y() - lamp.y());
    return rig.camera.project(lamp + along * (edge - lamp));
  };
  const Vec3 right = image_of_edge(front.centre + Vec3(0.025, 0, 0));
  const Vec3 bottom = image_of_edge(front.centre - Vec3(0, 0, 0.03));
  const int row = static_cast<int>(right.y()), column = static_cast<int>(bottom.x());
  const int first_column = static_cast<int>(right.x()) - 4;
  const int first_row = static_cast<int>(bottom.y()) - 4;
  double x = first_column, y = first_row;
  for (int k = 0; k < 8; ++k) {
    x += missing(row, first_column + k);
    y += missing(first_row + k, column);
  }
  EXPECT_NEAR(x, right.x(), 0.5);  // half a texel
  EXPECT_NEAR(y, bottom.y(), 0.5);
}

TEST(Renderer, ACurvedSheetDoesNotShadowItselfWhereItIsLit) {
  // A cylinder convex to camera and projector.
  const Rig rig = without_stripes();
  const TriangleMesh mesh = make_swatch(0.2, 0.15, 15, 5);
  Points x(3, mesh.vertex_count());
  for (int v = 0; v < mesh.vertex_count(); ++v) {
    const double angle = (mesh.material(0, v) - 0.1) / 0.07;
    x.col(v) = Vec3(0.07 * std::sin(angle), -0.07 * std::cos(angle), 0.075 - mesh.material(1, v));
  }
  RenderOptions options;
  const Image with = render(rig, mesh, x, options).intensity;
  options.shadows = false;
  const Image without = render(rig, mesh, x, options).intensity;
  // Light that falls at less than 8 degrees to the surface may be cut by its neighbourhood.
  const float grazing = 0.8f * (0.05f + 0.14f);
  EXPECT_GT((without > grazing).count(), 2000);
  EXPECT_LT((without > grazing).select((with - without).abs(), 0.0f).maxCoeff(), 1e-6);
  EXPECT_LT((with - without).abs().maxCoeff(), 0.14f);
}

TEST(Renderer, BothSidesAreAlike) {
  const Rig rig = small_rig();
  const Sheet front = tilted();
  Sheet back = front;
  back.right = -front.right;
  const RenderedFrame a = render(rig, front), b = render(rig, back);
  EXPECT_GT(a.silhouette.cast<int>().sum(), 1000);
  EXPECT_TRUE((a.silhouette == b.silhouette).all());
  EXPECT_LT((a.intensity - b.intensity).abs().maxCoeff(), 2e-3);
}

TEST(Renderer, TheSideAwayFromTheProjectorHasAmbientLightOnly) {
  Rig rig = without_stripes();
  rig.projector =
      Pinhole(testing::look_at({0.1, 1, 0.1}, {0, 0, 0}, 700, {150, 110}), {0, 0, 0}, "projector");
  const RenderedFrame frame = render(rig, Sheet());
  EXPECT_NEAR(frame.intensity(60, 80), 0.8 * 0.05, 1e-6);
}

TEST(Renderer, TheNearerSheetHidesTheOther) {
  const Rig rig = small_rig();
  Sheet near = tilted(), far;
  near.centre = Vec3(0.02, -0.2, 0);
  far.centre = Vec3(-0.02, 0.1, 0.01);
  Assembly one, other;
  one.add(near), one.add(far);
  other.add(far), other.add(near);
  const RenderedFrame a = render(rig, one.mesh, one.x), b = render(rig, other.mesh, other.x);
  EXPECT_TRUE((a.depth == b.depth).all());
  EXPECT_TRUE((a.intensity == b.intensity).all());
  const Image alone = render(rig, near).depth;
  for_each_pixel(rig, [&](int i, int j, const Vec2&) {
    if (alone(i, j) > 0) {
      ASSERT_EQ(a.depth(i, j), alone(i, j));
    }
  });
  EXPECT_NEAR(a.depth.maxCoeff(), 1.1, 1e-5);  // some of the far one is seen
}

TEST(Renderer, DepthOfASphereIsNearerThanThatOfItsFacets) {
  Rig rig = small_rig();
  const TriangleMesh mesh = make_swatch(0.16, 0.12, 9, 7);
  const Vec3 centre(0, 0.2, 0);
  Points x(3, mesh.vertex_count());
  for (int v = 0; v < mesh.vertex_count(); ++v)
    x.col(v) =
        centre +
        0.2 * Vec3(mesh.material(0, v) - 0.08, -0.2, 0.06 - mesh.material(1, v)).normalized();
  const auto error = [&](int subdivision) {
    RenderOptions options;
    options.subdivision = subdivision;
    const RenderedFrame frame = render(rig, mesh, x, options);
    double sum = 0;
    int count = 0;
    for_each_pixel(rig, [&](int i, int j, const Vec2& pixel) {
      const Vec3 direction = rig.camera.ray(pixel), to_centre = centre - rig.camera.center();
      const double half = direction.dot(to_centre);
      const double root = half * half - to_centre.squaredNorm() + 0.2 * 0.2;
      if (root <= 0) return;
      const Vec3 point = rig.camera.center() + (half - std::sqrt(root)) * direction;
      // Inside the swatch by more than a cell.
      if (std::abs(point.x()) > 0.045 || std::abs(point.z()) > 0.03) return;
      const double d = frame.depth(i, j) - rig.camera.project(point).z();
      sum += d * d;
      ++count;
    });
    return std::sqrt(sum / count);
  };
  const double facets = error(1);
  // Cells of 2 cm: the sagitta h^2 / (8 r) is 0.25 mm along an edge, so facets miss by 0.1 to 0.5
  // mm.
  EXPECT_GT(facets, 1e-4);
  EXPECT_LT(facets, 5e-4);
  // Pieces of a third of the edge miss by a ninth of it.
  EXPECT_LT(error(3), 0.15 * facets);
  EXPECT_LT(error(8), 0.04 * facets);
}

TEST(Renderer, LeavesOutWhatIsBehindTheCamera) {
  const Rig rig = small_rig();
  // A floor that runs from in front of the camera to behind it.
  Sheet floor;
  floor.down = Vec3(0, -1, 0);
  floor.centre = Vec3(0, -0.6, -0.05);
  floor.height = 3;
  const RenderedFrame frame = render(rig, floor);
  EXPECT_TRUE(frame.intensity.allFinite());
  EXPECT_GT(frame.silhouette.cast<int>().sum(), 500);
  EXPECT_EQ(frame.silhouette.topRows(60).cast<int>().sum(), 0);  // the horizon
  EXPECT_TRUE((frame.depth >= 0).all());

  Sheet behind;
  behind.centre = Vec3(0, -2, 0);
  EXPECT_EQ(render(rig, behind).silhouette.cast<int>().sum(), 0);
  Sheet at_the_centre;
  at_the_centre.centre = Vec3(0, -1, 0);
  EXPECT_EQ(render(rig, at_the_centre).silhouette.cast<int>().sum(), 0);
  Sheet aside;
  aside.centre = Vec3(5, 0, 0);
  EXPECT_EQ(render(rig, aside).silhouette.cast<int>().sum(), 0);
}

TEST(Renderer, WhatIsBehindTheProjectorIsNotLit) {
  Rig rig = without_stripes();
  rig.projector =
      Pinhole(testing::look_at({0, 0.2, 0}, {0, 1, 0}, 700, {150, 110}), {0, 1, 0}, "projector");
  const RenderedFrame frame = render(rig, Sheet());
  EXPECT_EQ(frame.silhouette(60, 80), 1);
  EXPECT_NEAR(frame.intensity(60, 80), 0.8 * 0.05, 1e-6);
}

TEST(Renderer, TheProjectorsImageEndsAtItsBorder) {
  Rig rig = without_stripes();
  rig.projector_width = 150, rig.projector_height = 1000;  // its axis meets the origin at x = 150
  Sheet sheet;
  RenderOptions options;
  options.projector_row = true;
  const RenderedFrame frame = render(rig, sheet, options);
  for_each_pixel(rig, [&](int i, int j, const Vec2& pixel) {
    const Vec3 point = on_plane(rig.camera.projection(), pixel, sheet.centre, sheet.normal());
    const double x = rig.projector.project(point).x();
    if (!sheet.holds(point, 3e-3) || std::abs(x - 150) < 0.01) return;
    ASSERT_EQ(std::isnan(frame.projector_row(i, j)), x > 150);
    if (x > 151) {
      ASSERT_NEAR(frame.intensity(i, j), 0.8 * 0.05, 1e-6);
    }
  });
}

TEST(Renderer, PointsThatAreNotFiniteAreLeftOut) {
  const Rig rig = small_rig();
  const Sheet sheet;
  const TriangleMesh mesh = sheet.mesh();
  Points x = sheet.at(mesh);
  x(1, 0) = std::nan("");
  x(2, 19) = std::numeric_limits<double>::infinity();
  const RenderedFrame frame = render(rig, mesh, x);
  EXPECT_TRUE(frame.intensity.allFinite());
  EXPECT_TRUE(frame.depth.allFinite());
  EXPECT_EQ(frame.silhouette(60, 80), 1);
  x.setConstant(std::nan(""));
  EXPECT_EQ(render(rig, mesh, x).silhouette.cast<int>().sum(), 0);
}

TEST(Renderer, SupersamplingConvergesAndFilteringStartsNearer) {
  const Rig rig = small_rig();
  const Sheet sheet = tilted();
  enum class Stripes { sampled, filtered };
  const auto image = [&](int samples, Stripes stripes) {
    RenderOptions options;
    options.supersampling = samples;
    options.filter_stripes = stripes == Stripes::filtered;
    return render(rig, sheet, options).intensity;
  };
  const Image reference = image(8, Stripes::sampled);
  const auto error = [&](int samples, Stripes stripes) {
    // Without the rim: stripes only.
    return rms_difference(image(samples, stripes).block(45, 60, 30, 40),
                          reference.block(45, 60, 30, 40));
  };
  EXPECT_LT(error(2, Stripes::sampled), 0.6 * error(1, Stripes::sampled));
  EXPECT_LT(error(4, Stripes::sampled), 0.6 * error(2, Stripes::sampled));
  EXPECT_LT(error(1, Stripes::filtered), 0.5 * error(2, Stripes::sampled));
}

TEST(Renderer, AFrameDoesNotDependOnTheOneBefore) {
  const Rig rig = small_rig();
  RenderOptions options;
  options.projector_row = true;
  options.background = 0.25;
  const Sheet first;
  Sheet second = tilted(), gone, left, low;
  second.width = first.width, second.height = first.height;
  second.centre = Vec3(0.08, 0.1, 0.05);
  gone.centre = Vec3(0, -3, 0);
  left.centre = Vec3(-0.03, 0.4, 0.03);
  low.centre = Vec3(0.02, 0.3, -0.04);
  const TriangleMesh mesh = first.mesh();
  Renderer renderer(rig, mesh, options);
  for (const Sheet& sheet : {first, second, left, low, left, gone, first}) {
    const RenderedFrame& again = renderer.render(sheet.at(mesh));
    const RenderedFrame fresh = render(rig, mesh, sheet.at(mesh), options);
    EXPECT_TRUE((again.intensity == fresh.intensity).all());
    EXPECT_TRUE((again.silhouette == fresh.silhouette).all());
    EXPECT_TRUE((again.depth == fresh.depth).all());
    EXPECT_TRUE((again.projector_row.isNaN() == fresh.projector_row.isNaN()).all());
  }
}

TEST(Renderer, RejectsBadOptionsAndRigs) {
  const TriangleMesh mesh = Sheet().mesh();
  const auto message = [&](auto change) -> std::string {
    Rig rig = small_rig();
    RenderOptions options;
    change(rig, options);
    try {
      Renderer renderer(rig, mesh, options);
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  };
  using ::testing::HasSubstr;
  using O = RenderOptions;
  EXPECT_EQ(message([](Rig&, O&) {}), "no error");
  EXPECT_THAT(message([](Rig&, O& o) { o.supersampling = 0; }),
              HasSubstr("supersampling is 0; must be 1 to 8"));
  EXPECT_THAT(message([](Rig&, O& o) { o.supersampling = 9; }), HasSubstr("supersampling is 9"));
  EXPECT_THAT(message([](Rig&, O& o) { o.subdivision = 0; }), HasSubstr("subdivision is 0"));
  EXPECT_THAT(message([](Rig&, O& o) { o.ambient = -0.1; }), HasSubstr("ambient is -0.1"));
  EXPECT_THAT(message([](Rig&, O& o) { o.albedo = 1.5; }), HasSubstr("albedo is 1.5"));
  EXPECT_THAT(message([](Rig&, O& o) { o.background = std::nan(""); }), HasSubstr("background"));
  EXPECT_THAT(message([](Rig&, O& o) { o.shadow_bias = 0; }), HasSubstr("shadow_bias is 0"));
  EXPECT_THAT(message([](Rig&, O& o) { o.shadow_scale = 0; }), HasSubstr("shadow_scale is 0"));
  EXPECT_THAT(message([](Rig& r, O&) { r.width = 0; }), HasSubstr("image width is 0"));
  EXPECT_THAT(message([](Rig& r, O&) { r.height = -5; }), HasSubstr("image height is -5"));
  EXPECT_THAT(message([](Rig& r, O&) { r.camera = {}; }), HasSubstr("no camera"));
  EXPECT_THAT(message([](Rig& r, O&) { r.projector = {}; }), HasSubstr("no projector"));
  EXPECT_THAT(message([](Rig& r, O&) { r.projector_width = -1; }), HasSubstr("projector width"));
  EXPECT_THAT(message([](Rig& r, O&) { r.pattern.period = 0; }), HasSubstr("stripe period is 0"));
}

}  // namespace
}  // namespace weft::render_test
