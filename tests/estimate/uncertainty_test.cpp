#include "weft/estimate/uncertainty.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

#include "estimate/analytic_problem.h"
#include "weft/base/dense.h"
#include "weft/base/error.h"
#include "weft/base/random.h"

namespace weft::uncertainty_test {
namespace {

/// A linear problem y = A x + noise, in clusters within which the noise of neighbours is
/// correlated; solved by least squares.
struct LinearProblem {
  int clusters = 30, size = 200;
  double correlation = 0.98;  ///< of neighbours in a cluster
  double noise = 0.3;
  VecX truth;

  struct Solution {
    VecX x;
    std::vector<CostPart> parts;
    double residual_variance = 0;
    MatX inverse_normal;
  };

  /// Columns of the design differ in how they vary inside a cluster and between clusters.
  Solution solve(std::uint64_t seed) const {
    Rng rng(seed);
    const auto n = truth.size();
    std::vector<MatX> a(static_cast<std::size_t>(clusters), MatX(size, n));
    std::vector<VecX> y(a.size(), VecX(size));
    MatX normal = MatX::Zero(n, n);
    VecX right = VecX::Zero(n);
    for (std::size_t k = 0; k < a.size(); ++k) {
      double e = rng.normal();
      for (int i = 0; i < size; ++i) {
        for (Eigen::Index j = 0; j < n; ++j)
          a[k](i, j) = 1 + std::cos(0.02 * double((j + 1) * i) + double(k) * double(j));
        e = correlation * e + std::sqrt(1 - correlation * correlation) * rng.normal();
        y[k][i] = a[k].row(i).dot(truth) + noise * e;
      }
      normal += a[k].transpose() * a[k];
      right += a[k].transpose() * y[k];
    }
    Solution solution;
    solution.x = solve_symmetric(normal, right);
    solution.inverse_normal = inverse(normal);
    for (std::size_t k = 0; k < a.size(); ++k) {
      const VecX r = a[k] * solution.x - y[k];
      solution.residual_variance += r.squaredNorm() / (clusters * size);
      solution.parts.push_back(
          {0, static_cast<int>(k), 2 * a[k].transpose() * r, 2 * a[k].transpose() * a[k]});
    }
    return solution;
  }
};

// Over 400 repetitions the standard error of a share of 90 % is 1.5 %.
TEST(Uncertainty, IntervalsCoverTheTruthUnderCorrelatedNoise) {
  LinearProblem problem;
  problem.truth = Vec3(0.3, -0.2, 0.5);
  const double t = student_quantile(0.95, problem.clusters - 1);
  const int repetitions = 400;
  Vec3 covered = Vec3::Zero(), covered_if_independent = Vec3::Zero();
  for (int i = 0; i < repetitions; ++i) {
    const auto solution = problem.solve(1000 + static_cast<std::uint64_t>(i));
    const ClusterCovariance found = cluster_covariance(solution.parts);
    for (int j = 0; j < 3; ++j) {
      const double error = std::abs(solution.x[j] - problem.truth[j]);
      covered[j] += error <= t * std::sqrt(found.covariance(j, j));
      covered_if_independent[j] +=
          error <= 1.645 * std::sqrt(solution.residual_variance * solution.inverse_normal(j, j));
    }
  }
  for (int j = 0; j < 3; ++j) {
    EXPECT_GT(covered[j], 0.85 * repetitions) << j;
    EXPECT_LT(covered[j], 0.95 * repetitions) << j;
  }
  // What is guarded against: residuals taken for independent.
  EXPECT_LT(covered_if_independent.minCoeff(), 0.5 * repetitions);
}

// cov(g_k) = phi H_k by construction. Of (K - 1) m = 36 squares a repetition, 200 repetitions: the
// relative standard error of the mean is sqrt(2 / 36 / 200) = 1.7 %.
TEST(Uncertainty, DispersionIsUnbiasedAndDoesNotDependOnWhereItIsTaken) {
  const double phi = 7.5;
  const int repetitions = 200, clusters = 10, n = 4;
  double mean = 0;
  for (int i = 0; i < repetitions; ++i) {
    Rng rng(static_cast<std::uint64_t>(i), 5);
    std::vector<CostPart> parts;
    for (int k = 0; k < clusters; ++k) {
      MatX a(n + 2, n);
      for (double& entry : a.reshaped()) entry = (1 + k) * rng.normal();
      const MatX h = a.transpose() * a;
      VecX noise(n);
      for (double& entry : noise) entry = rng.normal();
      parts.push_back({0, k, std::sqrt(phi) * (MatX(h.llt().matrixL()) * noise), h});
    }
    const double found = cluster_dispersion(parts);
    mean += found / repetitions;
    for (CostPart& part : parts) part.gradient += part.hessian * VecX::Constant(n, 3);
    EXPECT_NEAR(cluster_dispersion(parts), found, 1e-6 * found);
  }
  EXPECT_NEAR(mean, phi, 0.06 * phi);
}

// Errors that stay: each patch of the picture has its own, the same in all frames, and there is
// hardly any noise. Frames all tell the same and seem sure of it.
TEST(Uncertainty, ErrorsThatLastThroughAllFramesAreSeenInThePatches) {
  const Problem problem =
      analytic_problem({"bend_stiffness", "drag_linear"}, [](const VecX&) { return 0.0; });
  const int repetitions = 300, frames = 10, patches = 12, rows = 6;
  const VecX truth = Vec2(0.5, 0.5);
  Vec2 by_frames = Vec2::Zero(), by_both = Vec2::Zero();
  for (int repetition = 0; repetition < repetitions; ++repetition) {
    Rng rng(static_cast<std::uint64_t>(repetition), 9);
    MatX hessian = MatX::Zero(2, 2);
    VecX right = VecX::Zero(2);
    std::vector<PatchPart> parts;
    std::vector<VecX> rights;
    const std::vector<double> lasting = [&] {
      std::vector<double> errors;
      for (int p = 0; p < patches; ++p) errors.push_back(0.01 * rng.normal());
      return errors;
    }();
    for (int k = 0; k < frames; ++k) {
      for (int p = 0; p < patches; ++p) {
        MatX a(rows, 2);
        VecX error(rows);
        for (int i = 0; i < rows; ++i) {
          a.row(i) << 1 + 0.3 * std::cos(p + 0.1 * k), std::sin(0.8 * p + 0.1 * i);
          error[i] = lasting[static_cast<std::size_t>(p)] + 0.001 * rng.normal();
        }
        parts.push_back({{0, k, {}, 2 * a.transpose() * a}, p});
        rights.push_back(2 * a.transpose() * error);
        hessian += parts.back().part.hessian;
        right += rights.back();
      }
    }
    const VecX error = solve_symmetric(hessian, right);
    for (std::size_t i = 0; i < parts.size(); ++i)
      parts[i].part.gradient = parts[i].part.hessian * error - rights[i];
    const VecX scaled = truth + error;
    const Uncertainty frames_alone = estimate_uncertainty(problem, scaled, frames_of(parts));
    const Uncertainty both = estimate_uncertainty(problem, scaled, parts);
    for (int j = 0; j < 2; ++j) {
      const auto at = static_cast<std::size_t>(j);
      by_frames[j] += std::abs(error[j]) <= frames_alone.parameters[at].half_width;
      by_both[j] += std::abs(error[j]) <= both.parameters[at].half_width;
    }
    EXPECT_EQ(both.clusters, frames);
  }
  for (int j = 0; j < 2; ++j) {
    EXPECT_LT(by_frames[j], 0.5 * repetitions) << j;
    EXPECT_GT(by_both[j], 0.85 * repetitions) << j;
    EXPECT_LT(by_both[j], 0.97 * repetitions) << j;
  }
}

// An estimate that a search left beside the minimum has the way to it in its interval.
TEST(Uncertainty, TheStepThatIsLeftWidensTheInterval) {
  const Problem problem = analytic_problem({"bend_stiffness"}, [](const VecX&) { return 0.0; });
  std::vector<PatchPart> parts;
  Rng rng(11);
  for (int k = 0; k < 10; ++k)
    for (int p = 0; p < 4; ++p)
      parts.push_back({{0, k, VecX::Constant(1, 0.001 * rng.normal()), MatX::Ones(1, 1)}, p});
  const double before =
      estimate_uncertainty(problem, VecX::Constant(1, 0.5), parts).covariance(0, 0);
  double mean = 0;
  for (const PatchPart& p : parts) mean += p.part.gradient[0] / double(parts.size());
  for (PatchPart& p : parts) p.part.gradient[0] += 0.1 - mean;
  const double after =
      estimate_uncertainty(problem, VecX::Constant(1, 0.5), parts).covariance(0, 0);
  EXPECT_NEAR(after - (before - mean * mean), 0.01, 1e-9);
}

// Few clusters, of which half say nothing of the second parameter.
TEST(Uncertainty, IntervalsCoverTheTruthWithFewUnequalClusters) {
  const int repetitions = 400, clusters = 12;
  const double t = student_quantile(0.95, clusters - 1);
  Vec2 covered = Vec2::Zero();
  for (int i = 0; i < repetitions; ++i) {
    Rng rng(static_cast<std::uint64_t>(i), 3);
    std::vector<CostPart> parts;
    MatX hessian = MatX::Zero(2, 2);
    VecX right = VecX::Zero(2);
    std::vector<VecX> rights;
    for (int k = 0; k < clusters; ++k) {
      MatX h(2, 2);
      const double second = k % 2 == 0 ? 0 : 1 + 0.2 * k;
      h << 1, 0.3 * second, 0.3 * second, second;
      // The gradient's noise has covariance h.
      const MatX root = h.llt().matrixL();
      const VecX noise =
          second > 0 ? VecX(root * Vec2(rng.normal(), rng.normal())) : VecX(Vec2(rng.normal(), 0));
      rights.push_back(noise);
      right += noise;
      hessian += h;
      parts.push_back({0, k, {}, h});
    }
    const VecX x = solve_symmetric(hessian, right);  // truth: 0
    for (int k = 0; k < clusters; ++k) {
      const auto at = static_cast<std::size_t>(k);
      parts[at].gradient = parts[at].hessian * x - rights[at];
    }
    const ClusterCovariance found = cluster_covariance(parts);
    for (int j = 0; j < 2; ++j)
      covered[j] += std::abs(x[j]) <= t * std::sqrt(found.covariance(j, j));
  }
  EXPECT_GT(covered.minCoeff(), 0.85 * repetitions);
  EXPECT_LT(covered.maxCoeff(), 0.96 * repetitions);
}

// The mean of K numbers: the jackknife's variance is s^2 / K exactly.
TEST(Uncertainty, OfAMeanIsItsStandardError) {
  const std::vector<double> numbers{1.0, 2.5, -0.5, 4.0, 3.0};
  double mean = 0, square = 0;
  for (const double y : numbers) mean += y / 5;
  for (const double y : numbers) square += (y - mean) * (y - mean) / 4;
  std::vector<CostPart> parts;
  for (const double y : numbers)
    parts.push_back(
        {0, int(parts.size()), VecX::Constant(1, 2 * (mean - y)), MatX::Constant(1, 1, 2)});
  EXPECT_NEAR(cluster_covariance(parts).covariance(0, 0), square / 5, 1e-12);
}

UncertaintyOptions single_frames() {
  UncertaintyOptions options;
  options.frames_per_cluster = 1;
  return options;
}

std::vector<CostPart> random_parts(int count, const std::vector<VecX>& rows) {
  Rng rng(5);
  std::vector<CostPart> parts;
  VecX sum = VecX::Zero(rows[0].size());
  for (int k = 0; k < count; ++k) {
    CostPart part{0, k, VecX::Zero(rows[0].size()), MatX::Zero(rows[0].size(), rows[0].size())};
    for (const VecX& row : rows) {
      const double scale = 1 + rng.uniform();
      part.hessian += scale * row * row.transpose();
      part.gradient += 0.01 * rng.normal() * row;
    }
    sum += part.gradient;
    parts.push_back(part);
  }
  for (CostPart& part : parts) part.gradient -= sum / count;
  return parts;
}

TEST(Uncertainty, DirectionsWithoutDataHaveInfiniteIntervals) {
  const Problem problem = analytic_problem({"stretch_stiffness", "bend_stiffness", "drag_linear"},
                                           [](const VecX&) { return 0.0; });
  // Measured: the sum of the first two, and the third.
  const auto parts = random_parts(20, {Vec3(1, 1, 0), Vec3(0, 0, 1)});
  const Uncertainty u =
      estimate_uncertainty(problem, VecX::Constant(3, 0.5), parts, single_frames());
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_FALSE(u.parameters[i].determined);
    EXPECT_EQ(u.parameters[i].lower, 0);
    EXPECT_EQ(u.parameters[i].upper, std::numeric_limits<double>::infinity());
    EXPECT_TRUE(std::isnan(u.correlation(0, Eigen::Index(i))));
  }
  EXPECT_TRUE(u.parameters[2].determined);
  EXPECT_GT(u.condition, 1e12);
  ASSERT_FALSE(u.warnings.empty());
  EXPECT_NE(u.warnings[0].find("condition number"), std::string::npos);
}

TEST(Uncertainty, OfAnIntervalWiderThanTheRangeTheEndInsideStays) {
  const Problem problem =
      analytic_problem({"bend_stiffness", "drag_linear"}, [](const VecX&) { return 0.0; });
  const Problem known(problem.trials(), problem.initial(), problem.free(), problem.evaluator(),
                      {{"drag_linear", 0.5, 1e6}});
  const auto parts = random_parts(20, {Vec2(1, 0.2), Vec2(0.1, 1)});
  UncertaintyOptions wide = single_frames();
  wide.systematic = VecX::Constant(2, 0.55);
  const Vec2 scaled(0.9, 0.2);
  const Uncertainty u = estimate_uncertainty(problem, scaled, parts, wide);
  const ParameterInterval &bend = u.parameters[0], &drag = u.parameters[1];
  EXPECT_FALSE(bend.determined);
  EXPECT_GT(bend.half_width, 0.55);
  EXPECT_NEAR(to_scaled(problem.info(0), bend.lower), 0.9 - bend.half_width, 1e-9);
  EXPECT_EQ(bend.upper, kInfinity);
  EXPECT_FALSE(drag.determined);
  EXPECT_EQ(drag.lower, 0);
  EXPECT_NEAR(to_scaled(problem.info(1), drag.upper), 0.2 + drag.half_width, 1e-9);
  // A prior's single end is not the data's, and in the middle there is no end inside.
  EXPECT_EQ(estimate_uncertainty(known, scaled, parts, wide).parameters[1].upper, kInfinity);
  for (const ParameterInterval& p :
       estimate_uncertainty(problem, Vec2(0.5, 0.5), parts, wide).parameters) {
    EXPECT_EQ(p.lower, 0);
    EXPECT_EQ(p.upper, kInfinity);
  }
}

TEST(Uncertainty, IntervalsAreSymmetricInTheSearchCoordinate) {
  const Problem problem =
      analytic_problem({"bend_stiffness", "drag_linear"}, [](const VecX&) { return 0.0; });
  const auto parts = random_parts(20, {Vec2(1, 0.2), Vec2(0.1, 1)});
  const Vec2 scaled(0.4, 0.6);
  const Uncertainty u = estimate_uncertainty(problem, scaled, parts, single_frames());
  for (int i = 0; i < 2; ++i) {
    const ParameterInterval& p = u.parameters[static_cast<std::size_t>(i)];
    EXPECT_TRUE(p.determined);
    EXPECT_NEAR(to_scaled(problem.info(i), p.upper) - scaled[i], p.half_width, 1e-9);
    EXPECT_NEAR(scaled[i] - to_scaled(problem.info(i), p.lower), p.half_width, 1e-9);
    EXPECT_NEAR(p.half_width, student_quantile(0.95, 19) * std::sqrt(u.covariance(i, i)), 1e-12);
    EXPECT_LT(p.lower, p.value);
    EXPECT_LT(p.value, p.upper);
  }
  // Of a logarithmic coordinate: equal ratios.
  const ParameterInterval& bend = u.parameters[0];
  EXPECT_NEAR(bend.upper / bend.value, bend.value / bend.lower, 1e-9);
  EXPECT_NEAR(u.correlation(0, 1),
              u.covariance(0, 1) / std::sqrt(u.covariance(0, 0) * u.covariance(1, 1)), 1e-12);
  EXPECT_EQ(u.correlation(1, 1), 1);
  EXPECT_TRUE(u.warnings.empty());
  UncertaintyOptions wider = single_frames();
  wider.confidence = 0.99;
  EXPECT_GT(estimate_uncertainty(problem, scaled, parts, wider).parameters[0].half_width,
            bend.half_width);
}

TEST(Uncertainty, AParameterAtABoundIsHeldAndSaid) {
  const Problem problem =
      analytic_problem({"bend_stiffness", "drag_linear"}, [](const VecX&) { return 0.0; });
  auto parts = random_parts(20, {Vec2(1, 0.5), Vec2(0.1, 1)});
  for (CostPart& part : parts) part.gradient[1] += 0.1;  // drag would go below zero
  const Uncertainty u = estimate_uncertainty(problem, Vec2(0.5, 0), parts, single_frames());
  EXPECT_TRUE(u.parameters[1].at_lower);
  EXPECT_EQ(u.parameters[1].lower, 0);
  EXPECT_GT(u.parameters[1].upper, 0);
  EXPECT_EQ(u.covariance(1, 1), 0);
  ASSERT_EQ(u.warnings.size(), 1u);
  EXPECT_NE(u.warnings[0].find("drag_linear lies at the lower bound"), std::string::npos);
  // The other one as if the held parameter were known.
  std::vector<CostPart> alone;
  for (const CostPart& part : parts)
    alone.push_back({0, part.frame, part.gradient.head(1), part.hessian.topLeftCorner(1, 1)});
  EXPECT_NEAR(u.covariance(0, 0), cluster_covariance(alone).covariance(0, 0), 1e-15);
}

// However far beyond its bound the minimum of a parameter lies, its own interval is what the noise
// makes; and how hard it is held is said.
TEST(Uncertainty, APullAtABoundWidensNoInterval) {
  const Problem problem = analytic_problem({"drag_linear"}, [](const VecX&) { return 0.0; });
  const auto at = [&](double pull) {
    std::vector<PatchPart> parts;
    Rng rng(11);
    for (int k = 0; k < 10; ++k)
      for (int p = 0; p < 4; ++p)
        parts.push_back(
            {{0, k, VecX::Constant(1, pull + 0.001 * rng.normal()), MatX::Ones(1, 1)}, p});
    return estimate_uncertainty(problem, VecX::Zero(1), parts);
  };
  const Uncertainty weak = at(0.05), strong = at(1);
  EXPECT_TRUE(weak.parameters[0].at_lower);
  EXPECT_TRUE(strong.parameters[0].determined);
  EXPECT_NEAR(strong.parameters[0].half_width, weak.parameters[0].half_width,
              1e-6 * weak.parameters[0].half_width);
  EXPECT_LT(strong.parameters[0].half_width, 0.01);
  // Over the dispersion, which a pull does not change: 40 parts of 1.
  EXPECT_NEAR(strong.slope[0] * strong.dispersion, 40, 0.1);
}

TEST(Uncertainty, InformationIsTheMatrixOverTheDispersion) {
  const Problem problem =
      analytic_problem({"bend_stiffness", "drag_linear"}, [](const VecX&) { return 0.0; });
  auto parts = random_parts(30, {Vec2(1, 0.2), Vec2(0.1, 1)});
  for (CostPart& part : parts) part.factor = 0.01;
  const Uncertainty u = estimate_uncertainty(problem, Vec2(0.4, 0.6), parts);
  EXPECT_EQ(u.frames_per_cluster, 3);
  EXPECT_EQ(u.clusters, 10);
  const auto clusters = join_frames(parts, 3);
  EXPECT_EQ(u.dispersion, cluster_dispersion(clusters));
  EXPECT_NEAR(u.noise, 100 * u.dispersion, 1e-9 * u.noise);
  MatX hessian = MatX::Zero(2, 2);
  for (const CostPart& part : parts) hessian += part.hessian;
  EXPECT_LT((u.information * u.dispersion - hessian).norm(), 1e-9 * hessian.norm());
}

// Nothing is measured of the second parameter but its prior; nothing but data of the first.
TEST(Uncertainty, APriorBoundsWhatTheDataDoNot) {
  const Problem plain =
      analytic_problem({"bend_stiffness", "drag_linear"}, [](const VecX&) { return 0.0; });
  const Problem known(plain.trials(), plain.initial(), plain.free(), plain.evaluator(),
                      {{"drag_linear", 0.5, 2}});
  const auto parts = random_parts(20, {Vec2(1, 0)});
  const VecX scaled = Vec2(0.4, to_scaled(plain.info(1), 0.5));
  const Uncertainty without = estimate_uncertainty(plain, scaled, parts, single_frames());
  const Uncertainty with = estimate_uncertainty(known, scaled, parts, single_frames());
  EXPECT_FALSE(without.parameters[1].determined);
  EXPECT_TRUE(with.parameters[1].determined);
  // Standard deviation log 2 in log(0.1 + value), over the range log(10.1 / 0.1).
  const double deviation = std::log(2.0) / std::log(101.0);
  EXPECT_NEAR(with.parameters[1].half_width, student_quantile(0.95, 19) * deviation, 1e-9);
  EXPECT_NEAR(with.parameters[0].half_width, without.parameters[0].half_width, 1e-12);
  EXPECT_EQ(known.prior_cost(scaled), 0);
  EXPECT_NEAR(known.prior_cost(Vec2(0.4, scaled[1] + deviation)), 0.5, 1e-12);
  EXPECT_EQ(with.information(1, 1), 0);  // of the data alone
}

// The same knowledge as other data: the intervals are the same, and the information has it.
TEST(Uncertainty, OtherDataBoundWhatTheTrialsDoNot) {
  const Problem plain =
      analytic_problem({"bend_stiffness", "drag_linear"}, [](const VecX&) { return 0.0; });
  const Problem prior(plain.trials(), plain.initial(), plain.free(), plain.evaluator(),
                      {{"drag_linear", 0.5, 2}});
  const VecX mean = prior.prior_mean();
  const MatX precision = prior.prior_precision().asDiagonal();
  OtherData other;
  other.cost = [=](const VecX& x) { return 0.5 * (x - mean).dot(precision * (x - mean)); };
  other.linearize = [=](const VecX& x) {
    return QuadraticModel{other.cost(x), precision * (x - mean), precision};
  };
  const Problem beside(plain.trials(), plain.initial(), plain.free(), plain.evaluator(), {}, other);
  const auto parts = random_parts(20, {Vec2(1, 0)});
  const VecX scaled = Vec2(0.4, 0.3);
  EXPECT_NEAR(beside.prior_cost(scaled), prior.prior_cost(scaled), 1e-12);
  const Uncertainty expected = estimate_uncertainty(prior, scaled, parts, single_frames());
  const Uncertainty found = estimate_uncertainty(beside, scaled, parts, single_frames());
  for (std::size_t i = 0; i < 2; ++i)
    EXPECT_NEAR(found.parameters[i].half_width, expected.parameters[i].half_width, 1e-12);
  EXPECT_EQ(expected.information(1, 1), 0);
  EXPECT_NEAR(found.information(1, 1), precision(1, 1), 1e-9);
  // Where they cannot be computed the cost is infinite, but for the weight 0.
  other.cost = [](const VecX&) { return std::numeric_limits<double>::infinity(); };
  const Problem broken(plain.trials(), plain.initial(), plain.free(), plain.evaluator(), {}, other);
  EXPECT_TRUE(std::isinf(broken.prior_cost(scaled, 0.5)));
  EXPECT_EQ(broken.prior_cost(scaled, 0), 0);
}

TEST(Uncertainty, FramesAreJoinedWithinTheirTrial) {
  std::vector<CostPart> parts;
  for (const std::size_t trial : {0u, 1u})
    for (int k = 0; k < 5; ++k)
      parts.push_back({trial, k, VecX::Constant(1, k), MatX::Constant(1, 1, 1)});
  const auto joined = join_frames(parts, 2);
  ASSERT_EQ(joined.size(), 6u);
  EXPECT_EQ(joined[0].gradient[0], 1);
  EXPECT_EQ(joined[2].gradient[0], 4);
  EXPECT_EQ(joined[3].trial, 1u);
  EXPECT_EQ(joined[3].hessian(0, 0), 2);
  EXPECT_THROW(join_frames(parts, 0), Error);
}

// Table 26.10 of Abramowitz and Stegun: one-sided 0.95 and 0.995.
TEST(Uncertainty, QuantilesOfStudentsDistribution) {
  EXPECT_NEAR(student_quantile(0.95, 1), 6.314, 1e-3);
  EXPECT_NEAR(student_quantile(0.95, 2), 2.920, 1e-3);
  EXPECT_NEAR(student_quantile(0.95, 3), 2.353, 3e-3);
  EXPECT_NEAR(student_quantile(0.95, 10), 1.812, 1e-3);
  EXPECT_NEAR(student_quantile(0.95, 49), 1.677, 1e-3);
  EXPECT_NEAR(student_quantile(0.995, 30), 2.750, 1e-3);
  EXPECT_NEAR(student_quantile(0.05, 10), -student_quantile(0.95, 10), 1e-12);
  EXPECT_THROW(student_quantile(1, 10), Error);
  EXPECT_THROW(student_quantile(0.5, 0), Error);
}

TEST(Uncertainty, RejectsBadArguments) {
  const Problem problem =
      analytic_problem({"bend_stiffness", "drag_linear"}, [](const VecX&) { return 0.0; });
  auto parts = random_parts(20, {Vec2(1, 0.5), Vec2(0.1, 1)});
  EXPECT_THROW(estimate_uncertainty(problem, VecX::Zero(3), parts), Error);
  EXPECT_THROW(cluster_covariance({}), Error);
  UncertaintyOptions options;
  options.frames_per_cluster = -1;
  EXPECT_THROW(estimate_uncertainty(problem, VecX::Zero(2), parts, options), Error);
  options = {};
  options.confidence = 1;
  EXPECT_THROW(estimate_uncertainty(problem, VecX::Zero(2), parts, options), Error);
  parts[3].gradient = VecX::Zero(3);
  EXPECT_THROW(cluster_covariance(parts), Error);
}

// Frame 0 alone tells p_0, however much of it; all frames tell p_1.
TEST(ClusterCovariance, GivesUpWhatOneClusterDecidesAndNothingElse) {
  for (const double weight : {0.1, 100.0}) {
    std::vector<CostPart> clusters;
    for (int k = 0; k < 10; ++k) {
      CostPart part{0, k, VecX::Zero(2), MatX::Zero(2, 2)};
      part.hessian(1, 1) = 2;
      part.gradient[1] = k % 2 ? 0.1 : -0.1;
      if (k == 0) part.hessian(0, 0) = weight;
      clusters.push_back(part);
    }
    const ClusterCovariance found = cluster_covariance(clusters);
    ASSERT_EQ(found.undetermined.cols(), 1) << weight;
    EXPECT_EQ(found.without_data, 0);
    EXPECT_NEAR(std::abs(found.undetermined(0, 0)), 1, 1e-12);
    EXPECT_EQ(found.covariance(0, 0), 0);
    // Without one of ten the estimate moves by 0.1 / 18: (9 / 10) 10 (0.1 / 18)^2.
    EXPECT_NEAR(found.covariance(1, 1), 9 * std::pow(0.1 / 18, 2), 1e-12) << weight;
  }
}

TEST(ClusterCovariance, DirectionsWithoutDataComeFirst) {
  std::vector<CostPart> clusters;
  for (int k = 0; k < 4; ++k) {
    CostPart part{0, k, VecX::Zero(3), MatX::Zero(3, 3)};
    part.hessian(0, 0) = 1;
    if (k == 2) part.hessian(1, 1) = 1;
    clusters.push_back(part);
  }
  const ClusterCovariance found = cluster_covariance(clusters);
  ASSERT_EQ(found.undetermined.cols(), 2);
  EXPECT_EQ(found.without_data, 1);
  EXPECT_NEAR(std::abs(found.undetermined(2, 0)), 1, 1e-12);
  EXPECT_NEAR(std::abs(found.undetermined(1, 1)), 1, 1e-12);
  EXPECT_TRUE(std::isinf(found.condition));
}

}  // namespace
}  // namespace weft::uncertainty_test
