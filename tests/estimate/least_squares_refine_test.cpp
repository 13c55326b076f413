#include "weft/estimate/least_squares_refine.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "weft/base/error.h"

namespace weft {
namespace {

/// An ellipsoid of axes that differ 100 times, turned by 30 degrees.
MatX narrow() {
  const double c = std::cos(std::numbers::pi / 6), s = std::sin(std::numbers::pi / 6);
  MatX turn(2, 2);
  turn << c, -s, s, c;
  MatX axes = MatX::Zero(2, 2);
  axes.diagonal() << 4e4, 4;
  return turn * axes * turn.transpose();
}

const VecX kMinimum = Vec2(0.4, 0.6);

/// 1 at kMinimum, with ripples that stop a descent.
double rippled(const VecX& x) {
  const VecX d = x - kMinimum;
  return 1 + 0.5 * d.dot(narrow() * d) + 0.02 * (1 - std::cos(200 * d.sum()));
}

RefineOptions some() {
  RefineOptions options;
  options.generations = 20;
  options.population = 8;
  options.spread = 0.2;
  options.largest_step = 0.2;
  return options;
}

TEST(Refine, CrossesRipplesInANarrowValley) {
  // 0.15 along the valley: the smooth part is 4.5 % above its minimum.
  const VecX start = kMinimum + 0.15 * Vec2(-0.5, std::cos(std::numbers::pi / 6));
  const SearchResult found = refine(rippled, start, rippled(start), narrow(), some());
  EXPECT_LT(found.error, 1 + 0.1 * (rippled(start) - 1));
  EXPECT_EQ(found.error, rippled(found.best));
  EXPECT_EQ(found.evaluations, 160u);
}

TEST(Refine, NeverEndsAboveItsStart) {
  const SearchResult found = refine(rippled, kMinimum, 1, narrow(), some());
  EXPECT_EQ(found.error, 1);
  EXPECT_EQ(found.best, kMinimum);
  RefineOptions none;
  none.generations = 0;
  EXPECT_EQ(refine(rippled, kMinimum, 1, narrow(), none).evaluations, 0u);
}

TEST(Refine, TheSameForAnyThreads) {
  RefineOptions one = some(), four = some();
  one.threads = 1;
  four.threads = 4;
  const VecX start = Vec2(0.5, 0.5);
  EXPECT_EQ(refine(rippled, start, rippled(start), narrow(), one).best,
            refine(rippled, start, rippled(start), narrow(), four).best);
}

// The first samples: with H = 2 / s^2 along every direction the model expects half the spread's
// rise for one standard deviation of one coordinate of two.
TEST(Refine, FirstSamplesRaiseTheModelAsTold) {
  RefineOptions options = some();
  options.generations = 1;
  options.population = 1000;
  options.largest_step = 10;
  const MatX h = 4e4 * MatX::Identity(2, 2);
  double rise = 0;
  refine([&](const VecX& x) { return 1 + 0.5 * (x - kMinimum).dot(h * (x - kMinimum)); }, kMinimum,
         1, h, options,
         [&](std::size_t, const VecX&, double error) {
           rise += (error - 1) / 1000;
           return true;
         });
  EXPECT_NEAR(rise, options.spread, 0.1 * options.spread);  // 1000 samples: 3 %
}

TEST(Refine, StaysInsideAndSurvivesInfiniteErrors) {
  const SearchResult found = refine(
      [](const VecX& x) {
        EXPECT_TRUE((x.array() >= 0).all() && (x.array() <= 1).all());
        return x[0] > 0.05 ? std::numeric_limits<double>::infinity() : 1 + x[1];
      },
      Vec2(0.01, 0.5), 1.5, MatX::Zero(2, 2), some());
  EXPECT_LT(found.error, 1.5);
}

TEST(Refine, StopsWhenToldTo) {
  std::size_t seen = 0;
  const SearchResult found = refine(rippled, kMinimum, 1, narrow(), some(),
                                    [&](std::size_t, const VecX&, double) { return ++seen < 5; });
  EXPECT_TRUE(found.stopped);
  EXPECT_EQ(found.evaluations, 8u);  // a generation is finished
}

TEST(Refine, RejectsBadArguments) {
  for (const auto& spoil :
       {+[](RefineOptions& o) { o.generations = -1; }, +[](RefineOptions& o) { o.population = 3; },
        +[](RefineOptions& o) { o.spread = 0; }, +[](RefineOptions& o) { o.largest_step = 0; }}) {
    RefineOptions options;
    spoil(options);
    EXPECT_THROW(refine(rippled, kMinimum, 1, narrow(), options), Error);
  }
  EXPECT_THROW(refine(rippled, kMinimum, 1, MatX::Identity(3, 3)), Error);
}

}  // namespace
}  // namespace weft
