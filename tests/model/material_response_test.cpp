#include "weft/model/material_response.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "weft/base/error.h"

namespace weft::material_response_test {
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

// A strip on the bias: K_uu = K_vv = K_uv = K / 2, so M = (D11 + D22 + 2 D12 + 4 D66) / 4 K.
TEST(MaterialResponse, DiagonalBendHasTheTwist) {
  const std::array<double, 2> strains{5, -40};
  const MaterialResponse r = material_response(sheet(), MaterialTest::diagonal_bend, strains);
  for (std::size_t k = 0; k < 2; ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    EXPECT_NEAR(r.stress[i] / ((4e-5 + 1e-5 + 2 * 5e-6 + 4 * 1e-5) / 4 * strains[k]), 1, 2e-3);
    EXPECT_NEAR(r.derivative(i, 7) / strains[k], 1, 2e-3);
  }
}

Fabric rubbing_sheet() {
  Fabric fabric = Fabric::with_defaults("rubbing", "stvk-diagonal");
  for (const char* row : {"weft_stretch_friction", "weft_stretch_friction_scale",
                          "weft_bend_friction", "weft_bend_friction_scale"})
    fabric.include(row);
  fabric.set("weft_stretch_friction", 2);
  fabric.set("weft_stretch_friction_scale", 0.001);
  fabric.set("weft_bend_friction", 1e-4);
  fabric.set("weft_bend_friction_scale", 1);
  return fabric;
}

// Far from the turns friction adds its amplitude on the way out and takes it on the way back.
TEST(MaterialResponse, ACycleShowsTheLoopOfFriction) {
  const std::array<double, 3> stretch{0.02, 0.05, 0.02}, bend{20, 50, 20};
  const MaterialResponseOptions cycle{.path = StrainPath::continued};
  const MaterialResponse u =
      material_response(rubbing_sheet(), MaterialTest::weft_stretch, stretch, cycle);
  // By Green strain: times 1 + s.
  EXPECT_NEAR(u.stress[0] - u.stress[2], 2 * 2 * 1.02, 1e-6);
  const MaterialResponse k =
      material_response(rubbing_sheet(), MaterialTest::weft_bend, bend, cycle);
  EXPECT_NEAR(k.stress[0] - k.stress[2], 2 * 1e-4, 1e-7);
  const MaterialResponse apart =
      material_response(rubbing_sheet(), MaterialTest::weft_stretch, stretch);
  EXPECT_NEAR(apart.stress[0], apart.stress[2], 1e-9);
  // On the way back the history has the parameters in it, too.
  const Fabric fabric = rubbing_sheet();
  for (const char* name : {"weft_stretch_friction", "weft_stretch_friction_scale"}) {
    const std::array<double, 3> near_the_turn{0.02, 0.05, 0.0495};
    const auto stress = [&](double change) {
      Fabric other = fabric;
      other.set(name, fabric.value(name) * (1 + change));
      return material_response(other, MaterialTest::weft_stretch, near_the_turn, cycle).stress[2];
    };
    const double step = 1e-5;
    const double by_difference = (stress(step) - stress(-step)) / (2 * step * fabric.value(name));
    const double derivative =
        material_response(fabric, MaterialTest::weft_stretch, near_the_turn, cycle)
            .derivative(2, fabric.value_index(name));
    EXPECT_NEAR(derivative / by_difference, 1, 1e-6) << name;
  }
}

// c = s along the weft; shear springs of square cells of c / 2, to first order. Next neighbours
// but one are stretched as their edges are: the bend's stiffness counts as well.
TEST(MaterialResponse, SpringsAreStretched) {
  Fabric springs = Fabric::with_defaults("springs", "springs");
  springs.set("weft_stretch", 300);
  springs.set("shear", 20);
  for (const char* bend : {"weft_bend", "warp_bend", "diagonal_bend"}) springs.set(bend, 1e-6);
  const std::array<double, 1> strain{1e-5};
  EXPECT_NEAR(
      material_response(springs, MaterialTest::weft_stretch, strain).stress[0] / (320 * strain[0]),
      1, 1e-4);
  EXPECT_NEAR(material_response(springs, MaterialTest::shear, strain).stress[0] / (20 * strain[0]),
              1, 1e-4);
}

// Edges keep their length h; the chord over two that turn by K h is 2 h cos(K h / 2). Its spring
// stands for a cell: W = k c^2 / 2 with c = - (K h)^2 / 8, to the fourth power of the width.
TEST(MaterialResponse, SpringsBendAsTheirCellsAreWide) {
  Fabric springs = Fabric::with_defaults("springs", "springs");
  springs.set("weft_bend", 3);
  springs.set("diagonal_bend", 1e-6);
  const std::array<double, 1> strain{10};
  for (const double cell : {0.002, 0.004}) {
    const double moment =
        material_response(springs, MaterialTest::weft_bend, strain, {.cell = cell}).stress[0];
    EXPECT_NEAR(moment / (3 * 1e3 * std::pow(cell, 4) / 32), 1, 1e-3);
  }
}

TEST(MaterialResponse, RefusesWhatHasNoAnswer) {
  const std::array<double, 1> torn{-1.0}, fine{0.1};
  EXPECT_THROW(material_response(sheet(), MaterialTest::weft_stretch, torn), Error);
  EXPECT_THROW(
      material_response(Fabric::with_defaults("s", "springs"), MaterialTest::weft_bend, fine),
      Error);
  EXPECT_THROW(material_response(sheet(), MaterialTest::weft_stretch, fine, {.cell = -1}), Error);
}

}  // namespace
}  // namespace weft::material_response_test
