#include "weft/mesh/grid_lines.h"

#include <gmock/gmock.h>

#include <cmath>

#include "weft/base/error.h"

namespace weft::grid_lines_test {
namespace {

using ::testing::DoubleNear;
using ::testing::ElementsAre;

TEST(GridLines, HaveTheBordersAndEqualCellsBetween) {
  const auto near = [](double x) { return DoubleNear(x, 1e-15); };
  EXPECT_THAT(grid_lines(0.1, {0.04}, 0.03), ElementsAre(0.0, near(0.02), 0.04, near(0.07), 0.1));
  // At an end, twice, or off the swatch: no further line.
  EXPECT_THAT(grid_lines(0.1, {0.1, 0.04, 0.04 + 1e-12, 0, -1, 2}, 0.1),
              ElementsAre(0.0, 0.04, 0.1));
  EXPECT_EQ(grid_lines(0.3, {}, 0.1).size(), 4u);  // 0.3 / 0.1 is a little below 3
  EXPECT_THROW(grid_lines(0.1, {std::nan("")}, 0.1), Error);
  EXPECT_THROW(grid_lines(0.1, {}, 0), Error);
}

TEST(GradedLines, GrowFromTheFineEnds) {
  const GridGrading both{
      .spacing = 0.01, .first = 0.002, .growth = 0.1, .fine_lower = true, .fine_upper = true};
  const std::vector<double> lines = graded_lines(0.02, 0.12, both);
  EXPECT_EQ(lines.front(), 0.02);
  EXPECT_EQ(lines.back(), 0.12);
  const std::size_t n = lines.size() - 1;
  for (std::size_t i = 0; i < n; ++i) {
    const double width = lines[i + 1] - lines[i];
    EXPECT_GT(width, 0.0015);
    EXPECT_LE(width, 0.01);
    // Symmetric, to the midpoint rule's error.
    EXPECT_NEAR(width, lines[n - i] - lines[n - i - 1], 1e-6);
    if (i == 0) continue;
    EXPECT_LT(std::abs(width / (lines[i] - lines[i - 1]) - 1), 0.12);
  }
  EXPECT_NEAR(lines[1] - lines[0], 0.002, 0.0003);
  const GridGrading plain{.spacing = 0.025, .first = 0.025};
  EXPECT_EQ(graded_lines(0, 0.1, plain).size(), 5u);
  EXPECT_THROW(graded_lines(0.1, 0.1, plain), Error);
}

TEST(SwatchFromLines, IsTheSwatchWhereLinesAreEven) {
  const TriangleMesh even = make_swatch(0.2, 0.1, 3, 2);
  const TriangleMesh same = make_swatch({0, 0.1, 0.2}, {0, 0.1});
  EXPECT_EQ(same.triangles, even.triangles);
  EXPECT_LT((same.material - even.material).cwiseAbs().maxCoeff(), 1e-15);
  EXPECT_NO_THROW(validate(make_swatch({0, 0.1, 0.11, 0.4}, {0, 0.05, 0.2}), "graded"));
  EXPECT_THROW(make_swatch({0, 0.1, 0.1}, {0, 0.1}), Error);
}

}  // namespace
}  // namespace weft::grid_lines_test
