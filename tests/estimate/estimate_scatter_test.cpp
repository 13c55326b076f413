#include "weft/estimate/estimate_scatter.h"

#include <gtest/gtest.h>

#include <cmath>

#include "weft/estimate/residual_intervals.h"
#include "weft/fabric/parameter.h"

namespace weft::estimate_scatter_test {
namespace {

/// Parts of equal matrices, whose gradients pull one coordinate each to and fro by `pull`.
std::vector<CostPart> opposed_parts(const VecX& diagonal, double pull) {
  const Eigen::Index n = diagonal.size();
  std::vector<CostPart> parts;
  for (Eigen::Index i = 0; i < n; ++i) {
    for (const int sign : {1, -1}) {
      const MatX hessian = diagonal.asDiagonal();
      parts.push_back({0, static_cast<int>(parts.size()), sign * pull * VecX::Unit(n, i), hessian});
    }
  }
  return parts;
}

QuadraticModel sum_of(const std::vector<CostPart>& parts) {
  QuadraticModel model;
  model.gradient = VecX::Zero(parts.front().gradient.size());
  model.hessian = MatX::Zero(model.gradient.size(), model.gradient.size());
  for (const CostPart& part : parts) {
    model.gradient += part.gradient;
    model.hessian += part.hessian;
  }
  return model;
}

// Without part k of K = 4 the estimate moves by g_k / (3 h): the jackknife's variance is
// (3 / 4) 2 (pull / 3 h)^2, the noise's dispersion / (4 h).
TEST(EstimateScatter, IsTheJackknifeAndAtLeastTheNoise) {
  const double pull = 0.6;
  const auto parts = opposed_parts(Vec2(2, 5), pull);
  const Vec2 scaled(0.4, 0.5);
  for (const double dispersion : {1e-6, 10.0}) {
    const EstimateScatter scatter = scatter_of(scaled, sum_of(parts), parts, dispersion);
    EXPECT_NEAR(scatter.condition, 2.5, 1e-12);
    for (Eigen::Index i = 0; i < 2; ++i) {
      const double h = i == 0 ? 2 : 5;
      const double variance = 1.5 * std::pow(pull / (3 * h), 2), noise = dispersion / (4 * h);
      EXPECT_NEAR(scatter.covariance(i, i), variance, 1e-12);
      EXPECT_NEAR(scatter.noise[i], noise, 1e-12);
      EXPECT_TRUE(scatter.determined(i));
      EXPECT_NEAR(half_width(scatter, i, 0.9),
                  std::max(student_quantile(0.95, 3) * std::sqrt(variance),
                           normal_half_width(0.9) * std::sqrt(noise)),
                  1e-9);
    }
  }
  EXPECT_NEAR(normal_half_width(0.9), 1.6449, 1e-4);
}

TEST(ResidualIntervals, KeepTheEndThatIsInsideOfTheRange) {
  const auto parts = opposed_parts(Vec2(2, 5), 0.1);
  ParameterInfo twist = baraff_witkin_parameters()[0];
  twist.scale = Scale::linear;
  twist.lower = -10;
  twist.upper = 10;
  const std::vector<ParameterInfo> infos{baraff_witkin_parameters()[0], twist};
  const Vec2 scaled(0.8, 0.3), wide(0.6, 0.55);
  const auto intervals = [&](const PriorTerm& prior) {
    return residual_intervals(infos, scaled, sum_of(parts), parts, 1e6, 0.9, wide, prior).intervals;
  };
  const auto found = intervals({});
  EXPECT_FALSE(found[0].bounded());
  EXPECT_NEAR(to_scaled(infos[0], found[0].lower), 0.8 - found[0].half_width, 1e-9);
  EXPECT_EQ(found[0].upper, kInfinity);
  EXPECT_FALSE(found[1].bounded());
  EXPECT_EQ(found[1].lower, -kInfinity);
  EXPECT_NEAR(found[1].upper, -10 + 20 * (0.3 + found[1].half_width), 1e-9);
  // Of a prior that is weaker than the data: its single end would not be theirs.
  const MatX weak = Vec2(1e-3, 0).asDiagonal();
  const auto with = intervals({VecX::Zero(2), weak, weak});
  EXPECT_FALSE(with[0].bounded());
  EXPECT_EQ(with[0].lower, 0);
  EXPECT_EQ(with[0].upper, kInfinity);
  EXPECT_TRUE(std::isfinite(with[1].upper));
}

TEST(EstimateScatter, LeavesOutWhatABoundHolds) {
  auto parts = opposed_parts(Vec3(2, 5, 3), 0.6);
  for (CostPart& part : parts) part.gradient[1] += 1;
  const EstimateScatter scatter = scatter_of(Vec3(0.4, 0, 1), sum_of(parts), parts, 0.1);
  EXPECT_EQ(scatter.free, (std::vector<Eigen::Index>{0, 2}));
  EXPECT_TRUE(scatter.held(1));
  EXPECT_FALSE(scatter.determined(1));
  EXPECT_EQ(scatter.covariance(1, 1), 0);
  EXPECT_EQ(scatter.noise[1], 0);
  EXPECT_GT(scatter.covariance(2, 2), 0);  // at its bound, but nothing pushes it there
}

TEST(EstimateScatter, SaysWhatTheDataLeaveOpen) {
  const auto parts = opposed_parts(Vec2(2, 0), 0.6);
  const EstimateScatter scatter = scatter_of(Vec2(0.4, 0.5), sum_of(parts), parts, 0.1);
  EXPECT_TRUE(scatter.determined(0));
  EXPECT_FALSE(scatter.determined(1));
  EXPECT_EQ(half_width(scatter, 1, 0.9), kInfinity);
}

TEST(EstimateScatter, WithOnePartTheNoiseCounts) {
  const auto parts = opposed_parts(Vec2(2, 0), 0.6);
  const EstimateScatter one = scatter_of(Vec2(0.4, 0.5), sum_of({parts[0]}), {parts[0]}, 0.1, 3);
  EXPECT_TRUE(one.determined(0));
  EXPECT_FALSE(one.determined(1));
  EXPECT_NEAR(one.covariance(0, 0), 3 * 0.1 / 2, 1e-15);
  EXPECT_NEAR(half_width(one, 0, 0.9), normal_half_width(0.9) * std::sqrt(0.15), 1e-12);
}

// Of a table of strips and one test of bending: what that one alone tells is known by the noise,
// and what nothing tells does not make the others unknown.
TEST(EstimateScatter, OnePartMayDecideAloneBesideMany) {
  auto parts = opposed_parts(Vec3(2, 0, 0), 0.6);
  CostPart bend{1, 0, Vec3(0, 0, 0), MatX::Zero(3, 3)};
  bend.hessian(1, 1) = 50;  // stronger than all others together
  parts.push_back(bend);
  const EstimateScatter scatter = scatter_of(Vec3(0.4, 0.5, 0.5), sum_of(parts), parts, 0.1, 2);
  EXPECT_TRUE(scatter.determined(0));
  EXPECT_TRUE(scatter.determined(1));
  EXPECT_FALSE(scatter.determined(2));
  // Of seven parts, six with a stiffness of 2, two pull: (6 / 7) 2 (0.6 / 10)^2.
  EXPECT_NEAR(scatter.covariance(0, 0), 6.0 / 7 * 2 * 0.0036, 1e-12);
  EXPECT_NEAR(scatter.covariance(1, 1), 2 * 0.1 / 50, 1e-12);
  EXPECT_EQ(half_width(scatter, 2, 0.9), kInfinity);
}

TEST(EstimateScatter, PriorsNarrow) {
  const auto parts = opposed_parts(Vec2(2, 5), 0.6);
  const PriorTerm prior{Vec2::Zero(), Vec2(1000, 0).asDiagonal(), MatX::Zero(2, 2)};
  QuadraticModel model = sum_of(parts);
  const EstimateScatter free = scatter_of(Vec2(0.4, 0.5), model, parts, 0.1);
  model.hessian += prior.hessian;
  const EstimateScatter tied = scatter_of(Vec2(0.4, 0.5), model, parts, 0.1, 1, prior);
  EXPECT_LT(half_width(tied, 0, 0.9), 0.1 * half_width(free, 0, 0.9));
  EXPECT_NEAR(half_width(tied, 1, 0.9), half_width(free, 1, 0.9), 1e-12);
}

// What no part shows is as wide as the prior, whatever Student's t of the parts is.
TEST(EstimateScatter, WithoutDataIsThePrior) {
  auto parts = opposed_parts(Vec2(2, 0), 0.6);
  for (CostPart& part : parts) part.gradient[1] = 0;
  const double weight = 0.3, deviation = 0.07, precision = 1 / (deviation * deviation);
  const MatX unit = Vec2(0, 1).asDiagonal();
  const PriorTerm prior{Vec2(0, 0), weight * precision * unit, weight * weight * precision * unit};
  QuadraticModel model = sum_of(parts);
  model.hessian += prior.hessian;
  const EstimateScatter scatter = scatter_of(Vec2(0.4, 0.5), model, parts, 0.1, 1, prior);
  EXPECT_TRUE(scatter.determined(1));
  EXPECT_NEAR(scatter.prior[1], deviation * deviation, 1e-12);
  EXPECT_NEAR(half_width(scatter, 1, 0.9), normal_half_width(0.9) * deviation, 1e-12);
  EXPECT_EQ(scatter.prior[0], 0);
}

// Parts that agree do not scatter, though each is left by a prior's pull with a gradient.
TEST(EstimateScatter, APullIsNoScatter) {
  auto parts = opposed_parts(VecX::Constant(1, 2), 0);
  parts[0].hessian *= 3;
  const double away = 0.05;  // from where the parts have their minimum
  for (CostPart& part : parts) part.gradient = part.hessian * VecX::Constant(1, away);
  QuadraticModel model = sum_of(parts);
  const PriorTerm prior{-model.gradient, 4 * MatX::Identity(1, 1), MatX::Zero(1, 1)};
  model.gradient.setZero();
  model.hessian += prior.hessian;
  const EstimateScatter scatter = scatter_of(VecX::Constant(1, 0.4), model, parts, 0, 1, prior);
  EXPECT_NEAR(scatter.covariance(0, 0), 0, 1e-15);
}

// Of a single test of bending the noise decides, however wide the prior that would be left.
TEST(EstimateScatter, OnePartDecidesAloneBesideAPrior) {
  auto parts = opposed_parts(Vec2(2, 0), 0.6);
  CostPart bend{1, 0, Vec2(0, 0), MatX::Zero(2, 2)};
  bend.hessian(1, 1) = 50;
  parts.push_back(bend);
  const double dispersion = 0.1, precision = 20;
  const MatX unit = Vec2(0, 1).asDiagonal();
  const PriorTerm prior{Vec2(0, 0), dispersion * precision * unit,
                        dispersion * dispersion * precision * unit};
  QuadraticModel model = sum_of(parts);
  model.hessian += prior.hessian;
  const EstimateScatter scatter = scatter_of(Vec2(0.4, 0.5), model, parts, dispersion, 1, prior);
  EXPECT_NEAR(scatter.covariance(1, 1), 1 / (50 / dispersion + precision), 1e-12);
  EXPECT_NEAR(scatter.covariance(0, 0), 4.0 / 5 * 2 * 0.01, 1e-12);  // (K - 1) / K 2 (0.6 / 6)^2
}

TEST(EstimateScatter, CorrelationOfWhatHasNoVarianceIsNotANumber) {
  MatX covariance = MatX::Zero(3, 3);
  covariance.topLeftCorner(2, 2) << 4, -3, -3, 9;
  const MatX correlation = correlation_of(covariance);
  EXPECT_EQ(correlation(0, 0), 1);
  EXPECT_EQ(correlation(0, 1), -0.5);
  EXPECT_TRUE(std::isnan(correlation(0, 2)) && std::isnan(correlation(2, 2)));
}

TEST(EstimateScatter, IntervalIsInTheParametersUnit) {
  const ParameterInfo info{"x", "N/m", 1, 100, 10, Scale::logarithmic, "", ""};
  const ParameterInterval interval = interval_about(info, 0.5, 0.25);
  EXPECT_NEAR(interval.value, 10, 1e-12);
  EXPECT_NEAR(interval.lower, std::sqrt(10.0), 1e-12);
  EXPECT_NEAR(interval.upper, 10 * std::sqrt(10.0), 1e-11);
  EXPECT_FALSE(interval.at_lower || interval.at_upper);
  EXPECT_TRUE(interval_about(info, 1, 0.25).at_upper);
}

}  // namespace
}  // namespace weft::estimate_scatter_test
