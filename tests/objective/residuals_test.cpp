#include "weft/objective/residuals.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "objective/folded_sheet.h"
#include "weft/base/error.h"

namespace weft::residuals_test {
namespace {

using testing::directions;
using testing::features_of;
using testing::folded;
using testing::rig;
using testing::swatch;

FrameResiduals residuals(const ResidualOptions& options) {
  static const Rig shared_rig = rig();
  static const TriangleMesh mesh = swatch();
  return FrameResiduals(shared_rig, mesh, {}, {}, options);
}

ResidualOptions folds_only() {
  ResidualOptions options;
  options.alpha = 0;
  options.fold_scale = kInfinity;
  return options;
}

TEST(Residuals, PlainSquaresOfTheFoldsAreEquationFive) {
  const TriangleMesh mesh = swatch();
  const FrameFeatures measured = features_of(folded(mesh, 0.01));
  const FrameCost found = residuals(folds_only()).evaluate(measured, folded(mesh, 0.014));
  EXPECT_GT(found.error.fold, 1);
  EXPECT_NEAR(found.cost, found.error.fold, 1e-4 * found.cost);
  EXPECT_GT(found.error.overlap_pixels, 1000);
}

TEST(Residuals, TheSameShapeCostsNothing) {
  const TriangleMesh mesh = swatch();
  const FrameCost found =
      residuals({}).evaluate(features_of(folded(mesh, 0.01)), folded(mesh, 0.01));
  EXPECT_EQ(found.cost, 0);
  EXPECT_EQ(found.error.fold, 0);
  EXPECT_EQ(found.error.silhouette, 0);
}

TEST(Residuals, TheRobustLossCostsLessAndForSmallResidualsTheSame) {
  const TriangleMesh mesh = swatch();
  const FrameFeatures measured = features_of(folded(mesh, 0.01));
  ResidualOptions robust = folds_only();
  robust.fold_scale = 0.1;
  const auto ratio = [&](double amplitude) {
    return residuals(robust).evaluate(measured, folded(mesh, amplitude)).cost /
           residuals(folds_only()).evaluate(measured, folded(mesh, amplitude)).cost;
  };
  EXPECT_NEAR(ratio(0.0102), 1, 0.01);
  EXPECT_LT(ratio(0.03), 0.5);
}

// A flat sheet slides by d px: both of its vertical outlines, 160 px long, move by d.
TEST(Residuals, SilhouettesCostTheSquareOfSmallShiftsAndTheCountOfLargeOnes) {
  const TriangleMesh mesh = swatch();
  const FrameFeatures measured = features_of(folded(mesh, 0));
  ResidualOptions options;
  const auto silhouette_cost = [&](double shift, double sigma) {
    ResidualOptions with = options, without = options;
    with.silhouette_sigma = without.silhouette_sigma = sigma;
    without.alpha = 0;
    const Points x = folded(mesh, 0, 1e-3 * shift);
    return (residuals(with).evaluate(measured, x).cost -
            residuals(without).evaluate(measured, x).cost) /
           options.alpha;
  };
  const double length = 2 * 160, root_pi = std::sqrt(std::numbers::pi);
  // d^2 / (2 sqrt(pi) sigma) (1 - d^2 / (8 sigma^2) + ...); the ends of the outlines count less.
  EXPECT_NEAR(silhouette_cost(2, 6), length * 4 / (2 * root_pi * 6), 0.1 * length * 4 / 21);
  // d - 2 sigma / sqrt(pi).
  EXPECT_NEAR(silhouette_cost(20, 3), length * (20 - 6 / root_pi), 0.03 * length * 20);
  // Without blur, what equation 6 counts.
  const double counted =
      residuals(options).evaluate(measured, folded(mesh, 0, 0.02)).error.silhouette;
  EXPECT_NEAR(silhouette_cost(20, 0.1), counted, 0.01 * counted);
}

/// Blurred by a Gaussian out to 3 sigma, of what lies in the image.
Eigen::ArrayXXd blurred(const Mask& mask, double sigma) {
  const int reach = static_cast<int>(std::ceil(3 * sigma));
  const auto along = [&](const Eigen::ArrayXXd& in, Eigen::Index dy, Eigen::Index dx) {
    Eigen::ArrayXXd out = Eigen::ArrayXXd::Zero(in.rows(), in.cols());
    double total = 0;
    for (int n = -reach; n <= reach; ++n) total += std::exp(-0.5 * n * n / (sigma * sigma));
    for (Eigen::Index y = 0; y < in.rows(); ++y)
      for (Eigen::Index x = 0; x < in.cols(); ++x)
        for (int n = -reach; n <= reach; ++n) {
          const Eigen::Index i = y + n * dy, j = x + n * dx;
          if (i >= 0 && j >= 0 && i < in.rows() && j < in.cols())
            out(y, x) += std::exp(-0.5 * n * n / (sigma * sigma)) / total * in(i, j);
        }
    return out;
  };
  return along(along(mask.cast<double>(), 1, 0), 0, 1);
}

TEST(Residuals, SilhouettesOfAnyFormCostTheSquaresOfTheirBlur) {
  const TriangleMesh mesh = swatch();
  const Points x = folded(mesh, 0.02);
  FrameFeatures measured = features_of(x);
  const Mask simulated = measured.silhouette;
  ResidualOptions options;
  options.fold_weight = 0;
  for (const double sigma : {2.0, 7.0}) {
    // Holes and specks, with room between them and without, and a side at the image's border.
    Mask& mask = measured.silhouette;
    mask = simulated;
    mask.block(60, 100, 1, 1).setZero();
    mask.block(100, 90, 60, 70).setZero();
    mask.block(120, 110, 9, 30).setOnes();
    mask.block(5, 3, 2, 2).setOnes();
    mask.rightCols(40).setOnes();
    options.silhouette_sigma = sigma;
    const double expected =
        options.alpha * (blurred(mask, sigma) - blurred(simulated, sigma)).square().sum();
    EXPECT_NEAR(residuals(options).evaluate(measured, x).cost, expected, 2e-3 * expected) << sigma;
  }
}

/// Slope of the cost along direction j between two points `width` to either side.
double slope(const ResidualOptions& options, const FrameFeatures& measured, const Points& x,
             const VecX& direction, double width) {
  FrameResiduals compared = residuals(options);
  Points above = x, below = x;
  flat(above) += width * direction;
  flat(below) -= width * direction;
  return (compared.evaluate(measured, above).cost - compared.evaluate(measured, below).cost) /
         (2 * width);
}

class ResidualDerivatives : public ::testing::TestWithParam<ResidualOptions::Derivatives> {};

// Over +-1.5 px, which averages over the flips of single pixels. 10 %: the analytic derivative does
// not know of the filters' blur.
TEST_P(ResidualDerivatives, GradientIsTheSlopeOfTheCost) {
  const TriangleMesh mesh = swatch();
  const FrameFeatures measured = features_of(folded(mesh, 0.012, 0.006));
  const Points x = folded(mesh, 0.009);
  const MatX d = directions(mesh);
  for (const bool silhouettes : {false, true}) {
    ResidualOptions options = folds_only();
    options.alpha = silhouettes ? 0.1 : 0;
    options.fold_scale = silhouettes ? 0.3 : kInfinity;
    options.derivatives = GetParam();
    const FrameLinearization found = residuals(options).linearize(measured, x, d);
    for (int j = 0; j < 2; ++j) {
      const double expected = slope(options, measured, x, d.col(j), 1.5e-3);
      EXPECT_NEAR(found.gradient[j], expected, 0.1 * std::abs(expected)) << silhouettes << j;
    }
  }
}

// Where residuals are small the cost is its own Gauss-Newton model: cost(x + d) = d^T H d / 2.
TEST_P(ResidualDerivatives, GaussNewtonMatrixIsTheCurvatureAtTheMinimum) {
  const TriangleMesh mesh = swatch();
  const Points x = folded(mesh, 0.01);
  const FrameFeatures measured = features_of(x);
  const MatX d = directions(mesh);
  ResidualOptions options = folds_only();
  options.derivatives = GetParam();
  const FrameLinearization found = residuals(options).linearize(measured, x, d);
  EXPECT_LT((found.hessian - found.hessian.transpose()).norm(), 1e-9 * found.hessian.norm());
  for (int j = 0; j < 2; ++j) {
    Points moved = x;
    const double width = 1e-3;
    flat(moved) += width * d.col(j);
    const double curvature =
        2 * residuals(options).evaluate(measured, moved).cost / (width * width);
    EXPECT_NEAR(found.hessian(j, j), curvature, 0.25 * curvature) << j;
  }
}

TEST_P(ResidualDerivatives, CostIsThatOfTheEvaluationAndStillDirectionsCountNothing) {
  const TriangleMesh mesh = swatch();
  const FrameFeatures measured = features_of(folded(mesh, 0.012));
  MatX d = directions(mesh);
  d.col(1).setZero();
  ResidualOptions options;
  options.derivatives = GetParam();
  const FrameLinearization found = residuals(options).linearize(measured, folded(mesh, 0.01), d);
  const FrameCost alone = residuals(options).evaluate(measured, folded(mesh, 0.01));
  EXPECT_EQ(found.cost, alone.cost);
  EXPECT_EQ(found.error.fold, alone.error.fold);
  EXPECT_EQ(found.gradient[1], 0);
  EXPECT_EQ(found.hessian(1, 1), 0);
  EXPECT_EQ(found.hessian(0, 1), 0);
  EXPECT_GT(found.hessian(0, 0), 0);
}

TEST_P(ResidualDerivatives, NoClothInSightIsNoError) {
  const TriangleMesh mesh = swatch();
  const FrameFeatures measured = features_of(folded(mesh, 0.012));
  Points away = folded(mesh, 0.012);
  away.row(0).array() += 5;
  ResidualOptions options;
  options.derivatives = GetParam();
  const FrameLinearization found = residuals(options).linearize(measured, away, directions(mesh));
  EXPECT_TRUE(found.gradient.allFinite());
  EXPECT_EQ(found.error.overlap_pixels, 0);
  EXPECT_GT(found.cost, 0);
}

INSTANTIATE_TEST_SUITE_P(Both, ResidualDerivatives,
                         ::testing::Values(ResidualOptions::Derivatives::analytic,
                                           ResidualOptions::Derivatives::differences));

TEST(Residuals, RejectsBadOptions) {
  for (const auto& spoil :
       {+[](ResidualOptions& o) { o.alpha = -1; }, +[](ResidualOptions& o) { o.fold_scale = 0; },
        +[](ResidualOptions& o) { o.silhouette_sigma = 0; },
        +[](ResidualOptions& o) { o.fold_weight = -1; },
        +[](ResidualOptions& o) { o.phase_weight = kInfinity; },
        +[](ResidualOptions& o) { o.phase_scale = 0; },
        +[](ResidualOptions& o) { o.largest_phase_turn = 0; },
        +[](ResidualOptions& o) { o.silhouette_sigma = 100; },
        +[](ResidualOptions& o) { o.image_step = std::nan(""); },
        +[](ResidualOptions& o) { o.largest_turn = 0; }}) {
    ResidualOptions options;
    spoil(options);
    EXPECT_THROW(residuals(options), Error);
  }
  const TriangleMesh mesh = swatch();
  EXPECT_THROW(
      residuals({}).linearize(features_of(folded(mesh, 0)), folded(mesh, 0), MatX::Zero(7, 1)),
      Error);
}

}  // namespace
}  // namespace weft::residuals_test
