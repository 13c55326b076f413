#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/elastic_battery.h"
#include "weft/model/material_response.h"

namespace weft::motion_elastic_test {
namespace {

constexpr double kSize = 0.02;  // m, edge of a grid cell

Fabric fabric_of(const char* model) {
  Fabric fabric = Fabric::with_defaults("test", model);
  fabric.set("stretch_stiffness", 40);
  fabric.set("shear_stiffness", 12);
  fabric.set("bend_stiffness", 3e-3);
  return fabric;
}

TEST(MotionElastic, Battery) {
  for (const double grain : {0.0, 0.4})
    testing::expect_elastic_model(make_swatch(3 * kSize, 2 * kSize, 4, 3),
                                  fabric_of("baraff-witkin"), kSize, grain);
}

// Stress k (|w| - 1) per width along a thread, k for the other one, shear k w_u . w_v.
TEST(MotionElastic, StressIsLinearInTheStrain) {
  const std::array<double, 2> strains{0.03, 0.2};
  const Fabric fabric = fabric_of("baraff-witkin");
  for (const MaterialTest test : {MaterialTest::weft_stretch, MaterialTest::warp_stretch}) {
    const MaterialResponse r = material_response(fabric, test, strains);
    for (Eigen::Index k = 0; k < 2; ++k) {
      EXPECT_NEAR(r.stress[k], 40 * strains[static_cast<std::size_t>(k)], 1e-9);
      EXPECT_NEAR(r.derivative(k, 0), strains[static_cast<std::size_t>(k)], 1e-9);
      EXPECT_EQ(r.derivative.row(k).tail(6).norm(), 0);  // damping and drag do nothing at rest
    }
  }
}

// With v held both diagonals are stretched to d = sqrt((1 + (1 + e)^2) / 2): k_d (d - 1) (1 + e) /
// d more. None in compression.
TEST(MotionElastic, TautDiagonalsAddToTheStress) {
  const std::array<double, 3> strains{0.03, 0.2, -0.1};
  for (const char* model : {"baraff-witkin-diagonals", "baraff-witkin-hinges"}) {
    Fabric fabric = fabric_of(model);
    fabric.set("diagonal_stiffness", 60);
    for (const MaterialTest test : {MaterialTest::weft_stretch, MaterialTest::warp_stretch}) {
      const MaterialResponse r = material_response(fabric, test, strains);
      for (Eigen::Index k = 0; k < 3; ++k) {
        const double e = strains[static_cast<std::size_t>(k)];
        const double d = std::sqrt((1 + (1 + e) * (1 + e)) / 2);
        const double diagonals = std::max(0.0, d - 1) * (1 + e) / d;
        EXPECT_NEAR(r.stress[k], 40 * e + 60 * diagonals, 1e-9) << model;
        EXPECT_NEAR(r.derivative(k, fabric.value_index("diagonal_stiffness")), diagonals, 1e-9);
      }
    }
  }
}

}  // namespace
}  // namespace weft::motion_elastic_test
