#include "weft/estimate/posterior.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <limits>

#include "common/temporary_folder.h"
#include "estimate/analytic_problem.h"
#include "weft/base/error.h"
#include "weft/base/random.h"
#include "weft/estimate/evaluation_store.h"
#include "weft/estimate/stored_evaluations.h"

namespace weft::posterior_test {
namespace {

std::vector<double> row_of(const MatX& samples, Eigen::Index i) {
  return {samples.row(i).begin(), samples.row(i).end()};
}

// Standard errors: of a mean sigma / sqrt(effective), of a variance sqrt(2 / effective) of it. Four
// of them are allowed; for the variance with at least half of what is counted as effective.
TEST(SampleEnsemble, GaussianHasItsMeanAndCovariance) {
  MatX covariance(3, 3);
  // Correlated by 0.98, and a third direction ten times as narrow.
  covariance << 0.01, 0.0098, 0, 0.0098, 0.01, 0, 0, 0, 0.0001;
  const MatX information = covariance.inverse();
  const Vec3 mean(0.5, 0.4, 0.6);
  const LogDensity density = [&](const VecX& x) {
    return -0.5 * (x - mean).dot(information * (x - mean));
  };
  SamplingOptions options;
  options.steps = 4000;
  const SamplingResult found =
      sample_ensemble(density, Vec3(0.5, 0.5, 0.5), Vec3::Constant(-9), Vec3::Constant(9), options);
  EXPECT_GT(found.acceptance, 0.2);
  const VecX average = found.samples.rowwise().mean();
  const MatX centred = found.samples.colwise() - average;
  const MatX spread = centred * centred.transpose() / double(found.samples.cols());
  for (int i = 0; i < 3; ++i) {
    EXPECT_GT(found.effective(i), 500) << i;
    const double sigma = std::sqrt(covariance(i, i));
    EXPECT_NEAR(average[i], mean[i], 4 * sigma / std::sqrt(found.effective(i))) << i;
    EXPECT_NEAR(spread(i, i), covariance(i, i),
                4 * std::sqrt(4 / found.effective(i)) * covariance(i, i))
        << i;
  }
  EXPECT_NEAR(spread(0, 1) / std::sqrt(spread(0, 0) * spread(1, 1)), 0.98, 0.01);
}

// x: exponential, cut off at the bounds 0 and 1; y: uniform between them.
TEST(SampleEnsemble, BoundedDensityHasItsClosedForm) {
  const double rate = 5;
  const LogDensity density = [&](const VecX& x) { return -rate * x[0]; };
  SamplingOptions options;
  options.steps = 4000;
  const SamplingResult found =
      sample_ensemble(density, Vec2(0.1, 0.5), Vec2(0, 0), Vec2(1, 1), options);
  EXPECT_GE(found.samples.minCoeff(), 0);
  EXPECT_LE(found.samples.maxCoeff(), 1);
  const auto tolerance = [&](double p, double slope, Eigen::Index i) {
    return 4 * std::sqrt(p * (1 - p) / found.effective(i)) / slope;
  };
  for (const double p : {0.05, 0.5, 0.95}) {
    const double norm = 1 - std::exp(-rate);
    const double expected = -std::log(1 - p * norm) / rate;
    const double slope = rate * std::exp(-rate * expected) / norm;
    EXPECT_NEAR(sample_quantile(row_of(found.samples, 0), p), expected, tolerance(p, slope, 0))
        << p;
    EXPECT_NEAR(sample_quantile(row_of(found.samples, 1), p), p, tolerance(p, 1, 1)) << p;
  }
}

TEST(SampleEnsemble, TheSeedDecidesAndBadArgumentsAreRefused) {
  const LogDensity density = [](const VecX& x) { return -50 * (x[0] - 0.5) * (x[0] - 0.5); };
  const VecX start = VecX::Constant(1, 0.5), zero = VecX::Zero(1), one = VecX::Ones(1);
  SamplingOptions options;
  options.steps = 50;
  options.burn_in = 10;
  const MatX a = sample_ensemble(density, start, zero, one, options).samples;
  EXPECT_EQ(a, sample_ensemble(density, start, zero, one, options).samples);
  options.seed = 2;
  EXPECT_NE(a, sample_ensemble(density, start, zero, one, options).samples);
  const LogDensity nothing = [](const VecX&) { return -std::numeric_limits<double>::infinity(); };
  EXPECT_THROW(sample_ensemble(nothing, start, zero, one, options), Error);
  EXPECT_THROW(sample_ensemble(density, start, one, zero, options), Error);
  EXPECT_THROW(sample_ensemble(density, VecX::Zero(2), zero, one, options), Error);
  options.walkers = 7;
  EXPECT_THROW(sample_ensemble(density, start, zero, one, options), Error);
  EXPECT_THROW(sample_ensemble(density, start, zero, one, {}, [](auto, auto) { return false; }),
               Error);
  EXPECT_THROW(sample_quantile({}, 0.5), Error);
  EXPECT_EQ(sample_quantile({3, 1, 2}, 0.25), 1.5);
}

double skewed(const VecX& x) {
  const double a = (x[0] - 0.5) / 0.1, b = (x[1] - 0.5) / 0.2;
  return 0.5 * a * a + 0.5 * b * b + 0.15 * a * a * b;
}

TEST(LikelihoodSurrogate, EvaluationsCorrectTheQuadratic) {
  MatX information(2, 2);
  information << 100, 0, 0, 25;
  const VecX estimate = Vec2(0.5, 0.5);
  const LikelihoodSurrogate plain(estimate, information, VecX::Zero(2), {});
  EXPECT_EQ(plain.length(), 0);
  EXPECT_NEAR(plain.cost(Vec2(0.6, 0.7)), 1, 1e-12);

  Rng rng(3);
  std::vector<LikelihoodPoint> points;
  for (int i = 0; i < 60; ++i) {
    const VecX x = Vec2(0.5 + 0.1 * rng.normal(), 0.5 + 0.2 * rng.normal());
    points.push_back({x, skewed(x)});
  }
  const LikelihoodSurrogate corrected(estimate, information, VecX::Zero(2), points);
  EXPECT_GT(corrected.length(), 0);
  double before = 0, after = 0;
  for (int i = 0; i < 200; ++i) {
    const VecX x = Vec2(rng.uniform(0.4, 0.6), rng.uniform(0.3, 0.7));
    before += std::pow(corrected.quadratic(x) - skewed(x), 2);
    after += std::pow(corrected.cost(x) - skewed(x), 2);
  }
  EXPECT_LT(after, 0.1 * before);
}

TEST(LikelihoodSurrogate, ThePriorThatPulledTheEstimateCountsOnce) {
  // Data at 0.3 +- 0.1, prior at 0.5 +- 0.1: the estimate is at 0.4 +- 0.1 / sqrt(2). The data
  // alone fall by half from there to their own best.
  const auto data = [](double x) { return 0.5 * std::pow((x - 0.3) / 0.1, 2) - 0.5; };
  const auto prior = [](double x) { return 0.5 * std::pow((x - 0.5) / 0.1, 2) - 0.5; };
  const VecX estimate = VecX::Constant(1, 0.4), slope = VecX::Constant(1, 10);
  const MatX information = MatX::Constant(1, 1, 100);
  std::vector<LikelihoodPoint> points;
  for (const double x : {0.25, 0.35, 0.4, 0.45, 0.6})
    points.push_back({VecX::Constant(1, x), data(x)});
  for (const auto& evaluations : {std::vector<LikelihoodPoint>(), points}) {
    const LikelihoodSurrogate surrogate(estimate, information, slope, evaluations);
    for (const double x : {0.2, 0.3, 0.4, 0.5, 0.6}) {
      EXPECT_NEAR(surrogate.cost(VecX::Constant(1, x)), data(x), 1e-9) << x;
      EXPECT_NEAR(surrogate.cost(VecX::Constant(1, x)) + prior(x), std::pow((x - 0.4) / 0.1, 2),
                  1e-9);
    }
  }
  EXPECT_THROW(LikelihoodSurrogate(estimate, information, VecX::Zero(2), {}), Error);
}

TEST(LikelihoodSurrogate, NoiseIsNotFollowed) {
  Rng rng(4);
  std::vector<LikelihoodPoint> points;
  const MatX information = 100 * MatX::Identity(2, 2);
  for (int i = 0; i < 60; ++i) {
    const VecX x = Vec2(rng.uniform(), rng.uniform());
    points.push_back({x, 50 * (x - Vec2(0.5, 0.5)).squaredNorm() + 0.5 * rng.normal()});
  }
  const LikelihoodSurrogate surrogate(Vec2(0.5, 0.5), information, VecX::Zero(2), points);
  double square = 0;
  for (int i = 0; i < 200; ++i) {
    const VecX x = Vec2(rng.uniform(0.3, 0.7), rng.uniform(0.3, 0.7));
    square += std::pow(surrogate.cost(x) - surrogate.quadratic(x), 2) / 200;
  }
  EXPECT_LT(std::sqrt(square), 0.5);
}

TEST(StoredEvaluations, ComeBackWithTheirValues) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "evaluations.sqlite";
  EXPECT_THROW(read_evaluations(path, "", {"bend_stiffness"}), Error);
  const Problem problem = analytic_problem({"bend_stiffness"}, [](const VecX&) { return 0.0; });
  {
    EvaluationStore store(path);
    Fabric fabric = problem.initial();
    ProblemEvaluation evaluation;
    for (const double bend : {1e-5, 3e-5}) {
      fabric.set("bend_stiffness", bend);
      evaluation.error = 1e3 * bend;
      store.add(problem, fabric, 0, "anneal", evaluation);
    }
    store.add(problem, fabric, 5, "anneal", evaluation);  // few frames
    fabric.set("bend_stiffness", 4e-5);
    evaluation.error = std::numeric_limits<double>::infinity();
    evaluation.diverged = true;
    store.add(problem, fabric, 0, "anneal", evaluation);
  }
  const auto points =
      read_evaluations(path, problem.fingerprint(), {"drag_linear", "bend_stiffness"});
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[1].values[1], 3e-5);
  EXPECT_EQ(points[1].values[0], problem.initial().value("drag_linear"));
  EXPECT_EQ(points[1].error, 1e3 * 3e-5);
  EXPECT_TRUE(read_evaluations(path, "of another start", {"bend_stiffness"}).empty());
  // Of a fit that held another stretch nothing is told.
  const double stretch = problem.initial().value("stretch_stiffness");
  EXPECT_EQ(read_evaluations(path, problem.fingerprint(), {"bend_stiffness"},
                             {{"stretch_stiffness", stretch * (1 + 1e-8)}})
                .size(),
            2u);
  EXPECT_TRUE(read_evaluations(path, problem.fingerprint(), {"bend_stiffness"},
                               {{"stretch_stiffness", 2 * stretch}})
                  .empty());
}

}  // namespace
}  // namespace weft::posterior_test
