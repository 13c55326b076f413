/// Priors beside mechanical captures and scans.
#include "weft/estimate/weighed_priors.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "common/gradient_check.h"
#include "weft/base/error.h"
#include "weft/base/random.h"
#include "weft/estimate/curve_fit.h"
#include "weft/estimate/estimate_scatter.h"
#include "weft/estimate/mechanical_fit.h"

namespace weft::weighed_priors_test {
namespace {

/// A fabric of soft-constraints with `scaled` as its stretch of the weft and its shear.
Fabric stretch_and_shear(const VecX& scaled) {
  Fabric fabric = Fabric::with_defaults("test", "soft-constraints");
  for (const auto& [name, x] : {std::pair{"weft_stretch", scaled[0]}, {"shear", scaled[1]}})
    fabric.values[fabric.value_index(name)] = from_scaled(fabric.info(fabric.value_index(name)), x);
  return fabric;
}
VecX scaled_of(double stretch, double shear) {
  const Fabric fabric = Fabric::with_defaults("test", "soft-constraints");
  return Vec2(to_scaled(fabric.info(fabric.value_index("weft_stretch")), stretch),
              to_scaled(fabric.info(fabric.value_index("shear")), shear));
}

TEST(WeighedPriors, AreSquaresInUnitsOfTheirFactors) {
  const WeighedPriors priors({{"weft_stretch", 300, 1.5}, {"shear", 20, 3}, {"warp_bend", 1e-5, 2}},
                             2, stretch_and_shear, 0.1);
  EXPECT_EQ(priors.cost(scaled_of(300, 20)), 0);
  EXPECT_NEAR(priors.cost(scaled_of(450, 20)), 0.1 * 0.5, 1e-12);
  EXPECT_NEAR(priors.cost(scaled_of(200, 180)), 0.1 * 0.5 * (1 + 4), 1e-12);
  const VecX x = scaled_of(500, 7);
  QuadraticModel model{1, Vec3(1, 2, 3), MatX::Identity(3, 3)};  // with one unknown more
  priors.add_to(x, model);
  EXPECT_NEAR(model.cost, 1 + priors.cost(x), 1e-15);
  const auto gradient = [&](const VecX& at) { return VecX(priors.term(at, 2).gradient); };
  EXPECT_TRUE(testing::near(
      VecX(model.gradient - Vec3(1, 2, 3)).head(2).eval(),
      testing::numeric_gradient([&](const VecX& at) { return priors.cost(at); }, x, 1e-2)));
  for (int i = 0; i < 2; ++i)
    EXPECT_TRUE(testing::near(VecX((model.hessian - MatX::Identity(3, 3)).col(i).head(2)),
                              testing::derivative(gradient, x, VecX::Unit(2, i), 1e-2)));
  EXPECT_EQ(model.gradient[2], 3);
  EXPECT_TRUE(WeighedPriors({{"warp_bend", 1e-5, 2}}, 2, stretch_and_shear, 0.1).empty());
  EXPECT_THROW(WeighedPriors({{"stretch", 1, 2}}, 2, stretch_and_shear, 0.1), Error);
}

/// A shear curve over `knots` with the scaled coordinates of its values.
std::function<Fabric(const VecX&)> shear_over(const VecX& knots) {
  return [knots](const VecX& scaled) {
    Fabric fabric = Fabric::with_defaults("test", "soft-constraints");
    const ParameterInfo info = fabric.info(fabric.value_index("shear"));
    VecX values(scaled.size());
    for (Eigen::Index i = 0; i < scaled.size(); ++i) values[i] = from_scaled(info, scaled[i]);
    fabric.set_curve("shear", {knots, values});
    return fabric;
  };
}

// A curve has the prior of its mean: as many control points as it may have pull no more than one.
TEST(WeighedPriors, OfACurveIsThatOfItsMean) {
  const auto prior_of = [](int values) {
    return WeighedPriors({{"shear", 20, 2}}, values, shear_over(VecX::LinSpaced(values, 0, 1)), 1);
  };
  const WeighedPriors one = prior_of(1), three = prior_of(3);
  const double x = scaled_of(300, 55)[1];
  const VecX equal = VecX::Constant(3, x), spread = equal + Vec3(0.1, -0.3, 0.2);
  EXPECT_NEAR(three.cost(equal), one.cost(VecX::Constant(1, x)), 1e-12);
  EXPECT_NEAR(three.cost(spread), three.cost(equal), 1e-12);
}

VecX scaled_shear(const VecX& logarithms) {
  const Fabric fabric = Fabric::with_defaults("test", "soft-constraints");
  const ParameterInfo info = fabric.info(fabric.value_index("shear"));
  return logarithms.unaryExpr([&](double t) { return to_scaled(info, std::exp(t)); });
}
WeighedPriors smooth_shear(const VecX& knots, double weight) {
  WeighedPriors priors({}, static_cast<int>(knots.size()), shear_over(knots), weight);
  priors.add_smooth_curve("shear", shear_over(knots), static_cast<int>(knots.size()));
  return priors;
}

TEST(SmoothCurve, IsTheIntegralOfSquaredBends) {
  const VecX knots = (VecX(5) << 0.1, 0.14, 0.2, 0.23, 0.3).finished();
  const double weight = 0.3;
  WeighedPriors priors = smooth_shear(knots, weight);
  ASSERT_TRUE(priors.has_smooth_curves());
  EXPECT_EQ(priors.weight(), weight);
  const VecX u = (knots.array() - 0.1) / 0.2;
  // An exponential is free; log k = a u^2 bends by 2 a everywhere, over half of the outer
  // intervals less than all.
  EXPECT_NEAR(priors.cost(scaled_shear(3 + 0.7 * u.array())), 0, 1e-20);
  const double a = 0.4, length = 1 - 0.5 * (u[1] - u[0]) - 0.5 * (u[4] - u[3]);
  const VecX square = scaled_shear(3 + a * u.array().square());
  EXPECT_NEAR(priors.cost(square), weight * 0.5 * length * 4 * a * a, 1e-12);
  priors.roughen_by({{"shear", 2}, {"warp_stretch", 5}});
  EXPECT_EQ(priors.roughness(), (WeighedPriors::Roughness{{"shear", 2}}));
  EXPECT_NEAR(priors.cost(square), weight * 0.5 * length * a * a, 1e-12);

  const VecX x = scaled_shear((VecX(5) << 3, 3.3, 3.1, 2.8, 3.4).finished());
  const auto gradient = [&](const VecX& at) { return VecX(priors.term(at, 5).gradient); };
  EXPECT_TRUE(testing::near(
      gradient(x),
      testing::numeric_gradient([&](const VecX& at) { return priors.cost(at); }, x, 1e-2)));
  for (int i = 0; i < 5; ++i)
    EXPECT_TRUE(testing::near(VecX(priors.term(x, 5).hessian.col(i)),
                              testing::derivative(gradient, x, VecX::Unit(5, i), 1e-2)));
}

TEST(SmoothCurve, OfTwoValuesOrOfOthersHasNoEffect) {
  const Vec2 two(0, 0.2);
  EXPECT_FALSE(smooth_shear(two, 1).has_smooth_curves());
  WeighedPriors others({}, 2, stretch_and_shear, 1);
  others.add_smooth_curve("warp_stretch", stretch_and_shear, 2);
  EXPECT_TRUE(others.empty());
  EXPECT_THROW(others.add_smooth_curve("stretch", stretch_and_shear, 2), Error);
}

// Values of log k that were read with noise sigma, as many as control points: their bends D y are
// normal with covariance sigma^2 D D^T + r^2, of which the most probable r can be told without any
// search for the values.
TEST(SmoothCurve, IsAsRoughAsIsMostProbable) {
  const VecX knots = VecX::LinSpaced(6, 0, 0.3);
  const double sigma = 0.05, weight = 0.02, spacing = 0.2;
  MatX bends = MatX::Zero(4, 6);
  for (int i = 0; i < 4; ++i) bends.row(i).segment<3>(i) << 1, -2, 1;
  bends /= std::pow(spacing, 1.5);
  const WeighedPriors priors = smooth_shear(knots, weight);
  const Fabric fabric = Fabric::with_defaults("test", "soft-constraints");
  const ParameterInfo info = fabric.info(fabric.value_index("shear"));
  const double range = std::log(info.upper / info.lower);  // of log k, by the scaled coordinate
  Rng rng(3);
  int inside = 0;
  for (int k = 0; k < 20; ++k) {
    VecX y(6);
    for (int i = 0; i < 6; ++i) {
      const double u = spacing * i;
      y[i] = 3 + 0.3 * k * u * u + sigma * rng.normal();
    }
    const MatX noise = sigma * sigma * bends * bends.transpose();
    const auto log_density = [&](double r) {
      const MatX covariance = noise + r * r * MatX::Identity(4, 4);
      const VecX d = bends * y;
      return -0.5 * d.dot(covariance.ldlt().solve(d)) - 0.5 * std::log(covariance.determinant()) -
             0.5 * std::pow(std::log(r) / std::log(2.5), 2);
    };
    double best = -kInfinity, expected = 0;
    for (int step = 0; step <= 40; ++step) {
      const double r = std::pow(10, -2 + 0.1 * step);
      if (log_density(r) > best + 1e-9) {
        best = log_density(r);
        expected = r;
      }
    }
    // The cost of the reading about a point beside it.
    const VecX x = scaled_shear(VecX::Constant(6, 3.2)), off = x - scaled_shear(y);
    const double precision = weight * range * range / (sigma * sigma);
    const QuadraticModel data{0.5 * precision * off.squaredNorm(), precision * off,
                              precision * MatX::Identity(6, 6)};
    const double found = priors.most_probable_roughness(x, data).at("shear");
    EXPECT_NEAR(found, expected, 1e-9 * expected) << k;
    if (expected > 0.02 && expected < 50) ++inside;
  }
  EXPECT_EQ(inside, 20);
}

/// A strip between two clips, pulled along its weft by 1 to 5 %, whose `forces` were read at the
/// clips; nothing of it depends on the shear, nor on the mesh.
MechanicalCapture pulled_strip(const VecX& forces) {
  MechanicalCapture capture;
  capture.name = "strip";
  capture.width = 0.12;
  capture.height = 0.02;
  capture.areal_density = 0.1;
  capture.gravity = Vec3::Zero();
  capture.frame_count = static_cast<int>(forces.size());
  for (const double end : {0.0, 1.0}) {
    MechanicalFixture fixture;
    fixture.name = end > 0 ? "right" : "left";
    fixture.forces = Points::Zero(3, capture.frame_count);
    for (int k = 0; k < capture.frame_count; ++k) {
      Clip clip;
      clip.region = {{0.11 * end, 0}, {0.01 + 0.11 * end, capture.height}};
      clip.position = Vec3(0.005 + end * (0.11 + 0.1 * 0.01 * (k + 1)), 0.01, 0);
      fixture.frames.push_back(clip);
      fixture.forces(0, k) = (end > 0 ? 1 : -1) * forces[k];
    }
    capture.fixtures.push_back(std::move(fixture));
  }
  return capture;
}
/// N per N/m of stretch stiffness.
VecX lever() { return 0.02 * VecX::LinSpaced(5, 0.01, 0.05); }

constexpr double kStiffness = 300;  // N/m

MechanicalProblem strip_problem(const VecX& forces, const std::vector<ParameterPrior>& priors,
                                double force_noise = 3e-3) {
  MechanicalOptions mesh;
  mesh.cells = 3;
  MechanicalCostOptions options;
  options.priors = priors;
  options.force_noise = force_noise;
  Fabric fabric = Fabric::with_defaults("strip", "soft-constraints");
  fabric.set("weft_stretch", 200);
  fabric.set("shear", 40);
  return MechanicalProblem({prepare_mechanical(pulled_strip(forces), mesh)}, fabric,
                           {"weft_stretch", "shear"}, options);
}
MechanicalFitResult fit_strip(const MechanicalProblem& problem,
                              const MechanicalFitOptions& options = {}) {
  return fit_mechanical(
      problem, problem.fabric(problem.scaled(stretch_and_shear(scaled_of(200, 40)))), options);
}

// The force of each frame is known to sigma at both clips, so is the stiffness; the prior says
// another one. The density of both has its maximum where their forces balance, and between them its
// width is that of the sum of their precisions.
TEST(FitMechanical, APriorIsWeighedByItsPrecision) {
  const double median = 310, factor = 1.01, sigma = 3e-3;
  const MechanicalFitResult fit =
      fit_strip(strip_problem(kStiffness * lever(), {{"weft_stretch", median, factor}}));
  // minus the logarithm: a (k - k0)^2 / 2 + (log k - log m)^2 / (2 s^2).
  const double a = 2 * lever().squaredNorm() / (sigma * sigma), s = std::log(factor);
  double k = kStiffness;
  for (int i = 0; i < 20; ++i) {
    const double slope = a * (k - kStiffness) + std::log(k / median) / (s * s * k);
    k -= slope / (a + 1 / (s * s * k * k));
  }
  const double deviation = 1 / std::sqrt(a * k * k + 1 / (s * s));  // of log k
  ASSERT_GT(std::log(k / kStiffness), deviation);                   // it does pull
  EXPECT_NEAR(std::log(fit.fabric.value("weft_stretch") / k), 0, 0.02 * deviation);
  const ParameterInterval& p = fit.intervals[0];
  EXPECT_NEAR(std::log(p.upper / p.value), normal_half_width(0.9) * deviation, 0.02 * deviation);
  EXPECT_TRUE(p.determined);
  // Forces that the model makes scatter as stated at most.
  EXPECT_EQ(fit.prior_weight, 2.0 / 30);
  EXPECT_NEAR(fit.prior_error, fit.prior_weight * std::pow(std::log(k / median) / s, 2) / 2,
              0.03 * fit.prior_error);
  const double left = a * (k - kStiffness) * (k - kStiffness) / 30;
  EXPECT_NEAR(fit.cost, left, 0.05 * left);
}

TEST(FitMechanical, WithoutDataAParameterIsItsPrior) {
  for (const MeshError mesh_error : {MeshError::left_out, MeshError::included}) {
    MechanicalFitOptions options;
    options.mesh_error = mesh_error;
    const MechanicalFitResult fit =
        fit_strip(strip_problem(kStiffness * lever(), {{"shear", 25, 1.5}}), options);
    const ParameterInterval &stretch = fit.intervals[0], &shear = fit.intervals[1];
    EXPECT_TRUE(stretch.determined);
    EXPECT_NEAR(stretch.value, kStiffness, 1e-3 * kStiffness);
    EXPECT_FALSE(shear.determined);
    EXPECT_TRUE(shear.by_prior);
    EXPECT_NEAR(shear.value, 25, 25 * 1e-3);
    const double half = normal_half_width(0.9) * std::log(1.5);
    EXPECT_NEAR(std::log(shear.upper / shear.value), half, 1e-3);
    EXPECT_NEAR(std::log(shear.value / shear.lower), half, 1e-3);
    // The data say nothing of it.
    EXPECT_LT(fit.certainty.information(1, 1), 1e-6 * fit.certainty.information(0, 0));
  }
}

// Forces that scatter by ten times what is stated: the prior is weighed by what they do, so that
// what was stated hardly matters.
TEST(FitMechanical, PriorsAreWeighedByTheScatterOfTheResiduals) {
  Rng rng(4);
  VecX forces = kStiffness * lever();
  for (double& force : forces) force += 3e-3 * rng.normal();
  const std::vector<ParameterPrior> prior{{"weft_stretch", 310, 1.01}};
  const MechanicalFitResult bold = fit_strip(strip_problem(forces, prior, 3e-5)),
                            bolder = fit_strip(strip_problem(forces, prior, 3e-6));
  const double deviation = bold.intervals[0].half_width / 2;
  const ParameterInfo info = bold.fabric.info(bold.fabric.value_index("weft_stretch"));
  const auto scaled = [&](double value) { return to_scaled(info, value); };
  EXPECT_NEAR(scaled(bold.fabric.value("weft_stretch")),
              scaled(bolder.fabric.value("weft_stretch")), 0.03 * deviation);
  EXPECT_NEAR(bolder.prior_weight / bold.prior_weight, 100, 3);
  EXPECT_GT(bold.prior_weight, 10 * 2.0 / 30);
  // It is pulled all the same.
  const MechanicalFitResult alone = fit_strip(strip_problem(forces, {}, 3e-5));
  EXPECT_EQ(alone.prior_weight, 0);
  EXPECT_GT(scaled(bold.fabric.value("weft_stretch")) - scaled(alone.fabric.value("weft_stretch")),
            0.1 * deviation);
}

TEST(FitMechanical, PriorsAreOfTheRunsFingerprint) {
  const Fabric start = stretch_and_shear(scaled_of(200, 40));
  const auto fingerprint = [&](const std::vector<ParameterPrior>& priors) {
    return fit_fingerprint(strip_problem(kStiffness * lever(), priors), start);
  };
  EXPECT_NE(fingerprint({}), fingerprint({{"shear", 25, 1.5}}));
  EXPECT_NE(fingerprint({{"shear", 25, 1.6}}), fingerprint({{"shear", 25, 1.5}}));
  EXPECT_EQ(fingerprint({}), fingerprint({{"warp_bend", 1e-5, 1.5}}));  // not searched
}

TEST(FitCurves, WeighsPriorsOfWhatAStepSearches) {
  MechanicalOptions mesh;
  mesh.cells = 3;
  const std::vector<std::shared_ptr<const MechanicalTrial>> trials{
      prepare_mechanical(pulled_strip(kStiffness * lever()), mesh)};
  const Fabric start = stretch_and_shear(scaled_of(200, 40));
  CurveFitOptions options;
  options.shape = CurveShape::subdivided;
  options.cost.priors = {{"weft_stretch", 310, 1.01}, {"shear", 25, 1.5}};
  const CurveFitResult found = fit_curves(trials, start, {"weft_stretch", "shear"}, options);
  const MechanicalFitResult joint =
      fit_strip(strip_problem(kStiffness * lever(), {{"weft_stretch", 310, 1.01}}));
  // One number makes these forces; a control point more could only undo the prior.
  EXPECT_EQ(found.fit.fabric.value_count("weft_stretch"), 1);
  const double half = joint.intervals[0].half_width;
  EXPECT_NEAR(found.fit.intervals[0].half_width, half, 0.02 * half);
  EXPECT_NEAR(std::log(found.fit.fabric.value("weft_stretch") / joint.fabric.value("weft_stretch")),
              0, 1e-4);
  EXPECT_NEAR(found.fit.prior_error, joint.prior_error, 0.02 * joint.prior_error);
  EXPECT_EQ(found.without_test, std::vector<std::string>{"shear"});
  EXPECT_DOUBLE_EQ(found.fit.fabric.value("shear"), 40);

  options.symmetry = ThreadSymmetry::isotropic;
  options.cost.priors = {{"warp_stretch", 310, 1.01}};
  EXPECT_THROW(fit_curves(trials, start, {"weft_stretch"}, options), Error);
}

}  // namespace
}  // namespace weft::weighed_priors_test
