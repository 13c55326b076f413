#include "weft/registration/nonrigid_icp.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "registration/developable.h"
#include "weft/base/error.h"

namespace weft::nonrigid_icp_test {
namespace {

using weft::testing::cone;
using weft::testing::cylinder;
using weft::testing::error_of;
using weft::testing::RegistrationError;
using weft::testing::sampled;
using weft::testing::scan_of;
using weft::testing::ScanMaking;
using weft::testing::Surface;
using weft::testing::wave;

constexpr double kWidth = 0.32, kHeight = 0.4;
const Vec3 right = Vec3::UnitX(), down = -Vec3::UnitZ();

GridTemplate test_grid() { return make_grid_template(kWidth, kHeight, 25, 31); }

ScanRegistration from_flat(const GridTemplate& grid, const Scan& scan,
                           const RegistrationOptions& options = {}) {
  const ScanGeometry geometry = scan_geometry(scan);
  return register_scan(grid, scan, geometry, flat_starts(grid, scan, geometry, right, down), {},
                       options);
}

// 7 to 13 points of 0.2 mm a cell: a plane through those of a cell and its neighbours is known to
// 0.02 mm. What is left off the surface is the smoothing, and in the surface what the rim says:
// the outermost of 12000 points lies 0.1 mm inside of it in a strip of a cell, 0.4 mm at corners.
constexpr double kOffSurface = 0.1e-3, kSamePoint = 0.6e-3;

struct Case {
  std::string name;
  Surface surface;
  ScanMaking making;
};
void PrintTo(const Case& test_case, std::ostream* stream) { *stream << test_case.name; }

class KnownSurface : public ::testing::TestWithParam<Case> {};

TEST_P(KnownSurface, IsFoundAtTheSamePoints) {
  const GridTemplate grid = test_grid();
  const Scan scan = scan_of(GetParam().surface, kWidth, kHeight, GetParam().making);
  const ScanRegistration registration = from_flat(grid, scan);
  const RegistrationError error = error_of(grid, registration.x, GetParam().surface);
  EXPECT_LT(error.off_surface, kOffSurface);
  EXPECT_LT(error.same_point, kSamePoint);
  EXPECT_LT(registration.strain_rms, 1e-3);
  // The noise, and nothing else, is left: along the normal it is that of one coordinate.
  EXPECT_NEAR(registration.residual_rms, GetParam().making.noise, 0.15 * GetParam().making.noise);
  EXPECT_GT(registration.inliers, 0.98 * GetParam().making.points);
  // A stray point counts where it lies by chance on the surface.
  EXPECT_LT(registration.inliers, 1.01 * GetParam().making.points);
}

ScanMaking spoilt() {
  ScanMaking making;
  making.hole = making.clutter = true;
  making.outliers = 0.1;
  return making;
}

INSTANTIATE_TEST_SUITE_P(
    Developable, KnownSurface,
    ::testing::Values(Case{"cylinder", cylinder(0.15, 0.3, kWidth, kHeight), {}},
                      Case{"cone_spoilt", cone(0.5, 0.1, kWidth), spoilt()},
                      Case{"wave_spoilt", wave(0.8, 0.15, 0.4, kWidth, kHeight), spoilt()}),
    [](const auto& info) { return info.param.name; });

TEST(NonrigidIcp, SaysWhichVerticesHaveNoSupport) {
  const GridTemplate grid = test_grid();
  const Surface surface = cylinder(0.15, 0.3, kWidth, kHeight);
  ScanMaking making;
  making.hole = true;
  const ScanRegistration registration = from_flat(grid, scan_of(surface, kWidth, kHeight, making));
  for (int v = 0; v < grid.mesh.vertex_count(); ++v) {
    const double r = (grid.mesh.material.col(v) - Vec2(0.6 * kWidth, 0.45 * kHeight)).norm();
    // The hole has a radius of 4 cm; a cell is 1.3 cm wide.
    if (r < 0.025) {
      EXPECT_FALSE(registration.supported(v)) << r;
    } else if (r > 0.055) {
      EXPECT_TRUE(registration.supported(v)) << r;
    }
  }
}

// A cylinder turned under the sheet by an isometry: in both shapes each point of the fabric is
// known, and a registration that follows the surface but not the fabric would stay behind by as
// much as the fabric moves along the surface.
TEST(NonrigidIcp, DoesNotSlideWhenTheShapeRunsThroughTheFabric) {
  const GridTemplate grid = test_grid();
  const double length = 0.2;
  const auto phase_wave = [&](double shift) {
    return weft::testing::cylinder_over(
        [=](double s) { return 0.5 * std::sin(2 * std::numbers::pi * (s - shift) / length); }, 0,
        kWidth, kHeight);
  };
  Points x = sampled(phase_wave(0), grid.mesh.material);
  RegistrationOptions options;
  options.start_error = 0.03;
  for (int frame = 1; frame <= 3; ++frame) {
    const Surface surface = phase_wave(0.012 * frame);
    const Scan scan = scan_of(surface, kWidth, kHeight, {.points = 6000, .outliers = 0.05});
    x = register_scan(grid, scan, scan_geometry(scan), RegistrationStart{x, {}}, {}, options).x;
    const RegistrationError error = error_of(grid, x, surface);
    EXPECT_LT(error.same_point, 1e-3) << frame;
    EXPECT_LT(error.off_surface, 0.15e-3) << frame;
  }
}

TEST(NonrigidIcp, FollowsLandmarksOfStretchedCloth) {
  const GridTemplate grid = test_grid();
  const Surface bent = cylinder(0.2, 0, kWidth, kHeight);
  // 4 % longer along v: no isometry is the truth.
  const Surface surface = [=](const Vec2& uv) { return bent({uv.x(), 1.04 * uv.y()}); };
  const Scan scan = scan_of(surface, kWidth, kHeight);
  std::vector<Landmark> landmarks;
  for (double u = 0.02; u < kWidth; u += 0.04) {
    for (double v = 0.02; v < kHeight; v += 0.04) landmarks.push_back({{u, v}, surface({u, v}), 1});
  }
  const ScanRegistration with =
      register_scan(grid, scan, scan_geometry(scan),
                    RegistrationStart{flat_start(grid, landmarks), {}}, landmarks);
  const double same_point = error_of(grid, with.x, surface).same_point;
  EXPECT_LT(same_point, 1e-3);
  // Without them the rim alone has to stretch the sheet, by 16 mm.
  EXPECT_GT(error_of(grid, from_flat(grid, scan).x, surface).same_point, 3 * same_point);
}

TEST(NonrigidIcp, DoesNotDependOnTheNumberOfThreads) {
  const GridTemplate grid = make_grid_template(kWidth, kHeight, 9, 11);
  const Scan scan = scan_of(cylinder(0.15, 0.3, kWidth, kHeight), kWidth, kHeight,
                            {.points = 5000, .outliers = 0.1});
  EXPECT_EQ(from_flat(grid, scan, {.threads = 1}).x, from_flat(grid, scan, {.threads = 2}).x);
}

TEST(FlatStart, FindsARotatedSheetFromLandmarks) {
  const GridTemplate grid = make_grid_template(kWidth, kHeight, 5, 5);
  const Mat3 rotation = Eigen::AngleAxisd(1.1, Vec3(1, 2, 3).normalized()).toRotationMatrix();
  const Vec3 shift(0.1, -0.2, 0.3);
  std::vector<Landmark> landmarks;
  for (const Vec2& uv : {Vec2(0, 0), Vec2(0.3, 0.1), Vec2(0.1, 0.3), Vec2(0.2, 0.2)}) {
    landmarks.push_back({uv, rotation * Vec3(uv.x(), uv.y(), 0) + shift, 1});
  }
  const Points x = flat_start(grid, landmarks);
  for (int v = 0; v < grid.mesh.vertex_count(); ++v) {
    const Vec2 uv = grid.mesh.material.col(v);
    EXPECT_LT((x.col(v) - rotation * Vec3(uv.x(), uv.y(), 0) - shift).norm(), 1e-9);
  }
  for (Landmark& landmark : landmarks) landmark.position = Vec3(landmark.uv.x(), 0, 0);
  for (Landmark& landmark : landmarks) landmark.uv.y() = 0;
  EXPECT_THROW(flat_start(grid, landmarks), Error);
  landmarks.resize(2);
  EXPECT_THROW(flat_start(grid, landmarks), Error);
}

TEST(NonrigidIcp, RefusesWhatDoesNotFit) {
  const GridTemplate grid = make_grid_template(kWidth, kHeight, 5, 5);
  const Scan scan = scan_of(cylinder(0.15, 0, kWidth, kHeight), kWidth, kHeight, {.points = 100});
  const ScanGeometry geometry = scan_geometry(scan);
  const RegistrationStart start{sampled(cylinder(0.15, 0, kWidth, kHeight), grid.mesh.material),
                                {}};
  EXPECT_THROW(register_scan(grid, scan, geometry, RegistrationStart{Points(3, 7), {}}), Error);
  EXPECT_THROW(register_scan(grid, scan, geometry, start, {{{9, 9}, {0, 0, 0}, 1}}), Error);
  EXPECT_THROW(register_scan(grid, scan, geometry, start, {}, {.smoothing = -1}), Error);
  EXPECT_THROW(register_scan(grid, scan, geometry, std::vector<RegistrationStart>{}), Error);
  EXPECT_THROW(make_grid_template(kWidth, kHeight, 2, 5), Error);
}

}  // namespace
}  // namespace weft::nonrigid_icp_test
