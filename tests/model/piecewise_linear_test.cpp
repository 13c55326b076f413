#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

#include "common/elastic_battery.h"
#include "weft/base/dense.h"

namespace weft::piecewise_linear_test {
namespace {

using testing::flat_positions;

constexpr double kSize = 0.02;  // m, edge of a grid cell

/// A made-up table with a slope in every direction; one entry is below zero.
Fabric table() {
  Fabric fabric = Fabric::with_defaults("made-up", "piecewise-linear");
  fabric.values << 40, 6, 60, 30,  // at rest
      55, 9, 100, -4,              // 0
      50, 8, 90, 20,               // 22.5
      60, 12, 95, 35,              // 45
      65, 11, 110, 25,             // 67.5
      70, 10, 130, 28,             // 90 degrees
      4e-3, 5e-3, 6e-3, 5e-3, 3e-3, 3e-3, 3.5e-3, 4e-3, 4e-3, 3e-3, 2e-3, 2.5e-3, 2.6e-3, 2.7e-3,
      1e-3;
  return fabric;
}

// Not in all states: at a corner of the sheet, where both bends are free, a twist that is as cheap
// one way as the other bends by whichever direction of the table is softer, and has a kink there.
TEST(PiecewiseLinear, Battery) {
  testing::expect_elastic_model(make_swatch(2 * kSize, 3 * kSize, 3, 4), table(), kSize);
  testing::expect_elastic_model(make_swatch(3 * kSize, 3 * kSize, 4, 4, GridPattern::uniform),
                                table(), kSize);
  testing::expect_elastic_model(make_swatch(3 * kSize, 2 * kSize, 4, 3), table(), kSize, 0.2);
}

TEST(PiecewiseLinear, ATableOfEqualRowsIsAnOrthotropicSheet) {
  // A66 = k_shear / 2; a cylinder at 45 degrees has 4 D_45 = D11 + D22 + 4 D66.
  Fabric equal = table(), sheet = Fabric::with_defaults("sheet", "stvk");
  for (int row = 0; row < 6; ++row) equal.values.segment<4>(4 * row) << 40, 6, 60, 30;
  for (int row = 0; row < 3; ++row)
    equal.values.segment<5>(24 + 5 * row).setConstant(std::array{4e-3, 5e-3, 2e-3}[row]);
  sheet.values << 40, 6, 60, 15, 4e-3, 1e-12, 2e-3, 5e-3 - 1.5e-3;
  const TriangleMesh mesh = make_swatch(2 * kSize, 2 * kSize, 3, 3);
  const auto first = make_elastic_model(mesh, equal, 0.2);
  const auto second = make_elastic_model(mesh, sheet, 0.2);
  for (const Points& x : testing::states(mesh, kSize)) {
    const VecX at = testing::vector(x);
    EXPECT_TRUE(testing::near(testing::energy_of(*first).gradient(at),
                              testing::energy_of(*second).gradient(at), 1e-9));
    EXPECT_TRUE(testing::near(testing::energy_of(*first).hessian(at),
                              testing::energy_of(*second).hessian(at), 1e-9));
  }
}

/// Energy per area of the homogeneous Green strain (E_uu, E_vv, 2 E_uv).
double density(const ElasticModel& model, const Vec3& strain) {
  // F = sqrt(1 + 2 E), symmetric, by its eigenvectors.
  Eigen::Matrix2d c;
  c << 1 + 2 * strain[0], strain[2], strain[2], 1 + 2 * strain[1];
  const SymmetricEigen stretch = symmetric_eigen(c);
  Points x = flat_positions(model.mesh());
  x.topRows<2>() = stretch.vectors * stretch.values.cwiseSqrt().asDiagonal() *
                   stretch.vectors.transpose() * model.mesh().material;
  return model.energy(x);
}

TEST(PiecewiseLinear, StressAlongAProportionalPathIsTheTables) {
  // d psi(t E) / dt = E . C(t E) t E, with C by linear interpolation between the row at rest and
  // that of the angle, at the five angles; cut to the table beyond a principal stretch of 7/6.
  const TriangleMesh mesh = make_swatch(1, 1, 3, 3);
  const auto model = make_elastic_model(mesh, table());
  const VecX values = table().values.cwiseMax(0);
  for (int angle = 0; angle < 5; ++angle)
    for (const double large : {0.01, 0.1, 0.3}) {
      const double phi = angle * std::numbers::pi / 8, small = -0.4 * large;
      const double c = std::cos(phi), s = std::sin(phi);
      const Vec3 e(large * c * c + small * s * s, large * s * s + small * c * c,
                   2 * (large - small) * c * s);
      const double share = std::min(1.0, 6 * (std::sqrt(1 + 2 * large) - 1));
      const Eigen::Vector4d k =
          (1 - share) * values.segment<4>(0) + share * values.segment<4>(4 * (angle + 1));
      const double expected = k[0] * e[0] * e[0] + 2 * k[1] * e[0] * e[1] + k[2] * e[1] * e[1] +
                              0.5 * k[3] * e[2] * e[2];
      const auto along = [&](const VecX& t) { return density(*model, t[0] * e); };
      EXPECT_NEAR(testing::derivative(along, VecX::Ones(1), VecX::Ones(1), 1e-3), expected,
                  1e-7 * expected)
          << angle << ' ' << large;
    }
}

TEST(PiecewiseLinear, ContinuousWhereTheLargerDirectionChanges) {
  // On both sides of an equal biaxial stretch energy and force agree, though the angle jumps.
  const TriangleMesh mesh = make_swatch(0.1, 0.1, 3, 3);
  const auto model = make_elastic_model(mesh, table());
  Points x = 1.1 * flat_positions(mesh), one = x, other = x, g0, g1;
  one.row(0) *= 1 + 1e-6;
  other.row(1) *= 1 + 1e-6;
  model->gradient(one, g0);
  model->gradient(other, g1);
  EXPECT_TRUE(testing::near(g0, g1, 1e-4));
}

TEST(PiecewiseLinear, CylinderHasTheTablesMoment) {
  // Energy of cylinders along 0, 45 and 90 degrees over curvatures within the table, and beyond:
  // the integral of the table's row times the curvature. Interior alone, as twice the area has
  // twice the rim on a mesh twice as large.
  Fabric fabric = table();
  fabric.values.head(24).setConstant(1e-3);
  const auto row_energy = [&](int row, double kappa) {
    double sum = 0;
    const int n = 20000;
    for (int i = 0; i < n; ++i) {
      const double r = kappa * (i + 0.5) / n, t = std::min(r / 10, 4.0);
      const int k = std::min(3, static_cast<int>(t));
      const VecX table_row = fabric.values.segment(24 + 5 * row, 5);
      sum += (table_row[k] + (t - k) * (table_row[k + 1] - table_row[k])) * r;
    }
    return sum * kappa / n;
  };
  const auto energy = [&](int n, double kappa, double direction) {
    const double h = 0.05 / kappa;
    const TriangleMesh mesh = make_swatch(n * h, n * h, n + 1, n + 1, GridPattern::uniform);
    const Vec2 along(std::cos(direction), std::sin(direction)), across(-along.y(), along.x());
    Points x(3, mesh.vertex_count());
    for (int i = 0; i < mesh.vertex_count(); ++i) {
      const double s = along.dot(mesh.material.col(i));
      x.col(i) = Vec3(std::sin(kappa * s) / kappa, across.dot(mesh.material.col(i)),
                      (1 - std::cos(kappa * s)) / kappa);
    }
    return make_elastic_model(mesh, fabric)->energy(x) / (h * h);
  };
  for (const double kappa : {6.0, 24.0, 60.0})
    for (int row = 0; row < 3; ++row) {
      const double direction = row * std::numbers::pi / 4;
      const double interior =
          (energy(16, kappa, direction) - 2 * energy(8, kappa, direction)) / 128;
      EXPECT_NEAR(interior, row_energy(row, kappa), 0.03 * interior) << kappa << ' ' << row;
    }
}

}  // namespace
}  // namespace weft::piecewise_linear_test
