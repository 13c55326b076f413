#include "weft/model/material_response.h"

#include <gtest/gtest.h>

#include <array>

#include "weft/base/error.h"

namespace weft {
namespace {

Fabric sheet() {
  Fabric fabric = Fabric::with_defaults("sheet", "stvk");
  fabric.set("membrane_uu", 400);
  fabric.set("membrane_uv", 60);
  fabric.set("membrane_vv", 150);
  fabric.set("membrane_shear", 35);
  fabric.set("bend_uu", 4e-5);
  fabric.set("bend_uv", 5e-6);
  fabric.set("bend_vv", 1e-5);
  fabric.set("bend_twist", 1e-5);
  return fabric;
}

// St. Venant-Kirchhoff with v held: W = A11 E^2 / 2, E = s + s^2 / 2, so dW/ds = A11 E (1 + s).
TEST(MaterialResponse, StretchIsThatOfTheGreenStrain) {
  const std::array<double, 3> strains{-0.1, 0.02, 0.3};
  const MaterialResponse u = material_response(sheet(), MaterialTest::weft_stretch, strains);
  const MaterialResponse v = material_response(sheet(), MaterialTest::warp_stretch, strains);
  for (std::size_t k = 0; k < 3; ++k) {
    const double s = strains[k], by_stiffness = (s + s * s / 2) * (1 + s);
    const auto i = static_cast<Eigen::Index>(k);
    EXPECT_NEAR(u.stress[i], 400 * by_stiffness, 1e-9);
    EXPECT_NEAR(v.stress[i], 150 * by_stiffness, 1e-9);
    EXPECT_NEAR(u.derivative(i, 0), by_stiffness, 1e-12);
    EXPECT_NEAR(u.derivative(i, 3), 0, 1e-12);
  }
}

// x = (u + g v, v): E_vv = g^2 / 2, gamma = g, W = A22 g^4 / 8 + A66 g^2 / 2.
TEST(MaterialResponse, SimpleShear) {
  const std::array<double, 2> strains{0.1, -0.4};
  const MaterialResponse r = material_response(sheet(), MaterialTest::shear, strains);
  for (std::size_t k = 0; k < 2; ++k) {
    const double g = strains[k];
    EXPECT_NEAR(r.stress[static_cast<Eigen::Index>(k)], 150 * g * g * g / 2 + 35 * g, 1e-9);
  }
}

// M = D K on a cylinder. A cell spans 0.04 rad, whose chord is (0.04)^2 / 24 shorter than the arc;
// curvature and its derivative err by some multiples of that.
TEST(MaterialResponse, BendIsTheFlexuralRigidity) {
  const std::array<double, 2> strains{5, 40};
  const MaterialResponse u = material_response(sheet(), MaterialTest::weft_bend, strains);
  const MaterialResponse v = material_response(sheet(), MaterialTest::warp_bend, strains);
  for (std::size_t k = 0; k < 2; ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    EXPECT_NEAR(u.stress[i] / (4e-5 * strains[k]), 1, 1e-3);
    EXPECT_NEAR(v.stress[i] / (1e-5 * strains[k]), 1, 1e-3);
  }
}

TEST(MaterialResponse, RefusesWhatHasNoAnswer) {
  const std::array<double, 1> torn{-1.0}, fine{0.1};
  EXPECT_THROW(material_response(sheet(), MaterialTest::weft_stretch, torn), Error);
  EXPECT_THROW(
      material_response(Fabric::with_defaults("s", "springs"), MaterialTest::weft_stretch, fine),
      Error);
  EXPECT_THROW(
      material_response(Fabric::with_defaults("b", "baraff-witkin"), MaterialTest::shear, fine),
      Error);
}

}  // namespace
}  // namespace weft
