#include "weft/estimate/least_squares.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

#include "weft/base/error.h"
#include "weft/base/random.h"

namespace weft::least_squares_test {
namespace {

/// Residuals and their Jacobian as the callbacks of the solver; cost r^T r.
struct Residuals {
  std::function<VecX(const VecX&)> r;
  std::function<MatX(const VecX&)> jacobian;

  QuadraticModel model(const VecX& x) const {
    const VecX values = r(x);
    const MatX j = jacobian(x);
    return {values.squaredNorm(), 2 * j.transpose() * values, 2 * j.transpose() * j};
  }
  LeastSquaresResult minimize(const VecX& start, const VecX& lower, const VecX& upper,
                              const LeastSquaresOptions& options) const {
    return minimize_least_squares([this](const VecX& x) { return model(x); },
                                  [this](const VecX& x) { return r(x).squaredNorm(); }, start,
                                  lower, upper, options);
  }
};

LeastSquaresOptions tight() {
  LeastSquaresOptions options;
  options.max_iterations = 200;
  options.step_tolerance = 1e-10;
  options.cost_tolerance = 0;
  options.largest_step = 1;
  return options;
}

Residuals rosenbrock() {
  return {[](const VecX& x) {
            VecX r(2);
            r << 10 * (x[1] - x[0] * x[0]), 1 - x[0];
            return r;
          },
          [](const VecX& x) {
            MatX j(2, 2);
            j << -20 * x[0], 10, -1, 0;
            return j;
          }};
}

TEST(LeastSquares, FindsTheMinimumOfRosenbrocksValley) {
  const LeastSquaresResult found =
      rosenbrock().minimize(Vec2(-1.2, 1), VecX::Constant(2, -5), VecX::Constant(2, 5), tight());
  EXPECT_NEAR(found.x[0], 1, 1e-6);
  EXPECT_NEAR(found.x[1], 1, 1e-6);
  EXPECT_LT(found.iterations, 50);
}

// With x <= 0.5 the minimum over y is y = x^2 and (1 - x)^2 falls up to the bound.
TEST(LeastSquares, StopsAtAnActiveBoundOfRosenbrocksValley) {
  const LeastSquaresResult found =
      rosenbrock().minimize(Vec2(-1.2, 1), VecX::Constant(2, -5), Vec2(0.5, 5), tight());
  EXPECT_EQ(found.x[0], 0.5);
  EXPECT_NEAR(found.x[1], 0.25, 1e-6);
  EXPECT_NEAR(found.cost, 0.25, 1e-9);
}

// One Gauss-Newton step, up to the damping, solves a linear problem.
TEST(LeastSquares, SolvesALinearProblemInFewSteps) {
  Rng rng(3);
  MatX a(20, 4);
  VecX b(20);
  for (double& value : a.reshaped()) value = rng.normal();
  for (double& value : b) value = 0.1 * rng.normal();
  const Residuals linear{[&](const VecX& x) -> VecX { return a * x - b; },
                         [&](const VecX&) { return a; }};
  const VecX exact = (a.transpose() * a).ldlt().solve(a.transpose() * b);
  ASSERT_LT(exact.lpNorm<Eigen::Infinity>(), 1);
  const LeastSquaresResult found =
      linear.minimize(VecX::Zero(4), VecX::Constant(4, -1), VecX::Constant(4, 1), tight());
  EXPECT_LT((found.x - exact).norm(), 1e-8);
  EXPECT_LE(found.iterations, 8);
}

TEST(LeastSquares, DirectionsWithoutDataDoNotMove) {
  // Only x + y is measured; z not at all.
  const Residuals one{[](const VecX& x) { return VecX::Constant(1, x[0] + x[1] - 0.5); },
                      [](const VecX&) {
                        MatX j(1, 3);
                        j << 1, 1, 0;
                        return j;
                      }};
  const LeastSquaresResult found =
      one.minimize(Vec3(0.1, 0.2, 0.7), VecX::Zero(3), VecX::Ones(3), tight());
  EXPECT_NEAR(found.x[0], 0.2, 1e-8);
  EXPECT_NEAR(found.x[1], 0.3, 1e-8);
  EXPECT_EQ(found.x[2], 0.7);
}

TEST(LeastSquares, AnInfiniteCostIsARejectedStep) {
  // log x has no value at and below zero, where the first full step from 0.9 leads.
  const auto residual = [](double x) { return x > 0 ? std::log(x) + 2 : std::nan(""); };
  int infinite = 0;
  const auto cost = [&](const VecX& x) {
    if (x[0] > 0) return residual(x[0]) * residual(x[0]);
    ++infinite;
    return std::numeric_limits<double>::infinity();
  };
  const auto model = [&](const VecX& x) {
    const double r = residual(x[0]), j = 1 / x[0];
    return QuadraticModel{r * r, VecX::Constant(1, 2 * r * j), MatX::Constant(1, 1, 2 * j * j)};
  };
  LeastSquaresOptions options = tight();
  options.largest_step = 10;
  const LeastSquaresResult found = minimize_least_squares(
      model, cost, VecX::Constant(1, 0.9), VecX::Constant(1, -5), VecX::Constant(1, 5), options);
  EXPECT_GT(infinite, 0);
  EXPECT_NEAR(found.x[0], std::exp(-2), 1e-7);
}

TEST(LeastSquares, AnInfiniteCostShortensStepsAndDoesNotDampThoseAfterIt) {
  // Linear, but for costs that are infinite further than 0.1 from where the last model was made: as
  // equilibria that are not found from afar. Steps of 0.3 / 4 and then at most twice the last.
  double from = 0;
  const auto residual = [](const VecX& x) { return 1e3 * (x[0] - 0.5); };
  const auto model = [&](const VecX& x) {
    from = x[0];
    const double r = residual(x);
    return QuadraticModel{r * r, VecX::Constant(1, 2e3 * r), MatX::Constant(1, 1, 2e6)};
  };
  const auto cost = [&](const VecX& x) {
    if (std::abs(x[0] - from) > 0.1) return std::numeric_limits<double>::infinity();
    return residual(x) * residual(x);
  };
  LeastSquaresOptions options = tight();
  options.largest_step = 0.3;
  const LeastSquaresResult found = minimize_least_squares(
      model, cost, VecX::Constant(1, 0), VecX::Constant(1, -1), VecX::Constant(1, 1), options);
  EXPECT_NEAR(found.x[0], 0.5, 1e-8);
  // 0.075 six times and the rest, then the end is seen; 14 with damping in the box's place.
  EXPECT_LE(found.iterations, 9);
}

TEST(LeastSquares, AnInfiniteStartIsSaid) {
  const double infinity = std::numeric_limits<double>::infinity();
  const LeastSquaresResult found = minimize_least_squares(
      [&](const VecX&) {
        return QuadraticModel{infinity, {}, {}};
      },
      [&](const VecX&) { return infinity; }, VecX::Constant(1, 0.5), VecX::Zero(1), VecX::Ones(1));
  EXPECT_EQ(found.end, LeastSquaresEnd::start_infinite);
  EXPECT_EQ(found.x[0], 0.5);
}

TEST(LeastSquares, WhatWasReachedStaysWhereALinearizationFails) {
  const auto residual = [](const VecX& x) { return x[0] - 0.9; };
  const LeastSquaresResult found = minimize_least_squares(
      [&](const VecX& x) {
        const double cost =
            x[0] > 0.1 ? std::numeric_limits<double>::infinity() : residual(x) * residual(x);
        return QuadraticModel{cost, VecX::Constant(1, 2 * residual(x)), MatX::Constant(1, 1, 2)};
      },
      [&](const VecX& x) { return residual(x) * residual(x); }, VecX::Zero(1), VecX::Zero(1),
      VecX::Ones(1));
  EXPECT_EQ(found.end, LeastSquaresEnd::linearization_infinite);
  EXPECT_NEAR(found.x[0], 0.3, 1e-12);  // the largest step
  EXPECT_NEAR(found.cost, 0.36, 1e-12);
}

TEST(LeastSquares, ObserverSeesEachStepAndStops) {
  int seen = 0;
  const Residuals problem = rosenbrock();
  const LeastSquaresResult found =
      minimize_least_squares([&](const VecX& x) { return problem.model(x); },
                             [&](const VecX& x) { return problem.r(x).squaredNorm(); },
                             Vec2(-1.2, 1), VecX::Constant(2, -5), VecX::Constant(2, 5), tight(),
                             [&](const LeastSquaresStep&) { return ++seen < 3; });
  EXPECT_EQ(seen, 3);
  EXPECT_EQ(found.evaluations, 3);
  EXPECT_EQ(found.end, LeastSquaresEnd::stopped);
}

TEST(LeastSquares, NoStepIsLongerThanAllowed) {
  LeastSquaresOptions options = tight();
  options.largest_step = 0.05;
  VecX at = Vec2(-1.2, 1);
  const Residuals problem = rosenbrock();
  minimize_least_squares([&](const VecX& x) { return problem.model(x); },
                         [&](const VecX& x) { return problem.r(x).squaredNorm(); }, at,
                         VecX::Constant(2, -5), VecX::Constant(2, 5), options,
                         [&](const LeastSquaresStep& step) {
                           EXPECT_LE((step.x - at).lpNorm<Eigen::Infinity>(), 0.05 + 1e-12);
                           if (step.accepted) at = step.x;
                           return true;
                         });
  EXPECT_NEAR(at[0], 1, 1e-6);
}

TEST(LeastSquares, RejectsBadArguments) {
  const auto model = [](const VecX&) { return QuadraticModel{}; };
  const auto cost = [](const VecX&) { return 0.0; };
  const VecX one = VecX::Ones(1), two = VecX::Ones(2);
  EXPECT_THROW(minimize_least_squares(model, cost, one, two, two), Error);
  EXPECT_THROW(minimize_least_squares(model, cost, VecX(), VecX(), VecX()), Error);
  EXPECT_THROW(minimize_least_squares(model, cost, one, one, -one), Error);
  for (const auto& spoil : {+[](LeastSquaresOptions& o) { o.max_iterations = 0; },
                            +[](LeastSquaresOptions& o) { o.step_tolerance = -1; },
                            +[](LeastSquaresOptions& o) { o.cost_tolerance = std::nan(""); },
                            +[](LeastSquaresOptions& o) { o.initial_damping = 0; },
                            +[](LeastSquaresOptions& o) { o.raise = 1; },
                            +[](LeastSquaresOptions& o) { o.largest_step = 0; }}) {
    LeastSquaresOptions options;
    spoil(options);
    EXPECT_THROW(minimize_least_squares(model, cost, one, -one, one, options), Error);
  }
}

// Against the conditions of Karush, Kuhn and Tucker, over random programs with all kinds of active
// sets.
TEST(BoxProgram, MeetsTheOptimalityConditions) {
  Rng rng(7);
  int bound = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const int n = 1 + trial % 9;
    MatX root(n, n);
    for (double& value : root.reshaped()) value = rng.normal();
    const MatX a = root.transpose() * root + 1e-3 * MatX::Identity(n, n);
    VecX g(n), lower(n), upper(n);
    for (int i = 0; i < n; ++i) {
      g[i] = 3 * rng.normal();
      lower[i] = rng.uniform() < 0.2 ? 0 : -rng.uniform();
      upper[i] = rng.uniform() < 0.2 ? 0 : rng.uniform();
    }
    const VecX s = minimize_in_box(a, g, lower, upper);
    const VecX gradient = g + a * s;
    for (int i = 0; i < n; ++i) {
      EXPECT_GE(s[i], lower[i]);
      EXPECT_LE(s[i], upper[i]);
      if (lower[i] == upper[i]) continue;
      if (s[i] == lower[i])
        EXPECT_GE(gradient[i], -1e-9);
      else if (s[i] == upper[i])
        EXPECT_LE(gradient[i], 1e-9);
      else
        EXPECT_NEAR(gradient[i], 0, 1e-7);
      bound += s[i] == lower[i] || s[i] == upper[i];
    }
  }
  EXPECT_GT(bound, 200);
}

TEST(PayingSteps, EndAfterTwoSmallOnesInTurn) {
  const auto step = [](double cost) {
    return LeastSquaresStep{.x = {}, .cost = cost, .accepted = true};
  };
  LeastSquaresStep rejected = step(2);
  rejected.accepted = false;
  PayingSteps steps(kInfinity, 10);
  EXPECT_TRUE(steps.pay_after(step(1)));
  EXPECT_TRUE(steps.pay_after(step(0.9995)));   // by 0.005 of the sum of squares
  EXPECT_TRUE(steps.pay_after(rejected));       // says nothing
  EXPECT_TRUE(steps.pay_after(step(0.9)));      // by 1
  EXPECT_TRUE(steps.pay_after(step(0.8995)));   // by 0.005
  EXPECT_FALSE(steps.pay_after(step(0.8990)));  // and again
}

// In the principal directions the steps are independent, and each raises the parabola alike, but
// where the cost is flat the width ends them.
TEST(DrawByCurvature, PointsLieAlongTheValley) {
  const double s = std::sqrt(0.5);
  MatX directions(2, 2);
  directions << s, s, -s, s;
  const QuadraticModel model{3, VecX::Zero(2),
                             directions * Vec2(4000, 1e-6).asDiagonal() * directions.transpose()};
  Rng rng(7);
  const VecX middle = VecX::Constant(2, 0.5);
  const int count = 4000;
  const auto points = draw_by_curvature(middle, model, count, rng, {0.2, 0.05});
  ASSERT_EQ(points.size(), static_cast<std::size_t>(count));
  MatX covariance = MatX::Zero(2, 2);
  for (const VecX& point : points) {
    const VecX step = directions.transpose() * (point - middle);
    covariance += step * step.transpose() / count;
  }
  // 1/2 4000 variance = 0.2 * 3 / 2. The variance of a sample of 4000 scatters by 2.2 %.
  EXPECT_NEAR(covariance(0, 0), 1.5e-4, 0.1 * 1.5e-4);
  EXPECT_NEAR(covariance(1, 1), 2.5e-3, 0.1 * 2.5e-3);
  EXPECT_NEAR(covariance(0, 1), 0, 0.1 * std::sqrt(1.5e-4 * 2.5e-3));
}

TEST(DrawByCurvature, StaysInTheRangesAndRefusesNoWidth) {
  const QuadraticModel model{1, VecX::Zero(1), MatX::Zero(1, 1)};
  Rng rng(1);
  for (const VecX& point : draw_by_curvature(VecX::Ones(1), model, 50, rng)) {
    EXPECT_GE(point[0], 0);
    EXPECT_LE(point[0], 1);
  }
  EXPECT_THROW(draw_by_curvature(VecX::Ones(1), model, 1, rng, {0, 0.1}), Error);
  EXPECT_THROW(draw_by_curvature(VecX::Ones(1), model, 1, rng, {0.1, 0}), Error);
}

}  // namespace
}  // namespace weft::least_squares_test
