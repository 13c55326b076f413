#include "weft/fabric/blender_cloth.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "weft/base/error.h"

namespace weft::blender_cloth_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// What Blender's preset "Cotton" is on cells of 25 mm, T = 1/30 s and 0.3 kg/m^2, worked out by
/// hand from the formulas in the header: F = h^2 / T^2 = 0.5625 N, k = 15 F / h and so on.
Fabric cotton() {
  Fabric fabric = Fabric::with_defaults("cotton", "baraff-witkin-hinges");
  fabric.include("twist_stiffness");
  fabric.include("drag_normal_linear");
  fabric.set("stretch_stiffness", 337.5);
  fabric.set("shear_stiffness", 0.01);
  fabric.set("diagonal_stiffness", 675);
  fabric.set("bend_stiffness", 8.7890625e-6);
  fabric.set("twist_stiffness", 4.0 / 3 * 8.7890625e-6);
  fabric.set("stretch_damping", 0.09375);
  fabric.set("diagonal_damping", 0.1875);
  fabric.set("bend_damping", 9.1552734375e-8);
  fabric.set("drag_linear", 0.3);
  fabric.set("drag_normal_linear", 0.3);
  fabric.set("drag_quadratic", 0);
  return fabric;
}

BlenderClothOptions cells(double spacing) { return {spacing, 30, 0.3, 0.5}; }

TEST(BlenderCloth, SettingsOfAPreset) {
  const BlenderCloth cloth = blender_cloth(cotton(), cells(0.025));
  EXPECT_DOUBLE_EQ(cloth.vertex_mass, 0.3);
  EXPECT_NEAR(cloth.tension_stiffness, 15, 1e-12);
  EXPECT_NEAR(cloth.shear_stiffness, 15, 1e-3);  // and twice the shear_stiffness of 0.01 N/m
  EXPECT_NEAR(cloth.bending_stiffness, 0.5, 1e-12);
  EXPECT_NEAR(cloth.tension_damping, 5, 1e-12);
  EXPECT_NEAR(cloth.shear_damping, 5, 1e-12);
  EXPECT_NEAR(cloth.bending_damping, 0.03125, 1e-12);
  EXPECT_NEAR(cloth.air_damping, 1, 1e-12);
  EXPECT_NEAR(cloth.gravity, 1 / 0.9, 1e-12);
  EXPECT_THAT(cloth.lost, IsEmpty());
}

TEST(BlenderCloth, TheSameFabricOnHalvedCells) {
  const BlenderCloth coarse = blender_cloth(cotton(), cells(0.025));
  const BlenderCloth fine = blender_cloth(cotton(), cells(0.0125));
  EXPECT_NEAR(fine.tension_stiffness / coarse.tension_stiffness, 2, 1e-12);
  EXPECT_NEAR(fine.bending_stiffness / coarse.bending_stiffness, 16, 1e-12);
  EXPECT_NEAR(fine.tension_damping / coarse.tension_damping, 4, 1e-12);
  EXPECT_NEAR(fine.bending_damping / coarse.bending_damping, 16, 1e-12);
  EXPECT_NEAR(fine.air_damping / coarse.air_damping, 1, 1e-12);
}

TEST(BlenderCloth, LighterVerticesWhereASettingWouldLeaveItsRange) {
  const BlenderCloth full = blender_cloth(cotton(), cells(0.025));
  const BlenderCloth light = blender_cloth(cotton(), cells(0.005));  // tension_damping: 125
  EXPECT_NEAR(light.tension_damping, 50, 1e-9);
  EXPECT_NEAR(light.vertex_mass, 0.3 * 50 / 125, 1e-9);
  EXPECT_NEAR(light.tension_stiffness / light.vertex_mass,
              5 * full.tension_stiffness / full.vertex_mass, 1e-9);
  EXPECT_NEAR(light.air_damping / light.vertex_mass, full.air_damping / full.vertex_mass, 1e-9);
}

TEST(BlenderCloth, SaysWhatIsLost) {
  Fabric fabric = cotton();
  fabric.set("drag_quadratic", 2);
  fabric.set("drag_degradation", 4);
  fabric.leave_out("twist_stiffness");
  fabric.set("shear_stiffness", 20);
  const BlenderCloth cloth = blender_cloth(fabric, cells(0.025));
  // 0.3 + 2 v / (1 + 4 v^2) at 0.5 m/s
  EXPECT_NEAR(cloth.air_damping, 0.8 / 0.3, 1e-12);
  EXPECT_THAT(cloth.lost,
              ElementsAre(HasSubstr("40 N/m is added"), HasSubstr("0.8 N s/m^3 at every speed"),
                          HasSubstr("the fabric has 0.3"), HasSubstr("the fabric has 8.79e-06")));
}

TEST(BlenderCloth, ShearWithoutDiagonalsBecomesDiagonals) {
  Fabric fabric = Fabric::with_defaults("plain");
  fabric.set("shear_stiffness", 40);
  const BlenderCloth cloth = blender_cloth(fabric, cells(0.025));
  // k_d = 2 k_s = 80 N/m = F shear_stiffness / h, F = 0.5625 N
  EXPECT_NEAR(cloth.shear_stiffness, 80 * 0.025 / 0.5625, 1e-12);
  EXPECT_THAT(cloth.lost, Contains(HasSubstr("in tension only")));
}

TEST(BlenderCloth, RefusesOtherModelsAndMeshesWithoutSize) {
  EXPECT_THROW(blender_cloth(Fabric::with_defaults("sheet", "stvk"), cells(0.01)), Error);
  EXPECT_THROW(blender_cloth(cotton(), cells(0)), Error);
  BlenderClothOptions no_rate = cells(0.01);
  no_rate.frame_rate = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(blender_cloth(cotton(), no_rate), Error);
}

TEST(BlenderCloth, ANameCannotLeaveItsString) {
  Fabric fabric = cotton();
  fabric.name = "a \"b\"\nimport os";
  const std::string script =
      blender_script(fabric, blender_cloth(fabric, cells(0.025)), cells(0.025));
  EXPECT_THAT(script, HasSubstr("FABRIC = \"a \\\"b\\\"\\nimport os\"\n"));
  EXPECT_THAT(script, HasSubstr("    \"tension_stiffness\": 15,\n"));
}

}  // namespace
}  // namespace weft::blender_cloth_test
