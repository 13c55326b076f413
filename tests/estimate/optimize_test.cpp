#include "weft/estimate/optimize.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>

#include "weft/base/error.h"
#include "weft/base/random.h"

namespace weft::optimize_test {
namespace {

/// Rastrigin's function on [0, 1]^n: a bowl with a ripple, about 4^n local minima, the lowest one
/// (0.05) off the centre.
double ripples(const VecX& x) {
  double sum = 0.05;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const double z = 4 * (x[i] - 0.37 - 0.03 * double(i));
    sum += z * z + 0.5 * (1 - std::cos(2 * std::numbers::pi * z));
  }
  return sum;
}

/// Rosenbrock's curved valley on [0, 1]^2; the lowest point (0) is at the image of (0.6, 0.36).
double valley(const VecX& x) {
  const double a = 3 * x[0] - 1.2;
  const double b = 3 * x[1] - 1.2;
  return 100 * std::pow(b - a * a, 2) + std::pow(0.6 - a, 2);
}

double random_search(const ErrorFunction& f, int dimension, int evaluations, std::uint64_t seed) {
  Rng rng(seed);
  double best = kInfinity;
  VecX x(dimension);
  for (int k = 0; k < evaluations; ++k) {
    for (double& coordinate : x) coordinate = rng.uniform();
    best = std::min(best, f(x));
  }
  return best;
}

/// Median over 11 seeds.
template <typename Run>
double median_error(const Run& run) {
  std::vector<double> errors;
  for (std::uint64_t seed = 0; seed < 11; ++seed) errors.push_back(run(seed));
  std::sort(errors.begin(), errors.end());
  return errors[5];
}

double annealed(const ErrorFunction& f, const VecX& start, std::size_t evaluations,
                std::uint64_t seed) {
  AnnealingOptions options;
  options.max_evaluations = evaluations;
  options.seed = seed;
  return anneal(f, start, options).error;
}

TEST(ReflectIntoUnit, FoldsAtBothBounds) {
  EXPECT_DOUBLE_EQ(reflect_into_unit(0.3), 0.3);
  EXPECT_DOUBLE_EQ(reflect_into_unit(-0.3), 0.3);
  EXPECT_DOUBLE_EQ(reflect_into_unit(1.25), 0.75);
  EXPECT_DOUBLE_EQ(reflect_into_unit(2.25), 0.25);
  EXPECT_DOUBLE_EQ(reflect_into_unit(1), 1);
  EXPECT_DOUBLE_EQ(reflect_into_unit(-3.5), 0.5);
}

TEST(CoarseSearch, VisitsTheCentresOfEqualCellsInTheListedDimensions) {
  CoarseOptions options;
  options.dimensions = {2, 0};
  VecX base(3);
  base << 0.9, 0.123, 0.9;
  const std::vector<VecX> grid = coarse_grid(base, options);
  ASSERT_EQ(grid.size(), 16u);
  std::set<std::pair<double, double>> seen;
  for (const VecX& x : grid) {
    EXPECT_EQ(x[1], 0.123);
    for (const int d : {0, 2}) {
      const double level = x[d] * 4 - 0.5;
      EXPECT_NEAR(level, std::round(level), 1e-12);
      EXPECT_TRUE(x[d] > 0 && x[d] < 1);
    }
    seen.insert({x[0], x[2]});
  }
  EXPECT_EQ(seen.size(), 16u);
}

TEST(CoarseSearch, FindsTheLowestCellWhateverTheThreads) {
  const ErrorFunction f = [](const VecX& x) {
    return x[0] > 0.8 ? kInfinity : std::abs(x[0] - 0.6) + std::abs(x[1] - 0.1);
  };
  for (const int threads : {1, 3}) {
    CoarseOptions options;
    options.dimensions = {0, 1};
    options.threads = threads;
    const SearchResult result = coarse_search(f, VecX::Constant(2, 0.5), options);
    EXPECT_EQ(result.evaluations, 16u);
    EXPECT_DOUBLE_EQ(result.best[0], 0.625);
    EXPECT_DOUBLE_EQ(result.best[1], 0.125);
    EXPECT_DOUBLE_EQ(result.error, f(result.best));
  }
}

TEST(CoarseSearch, OfEqualErrorsTheFirstWins) {
  CoarseOptions options;
  options.dimensions = {0};
  options.threads = 4;
  const SearchResult result =
      coarse_search([](const VecX&) { return 1.0; }, VecX::Zero(1), options);
  EXPECT_DOUBLE_EQ(result.best[0], 0.125);
}

TEST(CoarseSearch, EverythingDivergedLeavesTheBase) {
  CoarseOptions options;
  options.dimensions = {0};
  const VecX base = VecX::Constant(2, 0.4);
  const SearchResult result = coarse_search(
      [](const VecX&) { return std::numeric_limits<double>::quiet_NaN(); }, base, options);
  EXPECT_EQ(result.error, kInfinity);
  EXPECT_EQ(result.best, base);
}

TEST(CoarseSearch, RejectsBadOptions) {
  const ErrorFunction f = [](const VecX&) { return 0.0; };
  const VecX base = VecX::Zero(12);
  EXPECT_THROW(coarse_search(f, base, {.levels = 0, .dimensions = {0}}), Error);
  EXPECT_THROW(coarse_search(f, base, {.levels = 4, .dimensions = {12}}), Error);
  EXPECT_THROW(coarse_search(f, base, {.levels = 4, .dimensions = {-1}}), Error);
  EXPECT_THROW(coarse_search(f, base, {.levels = 4, .dimensions = {3, 3}}), Error);
  EXPECT_THROW(coarse_search(f, base, {.levels = 10, .dimensions = {0, 1, 2, 3, 4, 5, 6}}), Error);
}

TEST(CoarseSearch, ObserverStopsIt) {
  CoarseOptions options;
  options.dimensions = {0, 1};
  options.threads = 1;
  std::size_t calls = 0;
  const SearchResult result =
      coarse_search([](const VecX& x) { return x.sum(); }, VecX::Zero(2), options,
                    [&](std::size_t done, double, double, double) { return ++calls, done < 3; });
  EXPECT_TRUE(result.stopped);
  EXPECT_EQ(calls, 3u);
  EXPECT_DOUBLE_EQ(result.error, 0.25);
}

// From a start 1.5 ripples away from the lowest minimum along both axes; the next lowest minima are
// at 0.96.
TEST(Anneal, LeavesLocalMinima) {
  const VecX start = VecX::Constant(2, 0.75);
  const double found =
      median_error([&](std::uint64_t seed) { return annealed(ripples, start, 400, seed); });
  const double by_chance =
      median_error([&](std::uint64_t seed) { return random_search(ripples, 2, 400, seed); });
  EXPECT_LT(found, 0.051);
  EXPECT_LT(20 * (found - 0.05), by_chance - 0.05);
}

TEST(Anneal, NineDimensionsWithAQuarterMillionLocalMinima) {
  const VecX start = VecX::Constant(9, 0.75);
  const double found =
      median_error([&](std::uint64_t seed) { return annealed(ripples, start, 600, seed); });
  const double by_chance =
      median_error([&](std::uint64_t seed) { return random_search(ripples, 9, 600, seed); });
  EXPECT_LT(found, 0.5 * by_chance);
}

TEST(Anneal, FollowsACurvedValley) {
  const VecX start = VecX::Constant(2, 0.9);
  const double found =
      median_error([&](std::uint64_t seed) { return annealed(valley, start, 400, seed); });
  const double by_chance =
      median_error([&](std::uint64_t seed) { return random_search(valley, 2, 400, seed); });
  EXPECT_LT(20 * found, by_chance);
}

TEST(Anneal, NineDimensionsWithRippleOfAFewPercent) {
  // A bowl whose curvatures span a factor of 60, with a ripple: what an error surface looks like.
  const ErrorFunction f = [](const VecX& x) {
    double sum = 0.1, weight = 1;
    for (Eigen::Index i = 0; i < x.size(); ++i) {
      sum += weight * std::pow(x[i] - 0.3 - 0.04 * double(i), 2) +
             1e-3 * (1 + std::sin(900 * x[i] + 3 * double(i)));
      weight *= 0.6;
    }
    return sum;
  };
  const VecX start = VecX::Constant(9, 0.9);
  const double found =
      median_error([&](std::uint64_t seed) { return annealed(f, start, 600, seed); });
  const double by_chance =
      median_error([&](std::uint64_t seed) { return random_search(f, 9, 600, seed); });
  EXPECT_LT(found - 0.1, 0.5 * (by_chance - 0.1));
  EXPECT_LT(found - 0.1, 0.02 * (f(start) - 0.1));
}

TEST(Anneal, SameSeedSameResultWhateverTheThreads) {
  AnnealingOptions options;
  options.max_evaluations = 200;
  options.seed = 5;
  options.parallel_moves = 3;
  const VecX start = VecX::Constant(6, 0.7);
  std::vector<double> first, again;
  options.threads = 1;
  const SearchResult one =
      anneal(ripples, start, options, [&](std::size_t, double error, double, double) {
        first.push_back(error);
        return true;
      });
  options.threads = 4;
  const SearchResult four =
      anneal(ripples, start, options, [&](std::size_t, double error, double, double) {
        again.push_back(error);
        return true;
      });
  EXPECT_EQ(first, again);
  EXPECT_EQ(one.best, four.best);
  options.seed = 6;
  EXPECT_NE(anneal(ripples, start, options).best, one.best);
}

TEST(Anneal, UsesItsBudgetAndCoolsGeometrically) {
  AnnealingOptions options;
  options.max_evaluations = 101;
  options.initial_temperature = 2;
  options.final_temperature_ratio = 1e-2;
  std::size_t calls = 0;
  double last = kInfinity;
  const SearchResult result =
      anneal(ripples, VecX::Constant(3, 0.2), options,
             [&](std::size_t done, double, double best, double temperature) {
               EXPECT_EQ(done, ++calls);
               EXPECT_LE(temperature, last);
               EXPECT_GE(best, 0.05);
               last = temperature;
               return true;
             });
  EXPECT_EQ(result.evaluations, 101u);
  EXPECT_EQ(calls, 101u);
  // The temperature of a batch is that of its first evaluation: at most a simplex before the end.
  EXPECT_NEAR(std::log(last / 0.02), 0, std::log(100.0) * 4 / 101);
}

TEST(Anneal, StaysInsideTheBoundsAndReachesACorner) {
  AnnealingOptions options;
  options.max_evaluations = 400;
  const SearchResult result = anneal(
      [](const VecX& x) {
        EXPECT_TRUE((x.array() >= 0).all() && (x.array() <= 1).all());
        return 1 + x.sum();
      },
      VecX::Constant(3, 0.8), options);
  EXPECT_LT(result.error, 1.02);
}

TEST(Anneal, FindsItsWayOutOfADivergingRegion) {
  const ErrorFunction f = [](const VecX& x) {
    return x[0] > 0.5 ? kInfinity : (x - VecX::Constant(3, 0.3)).squaredNorm() + 1;
  };
  AnnealingOptions options;
  options.max_evaluations = 300;
  const SearchResult result = anneal(f, VecX::Constant(3, 0.95), options);
  EXPECT_LT(result.error, 1.01);
}

TEST(Anneal, SurvivesAnErrorThatIsNeverFinite) {
  AnnealingOptions options;
  options.max_evaluations = 50;
  const SearchResult result =
      anneal([](const VecX&) { return kInfinity; }, VecX::Constant(2, 0.5), options);
  EXPECT_EQ(result.evaluations, 50u);
  EXPECT_EQ(result.error, kInfinity);
  EXPECT_EQ(result.best, VecX::Constant(2, 0.5));
}

TEST(Anneal, ObserverStopsItWithTheBestSoFar) {
  AnnealingOptions options;
  double best = kInfinity;
  const SearchResult result = anneal(ripples, VecX::Constant(4, 0.7), options,
                                     [&](std::size_t done, double error, double so_far, double) {
                                       best = std::min(best, error);
                                       EXPECT_EQ(best, so_far);
                                       return done < 40;
                                     });
  EXPECT_TRUE(result.stopped);
  EXPECT_LT(result.evaluations, 46u);  // what was evaluated together with the 40th
  EXPECT_EQ(result.error, best);
  EXPECT_EQ(result.error, ripples(result.best));
}

TEST(Anneal, RejectsBadOptions) {
  const VecX start = VecX::Constant(2, 0.5);
  const auto run = [&](auto change) {
    AnnealingOptions options;
    change(options);
    anneal(ripples, start, options);
  };
  EXPECT_THROW(run([](auto& o) { o.max_evaluations = 0; }), Error);
  EXPECT_THROW(run([](auto& o) { o.initial_temperature = -1; }), Error);
  EXPECT_THROW(run([](auto& o) { o.final_temperature_ratio = 0; }), Error);
  EXPECT_THROW(run([](auto& o) { o.simplex_size = 0; }), Error);
  EXPECT_THROW(run([](auto& o) { o.reset_factor = 1; }), Error);
  EXPECT_THROW(run([](auto& o) { o.parallel_moves = 0; }), Error);
  EXPECT_THROW(anneal(ripples, VecX::Constant(2, 1.5), {}), Error);
  EXPECT_THROW(anneal(ripples, VecX(), {}), Error);
}

}  // namespace
}  // namespace weft::optimize_test
