// The bend of an ElasticModel against plate theory, to first order in the deflection.
#include <gtest/gtest.h>

#include <Eigen/SparseCholesky>
#include <cmath>

#include "common/elastic_battery.h"

namespace weft::plate_test {
namespace {

struct Load {
  int vertex;
  double force;  ///< N, along z
};

/// Deflections z of the flat sheet under loads, with some vertices held.
VecX deflection(const ElasticModel& model, const std::vector<int>& held,
                const std::vector<Load>& loads) {
  const int n = model.mesh().vertex_count();
  SparseMatrix lower = model.hessian_pattern();
  Points gradient;
  model.hessian(testing::flat_positions(model.mesh()), HessianKind::exact, gradient, lower);
  std::vector<bool> fixed(static_cast<std::size_t>(n));
  for (const int v : held) fixed[static_cast<std::size_t>(v)] = true;
  std::vector<Eigen::Triplet<double>> entries;
  for (int column = 2; column < lower.outerSize(); column += 3)
    for (SparseMatrix::InnerIterator it(lower, column); it; ++it)
      if (it.row() % 3 == 2 && !fixed[static_cast<std::size_t>(it.row() / 3)] &&
          !fixed[static_cast<std::size_t>(column / 3)])
        entries.emplace_back(static_cast<int>(it.row() / 3), column / 3, it.value());
  for (const int v : held) entries.emplace_back(v, v, 1.0);
  SparseMatrix stiffness(n, n);
  stiffness.setFromTriplets(entries.begin(), entries.end());
  VecX force = VecX::Zero(n);
  for (const Load& load : loads) force[load.vertex] = load.force;
  return Eigen::SimplicialLDLT<SparseMatrix, Eigen::Lower>(stiffness).solve(force);
}

Fabric plate(double d11, double d12, double d22, double d66) {
  Fabric fabric = Fabric::with_defaults("plate", "stvk");
  fabric.set("bend_uu", d11);
  fabric.set("bend_uv", d12);
  fabric.set("bend_vv", d22);
  fabric.set("bend_twist", d66);
  return fabric;
}

/// Tip deflection of a strip clamped at u = 0 (its first two columns are held) under a load across
/// the tip, over that of a beam of the flexural rigidity `rigidity`.
double cantilever(const Fabric& fabric, int cells, double aspect, double rigidity,
                  GridPattern pattern) {
  const int rows = std::max(2, static_cast<int>(std::lround(cells / aspect)));
  const double h = 0.1 / cells, length = 0.1 - 0.5 * h, width = h * rows;
  const TriangleMesh mesh = make_swatch(0.1, width, cells + 1, rows + 1, pattern);
  const auto model = make_elastic_model(mesh, fabric);
  std::vector<int> held;
  std::vector<Load> loads;
  for (int row = 0; row <= rows; ++row) {
    const int first = row * (cells + 1);
    held.push_back(first);
    held.push_back(first + 1);
    loads.push_back({first + cells, (row == 0 || row == rows ? 0.5 : 1.0) / rows});
  }
  const VecX z = deflection(*model, held, loads);
  double tip = 0;
  for (const Load& load : loads) tip += load.force * z[load.vertex];
  return tip / (length * length * length / (3 * rigidity * width));
}

TEST(Plate, CantileverWithoutPoissonEffect) {
  // The clamp acts half a cell beyond the second column, where the angle at that column is shared.
  const Fabric fabric = plate(2e-5, 1e-12, 3e-6, 6e-6);
  for (const GridPattern pattern : {GridPattern::uniform, GridPattern::alternating}) {
    EXPECT_NEAR(cantilever(fabric, 10, 2.5, 2e-5, pattern), 1, 0.01);
    EXPECT_NEAR(cantilever(fabric, 40, 2.5, 2e-5, pattern), 1, 0.005);
  }
}

TEST(Plate, LongCantileverWithPoissonEffect) {
  // Free sides: D11 - D12^2 / D22. The clamp keeps the sheet from curling over about half a width,
  // which costs in proportion to the width over the length: extrapolated from two of them.
  const Fabric fabric = plate(2e-5, 6e-6, 6.667e-6, 4e-6);
  const double rigidity = 2e-5 - 6e-6 * 6e-6 / 6.667e-6;
  const double wide = cantilever(fabric, 40, 10, rigidity, GridPattern::uniform);
  const double narrow = cantilever(fabric, 80, 20, rigidity, GridPattern::uniform);
  EXPECT_LT(wide, narrow);
  EXPECT_NEAR(2 * narrow - wide, 1, 0.01);
  EXPECT_NEAR(wide, cantilever(fabric, 80, 10, rigidity, GridPattern::uniform), 0.002);
}

TEST(Plate, TwistByForcesAtTheCorners) {
  // w = F u v / (4 D66): a square plate under forces +-F at its corners is in pure twist.
  const double d66 = 4e-6, side = 0.1, force = 1e-4;
  for (const GridPattern pattern : {GridPattern::uniform, GridPattern::alternating})
    for (const int n : {10, 20}) {
      const TriangleMesh mesh = make_swatch(side, side, n + 1, n + 1, pattern);
      const auto model = make_elastic_model(mesh, plate(2e-5, 5e-6, 8e-6, d66));
      const int a = 0, b = n, c = n * (n + 1), d = c + n;
      const VecX z = deflection(*model, {a, b, c}, {{d, force}});
      EXPECT_NEAR(z[d], force * side * side / (4 * d66), 1e-3 * z[d]) << n;
      Fabric fabric = Fabric::with_defaults("plate");
      fabric.set("bend_stiffness", 2e-5);
      fabric.include("twist_stiffness");
      fabric.set("twist_stiffness", 2 * d66);
      const VecX same = deflection(*make_elastic_model(mesh, fabric), {a, b, c}, {{d, force}});
      EXPECT_NEAR(same[d], z[d], 1e-3 * z[d]) << n;
    }
}

}  // namespace
}  // namespace weft::plate_test
