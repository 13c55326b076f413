#include "weft/dynamics/held_equilibrium.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/gradient_check.h"
#include "weft/base/error.h"
#include "weft/fabric/orthotropic.h"

namespace weft::held_equilibrium_test {
namespace {

constexpr double kSide = 0.1;  // m
constexpr int kColumns = 6;

/// A swatch between two rows that are held, shorter than on the flat cloth, so that it buckles.
struct Held {
  TriangleMesh mesh = make_swatch(kSide, kSide, kColumns, kColumns, GridPattern::uniform);
  std::vector<char> held = std::vector<char>(static_cast<std::size_t>(mesh.vertex_count()), 0);
  Points start{3, mesh.vertex_count()};
  Held() {
    for (int i = 0; i < kColumns; ++i) held[static_cast<std::size_t>(i)] = 1;
    std::fill(held.end() - kColumns, held.end(), 1);
    for (Eigen::Index i = 0; i < start.cols(); ++i) {
      const Vec2 uv = mesh.material.col(i);
      start.col(i) = Vec3(0.98 * uv.x(), 0.003 * std::sin(60 * uv.x()), -uv.y());
    }
  }
  HeldCloth scene(double grain_angle = 0) const {
    return {mesh, 0.2, Vec3(0, 0, -9.81), grain_angle, held, start};
  }
};

Fabric cloth_fabric() {
  return orthotropic_fabric("f", stiffness_of(OrthotropicModuli{30, 60, 10, 0.3, 2e-5}));
}

TEST(HeldEquilibrium, PinsCarryTheWeight) {
  const Held cloth;
  for (const auto& solver : {make_static_solver(), make_xpbd_solver()}) {
    SCOPED_TRACE(solver->name());
    const HeldEquilibrium rest =
        solver->solve(cloth.scene(), cloth_fabric(), HeldDerivatives::none);
    ASSERT_TRUE(rest.converged);
    const Vec3 sum = rest.reactions.rowwise().sum();
    // Net forces of at most 1e-6 N on each of 24 free vertices.
    EXPECT_NEAR(sum.z(), 0.2 * kSide * kSide * 9.81, 2.4e-5);
    EXPECT_NEAR(sum.head<2>().norm(), 0, 2.4e-5);
    EXPECT_EQ(rest.reactions.col(kColumns).norm(), 0);
    EXPECT_EQ(rest.x.col(0), cloth.start.col(0));
  }
}

TEST(HeldEquilibrium, PinsCarryTheHem) {
  const Held cloth;
  HeldCloth scene = cloth.scene();
  scene.hem_width = 0.01;
  Fabric threads = Fabric::with_defaults("threads", "baraff-witkin-diagonals");
  threads.set("stretch_stiffness", 60);
  const HeldEquilibrium rest = make_static_solver()->solve(scene, threads, HeldDerivatives::none);
  ASSERT_TRUE(rest.converged);
  const double area = kSide * kSide + 4 * kSide * scene.hem_width;
  EXPECT_NEAR(rest.reactions.row(2).sum(), 0.2 * area * 9.81, 2.4e-5);
  // A sheet has none, nor has XPBD.
  for (const auto& solver : {make_static_solver(), make_xpbd_solver()})
    EXPECT_THROW(solver->solve(scene, cloth_fabric(), HeldDerivatives::none), Error);
}

TEST(HeldEquilibrium, DerivativesAgreeWithDifferences) {
  const Held cloth;
  const auto solver = make_static_solver({.force_tolerance = 1e-11});
  const Fabric fabric = cloth_fabric();
  const HeldEquilibrium rest = solver->solve(cloth.scene(), fabric, HeldDerivatives::all);
  ASSERT_TRUE(rest.converged);
  const HeldCloth again{cloth.mesh, 0.2, Vec3(0, 0, -9.81), 0, cloth.held, rest.x};
  const auto at = [&](const VecX& scale) {
    Fabric other = fabric;
    other.values = fabric.values.cwiseProduct(scale);
    const HeldEquilibrium e = solver->solve(again, other, HeldDerivatives::none);
    VecX all(2 * e.x.size());
    all << flat(e.x), flat(e.reactions);
    return all;
  };
  // The descent ends where rounding of the energy hides what is left, some 1e-10 N, or 1e-10 m:
  // with steps of a hundredth, which move vertices by up to 3e-5 m, that is 1e-5
  // of the largest entry; other steps differ by some 1e-4.
  const MatX numeric = testing::numeric_jacobian(at, VecX::Ones(8), 1e-2);
  const MatX x = rest.x_derivative * fabric.values.asDiagonal(),
             r = rest.reaction_derivative * fabric.values.asDiagonal();
  EXPECT_TRUE(testing::near(x, numeric.topRows(x.rows()), 2e-4));
  EXPECT_TRUE(testing::near(r, numeric.bottomRows(r.rows()), 2e-4));
}

// Two solvers of one model: the same shape, forces and derivatives, b moving as one.
TEST(HeldEquilibrium, BothSolversAgree) {
  const Held cloth;
  const Fabric fabric = cloth_fabric();
  for (const double grain : {0.0, 0.5}) {
    const HeldEquilibrium a =
        make_static_solver()->solve(cloth.scene(grain), fabric, HeldDerivatives::all);
    XpbdOptions options = xpbd_solver_options();
    options.force_tolerance = 1e-8;
    const HeldCloth near{cloth.mesh, 0.2, Vec3(0, 0, -9.81), grain, cloth.held, a.x};
    const HeldEquilibrium b = make_xpbd_solver(options)->solve(near, fabric, HeldDerivatives::all);
    ASSERT_TRUE(a.converged && b.converged);
    EXPECT_LT((a.x - b.x).colwise().norm().maxCoeff(), 1e-6);
    EXPECT_LT((a.reactions - b.reactions).norm(), 1e-6);
    VecX tied = VecX::Zero(8);
    tied[fabric.value_index("bend_uu")] = tied[fabric.value_index("bend_vv")] = 1;
    tied[fabric.value_index("bend_twist")] = 0.5;
    EXPECT_TRUE(testing::near(b.x_derivative * tied, a.x_derivative * tied, 1e-3));
    EXPECT_TRUE(testing::near(b.x_derivative.leftCols(4), a.x_derivative.leftCols(4), 1e-3));
    EXPECT_TRUE(
        testing::near(b.reaction_derivative.leftCols(4), a.reaction_derivative.leftCols(4), 1e-3));
  }
}

TEST(HeldEquilibrium, XpbdHasOneRigidity) {
  const Held cloth;
  Fabric fabric = cloth_fabric();
  fabric.set("bend_vv", 1e-5);
  EXPECT_THROW(make_xpbd_solver()->solve(cloth.scene(), fabric, HeldDerivatives::none), Error);
  fabric = cloth_fabric();
  fabric.set("bend_uv", 0.1 * fabric.value("bend_uu"));
  EXPECT_THROW(make_xpbd_solver()->solve(cloth.scene(), fabric, HeldDerivatives::none), Error);
  EXPECT_THROW(
      make_xpbd_solver()->solve(cloth.scene(), Fabric::with_defaults("f"), HeldDerivatives::none),
      Error);
}

}  // namespace
}  // namespace weft::held_equilibrium_test
