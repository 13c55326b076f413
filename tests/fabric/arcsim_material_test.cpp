#include "weft/fabric/arcsim_material.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "common/temporary_folder.h"
#include "weft/base/error.h"

namespace weft::arcsim_material_test {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr const char* kMaterial = R"(// made up
{ "density": 0.25,
  "stretching": [[40, 6, 60, 30], [55, 9, 100, -4], [50, 8, 90, 20], [60, 12, 95, 35],
                 [65, 11, 110, 25], [70, 10, 130, 28]],
  "bending": [[4e-6, 5e-6, 6e-6, 5e-6, 3e-6], [3e-6, 3.5e-6, 4e-6, 4e-6, 3e-6],
              [2e-6, 2.5e-6, 2.6e-6, 2.7e-6, 1e-6]] }
)";

class ArcsimMaterial : public ::testing::Test {
 protected:
  std::filesystem::path write(std::string text, const std::string& from = "",
                              const std::string& to = "") {
    if (!from.empty()) text.replace(text.find(from), from.size(), to);
    const auto path = folder_.path() / "cloth.json";
    std::ofstream(path) << text;
    return path;
  }
  void expect_error(const std::string& from, const std::string& to, const std::string& what) {
    const auto path = write(kMaterial, from, to);
    try {
      read_arcsim_material(path);
      FAIL() << "accepted: " << to;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), AllOf(HasSubstr("cloth.json"), HasSubstr(what)));
    }
  }
  test::TemporaryFolder folder_;
};

TEST_F(ArcsimMaterial, ReadsTheTable) {
  const auto path = write(kMaterial);
  const Fabric fabric = read_arcsim_material(path);
  EXPECT_EQ(fabric.name, "cloth");
  EXPECT_EQ(fabric.model, "piecewise-linear");
  EXPECT_EQ(fabric.areal_density, 0.25);
  EXPECT_EQ(fabric.values.size(), 39);
  EXPECT_EQ(fabric.value("rest_vv"), 2 * 60);
  EXPECT_EQ(fabric.value("weft_shear"), 2 * -4);
  EXPECT_EQ(fabric.value("warp_uu"), 2 * 70);
  EXPECT_EQ(fabric.value("diagonal_bend_40"), 3e-6 / 4);
  // The first row is of edges along the weft, which resist curvature along the warp.
  EXPECT_EQ(fabric.value("warp_bend_10"), 5e-6 / 4);
  EXPECT_EQ(fabric.value("weft_bend_0"), 2e-6 / 4);
  EXPECT_EQ(find_fabric(path.string()).values, fabric.values);
  const Fabric again = fabric_from_toml(fabric_to_toml(fabric), "cloth.toml");
  EXPECT_EQ(again.values, fabric.values);
}

TEST_F(ArcsimMaterial, RejectsAnythingElse) {
  expect_error("[40, 6, 60, 30]", "[40, 6, 60]", "stretching[0]");
  expect_error("[40, 6, 60, 30],", "", "stretching");
  expect_error("3.5e-6", "\"soft\"", "bending[1]");
  expect_error("3.5e-6", "-1e-6", "bending");
  expect_error("0.25", "0", "density");
  expect_error("\"density\": 0.25,", "", "density");
  expect_error("\"density\"", "\"mass\"", "mass");
  expect_error("\"bending\":", "\"bending\"", "cloth.json:5: is not JSON");
  expect_error("0.25", "1e999", "cloth.json:2: 1e999 is too large");
  EXPECT_THROW(read_arcsim_material(folder_.path() / "none.json"), Error);
}

