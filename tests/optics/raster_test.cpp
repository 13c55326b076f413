#include "weft/optics/raster.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "weft/base/random.h"

namespace weft::raster_test {
namespace {

constexpr int kColumns = 40, kRows = 30;

/// How often each sample of the image is visited.
class Visits {
 public:
  void draw(ImagePoint a, ImagePoint b, ImagePoint c) {
    for_each_span(a, b, c, kColumns, kRows, [&](int row, int begin, int end) {
      ASSERT_TRUE(row >= 0 && row < kRows && begin >= 0 && begin < end && end <= kColumns);
      add(row, begin, end);
    });
  }
  void add(int row, int begin, int end) {
    for (int column = begin; column < end; ++column) ++counts_[index(row, column)];
  }
  bool operator==(const Visits&) const = default;
  int at(int row, int column) const { return counts_[index(row, column)]; }

 private:
  static std::size_t index(int row, int column) {
    return static_cast<std::size_t>(row * kColumns + column);
  }
  std::vector<int> counts_ = std::vector<int>(kColumns * kRows);
};

/// Distance of a sample to the line through p and q, px; positive on one side.
double distance(ImagePoint p, ImagePoint q, int row, int column) {
  const double x = double(q.x) - double(p.x), y = double(q.y) - double(p.y);
  return (x * (row + 0.5 - double(p.y)) - y * (column + 0.5 - double(p.x))) / std::hypot(x, y);
}

/// The smallest distance to a side, positive inside.
double depth_inside(ImagePoint a, ImagePoint b, ImagePoint c, int row, int column) {
  const double ab = distance(a, b, row, column), bc = distance(b, c, row, column);
  const double ca = distance(c, a, row, column);
  return std::max(std::min({ab, bc, ca}), std::min({-ab, -bc, -ca}));
}

/// Partly outside the image, and some with a level side or on whole rows.
ImagePoint random_point(Rng& rng) {
  const auto x = static_cast<float>(rng.uniform(-15, kColumns + 15));
  const auto y = static_cast<float>(rng.uniform(-15, kRows + 15));
  return {x, rng.uniform() < 0.3 ? std::floor(y) + 0.5f : y};
}

TEST(Spans, CoverTheSamplesInsideATriangle) {
  Rng rng(5);
  for (int trial = 0; trial < 300; ++trial) {
    const ImagePoint a = random_point(rng), b = random_point(rng);
    ImagePoint c = random_point(rng);
    if (trial % 3 == 0) c.y = b.y;
    Visits visits;
    visits.draw(a, b, c);
    for (int row = 0; row < kRows; ++row)
      for (int column = 0; column < kColumns; ++column) {
        const double inside = depth_inside(a, b, c, row, column);
        if (std::abs(inside) < 1e-3) continue;
        ASSERT_EQ(visits.at(row, column), inside > 0 ? 1 : 0)
            << "triangle " << trial << ", row " << row << ", column " << column;
      }
  }
}

TEST(Spans, ASampleOnASharedSideBelongsToOneTriangle) {
  Rng rng(6);
  for (int trial = 0; trial < 100; ++trial) {
    // A fan about a point: every sample inside the quadrilateral once, whatever side it is on.
    const ImagePoint middle{static_cast<float>(rng.uniform(5, 35)),
                            static_cast<float>(std::floor(rng.uniform(5, 25))) + 0.5f};
    const std::array<ImagePoint, 4> corners{
        ImagePoint{-5, -5}, {kColumns + 5, -5}, {kColumns + 5, kRows + 5}, {-5, kRows + 5}};
    Visits visits;
    for (std::size_t k = 0; k < 4; ++k) visits.draw(middle, corners[k], corners[(k + 1) % 4]);
    for (int row = 0; row < kRows; ++row)
      for (int column = 0; column < kColumns; ++column)
        ASSERT_EQ(visits.at(row, column), 1) << "row " << row << ", column " << column;
  }
}

TEST(Spans, SeveralTrianglesInBandsCoverWhatEachCovers) {
  Rng rng(7);
  for (int trial = 0; trial < 50; ++trial) {
    std::array<PointLanes, 3> corners;
    for (PointLanes& corner : corners)
      for (int k = 0; k < kFloatLanes; ++k) {
        const ImagePoint point = random_point(rng);
        corner.x[k] = point.x, corner.y[k] = point.y;
      }
    std::array<Visits, kFloatLanes> each, together;
    for (int first = 0; first < kRows; first += 7) {
      const Extent band{first, std::min(first + 7, kRows)};
      const TriangleSpans spans(corners[0], corners[1], corners[2], band);
      for (int k = 0; k < kFloatLanes; ++k)
        spans.for_rows(k, kColumns, [&](const TriangleSpans::Rows& rows) {
          ASSERT_TRUE(rows.first >= band.first && rows.first + rows.count <= band.last);
          for (int i = 0; i < rows.count; ++i) {
            EXPECT_EQ(rows.y[i], static_cast<float>(rows.first + i) + 0.5f);
            together[static_cast<std::size_t>(k)].add(rows.first + i, rows.begin[i], rows.end[i]);
          }
        });
    }
    for (int k = 0; k < kFloatLanes; ++k) {
      const auto at = static_cast<std::size_t>(k);
      const auto corner = [&](std::size_t i) {
        return ImagePoint{corners[i].x[k], corners[i].y[k]};
      };
      each[at].draw(corner(0), corner(1), corner(2));
      EXPECT_EQ(together[at], each[at]) << "trial " << trial << ", triangle " << k;
    }
  }
}

}  // namespace
}  // namespace weft::raster_test
