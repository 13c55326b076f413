#include "weft/fabric/arcsim_material.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
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

/// Energy by area of hinges on cells of 1 whose diagonals alternate, bent by small curvatures,
/// where the vertices of one colour have moved by the height that makes it least.
double alternating_energy(const weft::ArcsimMaterial& material, const Vec3& curvature) {
  const double threads[] = {material.bending(0, 0), material.bending(2, 0)},
               diagonal = material.bending(1, 0);
  const auto energy = [&](double height) {
    const auto z = [&](int x, int y) {
      return 0.5 * (curvature[0] * x * x + curvature[1] * y * y) + curvature[2] * x * y +
             ((x + y) % 2 ? 0 : height);
    };
    // k l^2 theta^2 / (8 A) with A = 1; (0, 0) has diagonals on all sides.
    double sum = 0;
    for (int side : {1, -1}) {
      const double across = z(side, 1) - 2 * z(side, 0) + z(side, -1),
                   along = z(1, side) - 2 * z(0, side) + z(-1, side);
      sum += (threads[0] * across * across + threads[1] * along * along) / 8;
      const double fold = (z(side, 0) + z(0, 1) - z(0, 0) - z(side, 1)) * std::sqrt(2.0);
      sum += diagonal * 2 * fold * fold / 8;
    }
    return sum / 2;
  };
  const double zero = energy(0), up = energy(1), down = energy(-1);
  return zero - (up - down) * (up - down) / (8 * (up + down - 2 * zero));
}

TEST_F(ArcsimMaterial, OnAGridWhoseDiagonalsAlternate) {
  Fabric fabric = filmed("baraff-witkin");
  fabric.include("twist_stiffness");
  fabric.values[fabric.value_index("twist_stiffness")] = 5e-6;
  const ArcsimCloth cloth =
      arcsim_cloth(fabric, {.areal_density = 0.2, .mesh = ArcsimMesh::alternating});
  const double d11 = 2 * alternating_energy(cloth.material, Vec3(1, 0, 0));
  const double d22 = 2 * alternating_energy(cloth.material, Vec3(0, 1, 0));
  const double both = 2 * alternating_energy(cloth.material, Vec3(1, 1, 0));
  EXPECT_NEAR(d11, 8e-6, 1e-15);
  EXPECT_NEAR(d22, 8e-6, 1e-15);
  EXPECT_NEAR(alternating_energy(cloth.material, Vec3(0, 0, 1)), 5e-6, 1e-15);
  EXPECT_THAT(cloth.lost.front(),
              HasSubstr(fmt::format("coupled there by {:.3g} N m", (both - d11 - d22) / 2)));
  // What is said of the other export is of the same plate.
  const ArcsimCloth any = arcsim_cloth(fabric, {.areal_density = 0.2});
  EXPECT_THAT(any.lost.front(),
              HasSubstr(fmt::format("{:.3g} along the threads",
                                    2 * alternating_energy(any.material, Vec3(1, 0, 0)))));
  const Fabric table = read_arcsim_material(write(kMaterial));
  EXPECT_THROW(arcsim_cloth(table, {.mesh = ArcsimMesh::alternating}), Error);
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
