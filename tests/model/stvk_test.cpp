#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "common/elastic_battery.h"
#include "weft/base/error.h"

namespace weft::stvk_test {
namespace {

using testing::flat_positions;
using testing::vector;

constexpr double kSize = 0.02;  // m, edge of a grid cell

Fabric stvk_fabric() {
  Fabric fabric = Fabric::with_defaults("test", "stvk");
  fabric.set("membrane_uu", 40);
  fabric.set("membrane_uv", 15);
  fabric.set("membrane_vv", 25);
  fabric.set("membrane_shear", 12);
  fabric.set("bend_uu", 5e-3);
  fabric.set("bend_uv", 1e-3);
  fabric.set("bend_vv", 2e-3);
  fabric.set("bend_twist", 1.5e-3);
  return fabric;
}

TEST(Stvk, Battery) {
  for (const GridPattern pattern : {GridPattern::alternating, GridPattern::uniform})
    for (const double grain : {0.0, 0.4})
      testing::expect_elastic_model(make_swatch(3 * kSize, 2 * kSize, 4, 3, pattern), stvk_fabric(),
                                    kSize, grain);
}

TEST(Stvk, HomogeneousStrainStoresThePrintedEnergy) {
  // E = (F^T F - 1) / 2 by hand; the density is 1/2 E . C E, at any grain angle.
  const Fabric f = stvk_fabric();
  Eigen::Matrix2d deformation;
  deformation << 1.1, 0.15, -0.05, 0.97;
  for (const double grain : {0.0, 0.7}) {
    const TriangleMesh mesh = make_swatch(0.1, 0.05, 5, 4);
    const auto model = make_elastic_model(mesh, f, grain);
    Points x = flat_positions(mesh);
    x.topRows<2>() = deformation * mesh.material;
    const Eigen::Matrix2d along = Eigen::Rotation2Dd(grain).toRotationMatrix();
    const Eigen::Matrix2d e =
        0.5 * along.transpose() *
        (deformation.transpose() * deformation - Eigen::Matrix2d::Identity()) * along;
    const double density = 0.5 * (40 * e(0, 0) * e(0, 0) + 2 * 15 * e(0, 0) * e(1, 1) +
                                  25 * e(1, 1) * e(1, 1) + 12 * 4 * e(0, 1) * e(0, 1));
    EXPECT_NEAR(model->energy(x), density * 0.005, 1e-12 * density * 0.005);
  }
}

TEST(Stvk, UniaxialForceOfAStrip) {
  // Free sides: E_vv = - A12 / A22 E_uu and the force per width is (1 + e) (A11 - A12^2 / A22)
  // (e + e^2 / 2), with e the elongation: second Piola-Kirchhoff stress times the stretch.
  const double width = 0.05, length = 0.1, e = 0.08;
  const TriangleMesh mesh = make_swatch(length, width, 9, 5);
  const auto model = make_elastic_model(mesh, stvk_fabric());
  const double euu = e + 0.5 * e * e, evv = -15.0 / 25 * euu;
  Points x = flat_positions(mesh);
  x.row(0) *= 1 + e;
  x.row(1) *= std::sqrt(1 + 2 * evv);
  Points gradient;
  model->gradient(x, gradient);
  double pull = 0, inside = 0;
  for (int i = 0; i < x.cols(); ++i) {
    if (mesh.material(0, i) > length - 1e-9)
      pull += gradient(0, i);
    else if (mesh.material(0, i) > 1e-9)
      inside = std::max(inside, gradient.col(i).norm());
  }
  const double expected = width * (1 + e) * (40 - 15.0 * 15 / 25) * euu;
  EXPECT_NEAR(pull, expected, 1e-12 * expected);
  EXPECT_LT(inside, 1e-13);
}

/// Points on a cylinder of curvature `kappa` whose curved direction makes the angle `direction`
/// with u. Arc lengths are kept.
Points rolled(const TriangleMesh& mesh, double kappa, double direction) {
  const Vec2 along(std::cos(direction), std::sin(direction)), across(-along.y(), along.x());
  Points x(3, mesh.vertex_count());
  for (int i = 0; i < mesh.vertex_count(); ++i) {
    const double s = along.dot(mesh.material.col(i)), t = across.dot(mesh.material.col(i));
    x.col(i) = Vec3(std::sin(kappa * s) / kappa, t, (1 - std::cos(kappa * s)) / kappa);
  }
  return x;
}

/// Energy of bending alone: the membrane is as soft as its range allows.
Fabric plate(double d11, double d12, double d22, double d66) {
  Fabric fabric = Fabric::with_defaults("plate", "stvk");
  fabric.set("membrane_uu", 0.1);
  fabric.set("membrane_uv", 1e-4);
  fabric.set("membrane_vv", 0.1);
  fabric.set("membrane_shear", 0.01);
  fabric.set("bend_uu", d11);
  fabric.set("bend_uv", d12);
  fabric.set("bend_vv", d22);
  fabric.set("bend_twist", d66);
  return fabric;
}

TEST(Stvk, CylinderOfAnyDirection) {
  // kappa = k n n^T stores 1/2 k^2 (D11 c^4 + 2 (D12 + 2 D66) c^2 s^2 + D22 s^4) per area away from
  // the rim, which has no moment across it. The same mesh twice as large has four times the
  // interior and twice the rim: E(2 L) - 2 E(L) is the interior of 2 L^2, and the four corners,
  // which are 4 / 128 of it at most.
  const double d11 = 0.3, d12 = 0.1, d22 = 0.1, d66 = 0.08, kappa = 0.05;
  for (const double grain : {0.0, 0.5})
    for (int i = 0; i < 8; ++i) {
      const double direction = std::numbers::pi * i / 8;
      const double c = std::cos(direction - grain), s = std::sin(direction - grain);
      const auto energy = [&](int n) {
        const TriangleMesh mesh = make_swatch(n, n, n + 1, n + 1, GridPattern::uniform);
        return make_elastic_model(mesh, plate(d11, d12, d22, d66), grain)
            ->energy(rolled(mesh, kappa, direction));
      };
      const double density =
          0.5 * kappa * kappa *
          (d11 * c * c * c * c + 2 * (d12 + 2 * d66) * c * c * s * s + d22 * s * s * s * s);
      // The membrane of 0.1 N/m feels the chords, shorter by (kappa h)^2 / 24: below 1e-5 of this.
      EXPECT_NEAR((energy(16) - 2 * energy(8)) / 128, density, 0.03 * density) << i;
    }
}

TEST(Stvk, StripWithPoissonEffectBendsToItsPlateLimit) {
  // A long strip with free sides bent to kappa_uu: the sides curl until M_vv = 0 at the rim only;
  // held in a cylinder, D11 kappa^2 / 2 inside, (D11 - D12^2 / D22) kappa^2 / 2 on the triangles
  // along both sides: one of two in the outer rows.
  const int n = 40;
  const TriangleMesh mesh = make_swatch(n, 10, n + 1, 11, GridPattern::uniform);
  const double d11 = 0.3, d12 = 0.1, d22 = 0.1, d66 = 0.08, kappa = 0.02;
  const auto model = make_elastic_model(mesh, plate(d11, d12, d22, d66));
  const double energy = model->energy(rolled(mesh, kappa, 0));
  // Triangles at the two ends have no moment at all: n - 1 of n columns and one triangle of two
  // at each end count; compare with that count, to the share of the corners.
  const double inside = 0.5 * kappa * kappa * d11,
               side = 0.5 * kappa * kappa * (d11 - d12 * d12 / d22);
  const double expected = (n - 1) * (9 * inside + side);
  EXPECT_NEAR(energy, expected, 2e-3 * expected);
}

TEST(Stvk, RejectsAFabricWithoutPositiveStiffness) {
  const TriangleMesh mesh = make_swatch(0.1, 0.1, 3, 3);
  Fabric fabric = stvk_fabric();
  fabric.values[1] = 32;  // 32^2 = 1024 > 40 * 25
  try {
    make_elastic_model(mesh, fabric);
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("membrane_uv"), std::string::npos) << error.what();
  }
  const auto model = make_elastic_model(mesh, stvk_fabric());
  EXPECT_THROW(model->set_parameters(fabric.values), Error);
  EXPECT_EQ(model->parameters(), stvk_fabric().values);
  VecX bend = stvk_fabric().values;
  bend[5] = 1e-2;
  EXPECT_THROW(model->set_parameters(bend), Error);
  EXPECT_THROW(model->set_parameters(VecX::Ones(3)), Error);
}

}  // namespace
}  // namespace weft::stvk_test
