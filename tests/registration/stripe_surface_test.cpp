#include "weft/registration/stripe_surface.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <sstream>

#include "registration/striped_cloth.h"
#include "weft/base/error.h"
#include "weft/base/toml_reader.h"
#include "weft/mesh/mesh_io.h"
#include "weft/vision/silhouette.h"
#include "weft/vision/video.h"

namespace weft::stripe_surface_test {
namespace {

using testing::horizontal_fold;
using testing::kSize;
using testing::striped_frame;
using testing::swatch_scene;
using testing::vertical_folds;
using testing::vertical_rig;

double quantile(std::vector<double> values, double share) {
  const auto k = static_cast<std::size_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(k), values.end());
  return values[k];
}

double mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

/// Distances to a densely sampled surface (to its nearest sample, so never too small).
std::vector<double> distances_to_samples(const Points& points, const Points& samples) {
  std::vector<double> result;
  for (Eigen::Index k = 0; k < points.cols(); ++k) {
    result.push_back(
        std::sqrt((samples.colwise() - points.col(k)).colwise().squaredNorm().minCoeff()));
  }
  return result;
}

/// Depth of the decoded points against the depth that was drawn, where the pixel is one surface.
std::vector<double> depth_errors(const StripePoints& points, const Rig& rig,
                                 const RenderedFrame& frame) {
  std::vector<double> errors;
  for (Eigen::Index k = 0; k < points.pixel.cols(); ++k) {
    const auto row = static_cast<Eigen::Index>(points.pixel(1, k));
    const auto column = static_cast<Eigen::Index>(points.pixel(0, k));
    const auto around = frame.depth.block(row - 1, column - 1, 3, 3);
    if (around.minCoeff() == 0 || around.maxCoeff() - around.minCoeff() > 0.02f) continue;
    errors.push_back(
        std::abs(rig.camera.project(points.position.col(k)).z() - frame.depth(row, column)));
  }
  return errors;
}

TEST(DecodeStripes, PointsLieOnTheSurface) {
  const Rig rig = vertical_rig();
  const RenderedFrame frame = striped_frame(rig, vertical_folds, 0.6, 0.01);
  const Scene scene = swatch_scene(5, vertical_folds, 0.6);
  const StripePoints points = decode_stripes(frame.intensity, frame.silhouette, rig, scene);
  const std::vector<double> errors = depth_errors(points, rig, frame);
  // The swatch spans about 240 columns with some 27 edges each.
  EXPECT_GT(points.pixel.cols(), 4500);
  // A tenth of a pixel is 0.75 mm of depth; a pixel of height on the steepest flank another 0.3 mm.
  EXPECT_LT(quantile(errors, 0.5), 0.75e-3);
  EXPECT_LT(quantile(errors, 0.95), 3e-3);
  // The wrong index is off by 128 mm.
  EXPECT_LT(quantile(errors, 0.999), 0.02);
}

TEST(DecodeStripes, FillsDepthBetweenEdges) {
  const Rig rig = vertical_rig();
  const RenderedFrame frame = striped_frame(rig, vertical_folds, 0.6, 0.01);
  const Scene scene = swatch_scene(5, vertical_folds, 0.6);
  const StripePoints points = decode_stripes(frame.intensity, frame.silhouette, rig, scene);
  std::vector<double> errors;
  for (Eigen::Index k = 0; k < points.depth.size(); ++k) {
    if (points.depth.data()[k] == 0 || frame.depth.data()[k] == 0) continue;
    errors.push_back(std::abs(points.depth.data()[k] - frame.depth.data()[k]));
  }
  EXPECT_GT(static_cast<double>(errors.size()),
            0.8 * static_cast<double>((frame.silhouette != 0).count()));
  EXPECT_LT(quantile(errors, 0.5), 1e-3);
}

TEST(DecodeStripes, CountsRightAcrossAFoldWithItsShadow) {
  const Rig rig = vertical_rig();
  const RenderedFrame frame = striped_frame(rig, horizontal_fold, 1.25, 0.01);
  // The fold does cast a shadow, or this would test nothing.
  ASSERT_GT((frame.silhouette != 0 && frame.projector_row.isNaN()).count(), 300);
  const Scene scene = swatch_scene(5, horizontal_fold, 1.25);
  const StripePoints points = decode_stripes(frame.intensity, frame.silhouette, rig, scene);
  const std::vector<double> errors = depth_errors(points, rig, frame);
  EXPECT_LT(quantile(errors, 0.5), 1e-3);
  // The two rims of the shadow look like edges of a dark stripe: 2 of some 27 edges on most
  // columns. A wrong index on either side of the fold would put half of the points 128 mm off.
  EXPECT_LT(quantile(errors, 0.93), 0.02);
  // Both sides of the fold were reached.
  Eigen::Index above = 0, below = 0;
  for (Eigen::Index k = 0; k < points.position.cols(); ++k) {
    above += points.position(2, k) > -0.10;
    below += points.position(2, k) < -0.25;
  }
  EXPECT_GT(above, 500);
  EXPECT_GT(below, 500);
}

TEST(DecodeStripes, TheProjectorMayBeUpsideDown) {
  Rig rig = vertical_rig();
  Projection turned = rig.projector.projection();
  turned.row(0) = 1280 * turned.row(2) - turned.row(0);
  turned.row(1) = 800 * turned.row(2) - turned.row(1);
  rig.projector = Pinhole(turned, Vec3(0, 0, -0.2), "projector");
  const RenderedFrame frame = striped_frame(rig, vertical_folds, 0.6, 0.01);
  const Scene scene = swatch_scene(5, vertical_folds, 0.6);
  const StripePoints points = decode_stripes(frame.intensity, frame.silhouette, rig, scene);
  const std::vector<double> errors = depth_errors(points, rig, frame);
  ASSERT_GT(errors.size(), 4000u);
  EXPECT_LT(quantile(errors, 0.5), 0.75e-3);
}

TEST(DecodeStripes, RejectsAMaskOfAnotherSize) {
  const Rig rig = vertical_rig();
  EXPECT_THROW(decode_stripes(Image::Zero(480, 480), Mask::Zero(480, 479), rig,
                              swatch_scene(5, vertical_folds, 0.6)),
               Error);
}

TEST(FitSurface, FindsVerticalFolds) {
  const Rig rig = vertical_rig();
  const RenderedFrame frame = striped_frame(rig, vertical_folds, 0.6, 0.01);
  const Scene scene = swatch_scene(17, vertical_folds, 0.6);
  const StripePoints points = decode_stripes(frame.intensity, frame.silhouette, rig, scene);
  const SurfaceFit fit = fit_surface(points, frame.silhouette, rig, scene);
  EXPECT_TRUE(fit.usable) << fit.note;
  EXPECT_EQ(fit.points, points.pixel.cols());
  EXPECT_TRUE(fit.others.empty());
  EXPECT_GT((fit.support.array() > 0).count(), 0.8 * scene.mesh.vertex_count());

  const Points truth = vertical_folds(scene.mesh.material, 0.6);
  const VecX same_uv = (fit.x - truth).colwise().norm();
  // Chords of 25 mm sag by 25^2 / (8 R) = 1.5 mm where the folds are tightest (R = 53 mm).
  EXPECT_LT(fit.residual_median, 1e-3);
  EXPECT_LT(same_uv.mean(), 4e-3);
  EXPECT_LT(same_uv.maxCoeff(), 0.02);
  const TriangleMesh dense = make_swatch(kSize, kSize, 161, 161);
  const std::vector<double> nearest =
      distances_to_samples(fit.x, vertical_folds(dense.material, 0.6));
  // To samples 2.5 mm apart: up to 1.8 mm of the distance is along the surface.
  EXPECT_LT(quantile(nearest, 0.5), 2e-3);

  // Fixtures stay where they are held.
  for (const PointFixture& fixture : scene.fixtures) {
    EXPECT_LT((fit.x.col(fixture.vertex) - fixture.motion.position(0)).norm(), 1e-12);
  }
}

TEST(FitSurface, BridgesAFoldAndItsShadow) {
  const Rig rig = vertical_rig();
  const RenderedFrame frame = striped_frame(rig, horizontal_fold, 1.25, 0.01);
  const Scene scene = swatch_scene(17, horizontal_fold, 1.25);
  const StripePoints points = decode_stripes(frame.intensity, frame.silhouette, rig, scene);
  const SurfaceFit fit = fit_surface(points, frame.silhouette, rig, scene);
  EXPECT_TRUE(fit.usable) << fit.note;
  const VecX same_uv = (fit.x - horizontal_fold(scene.mesh.material, 1.25)).colwise().norm();
  EXPECT_LT(same_uv.mean(), 4e-3);
}

TEST(FitSurface, WithoutStripesSaysSo) {
  const Rig rig = vertical_rig();
  const Scene scene = swatch_scene(9, vertical_folds, 0.6);
  const RenderedFrame frame = striped_frame(rig, vertical_folds, 0.6, 0.0);
  const Image blank = frame.silhouette.cast<float>() * 0.5f;
  for (const Mask& mask : {frame.silhouette, Mask(Mask::Zero(480, 480))}) {
    const StripePoints points = decode_stripes(blank, mask, rig, scene);
    const SurfaceFit fit = fit_surface(points, mask, rig, scene);
    EXPECT_FALSE(fit.usable);
    EXPECT_THAT(fit.note, ::testing::HasSubstr("points were decoded"));
    EXPECT_EQ(fit.x.cols(), scene.mesh.vertex_count());
    EXPECT_TRUE(fit.x.allFinite());
  }
}

/// First frame, rig and truth of the bundled capture, read without the module `capture`.
struct BundledFrame {
  Rig rig;
  Scene scene;
  Image frame;
  TriangleMesh truth_mesh;
  Points truth;
};

BundledFrame read_bundled_frame() {
  const std::filesystem::path folder =
      std::filesystem::path(WEFT_SOURCE_DIR) / "data/captures/cotton_waving_A";
  const TomlTable file = TomlTable::parse_file(folder / "capture.toml");
  BundledFrame bundled;
  const TomlTable camera = file.table("camera"), projector = file.table("projector");
  const Vec3 in_front(0, 0, 0.8);
  bundled.rig.width = camera.integer("width", 1, 10000);
  bundled.rig.height = camera.integer("height", 1, 10000);
  bundled.rig.camera = Pinhole(camera.matrix("projection", 3, 4), in_front, "camera");
  bundled.rig.projector = Pinhole(projector.matrix("projection", 3, 4), in_front, "projector");
  bundled.rig.pattern.period = projector.number("stripe_period", {1, 1000});
  const TomlTable swatch = file.table("swatch");
  bundled.scene.mesh =
      make_swatch(swatch.number("width", {0, 10}), swatch.number("height", {0, 10}), 25, 25);
  bundled.scene.areal_density = swatch.number("areal_density", {0, 10});
  bundled.scene.frame_times = {0};
  std::ifstream corners(folder / "corners.csv");
  std::string line;
  std::getline(corners, line);
  std::getline(corners, line);
  std::replace(line.begin(), line.end(), ',', ' ');
  std::istringstream numbers(line);
  double time = 0;
  Vec3 left, right;
  numbers >> time >> left.x() >> left.y() >> left.z() >> right.x() >> right.y() >> right.z();
  bundled.scene.fixtures = {{"left", 0, Motion::fixed(left)}, {"right", 24, Motion::fixed(right)}};
  bundled.frame = read_frames(folder / "video.mp4", 1).front();
  const ObjMesh rest = read_obj(folder / "truth/rest.obj");
  bundled.truth_mesh = {*rest.texture, rest.triangles};
  bundled.truth = read_pc2(folder / "truth/points.pc2").frames.front();
  return bundled;
}

TEST(FitSurface, FirstFrameOfTheBundledCapture) {
  const BundledFrame bundled = read_bundled_frame();
  const Mask silhouette = find_silhouette(bundled.frame, {}).silhouette;
  const StripePoints points = decode_stripes(bundled.frame, silhouette, bundled.rig, bundled.scene);
  EXPECT_GT(points.pixel.cols(), 7000);

  // The true surface, sampled every 2.5 mm.
  const MaterialLocator locator(bundled.truth_mesh);
  const TriangleMesh dense = make_swatch(0.5, 0.5, 201, 201);
  const Points samples = interpolate(bundled.truth_mesh, locator, bundled.truth, dense.material);
  Points some(3, points.position.cols() / 20);
  for (Eigen::Index k = 0; k < some.cols(); ++k) some.col(k) = points.position.col(20 * k);
  const std::vector<double> decoded = distances_to_samples(some, samples);
  // 1 mm to the surface and, from its nearest sample, at most 1.8 mm along it (0.95 mm in the
  // mean).
  EXPECT_LT(quantile(decoded, 0.5), std::hypot(1e-3, 0.95e-3));
  EXPECT_LT(quantile(decoded, 0.99), 0.02);

  const SurfaceFit fit =
      fit_surface(points, silhouette, bundled.rig, bundled.scene, {.others = true});
  EXPECT_TRUE(fit.usable) << fit.note;
  EXPECT_LT(fit.residual_median, 1e-3);
  std::vector<double> same_uv;
  const Points expected =
      interpolate(bundled.truth_mesh, locator, bundled.truth, bundled.scene.mesh.material);
  for (Eigen::Index v = 0; v < expected.cols(); ++v) {
    same_uv.push_back((fit.x.col(v) - expected.col(v)).norm());
  }
  // A generic start is 39 mm away; the registration 2 mm. The bound leaves room for compilers.
  EXPECT_LT(mean(same_uv), 4e-3);
  EXPECT_FALSE(fit.others.empty());
  for (const Points& other : fit.others)
    EXPECT_GT((other - fit.x).colwise().norm().maxCoeff(), 5e-4);
}

}  // namespace
}  // namespace weft::stripe_surface_test