TEST_F(ArcsimMaterial, IsWrittenAsItWasRead) {
  const Fabric fabric = read_arcsim_material(write(kMaterial));
  const ArcsimCloth cloth = arcsim_cloth(fabric, {.areal_density = *fabric.areal_density});
  EXPECT_EQ(cloth.material.stretching(1, 3), -4);
  EXPECT_EQ(cloth.material.bending(0, 1), 5e-6);
  EXPECT_THAT(cloth.lost, ElementsAre(HasSubstr("folds to one side")));
  const Fabric again = read_arcsim_material(write(arcsim_text(fabric, cloth)));
  EXPECT_TRUE(again.values.isApprox(fabric.values, 1e-8));  // nine digits are written
  EXPECT_EQ(again.areal_density, fabric.areal_density);
}

Fabric filmed(const std::string& model) {
  Fabric fabric = Fabric::with_defaults("filmed", model);
  const auto set = [&](std::string_view name, double value) {
    fabric.values[fabric.value_index(name)] = value;
  };
  set("stretch_stiffness", 300);
  set("shear_stiffness", 40);
  set("bend_stiffness", 8e-6);
  set("stretch_damping", 0.03);
  set("shear_damping", 0.004);
  set("bend_damping", 8e-9);
  set("drag_linear", 0.2);
  set("drag_quadratic", 1.5);
  set("drag_degradation", 0);
  return fabric;
}

TEST_F(ArcsimMaterial, OfAFilmedFabric) {
  const Fabric fabric = filmed("baraff-witkin");
  const ArcsimCloth cloth = arcsim_cloth(fabric, {.areal_density = 0.2});
  EXPECT_EQ(cloth.material.density, 0.2);
  for (int row = 0; row < 6; ++row)
    EXPECT_EQ(cloth.material.stretching.row(row), Eigen::RowVector4d(150, 0, 150, 40)) << row;
  EXPECT_TRUE((cloth.material.bending.array() == 32e-6).all());
  EXPECT_DOUBLE_EQ(cloth.damping, 1e-4);
  EXPECT_EQ(cloth.wind_density, 1.5);
  EXPECT_EQ(cloth.wind_drag, 0.2);
  // Five sixths of the plate between hinges whose cells alternate, and twice its twist.
  EXPECT_THAT(cloth.lost,
              ElementsAre(HasSubstr("6.67e-06 along the threads"), HasSubstr("0.001 s of bend")));
  // The table is the fabric's law for small strains: its stretch, shear and bend are the model's.
  const Fabric table = read_arcsim_material(write(arcsim_text(fabric, cloth)));
  EXPECT_EQ(table.value("deg22_uu"), 300);
  EXPECT_EQ(table.value("rest_shear"), 2 * 40);  // by E_uv, half of the angle
  EXPECT_NEAR(table.value("weft_bend_30"), 8e-6, 1e-14);
}

TEST_F(ArcsimMaterial, SaysWhatIsLost) {
  Fabric fabric = filmed("baraff-witkin-diagonals");
  fabric.values[fabric.value_index("diagonal_stiffness")] = 200;
  fabric.values[fabric.value_index("drag_degradation")] = 4;
  fabric.include("twist_stiffness");
  fabric.values[fabric.value_index("twist_stiffness")] = 16e-6;
  const ArcsimCloth cloth = arcsim_cloth(fabric, {.areal_density = 0.2, .drag_speed = 0.5});
  EXPECT_EQ(cloth.material.stretching(0, 3), 90);
  EXPECT_DOUBLE_EQ(cloth.material.bending(1, 0), 48e-6);
  EXPECT_DOUBLE_EQ(cloth.wind_density, 0.75);
  EXPECT_THAT(cloth.lost,
              ElementsAre(HasSubstr("Shear is 90 N/m"), HasSubstr("twist is 2.4e-05 there"),
                          HasSubstr("s of bend"), HasSubstr("as the fabric's at 0.5 m/s")));
  EXPECT_THROW(arcsim_cloth(Fabric::with_defaults("plate", "stvk"), {}), Error);
  EXPECT_THROW(arcsim_cloth(fabric, {.areal_density = 0}), Error);
  EXPECT_THROW(arcsim_cloth(fabric, {.drag_speed = -1}), Error);
}

}  // namespace
}  // namespace weft::arcsim_material_test
