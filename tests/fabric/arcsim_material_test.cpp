#include "weft/fabric/arcsim_material.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "common/temporary_folder.h"
#include "weft/base/error.h"

namespace weft::arcsim_material_test {
namespace {

using ::testing::AllOf;
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
  EXPECT_EQ(fabric.value("rest_vv"), 60);
  EXPECT_EQ(fabric.value("weft_shear"), -4);
  EXPECT_EQ(fabric.value("warp_uu"), 70);
  EXPECT_EQ(fabric.value("diagonal_bend_20"), 3e-6);
  EXPECT_EQ(fabric.value("warp_bend_0"), 2e-6);
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

}  // namespace
}  // namespace weft::arcsim_material_test
