#include "weft/registration/hung_start.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "registration/developable.h"
#include "weft/base/error.h"
#include "weft/base/random.h"
#include "weft/dynamics/clips.h"
#include "weft/fabric/orthotropic.h"

namespace weft::hung_start_test {
namespace {

constexpr double kSide = 0.3;  // m

/// A cloud of points without outliers about a plane that is turned by `angle` about the vertical.
Scan upright_cloud(double angle) {
  Rng rng(3);
  Scan scan;
  scan.position.resize(3, 600);
  for (auto p : scan.position.colwise()) {
    const double along = rng.uniform(-0.1, 0.1);
    p = Vec3(along * std::cos(angle), along * std::sin(angle), rng.uniform(0.6, 0.95));
  }
  return scan;
}

double largest_fibre_strain(const GridTemplate& grid, const Points& x) {
  double largest = 0;
  for (int j = 0; j < grid.rows; ++j)
    for (int i = 0; i + 1 < grid.columns; ++i)
      largest = std::max(
          largest,
          (x.col(grid.vertex(i + 1, j)) - x.col(grid.vertex(i, j))).norm() / grid.cell_u() - 1);
  return largest;
}

TEST(HungStarts, HangByTwoCorners) {
  const GridTemplate grid = make_grid_template(kSide, kSide, 16, 16);
  const Scan scan = upright_cloud(0);
  const std::vector<Landmark> held{{{0, 0}, {-0.12, 0, 1}, 1}, {{kSide, 0}, {0.12, 0, 1}, 1}};
  const auto starts = hung_starts(grid, scan, scan_geometry(scan), held, {.cells = 10});
  ASSERT_GE(starts.size(), 2u) << "one shape only, or all alike";
  for (const RegistrationStart& start : starts) {
    EXPECT_LT((start.x.col(0) - held[0].position).norm(), 1e-9);
    EXPECT_LT((start.x.col(15) - held[1].position).norm(), 1e-9);
    // An edge of 0.3 m that hangs over 0.24 m as two straight halves has its middle 0.09 m below; a
    // sheet holds it higher, up to where it curls over; one that is flat has it at 0.
    EXPECT_LT(start.x(2, 8), 1 - 0.02);
    EXPECT_GT(start.x(2, 8), 1 - 0.1);
    // 0.2 kg/m^2 over 0.3 m pull with 0.6 N/m, more at the corners; 200 N/m.
    EXPECT_LT(largest_fibre_strain(grid, start.x), 0.05);
    EXPECT_LT(start.x(2, 15 * 16 + 8), 1 - 0.9 * kSide);
    EXPECT_GT(start.reach, 0);
  }
}

TEST(HungStarts, HangByOneCornerInThePlaneOfTheScan) {
  const GridTemplate grid = make_grid_template(kSide, kSide, 11, 11);
  const double angle = 0.7;
  const Scan scan = upright_cloud(angle);
  const std::vector<Landmark> held{{{0, 0}, {0.01, 0.02, 1}, 1}};
  const auto starts = hung_starts(grid, scan, scan_geometry(scan), held, {.cells = 8});
  ASSERT_GE(starts.size(), 2u);
  for (const RegistrationStart& start : starts) {
    EXPECT_LT((start.x.col(0) - held[0].position).norm(), 1e-9);
    // The corner across hangs below, by the diagonal or, folded, a little less.
    EXPECT_LT(start.x(2, 120), 1 - 0.35);
    const Points d = start.x.colwise() - start.x.rowwise().mean();
    const Vec3 in_plane(std::cos(angle), std::sin(angle), 0);
    const Vec3 across(-std::sin(angle), std::cos(angle), 0);
    EXPECT_GT((in_plane.transpose() * d).norm(), (across.transpose() * d).norm());
  }
  EXPECT_THROW(hung_starts(grid, scan, scan_geometry(scan), {}), Error);
  EXPECT_THROW(hung_starts(grid, scan, scan_geometry(scan), {{{0.4, 0}, {0, 0, 1}, 1}}), Error);
  EXPECT_THROW(hung_starts(grid, scan, scan_geometry(scan), held, {.gravity = Vec3::Zero()}),
               Error);
}

// A limp cloth of other moduli on another mesh, its corners so near that its upper edge sags by
// nearly half its side: of the shapes that hang some fold to the wrong side and stay there.
TEST(HungStarts, TheOneOfLeastCostIsRight) {
  const TriangleMesh mesh = make_swatch(kSide, kSide, 27, 27);
  const auto model = make_elastic_model(
      mesh, orthotropic_fabric("limp", stiffness_of({120, 150, 20, 0.2, 1.5e-6})));
  const HeavyCloth cloth(*model, 0.15, Vec3(0, 0, -9.81));
  Points x(3, mesh.vertex_count());
  Rng rng(5);
  const double apart = 0.4;
  for (Eigen::Index v = 0; v < x.cols(); ++v) {
    const Vec2 uv = mesh.material.col(v);
    const double across = uv.x() / kSide;
    x.col(v) = Vec3(apart * (uv.x() - kSide / 2), 0.05 * std::sin(M_PI * across), 1 - uv.y());
    x(1, v) += 1e-4 * rng.normal();
  }
  std::vector<char> fixed(static_cast<std::size_t>(x.cols()), 0);
  fixed[0] = fixed[26] = 1;
  x(1, 0) = x(1, 26) = 0;
  const Points truth = solve_static(cloth, x, fixed, {.force_tolerance = 1e-5}).x;

  const GridTemplate grid = make_grid_template(kSide, kSide, 19, 19);
  const MaterialLocator locator(mesh);
  MaterialPoints uv(2, 4000);
  for (auto p : uv.colwise()) p = Vec2(rng.uniform(0, kSide), rng.uniform(0, kSide));
  Scan scan;
  scan.position = interpolate(mesh, locator, truth, uv);
  for (double& coordinate : scan.position.reshaped()) coordinate += 3e-4 * rng.normal();
  const ScanGeometry geometry = scan_geometry(scan);
  const Points expected = interpolate(mesh, locator, truth, grid.mesh.material);
  const std::vector<Landmark> held{{{0, 0}, truth.col(0), 1}, {{kSide, 0}, truth.col(26), 1}};
  double worst = 0, best = 1, best_cost = 1;
  for (const RegistrationStart& start : hung_starts(grid, scan, geometry, held, {.cells = 10})) {
    const ScanRegistration r = register_scan(grid, scan, geometry, start, held);
    const double error = (r.x - expected).colwise().norm().mean();
    worst = std::max(worst, error);
    if (r.cost >= best_cost) continue;
    best_cost = r.cost;
    best = error;
  }
  // The cloth hangs 1 % longer than the template, 0.3 m: 3 mm at its lower edge.
  EXPECT_LT(best, 0.004);
  EXPECT_GT(worst, 0.02);
}

}  // namespace
}  // namespace weft::hung_start_test
