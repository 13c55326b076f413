#include "weft/estimate/mesh_error.h"

#include <gtest/gtest.h>

namespace weft::mesh_error_test {
namespace {

constexpr double kNoise = 0.02;  // of the mean of 100 squares

QuadraticModel model_of(const Vec2& gradient, const Vec2& diagonal) {
  return {1, gradient, MatX(diagonal.asDiagonal())};
}

TEST(MeshError, TheShiftIsTheStepOnFinerCellsLessTheOneHere) {
  const Vec2 inside(0.4, 0.5);
  const VecX shift =
      mesh_shift(inside, model_of({0.1, -0.2}, {2, 5}), model_of({-0.3, 0.1}, {3, 4}), kNoise);
  EXPECT_NEAR(shift[0], 0.3 / 3 + 0.1 / 2, 1e-15);
  EXPECT_NEAR(shift[1], -0.1 / 4 - 0.2 / 5, 1e-15);
  const VecX widths = mesh_half_widths(shift);
  EXPECT_NEAR(widths[0], 0.3, 1e-15);
  EXPECT_NEAR(widths[1], 0.13, 1e-15);
  EXPECT_EQ(mesh_half_widths({}).size(), 0);
}

// The variance of a coordinate is 2 / (count h): with h = 0.07 its standard deviation is 0.53.
TEST(MeshError, ADirectionThatIsNotDeterminedDoesNotCount) {
  const QuadraticModel here = model_of({0, 0}, {2, 0.09}), finer = model_of({0.1, 0.1}, {2, 0.07});
  const VecX shift = mesh_shift(Vec2(0.5, 0.5), here, finer, kNoise);
  EXPECT_NEAR(shift[0], -0.05, 1e-15);
  EXPECT_EQ(shift[1], 0);
}

// The coupling of the two would move the first one, too, if the second were not held.
TEST(MeshError, AParameterStaysAtTheBoundThatHoldsIt) {
  QuadraticModel here{1, Vec2(0, -0.5), MatX::Zero(2, 2)}, finer = here;
  here.hessian << 2, 1, 1, 3;
  finer.hessian = here.hessian;
  finer.gradient = Vec2(0.2, -0.1);
  const VecX shift = mesh_shift(Vec2(0.5, 1), here, finer, kNoise);
  EXPECT_NEAR(shift[0], -0.1, 1e-15);
  EXPECT_EQ(shift[1], 0);
  // Finer cells take it off the bound: -H^-1 g, both move.
  finer.gradient = Vec2(0, 0.5);
  const VecX released = mesh_shift(Vec2(0.5, 1), here, finer, kNoise);
  EXPECT_NEAR(released[0], 0.1, 1e-15);
  EXPECT_NEAR(released[1], -0.2, 1e-15);
}

}  // namespace
}  // namespace weft::mesh_error_test
