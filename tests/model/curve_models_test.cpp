#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "common/elastic_battery.h"
#include "weft/base/error.h"
#include "weft/mesh/grid_lines.h"

namespace weft::curve_models_test {
namespace {

using testing::flat_positions;

constexpr double kSize = 0.02;  // m, edge of a grid cell
const std::vector<std::string> kContinua = {"soft-constraints", "stvk-diagonal"};

StiffnessCurve curve(std::initializer_list<double> knots, std::initializer_list<double> values) {
  return {Eigen::Map<const VecX>(knots.begin(), static_cast<Eigen::Index>(knots.size())),
          Eigen::Map<const VecX>(values.begin(), static_cast<Eigen::Index>(values.size()))};
}

/// All six components different; bends of a size that lets them show beside the membrane.
Fabric constants(const std::string& model) {
  Fabric fabric = Fabric::with_defaults("constants", model);
  fabric.set("weft_stretch", 40);
  fabric.set("warp_stretch", 25);
  fabric.set("shear", 12);
  const double unit = model == "springs" ? 1e3 : 1;
  fabric.set("weft_bend", 5e-3 * unit);
  fabric.set("warp_bend", 2e-3 * unit);
  fabric.set("diagonal_bend", 3e-3 * unit);
  return fabric;
}

Fabric curves(const std::string& model) {
  Fabric fabric = constants(model);
  fabric.set_curve("weft_stretch", curve({-0.05, 0.02, 0.1, 0.3}, {30, 40, 70, 60}));
  fabric.set_curve("warp_stretch", curve({0, 0.2}, {25, 60}));
  fabric.set_curve("shear", curve({0, 0.15, 0.5}, {12, 5, 20}));
  const double unit = model == "springs" ? 1e3 : 1, strain = model == "springs" ? 1e-2 : 1;
  fabric.set_curve("weft_bend", curve({0, 20 * strain}, {5e-3 * unit, 2e-3 * unit}));
  fabric.set_curve("diagonal_bend",
                   curve({0, 5 * strain, 40 * strain}, {3e-3 * unit, 4e-3 * unit, 2e-3 * unit}));
  return fabric;
}

/// The integral of k(s) s from 0 to c, by the trapezoidal rule with 4000 steps: error 1e-7 of it.
double energy_of_curve(const StiffnessCurve& k, double c) {
  double sum = 0;
  for (int i = 1; i <= 4000; ++i) sum += k.stiffness(c * i / 4000) * c * i / 4000;
  return (sum - 0.5 * k.stiffness(c) * c) * c / 4000;
}

TEST(CurveModels, BatteryWithConstants) {
  for (const std::string& model : {kContinua[0], kContinua[1], std::string("springs")})
    testing::expect_elastic_model(make_swatch(3 * kSize, 2 * kSize, 4, 3), constants(model), kSize);
}

TEST(CurveModels, BatteryWhereAnElementHasAVertexTwice) {
  for (const std::string& model : kContinua)
    testing::expect_elastic_model(testing::three_triangles(kSize), constants(model), kSize);
}

TEST(CurveModels, BatteryWithCurves) {
  for (const std::string& model : {kContinua[0], kContinua[1], std::string("springs")})
    testing::expect_elastic_model(make_swatch(3 * kSize, 2 * kSize, 4, 3, GridPattern::uniform),
                                  curves(model), kSize);
  testing::expect_elastic_model(make_swatch(3 * kSize, 2 * kSize, 4, 3), curves(kContinua[0]),
                                kSize, 0.5);
}

TEST(CurveModels, BatteryWithOptionalTerms) {
  for (const std::string& model : kContinua) {
    Fabric fabric = curves(model);
    fabric.include("stretch_coupling");
    fabric.include("shear_stiffening");
    fabric.set("stretch_coupling", 11);
    fabric.set("shear_stiffening", 30);
    testing::expect_elastic_model(make_swatch(3 * kSize, 2 * kSize, 4, 3), fabric, kSize);
  }
}

TEST(CurveModels, HomogeneousStrainOnAnyMesh) {
  Eigen::Matrix2d deformation;
  deformation << 1.1, 0.15, -0.05, 1.06;
  const double lu = deformation.col(0).norm(), lv = deformation.col(1).norm();
  const double shear = deformation.col(0).dot(deformation.col(1));
  const double coupling = 8, stiffening = 40;
  for (const std::string& model : kContinua) {
    Fabric fabric = curves(model);
    fabric.include("stretch_coupling");
    fabric.include("shear_stiffening");
    fabric.set("stretch_coupling", coupling);
    fabric.set("shear_stiffening", stiffening);
    const bool green = model == "stvk-diagonal";
    const double cu = green ? (lu * lu - 1) / 2 : lu - 1, cv = green ? (lv * lv - 1) / 2 : lv - 1;
    const double density =
        energy_of_curve(fabric.curve("weft_stretch"), cu) +
        energy_of_curve(fabric.curve("warp_stretch"), cv) + coupling * cu * cv +
        (1 + stiffening * (cu * cu + cv * cv)) * energy_of_curve(fabric.curve("shear"), shear);
    for (const int n : {2, 5, 8})
      for (const GridPattern pattern : {GridPattern::alternating, GridPattern::uniform}) {
        const TriangleMesh mesh = make_swatch(0.1, 0.05, n, n + 1, pattern);
        Points x = flat_positions(mesh);
        x.topRows<2>() = deformation * mesh.material;
        EXPECT_NEAR(make_elastic_model(mesh, fabric)->energy(x), 0.005 * density,
                    1e-6 * 0.005 * density);
      }
  }
}

TEST(CurveModels, UniaxialForceOfAStrip) {
  // Without coupling the strip keeps its width. Force per width: k(e) e by elongation; by Green
  // strain E = e + e^2 / 2 it is (1 + e) k(E) E.
  const double width = 0.05, length = 0.1, e = 0.08;
  const TriangleMesh mesh = make_swatch(length, width, 9, 5);
  for (const std::string& model : kContinua) {
    const Fabric fabric = curves(model);
    Points x = flat_positions(mesh), gradient;
    x.row(0) *= 1 + e;
    make_elastic_model(mesh, fabric)->gradient(x, gradient);
    double pull = 0, inside = 0;
    for (int i = 0; i < x.cols(); ++i) {
      if (mesh.material(0, i) > length - 1e-9)
        pull += gradient(0, i);
      else if (mesh.material(0, i) > 1e-9)
        inside = std::max(inside, gradient.col(i).norm());
    }
    const double strain = model == "stvk-diagonal" ? e + 0.5 * e * e : e;
    const double stress = fabric.curve("weft_stretch").stiffness(strain) * strain;
    const double expected = width * (model == "stvk-diagonal" ? 1 + e : 1) * stress;
    EXPECT_NEAR(pull, expected, 1e-12 * expected) << model;
    EXPECT_LT(inside, 1e-13);
  }
}

/// Rolled onto a cylinder of curvature `kappa` about the warp; arc lengths are kept.
Points rolled(const TriangleMesh& mesh, double kappa) {
  Points x(3, mesh.vertex_count());
  for (int i = 0; i < mesh.vertex_count(); ++i) {
    const double s = mesh.material(0, i);
    x.col(i) =
        Vec3(std::sin(kappa * s) / kappa, mesh.material(1, i), (1 - std::cos(kappa * s)) / kappa);
  }
  return x;
}

TEST(CurveModels, CylinderStoresTheIntegralOfItsBendingCurve) {
  // One meter of cells of 1 cm, bent to a radius of 20 cm: angles of 0.05. No moment acts across
  // the ends, so that the first and the last column store half of theirs.
  Fabric fabric = Fabric::with_defaults("bend", "soft-constraints");
  fabric.set_curve("weft_bend", curve({0, 4, 10}, {2e-3, 4e-3, 1e-3}));
  for (const char* name : {"weft_stretch", "warp_stretch"}) fabric.set(name, 0.1);
  const double kappa = 5;
  const TriangleMesh mesh = make_swatch(1, 0.1, 101, 11, GridPattern::uniform);
  const double density = energy_of_curve(fabric.curve("weft_bend"), kappa);
  EXPECT_NEAR(make_elastic_model(mesh, fabric)->energy(rolled(mesh, kappa)), 0.099 * density,
              2e-3 * 0.1 * density);
}

MatX hessian_at_rest(const Fabric& fabric, const TriangleMesh& mesh) {
  const auto model = make_elastic_model(mesh, fabric);
  return testing::energy_of(*model).hessian(testing::vector(flat_positions(mesh)));
}

TEST(CurveModels, SameSmallStrainLimit) {
  // A12 = stretch_coupling, A66 = shear, D12 = 0, 2 D66 = diagonal_bend.
  Fabric stvk = Fabric::with_defaults("plate", "stvk");
  stvk.set("membrane_uu", 40);
  stvk.set("membrane_uv", 9);
  stvk.set("membrane_vv", 25);
  stvk.set("membrane_shear", 12);
  stvk.set("bend_uu", 5e-3);
  stvk.set("bend_uv", 1e-12);
  stvk.set("bend_vv", 2e-3);
  stvk.set("bend_twist", 1.5e-3);
  const TriangleMesh mesh = make_swatch(3 * kSize, 2 * kSize, 4, 3);
  const MatX expected = hessian_at_rest(stvk, mesh);
  // bend_uv cannot be 0: its share of the entries.
  constexpr double kTolerance = 1e-9;
  for (const std::string& model : kContinua) {
    Fabric fabric = constants(model);
    fabric.include("stretch_coupling");
    fabric.set("stretch_coupling", 9);
    EXPECT_TRUE(testing::near(hessian_at_rest(fabric, mesh), expected, kTolerance)) << model;
  }
}

TEST(Springs, SmallStrainMembraneOfSquareCells) {
  // A11 = weft_stretch + shear, A12 = A66 = shear; a strain of 1e-5 is linear to 1e-4. Bends are
  // left out as far as they go.
  Fabric fabric = constants("springs");
  for (const char* name : {"weft_bend", "warp_bend", "diagonal_bend"}) fabric.set(name, 1e-6);
  const double euu = 1e-5, evv = -4e-6, gamma = 1.2e-5;
  const double density = 0.5 * ((40 + 12) * euu * euu + 2 * 12 * euu * evv + (25 + 12) * evv * evv +
                                12 * gamma * gamma);
  for (const GridPattern pattern : {GridPattern::alternating, GridPattern::uniform})
    for (const int n : {2, 6}) {
      const TriangleMesh mesh = make_swatch(0.1, 0.1, n, n, pattern);
      Points x = flat_positions(mesh);
      x.row(0) += euu * mesh.material.row(0) + gamma * mesh.material.row(1);
      x.row(1) += evv * mesh.material.row(1);
      EXPECT_NEAR(make_elastic_model(mesh, fabric)->energy(x), 0.01 * density,
                  1e-4 * 0.01 * density);
    }
}

TEST(Springs, ShearOfOblongCells) {
  Fabric fabric = constants("springs");
  const TriangleMesh mesh = make_swatch(0.1, 0.1, 3, 6);
  Points x = flat_positions(mesh);
  const double gamma = 1e-5;
  x.row(0) += gamma * mesh.material.row(1);
  // Ring-2 diagonals add diagonal_bend = 3 N/m of 1 / (4 sin^2 cos^2) of the shear stiffness each.
  for (const char* name : {"weft_bend", "warp_bend", "diagonal_bend"}) fabric.set(name, 1e-6);
  EXPECT_NEAR(make_elastic_model(mesh, fabric)->energy(x), 0.01 * 0.5 * 12 * gamma * gamma,
              1e-4 * 0.01 * 0.5 * 12 * gamma * gamma);
}

TEST(Springs, BendGoesWithTheFourthPowerOfTheCurvature) {
  // Chords over two edges of length h are shorter by (kappa h)^2 / 8 with edges kept.
  Fabric fabric = constants("springs");
  fabric.set("weft_bend", 7);
  const double h = 0.01, kappa = 2;
  const TriangleMesh mesh = make_swatch(0.2, 0.1, 21, 11);
  Points x(3, mesh.vertex_count());
  const double radius = h / (2 * std::sin(kappa * h / 2));  // edges are chords of length h
  for (int i = 0; i < x.cols(); ++i) {
    const double angle = kappa * mesh.material(0, i);
    x.col(i) = Vec3(radius * std::sin(angle), mesh.material(1, i), radius * (1 - std::cos(angle)));
  }
  const double c = 1 - std::cos(kappa * h / 2);  // (kappa h)^2 / 8 + ...
  // 19 of 20 columns of vertices have both neighbours; ring-2 diagonals over two cells of h are
  // sqrt(2) longer, and shorten by half of c, to first order.
  const double expected = 0.5 * 7 * c * c * 19 * h * 0.1;
  const double diagonals = 0.5 * 3 * (c / 2) * (c / 2) * 19 * h * 9 * h;
  const double sheared = make_elastic_model(mesh, fabric)->energy(x) - expected - diagonals;
  // What is left is of the springs along the diagonals of ring 1: none, edges and cells are kept.
  EXPECT_NEAR(sheared, 0, 2e-3 * expected);
}

TEST(Springs, BendOverCellsOfUnequalSize) {
  // One row of cells, which stay flat, whose widths grow, folded at each line by the same small
  // angle: the chord over cells of a and b is shorter by a b angle^2 / (2 (a + b)).
  Fabric fabric = constants("springs");
  fabric.set("weft_bend", 7);
  const std::vector<double> u{0, 0.01, 0.024, 0.042}, v{0, 0.02};
  const TriangleMesh mesh = make_swatch(u, v, GridPattern::uniform);
  const double angle = 1e-2;
  const auto columns = static_cast<Eigen::Index>(u.size());
  Points x(3, mesh.vertex_count());
  Vec2 at(0, 0);
  double expected = 0;
  for (Eigen::Index i = 0; i < columns; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const auto turns = static_cast<double>(i - 1);
    if (i > 0) at += (u[k] - u[k - 1]) * Vec2(std::cos(angle * turns), std::sin(angle * turns));
    for (Eigen::Index row = 0; row < 2; ++row)
      x.col(row * columns + i) = Vec3(at.x(), v[static_cast<std::size_t>(row)], at.y());
    if (i == 0 || i + 1 == columns) continue;
    const double a = u[k] - u[k - 1], b = u[k + 1] - u[k];
    const double c = a * b * angle * angle / (2 * (a + b) * (a + b));
    expected += 0.5 * 7 * c * c * 0.5 * (a + b) * 0.02;
  }
  // Of the next order: angle^2 / 6 or so.
  EXPECT_NEAR(make_elastic_model(mesh, fabric)->energy(x), expected, 1e-3 * expected);
}

TEST(Springs, NeedARegularGrid) {
  TriangleMesh mesh = make_swatch(0.1, 0.1, 3, 3);
  EXPECT_THROW(make_elastic_model(mesh, constants("springs"), 0.1), Error);
  mesh.material(0, 4) += 0.01;
  EXPECT_THROW(make_elastic_model(mesh, constants("springs")), Error);
}

}  // namespace
}  // namespace weft::curve_models_test
