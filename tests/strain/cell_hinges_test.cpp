#include "weft/strain/cell_hinges.h"

#include <gtest/gtest.h>

#include "weft/base/random.h"

namespace weft::cell_hinges_test {
namespace {

using Vertices = std::array<Vector3<double>, CellStencil::vertices>;
constexpr int kSize = 3 * static_cast<int>(CellStencil::vertices);
using Laws = std::array<HingeLaw<double>, CellStencil::hinges>;

/// The sum of those of the hinges.
MatX hessian_by_hinges(const Vertices& x, const Laws& laws, bool exact) {
  MatX sum = MatX::Zero(kSize, kSize);
  for (std::size_t j = 0; j < CellStencil::hinges; ++j) {
    const auto v = CellStencil::hinge(j);
    const HingeStrain hinge = dihedral_angle_strain(to_eigen(x[v[0]]), to_eigen(x[v[1]]),
                                                    to_eigen(x[v[2]]), to_eigen(x[v[3]]));
    MatX h = laws[j].stiffness * hinge.gradient * hinge.gradient.transpose();
    if (exact) h += laws[j].moment * hinge.hessian;
    for (int r = 0; r < 4; ++r)
      for (int c = 0; c < 4; ++c)
        sum.block<3, 3>(3 * static_cast<int>(v[at(r)]), 3 * static_cast<int>(v[at(c)])) +=
            h.block<3, 3>(3 * r, 3 * c);
  }
  return sum;
}

MatX dense(const CellHessian<double>& h) {
  MatX out = MatX::Zero(kSize, kSize);
  for (std::size_t i = 0; i < CellStencil::vertices; ++i)
    out.block<3, 3>(3 * static_cast<int>(i), 3 * static_cast<int>(i)) =
        to_eigen(h.diagonal[i].full());
  for (std::size_t k = 0; k < CellStencil::pairs.size(); ++k) {
    const int row = 3 * static_cast<int>(CellStencil::pairs[k][0]);
    const int column = 3 * static_cast<int>(CellStencil::pairs[k][1]);
    out.block<3, 3>(row, column) = to_eigen(h.lower[k]);
    out.block<3, 3>(column, row) = to_eigen(h.lower[k]).transpose();
  }
  return out;
}

TEST(CellHinges, HessianIsTheSumOverTheHinges) {
  Rng rng(4);
  const double at_rest[8][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0, -1}, {-1, 0}, {1, 2}, {2, 1}};
  for (int k = 0; k < 10; ++k) {
    Vertices x;
    for (std::size_t i = 0; i < x.size(); ++i)
      x[i] = {at_rest[i][0] + 0.2 * rng.normal(), at_rest[i][1] + 0.2 * rng.normal(),
              0.2 * rng.normal()};
    if (k == 0) x[5] = x[3];  // as on a rim
    Laws laws;
    for (auto& law : laws) law = {rng.normal(), rng.uniform()};
    CellHessian<double> h;
    cell_hessian<true>(cell_angles(x), laws, h);
    const MatX exact = hessian_by_hinges(x, laws, true);
    EXPECT_LT((dense(h) - exact).norm(), 1e-14 * exact.norm());
    cell_hessian<false>(cell_angles(x), laws, h);
    const MatX squares = hessian_by_hinges(x, laws, false);
    EXPECT_LT((dense(h) - squares).norm(), 1e-14 * squares.norm());
  }
}

}  // namespace
}  // namespace weft::cell_hinges_test
