#include "weft/registration/registration_checks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "weft/base/error.h"

namespace weft::registration_checks_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

/// Points of a sheet of 0.3 x 0.2 m, upright, times `scale`.
Scan sheet(double scale) {
  Scan scan;
  scan.position.resize(3, 31 * 21);
  for (int j = 0; j < 21; ++j)
    for (int i = 0; i < 31; ++i) scan.position.col(31 * j + i) = scale * Vec3(i, 0, -j) / 100;
  return scan;
}
GridTemplate grid() { return make_grid_template(0.3, 0.2, 7, 5); }

template <class Function>
std::string refusal(const Function& function) {
  try {
    function();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}
std::string refusal_of_extent(const Scan& scan) {
  return refusal([&] { check_scan_extent(scan, grid(), {"a.ply", "--unit", ""}); });
}

TEST(RegistrationChecks, StraysDoNotCountInTheExtent) {
  Scan scan = sheet(1);
  scan.position.col(0) = Vec3(-1e6, 40, 3);
  EXPECT_NEAR((scan_extent(scan) - Vec3(0.3, 0, 0.2)).norm(), 0, 0.02);
  EXPECT_EQ(scan_extent(Scan{}), Vec3::Zero());
}

TEST(RegistrationChecks, AScanOfAnotherUnitIsRefused) {
  EXPECT_EQ(refusal_of_extent(sheet(1)), "no error");
  EXPECT_EQ(refusal_of_extent(sheet(25)), "no error");  // a room about the cloth
  EXPECT_THAT(refusal_of_extent(sheet(1000)),
              AllOf(StartsWith("a.ply: it is 300 x 0 x 200 m, the swatch 0.3 x 0.2 m; is --unit"),
                    HasSubstr("right?")));
  EXPECT_THAT(refusal_of_extent(sheet(0.001)), HasSubstr("--unit"));
  EXPECT_THAT(refusal_of_extent(sheet(0)), HasSubstr("it is 0 x 0 x 0 m"));
}

TEST(RegistrationChecks, ASheetThatWasNotFoundIsRefused) {
  ScanRegistration r;
  r.points = 651;
  r.weight = VecX::Zero(35);
  const auto check = [&](const ScanSource& source) {
    return refusal([&] { check_registration(r, sheet(1), grid(), source); });
  };
  EXPECT_THAT(check({"a.ply", "unit", ""}),
              AllOf(StartsWith("a.ply: the swatch was not found"), HasSubstr("0 of 651 points"),
                    HasSubstr("is unit (m per unit of its coordinates) right?")));
  EXPECT_THAT(check({"a.ply", "unit", "marks.csv"}), HasSubstr("is marks.csv in m"));
  r.weight[3] = 1;
  EXPECT_EQ(check({"a.ply", "unit", ""}), "no error");
}

TEST(RegistrationChecks, DoubtsAreOfSupportAndStrain) {
  ScanRegistration r;
  r.weight = VecX::Ones(40);
  r.weight.head(10).setZero();
  r.strain_rms = 0.05;
  EXPECT_EQ(unsupported_vertices(r), 10);
  EXPECT_TRUE(registration_doubts(r).empty());
  r.weight[10] = 0;
  r.strain_rms = 0.051;
  const std::vector<std::string> doubts = registration_doubts(r);
  ASSERT_EQ(doubts.size(), 2u);
  EXPECT_THAT(doubts[0], StartsWith("11 of 40 vertices are without points"));
  EXPECT_THAT(doubts[1], HasSubstr("strained by 5.1 % rms"));
}

}  // namespace
}  // namespace weft::registration_checks_test
