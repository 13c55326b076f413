#include "weft/fabric/kes_fabric.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "common/temporary_folder.h"
#include "weft/base/error.h"

namespace weft::kes_fabric_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr const char* kNumbers = R"(format = "weft-kes"
version = 1
name = "worsted"
W = 20.5
[weft]
EMT = 6.0
LT = 0.6
G = 0.8
2HG = 0.6
B = 0.07
2HB = 0.03
[warp]
EMT = 4.0
LT = 0.8
G = 1.0
2HG = 1.0
B = 0.11
)";

class KesFabric : public ::testing::Test {
 protected:
  std::filesystem::path write(std::string text, const std::string& from = "",
                              const std::string& to = "") {
    if (!from.empty()) text.replace(text.find(from), from.size(), to);
    const auto path = folder_.path() / "numbers.toml";
    std::ofstream(path) << text;
    return path;
  }
  test::TemporaryFolder folder_;
};

// By hand, with 1 gf = 9.80665e-3 N: 1 gf/cm = 0.980665 N/m, 1 gf/(cm deg) = 0.980665 x 57.29578
// N/m, 1 gf cm^2/cm = 1 gf cm = 9.80665e-5 N m, 1 gf cm/cm = 9.80665e-3 N.
TEST_F(KesFabric, UnitsAreThoseOfTheHandCalculation) {
  const Fabric fabric = find_fabric(write(kNumbers).string());
  EXPECT_EQ(fabric.name, "worsted");
  EXPECT_EQ(fabric.model, "soft-constraints");
  EXPECT_NEAR(*fabric.areal_density, 0.205, 1e-12);
  EXPECT_NEAR(fabric.value("shear"), 0.9 * 56.18796, 1e-4);
  EXPECT_NEAR(fabric.value("weft_bend"), 6.864655e-6, 1e-12);
  EXPECT_NEAR(fabric.value("warp_bend"), 1.0787315e-5, 1e-12);
  EXPECT_NEAR(fabric.value("diagonal_bend"), 8.605300e-6, 1e-11);
  EXPECT_NEAR(fabric.value("shear_friction"), 0.8 * 0.980665 / 2, 1e-9);
  EXPECT_NEAR(fabric.value("shear_friction_scale"), 0.00290888, 1e-8);
  EXPECT_NEAR(fabric.value("weft_bend_friction"), 0.015 * 9.80665e-3, 1e-12);
  EXPECT_NEAR(fabric.value("weft_bend_friction_scale"), 50.0 / 3, 1e-9);
  EXPECT_EQ(fabric.value_count("warp_bend_friction"), 0);
}

// The work of the tensile test, WT = LT Fm EMT / 2 with Fm = 500 gf/cm = 490.3325 N/m.
TEST_F(KesFabric, TensileCurvesHaveTheLoadAndTheWorkOfTheTest) {
  const Fabric fabric = find_fabric(write(kNumbers).string());
  const auto weft = fabric.curve("weft_stretch").respond(0.06);
  EXPECT_NEAR(weft.stress, 490.3325, 1e-6);
  // Slack parts are raised from 0 to 0.1 N/m, the least that a fabric holds.
  EXPECT_NEAR(weft.energy, 0.6 * 490.3325 * 0.06 / 2, 0.5 * 0.1 * 0.06 * 0.06);
  const auto warp = fabric.curve("warp_stretch").respond(0.04);
  EXPECT_NEAR(warp.stress, 490.3325, 1e-6);
  EXPECT_NEAR(warp.energy, 0.8 * 490.3325 * 0.04 / 2, 1e-9);
}

TEST(KesTensileCurve, HoldsWorkAndLoadForEveryLinearity) {
  for (const double linearity : {0.25, 0.4, 0.6, 0.66, 0.67, 0.8, 0.99, 1.0, 1.2}) {
    const auto end = kes::tensile_curve(400, 0.1, linearity).respond(0.1);
    EXPECT_NEAR(end.stress, 400, 1e-9) << linearity;
    EXPECT_NEAR(end.energy, linearity * 20, 1e-6) << linearity;
  }
  EXPECT_THROW(kes::tensile_curve(400, 0.1, 0.1), Error);
  EXPECT_THROW(kes::tensile_curve(0, 0.1, 1), Error);
}

TEST_F(KesFabric, IsWrittenAndReadBackAsAFabric) {
  const Fabric fabric = find_fabric(write(kNumbers).string());
  const Fabric again = fabric_from_toml(fabric_to_toml(fabric), "again.toml");
  EXPECT_EQ(again.values, fabric.values);
}

TEST_F(KesFabric, RefusesWhatIsMissingUnknownOrOutOfRange) {
  const auto refused = [&](const std::string& from, const std::string& to,
                           const std::string& what) {
    try {
      find_fabric(write(kNumbers, from, to).string());
      ADD_FAILURE() << "accepted: " << to;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), AllOf(HasSubstr("numbers.toml"), HasSubstr(what)));
    }
  };
  refused("B = 0.07\n", "", "B");
  refused("B = 0.07", "B = -1", "B");
  refused("LT = 0.6", "LT = 2.5", "LT");
  refused("EMT = 6.0", "EMT = 6.0\nRT = 60", "RT");
  refused("2HG = 1.0\n", "", "2HG");
}

}  // namespace
}  // namespace weft::kes_fabric_test
