#include "weft/objective/stripe_phase.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "objective/folded_sheet.h"

namespace weft::stripe_phase_test {
namespace {

using testing::directions;
using testing::features_of;
using testing::folded;
using testing::rig;
using testing::swatch;

constexpr double kTurn = 2 * std::numbers::pi;

FrameResiduals residuals(const ResidualOptions& options) {
  static const Rig shared_rig = rig();
  static const TriangleMesh mesh = swatch();
  return FrameResiduals(shared_rig, mesh, {}, {}, options);
}

ResidualOptions phase_only() {
  ResidualOptions options;
  options.alpha = 0;
  options.fold_weight = 0;
  options.phase_weight = 1;
  options.phase_scale = kInfinity;
  return options;
}

/// A flat sheet across the view, `depth` m behind the origin.
Points flat_at(const TriangleMesh& mesh, double depth) {
  Points x = folded(mesh, 0);
  x.row(1).array() += depth;
  return x;
}

/// Projector row of the plane y = depth where the ray of a pixel meets it.
double row_of_plane(const PhaseSample& sample, double depth) {
  const Rig r = rig();
  const Vec3 ray = r.camera.ray({sample.column + 0.5, double(sample.y)});
  const Vec3& eye = r.camera.center();
  return r.projector.project(eye + (depth - eye.y()) / ray.y() * ray).y();
}

// 0.15 px of the image, where stripes slant and at their ramps: 0.06 rad at 16 px a period.
TEST(StripePhase, SamplesCarryThePhaseOfTheirProjectorRow) {
  const TriangleMesh mesh = swatch();
  const FrameFeatures measured = features_of(flat_at(mesh, 0.02));
  // 160 px of height hold 10 periods of 16 px, so 20 edges a column, less those at the rim.
  EXPECT_GT(measured.phase.size(), 190u * 17);
  for (const PhaseSample& sample : measured.phase) {
    EXPECT_GE(sample.phase, 0);
    EXPECT_LT(sample.phase, kTurn);
    const double expected = kTurn * row_of_plane(sample, 0.02) / rig().pattern.period;
    EXPECT_LT(std::abs(std::remainder(expected - double(sample.phase), kTurn)), 0.06);
  }
}

// An upside-down projector's rows run against the image's: brightening and darkening change places.
TEST(StripePhase, KnowsWhichWayTheProjectorsRowsRun) {
  Rig turned = rig();
  Projection p = turned.projector.projection();
  p.row(0) = 600 * p.row(2) - p.row(0);
  p.row(1) = 440 * p.row(2) - p.row(1);
  turned.projector = Pinhole(p, {0, 0, 0}, "projector");
  const TriangleMesh mesh = swatch();
  Renderer renderer(turned, mesh);
  const RenderedFrame& image = renderer.render(flat_at(mesh, 0));
  const auto samples = stripe_phase_samples(image.intensity, image.silhouette, turned, {0, 0, 0});
  EXPECT_GT(samples.size(), 190u * 17);
  for (const PhaseSample& sample : samples) {
    const double expected = kTurn * (440 - row_of_plane(sample, 0)) / turned.pattern.period;
    EXPECT_LT(std::abs(std::remainder(expected - double(sample.phase), kTurn)), 0.06);
  }
}

TEST(StripePhase, NoneWhereStripesRunDownTheImageOrThereIsNoCloth) {
  Rig sideways = rig();
  Projection p = sideways.projector.projection();
  p.row(0).swap(p.row(1));
  p.row(1) *= -1;  // keeps it from being a mirror image
  sideways.projector = Pinhole(p, {0, 0, 0}, "projector");
  sideways.camera =
      Pinhole(testing::look_at({0, -1, 0}, {0, 0, 0}, 1000, {160, 120}), {0, 0, 0}, "camera");
  EXPECT_NO_THROW(
      stripe_phase_samples(Image::Zero(240, 320), Mask::Ones(240, 320), sideways, {0, 0, 0}));
  EXPECT_TRUE(
      stripe_phase_samples(Image::Zero(240, 320), Mask::Zero(240, 320), rig(), {0, 0, 0}).empty());
}

// Against the geometry of two planes.
TEST(PhaseResidual, IsTheDifferenceOfTheProjectorRows) {
  const TriangleMesh mesh = swatch();
  const FrameFeatures measured = features_of(flat_at(mesh, 0));
  const double depth = 0.01;
  const FrameCost found = residuals(phase_only()).evaluate(measured, flat_at(mesh, depth));
  EXPECT_EQ(found.phase_samples, int(measured.phase.size()));
  EXPECT_GT(found.phase_seen, 0.99 * found.phase_samples);
  double expected = 0;
  for (const PhaseSample& sample : measured.phase) {
    const double change = row_of_plane(sample, depth) - row_of_plane(sample, 0);
    expected += std::pow(kTurn * change / rig().pattern.period, 2);
  }
  EXPECT_GT(expected, 0.5 * double(measured.phase.size()));
  EXPECT_NEAR(found.phase_cost, expected, 0.02 * expected);
  EXPECT_EQ(found.cost, found.phase_cost);
  EXPECT_EQ(found.fold_cost, 0);
}

TEST(PhaseResidual, WrapsWhereDepthChangesByAPeriod) {
  const TriangleMesh mesh = swatch();
  const FrameFeatures measured = features_of(flat_at(mesh, 0));
  // The depth at which the middle of the image sees the next period.
  const PhaseSample middle{160, 120, 0};
  double depth = 0;
  while (std::abs(row_of_plane(middle, depth) - row_of_plane(middle, 0)) < rig().pattern.period)
    depth += 1e-4;
  const auto mean = [&](double d) {
    const FrameCost cost = residuals(phase_only()).evaluate(measured, flat_at(mesh, d));
    return cost.phase_cost / cost.phase_samples;
  };
  EXPECT_GT(mean(0.5 * depth), 5);  // pi^2 = 9.9 where the phases are opposite
  EXPECT_LT(mean(depth), 0.5);
}

/// Mean of Cauchy's loss over a turn, by the midpoint rule.
double mean_loss(double s) {
  double sum = 0;
  constexpr int n = 20000;
  for (int i = 0; i < n; ++i) {
    const double r = std::numbers::pi * (i + 0.5) / n;
    sum += std::isinf(s) ? r * r : s * s * std::log1p(r * r / (s * s));
  }
  return sum / n;
}

TEST(PhaseResidual, HiddenClothCostsWhatARandomPhaseWould) {
  const TriangleMesh mesh = swatch();
  const FrameFeatures measured = features_of(folded(mesh, 0.01));
  Points away = folded(mesh, 0.01);
  away.row(0).array() += 5;
  for (const double scale : {0.3, 1.0, 100.0, 2e3, kInfinity}) {
    ResidualOptions options = phase_only();
    options.phase_weight = 0.7;
    options.phase_scale = scale;
    const FrameLinearization found = residuals(options).linearize(measured, away, directions(mesh));
    EXPECT_EQ(found.phase_seen, 0);
    const double expected = 0.7 * mean_loss(scale) * found.phase_samples;
    EXPECT_NEAR(found.phase_cost, expected, 1e-5 * expected) << scale;
    EXPECT_TRUE(found.gradient.isZero(0));
  }
}

TEST(PhaseResidual, WithoutWeightItIsNotThere) {
  const TriangleMesh mesh = swatch();
  FrameFeatures measured = features_of(folded(mesh, 0.01));
  const FrameCost with = residuals({}).evaluate(measured, folded(mesh, 0.012));
  measured.phase.clear();
  const FrameCost without = residuals({}).evaluate(measured, folded(mesh, 0.012));
  EXPECT_EQ(with.cost, without.cost);
  EXPECT_EQ(with.phase_cost, 0);
}

class PhaseDerivatives : public ::testing::TestWithParam<ResidualOptions::Derivatives> {};

// The measured frame shows another mesh. Slope over +-1 px of the fastest vertex; 5 %: the analytic
// derivative moves flat triangles, the rendered surface is smooth. Edges at the rims are left out:
// there the cost jumps as cloth comes to be seen, which no derivative knows (the silhouette does).
TEST_P(PhaseDerivatives, GradientIsTheSlopeOfTheCost) {
  const TriangleMesh mesh = swatch(), truth = swatch(37);
  FrameFeatures measured = features_of(folded(truth, 0.012, 0.006), 0.003, truth);
  std::erase_if(measured.phase,
                [](const PhaseSample& s) { return s.column < 80 || s.column > 240; });
  const Points x = folded(mesh, 0.009);
  const MatX d = directions(mesh);
  for (const double scale : {kInfinity, 0.3}) {
    ResidualOptions options = phase_only();
    options.phase_scale = scale;
    options.derivatives = GetParam();
    options.stride = 1;
    const FrameLinearization found = residuals(options).linearize(measured, x, d);
    for (int j = 0; j < 2; ++j) {
      const double width = 1e-3;
      Points above = x, below = x;
      flat(above) += width * d.col(j);
      flat(below) -= width * d.col(j);
      FrameResiduals compared = residuals(options);
      const double expected =
          (compared.evaluate(measured, above).cost - compared.evaluate(measured, below).cost) /
          (2 * width);
      EXPECT_NEAR(found.gradient[j], expected, 0.05 * std::abs(expected)) << scale << " " << j;
    }
  }
}

// Where residuals vanish the cost is its own Gauss-Newton model: cost(x + d) = d^T H d / 2.
TEST_P(PhaseDerivatives, GaussNewtonMatrixIsTheCurvatureAtTheMinimum) {
  const TriangleMesh mesh = swatch();
  const Points x = folded(mesh, 0.01);
  const FrameFeatures measured = features_of(x);
  const MatX d = directions(mesh);
  ResidualOptions options = phase_only();
  options.derivatives = GetParam();
  const FrameLinearization found = residuals(options).linearize(measured, x, d);
  for (int j = 0; j < 2; ++j) {
    const double width = 2e-3;
    Points above = x, below = x;
    flat(above) += width * d.col(j);
    flat(below) -= width * d.col(j);
    FrameResiduals compared = residuals(options);
    const double curvature = (compared.evaluate(measured, above).cost +
                              compared.evaluate(measured, below).cost - 2 * found.cost) /
                             (width * width);
    EXPECT_NEAR(found.hessian(j, j), curvature, 0.05 * curvature) << j;
  }
}

INSTANTIATE_TEST_SUITE_P(Both, PhaseDerivatives,
                         ::testing::Values(ResidualOptions::Derivatives::analytic,
                                           ResidualOptions::Derivatives::differences));

}  // namespace
}  // namespace weft::stripe_phase_test
