#include "weft/dynamics/xpbd.h"

#include <gtest/gtest.h>

#include "common/gradient_check.h"
#include "dynamics/scenes.h"
#include "weft/base/error.h"
#include "weft/base/random.h"
#include "weft/dynamics/clips.h"
#include "weft/dynamics/sparse_cholesky.h"

namespace weft::xpbd_test {
namespace {

using namespace test;

std::array<double*, kSheetParameters> parameters(OrthotropicSheet& sheet) {
  return {&sheet.c00, &sheet.c11, &sheet.c01, &sheet.c22, &sheet.bend};
}

/// A swatch that hangs from two corners, and the same energy as an elastic model.
struct Hanging {
  TriangleMesh mesh;
  OrthotropicSheet sheet{
      .c00 = 300, .c11 = 400, .c01 = 80, .c22 = 60, .bend = 3e-4, .areal_density = 0.2};
  std::vector<int> pinned;
  Points start;

  explicit Hanging(int n) : mesh(make_swatch(0.5, 0.5, n, n)), pinned{0, n - 1} {
    start = sagging_start(mesh);
  }

  std::unique_ptr<ElasticModel> model() const {
    Fabric fabric = Fabric::with_defaults("test", "stvk");
    fabric.values.head(8) << sheet.c00, sheet.c01, sheet.c11, sheet.c22, sheet.bend, 0, sheet.bend,
        sheet.bend / 2;
    return make_elastic_model(mesh, fabric);
  }
  std::vector<char> held() const {
    std::vector<char> out(static_cast<std::size_t>(mesh.vertex_count()), 0);
    for (const int i : pinned) out[static_cast<std::size_t>(i)] = 1;
    return out;
  }
  /// The stable equilibrium next to `near`, by Newton's method.
  Points equilibrium(const Points& near) const {
    const auto elastic = model();
    const HeavyCloth cloth(*elastic, sheet.areal_density, Vec3(0, 0, -kGravity));
    const StaticResult result = solve_static(cloth, near, held(), {.force_tolerance = 1e-9});
    EXPECT_TRUE(result.converged);
    return result.x;
  }
};

XpbdOptions curvature_options() {
  XpbdOptions options;
  options.gravity = Vec3(0, 0, -kGravity);
  options.bending = XpbdBending::curvature;
  return options;
}

/// Moved by `size` at random, but for the corners on top.
Points disturbed(const Hanging& hanging, Points x, double size) {
  Rng rng(4);
  for (Eigen::Index i = 0; i < x.cols(); ++i) {
    const Vec3 move(rng.normal(), rng.normal(), rng.normal());
    if (hanging.held()[static_cast<std::size_t>(i)] == 0) x.col(i) += size * move;
  }
  return x;
}

TEST(XpbdEquilibrium, IsThatOfTheStaticSolverWhateverTheSweeps) {
  // Stiffness does not depend on how many sweeps are made, of which kind, or how long the step is.
  const Hanging hanging(9);
  const Points truth = hanging.equilibrium(hanging.start);
  const Points start = disturbed(hanging, truth, 1e-3);
  struct Way {
    XpbdSweep sweep;
    int sweeps_per_step;
    double time_step;
  };
  for (const Way& way : {Way{XpbdSweep::gauss_seidel, 1, 0}, Way{XpbdSweep::gauss_seidel, 5, 0},
                         Way{XpbdSweep::gauss_seidel, 2, 1e-3}, Way{XpbdSweep::jacobi, 1, 0}}) {
    XpbdOptions options = curvature_options();
    options.sweep = way.sweep;
    options.sweeps_per_step = way.sweeps_per_step;
    options.time_step = way.time_step;
    options.force_tolerance = 1e-7;
    const XpbdEquilibrium result =
        xpbd_equilibrium(hanging.mesh, hanging.sheet, hanging.pinned, start, options);
    ASSERT_TRUE(result.converged) << result.residual;
    EXPECT_LT(result.residual, 1e-7);
    // 1e-7 N over the lowest stiffness, some 0.01 N/m.
    EXPECT_LT(largest_distance(result.x, truth), 1e-5)
        << way.sweeps_per_step << " sweeps of kind " << static_cast<int>(way.sweep);
  }
}

TEST(XpbdEquilibrium, AStartAtRestStaysThere) {
  // A start whose net force is below the weights keeps its balance: the first check is the last.
  const Hanging hanging(9);
  const Points truth = hanging.equilibrium(hanging.start);
  XpbdOptions options = curvature_options();
  const auto result = xpbd_equilibrium(hanging.mesh, hanging.sheet, hanging.pinned, truth, options);
  EXPECT_TRUE(result.converged);
  EXPECT_LE(result.iterations, 25);
  EXPECT_LT(largest_distance(result.x, truth), 1e-7);
}

TEST(XpbdEquilibrium, WithMultipliersFromZeroTheSweepsDecideHowSoftTheClothIs) {
  // A strip that hangs from its top row, by its own weight. With kept multipliers its end is where
  // it belongs; from zero it hangs lower, the lower the fewer sweeps.
  const TriangleMesh mesh = make_swatch(0.05, 0.5, 3, 21, GridPattern::uniform);
  const Points start = place(mesh, [](double u, double v) { return Vec3(u, 0, -v); });
  const OrthotropicSheet sheet{
      .c00 = 300, .c11 = 300, .c01 = 0, .c22 = 100, .bend = 1e-5, .areal_density = 0.2};
  const auto sag = [&](XpbdMultipliers multipliers, int sweeps) {
    XpbdOptions options = curvature_options();
    options.multipliers = multipliers;
    options.sweeps_per_step = sweeps;
    options.time_step = 1e-3;
    options.max_iterations = 2000 * sweeps;
    const auto result = xpbd_equilibrium(mesh, sheet, {0, 1, 2}, start, options);
    EXPECT_EQ(result.converged, multipliers == XpbdMultipliers::kept);
    return -result.x.row(2).tail(3).mean() - 0.5;
  };
  // Tension rho g (L - s) = c (E + ...); to first order in the strain rho g L^2 / (2 c).
  const double expected = 0.2 * kGravity * 0.5 * 0.5 / (2 * 300);
  const double two = sag(XpbdMultipliers::kept, 2);
  EXPECT_NEAR(two, expected, 0.02 * expected);
  EXPECT_NEAR(sag(XpbdMultipliers::kept, 8), two, 1e-3 * expected);
  const double zero2 = sag(XpbdMultipliers::from_zero, 2);
  const double zero8 = sag(XpbdMultipliers::from_zero, 8);
  EXPECT_GT(zero2, 1.5 * expected);
  EXPECT_GT(zero8, 1.005 * expected);
  EXPECT_LT(zero8, 1.05 * expected);
}

struct Iterates {
  XpbdBending bending;
  XpbdSweep sweep;
};
class XpbdDerivativesAlong : public ::testing::TestWithParam<Iterates> {};

TEST_P(XpbdDerivativesAlong, AreThoseOfTheIterate) {
  // After a number of sweeps that is far from enough, the derivative is that of the shape reached.
  Hanging hanging(6);
  XpbdOptions options = curvature_options();
  options.bending = GetParam().bending;
  options.sweep = GetParam().sweep;
  options.time_step = 1e-3;
  options.sweeps_per_step = 2;
  options.max_iterations = 36;
  options.derivatives = XpbdDerivatives::along_iterates;
  const auto run = [&](const OrthotropicSheet& sheet) {
    return xpbd_equilibrium(hanging.mesh, sheet, hanging.pinned, hanging.start, options);
  };
  const XpbdEquilibrium result = run(hanging.sheet);
  EXPECT_FALSE(result.converged);
  EXPECT_GT(largest_distance(result.x, hanging.start), 1e-3);
  for (int p = 0; p < kSheetParameters; ++p) {
    const auto at = [&](const VecX& t) {
      OrthotropicSheet sheet = hanging.sheet;
      double& value = *parameters(sheet)[static_cast<std::size_t>(p)];
      value *= 1 + t[0];
      return run(sheet);
    };
    const double value = *parameters(hanging.sheet)[static_cast<std::size_t>(p)];
    const VecX zero = VecX::Zero(1), one = VecX::Ones(1);
    // Central differences are good to 1e-7 here: 36 sweeps multiply rounding.
    EXPECT_TRUE(testing::near(
        value * result.position_derivative.col(p),
        testing::derivative([&](const VecX& t) { return VecX(flat(at(t).x)); }, zero, one, 3e-4),
        1e-6))
        << "parameter " << p;
    EXPECT_TRUE(testing::near(
        value * result.reaction_derivative.col(p),
        testing::derivative([&](const VecX& t) { return VecX(flat(at(t).reactions)); }, zero, one,
                            3e-4),
        1e-6))
        << "parameter " << p;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Xpbd, XpbdDerivativesAlong,
    ::testing::Values(Iterates{XpbdBending::dihedral, XpbdSweep::gauss_seidel},
                      Iterates{XpbdBending::weighted_dihedral, XpbdSweep::gauss_seidel},
                      Iterates{XpbdBending::curvature, XpbdSweep::gauss_seidel},
                      Iterates{XpbdBending::dihedral, XpbdSweep::jacobi},
                      Iterates{XpbdBending::curvature, XpbdSweep::jacobi}));

TEST(XpbdDerivatives, AtRestAreThoseOfTheEquilibrium) {
  // By the implicit function theorem on another implementation of the same energy.
  const Hanging hanging(9);
  const Points truth = hanging.equilibrium(hanging.start);
  const auto model = hanging.model();
  const HeavyCloth cloth(*model, hanging.sheet.areal_density, Vec3(0, 0, -kGravity));
  SparseMatrix hessian = cloth.hessian_pattern();
  hessian.coeffs().setZero();
  Points gradient;
  cloth.hessian(truth, HessianKind::exact, gradient, hessian);
  SparseCholesky<double> cholesky(hessian, hanging.held(), hanging.mesh.material);
  ASSERT_TRUE(cholesky.factorize(hessian));
  MatX own;
  model->parameter_derivative(truth, own);
  MatX by_sheet(own.rows(), kSheetParameters);
  by_sheet << own.col(0), own.col(2), own.col(1), own.col(3),
      own.col(4) + own.col(6) + 0.5 * own.col(7);

  XpbdOptions options = curvature_options();
  options.force_tolerance = 1e-7;
  options.derivative_tolerance = 2e-7;
  for (const XpbdDerivatives kind : {XpbdDerivatives::at_rest, XpbdDerivatives::along_iterates}) {
    options.derivatives = kind;
    const auto result = xpbd_equilibrium(hanging.mesh, hanging.sheet, hanging.pinned,
                                         disturbed(hanging, truth, 1e-4), options);
    ASSERT_TRUE(result.converged) << result.derivative_residual;
    EXPECT_LE(result.derivative_residual, 2e-7);
    for (int p = 0; p < kSheetParameters; ++p) {
      Points column = Eigen::Map<const Points>(by_sheet.col(p).data(), 3, truth.cols());
      column = -column;
      cholesky.solve(column);
      const VecX expected = flat(column);
      EXPECT_TRUE(testing::near(result.position_derivative.col(p), expected, 1e-3)) << p;
      const VecX force = by_sheet.col(p) + hessian.selfadjointView<Eigen::Lower>() * expected;
      VecX reactions(6);
      reactions << force.segment<3>(3 * hanging.pinned[0]), force.segment<3>(3 * hanging.pinned[1]);
      EXPECT_TRUE(testing::near(result.reaction_derivative.col(p), reactions, 1e-3)) << p;
    }
  }
}

TEST(XpbdEquilibrium, ReactionsCarryWeightAndLoads) {
  const Hanging hanging(7);
  XpbdOptions options = curvature_options();
  const Vec3 load(0.05, -0.02, -0.3);
  options.loads = {{48, load}, {42, Vec3(0, 0, -0.1)}};
  const auto result =
      xpbd_equilibrium(hanging.mesh, hanging.sheet, hanging.pinned, hanging.start, options);
  ASSERT_TRUE(result.converged);
  const Vec3 sum = result.reactions.rowwise().sum();
  const Vec3 expected = -load - Vec3(0, 0, -0.1) - Vec3(0, 0, -0.2 * 0.25 * kGravity);
  // At most the tolerance at each of 47 free vertices.
  EXPECT_LT((sum - expected).norm(), 47e-6);
  for (std::size_t k = 0; k < 2; ++k)
    EXPECT_EQ(result.x.col(hanging.pinned[k]), hanging.start.col(hanging.pinned[k]));
}

TEST(XpbdEquilibrium, DoesNotDependOnTheNumberOfThreads) {
  // 71 x 71 vertices are two slabs.
  Hanging hanging(71);
  XpbdOptions options = curvature_options();
  options.bending = XpbdBending::dihedral;
  options.max_iterations = 30;
  options.threads = 1;
  const auto one =
      xpbd_equilibrium(hanging.mesh, hanging.sheet, hanging.pinned, hanging.start, options);
  options.threads = 2;
  const auto two =
      xpbd_equilibrium(hanging.mesh, hanging.sheet, hanging.pinned, hanging.start, options);
  EXPECT_EQ(one.x, two.x);
  EXPECT_EQ(one.residual, two.residual);
}

TEST(XpbdEquilibrium, SaysWhatIsWrong) {
  const Hanging hanging(4);
  const auto run = [&](const OrthotropicSheet& sheet, const std::vector<int>& pinned,
                       const XpbdOptions& options) {
    return xpbd_equilibrium(hanging.mesh, sheet, pinned, hanging.start, options);
  };
  OrthotropicSheet sheet = hanging.sheet;
  sheet.c01 = 400;  // above the geometric mean of 300 and 400
  EXPECT_THROW(run(sheet, hanging.pinned, {}), Error);
  sheet = hanging.sheet;
  sheet.c22 = 0;
  EXPECT_THROW(run(sheet, hanging.pinned, {}), Error);
  EXPECT_THROW(run(hanging.sheet, {16}, {}), Error);
  XpbdOptions options;
  options.force_tolerance = 0;
  EXPECT_THROW(run(hanging.sheet, hanging.pinned, options), Error);
  options = {};
  options.loads = {{-1, Vec3::Zero()}};
  EXPECT_THROW(run(hanging.sheet, hanging.pinned, options), Error);
  EXPECT_THROW(xpbd_equilibrium(hanging.mesh, hanging.sheet, hanging.pinned, Points(3, 5), {}),
               Error);
  // Without pins it falls: no equilibrium, and it says so.
  options = {};
  options.max_iterations = 200;
  EXPECT_FALSE(run(hanging.sheet, {}, options).converged);
}

}  // namespace
}  // namespace weft::xpbd_test
