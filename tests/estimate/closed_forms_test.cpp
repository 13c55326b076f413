#include "estimate/closed_forms.h"

#include <gtest/gtest.h>

#include "dynamics/elastica.h"

namespace weft::closed_forms_test {
namespace {

constexpr double kMembrane = 3000, kBend = 2e-5;

TEST(ClosedForms, StripOfEveryElasticModel) {
  for (const auto& [fabric, strip] : test::elastic_cases(kMembrane, kBend))
    for (const double stretch : {1.01, 1.08})
      // 1e-4: the couplings that springs and stvk cannot do without.
      EXPECT_NEAR(test::strip_on_mesh(fabric, stretch, 5), strip(stretch), 1e-4 * strip(stretch))
          << fabric.model << " at " << stretch;
}

TEST(ClosedForms, CantileverOfEverySheet) {
  for (const auto& [fabric, strip] : test::elastic_cases(kMembrane, kBend)) {
    if (fabric.model == "springs") continue;
    for (const double load : {2.0, 20.0}) {
      const double expected = test::elastica_tip_deflection(load);
      const double coarse = test::cantilever_on_mesh(fabric, kBend, load, 10) / expected - 1;
      const double fine = test::cantilever_on_mesh(fabric, kBend, load, 20) / expected - 1;
      EXPECT_LT(std::abs(coarse), 0.015) << fabric.model << " at load " << load;
      EXPECT_LT(std::abs(fine), 0.005) << fabric.model << " at load " << load;
    }
  }
}

// Springs bend like no plate: the moment goes with the third power of the curvature and the fourth
// of the cell, so that a mesh twice as fine is 16 times limper. On a regular grid the clamp lies
// half a cell inside the clip.
TEST(ClosedForms, CantileverOfSpringsFollowsItsMesh) {
  Fabric fabric = test::elastic_cases(kMembrane, kBend).back().fabric;
  ASSERT_EQ(fabric.model, "springs");
  double before = 0;
  for (const int cells : {10, 20}) {
    const double spring = 500, h = 0.1 / cells, weight = kBend * 2000;
    fabric.set("weft_bend", spring);
    const double found = test::cantilever_on_mesh(fabric, kBend, 2, cells);
    const ElasticaProfile own =
        heavy_elastica(test::bend_law_of_springs(spring, h, 60), weight, 0.1 + h / 2);
    const double expected = -own.at(1, own.at.cols() - 1) / 0.1;
    EXPECT_NEAR(found, expected, 0.08 * expected) << cells;
    EXPECT_GT(found, 1.3 * before);
    before = found;
  }
}

}  // namespace
}  // namespace weft::closed_forms_test
