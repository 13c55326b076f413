#include "weft/registration/landmarks.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "registration/developable.h"
#include "weft/base/error.h"

namespace weft::landmarks_test {
namespace {

using weft::testing::cylinder;
using weft::testing::error_of;
using weft::testing::sampled;
using weft::testing::Surface;

constexpr double kSide = 0.24;

/// Blots of different grey: what is printed on the fabric.
double print(const Vec2& uv) {
  return 0.5 + 0.2 * std::sin(230 * uv.x() + 40 * std::sin(50 * uv.y())) +
         0.2 * std::sin(260 * uv.y() + 30 * std::sin(60 * uv.x()));
}

/// A scan whose points have the grey of `ink` at their (u, v).
template <class Ink>
Scan coloured(const Surface& surface, int points, double noise, const Ink& ink) {
  Rng rng(4);
  Scan scan;
  scan.position.resize(3, points);
  scan.colour.resize(3, points);
  for (int k = 0; k < points; ++k) {
    const Vec2 uv(rng.uniform(0, kSide), rng.uniform(0, kSide));
    const Vec3 error(rng.normal(), rng.normal(), rng.normal());
    scan.position.col(k) = surface(uv) + noise * error;
    scan.colour.col(k).setConstant(static_cast<float>(ink(uv)));
  }
  return scan;
}

// The cloth is 5 % longer along u than the template: its rim alone does not say where, and a grid
// that keeps its lengths is off by up to 6 mm. The stamped lines say.
TEST(StampedGrid, BringsTheFabricToWhereItIs) {
  const GridTemplate grid = make_grid_template(kSide, kSide, 21, 21);
  const Surface bent = cylinder(0.15, 0, kSide, kSide);
  const Surface surface = [&](const Vec2& uv) { return bent({0.006 + 1.05 * uv.x(), uv.y()}); };
  const StampedGrid stamp{.pitch = 0.02, .origin = {0.005, 0.01}};
  const auto ink = [&](const Vec2& uv) {
    for (int axis = 0; axis < 2; ++axis) {
      const double at = (uv[axis] - stamp.origin[axis]) / stamp.pitch;
      if (std::abs(at - std::round(at)) * stamp.pitch < 0.001) return 0.2;
    }
    return 0.8;
  };
  const Scan scan = coloured(surface, 40000, 0.0001, ink);
  const ScanGeometry geometry = scan_geometry(scan);
  const Points flat = sampled(bent, grid.mesh.material);
  ScanRegistration registration =
      register_scan(grid, scan, geometry, RegistrationStart{flat, {}}, {}, {.start_error = 0.02});
  const double before = error_of(grid, registration.x, surface).same_point;
  for (int round = 0; round < 2; ++round) {
    const FabricImage image = unwrap_scan(grid, registration.x, scan, 0.001);
    const auto landmarks = find_stamped_grid(grid, registration.x, image, stamp);
    // 12 by 12 lines, the outermost crossings perhaps too near to the rim.
    EXPECT_GE(landmarks.size(), 100u);
    EXPECT_LE(landmarks.size(), 144u);
    double mean = 0, worst = 0;
    for (const Landmark& landmark : landmarks) {
      const double error = (landmark.position - surface(landmark.uv)).norm();
      mean += error / static_cast<double>(landmarks.size());
      worst = std::max(worst, error);
    }
    // A texel is 1 mm, points are 1.2 mm apart, a line is 2 mm wide; a crossing beside the rim
    // shows less of its arms.
    EXPECT_LT(mean, 0.0006);
    EXPECT_LT(worst, 0.002);
    registration = register_scan(grid, scan, geometry, RegistrationStart{registration.x, {}},
                                 landmarks, {.start_error = 0.02});
  }
  EXPECT_GT(before, 0.001);
  EXPECT_LT(error_of(grid, registration.x, surface).same_point, 0.0005);
}

TEST(StampedGrid, RefusesWhatItCannotSee) {
  const GridTemplate grid = make_grid_template(kSide, kSide, 5, 5);
  const Points x = sampled(cylinder(0.15, 0, kSide, kSide), grid.mesh.material);
  FabricImage image{Image::Constant(60, 60, 0.5f), Mask::Constant(60, 60, 1), 0.004};
  EXPECT_THROW(find_stamped_grid(grid, x, image, {.pitch = 0.02}), Error);
  EXPECT_THROW(find_stamped_grid(grid, x, image, {.pitch = 0.03, .origin = {0.04, 0}}), Error);
  EXPECT_TRUE(find_stamped_grid(grid, x, image, {.pitch = 0.03}).empty());
  Scan grey;
  grey.position = x;
  EXPECT_THROW(unwrap_scan(grid, x, grey, 0.004), Error);
}

Image photograph(const Surface& surface, const Pinhole& camera, int side) {
  // Each pixel is the mean of the dense points that fall into it.
  Image sum = Image::Zero(side, side), count = Image::Zero(side, side);
  constexpr int dense = 1500;
  for (int i = 0; i < dense; ++i) {
    for (int j = 0; j < dense; ++j) {
      const Vec2 uv = kSide / dense * Vec2(j + 0.5, i + 0.5);
      const Vec3 at = camera.project(surface(uv));
      const auto row = static_cast<Eigen::Index>(at.y()),
                 column = static_cast<Eigen::Index>(at.x());
      if (row < 0 || column < 0 || row >= side || column >= side) continue;
      sum(row, column) += static_cast<float>(print(uv));
      count(row, column) += 1;
    }
  }
  return (count > 0).select(sum / count.max(1), 0.0f);
}

// A registration that is shifted along the fabric by a known way is found to be, and its landmarks
// are on the true points.
TEST(TrackTexture, MeasuresHowFarAGridSlid) {
  const GridTemplate grid = make_grid_template(kSide, kSide, 21, 21);
  const Surface surface = cylinder(0.2, 0.4, kSide, kSide);
  Projection projection;
  projection << 1000, 240, 0, 144,  //
      0, 240, -1000, 144,           //
      0, 1, 0, 0.6;
  const Pinhole camera(projection, Vec3::Zero(), "camera");
  const Image picture = photograph(surface, camera, 480);
  const Points x = sampled(surface, grid.mesh.material);
  const Vec2 slide(0.0037, -0.0052);
  const MaterialPoints moved = grid.mesh.material.colwise() + slide;
  const Points slid = sampled(surface, moved);
  const FabricImage reference = unwrap_picture(grid, x, picture, camera, 0.001);
  EXPECT_GT(reference.seen.cast<double>().mean(), 0.95);
  const FabricImage other = unwrap_picture(grid, slid, picture, camera, 0.001);
  const auto shifts = track_texture(reference, other, {.spacing = 0.03});
  ASSERT_GE(shifts.size(), 9u);
  for (const TextureShift& shift : shifts) {
    // What the true grid shows at uv, the slid one shows at uv - slide.
    EXPECT_LT((shift.shift + slide).norm(), 0.0002);
  }
  for (const Landmark& landmark : landmarks_of(grid, slid, shifts)) {
    EXPECT_LT((landmark.position - surface(landmark.uv)).norm(), 0.0004);
  }
}

// The scan alone says where the surface is, but a cylinder may turn under the grid; with the rims
// cut off the scan nothing holds it. The print does.
TEST(FollowPrint, UndoesASlide) {
  const GridTemplate grid = make_grid_template(kSide, kSide, 17, 17);
  const Surface surface = cylinder(0.2, 0.4, kSide, kSide);
  Scan scan = coloured(surface, 30000, 0.0001, print);
  std::vector<int> inner;
  for (int k = 0; k < scan.size(); ++k) {
    const Vec3 p = scan.position.col(k);
    if (std::abs(p.x()) < 0.09 && std::abs(p.z()) < 0.09) inner.push_back(k);
  }
  scan.position = Points(scan.position(Eigen::all, inner));
  scan.colour = Eigen::Matrix3Xf(scan.colour(Eigen::all, inner));
  const ScanGeometry geometry = scan_geometry(scan);
  const FabricImage reference =
      unwrap_scan(grid, sampled(surface, grid.mesh.material), scan, 0.001);
  const Vec2 slide(0.004, -0.003);
  const RegistrationStart slid{sampled(surface, grid.mesh.material.colwise() + slide), {}};
  const RegistrationOptions options{.start_error = 0.01};
  ScanRegistration registration = register_scan(grid, scan, geometry, slid, {}, options);
  std::size_t landmarks = 0;
  EXPECT_GT(error_of(grid, registration.x, surface).same_point, 0.003);
  registration = follow_print(
      grid, scan, geometry, std::move(registration), reference,
      [&](const Points& x) { return unwrap_scan(grid, x, scan, 0.001); }, options,
      {.spacing = 0.03, .window = 0.03, .reach = 0.01}, landmarks);
  EXPECT_GE(landmarks, 9u);
  EXPECT_LT(error_of(grid, registration.x, surface).same_point, 0.0006);
}

}  // namespace
}  // namespace weft::landmarks_test
