#include "weft/dynamics/equilibrium_derivatives.h"

#include <algorithm>

#include "weft/base/error.h"
#include "weft/dynamics/sparse_cholesky.h"

namespace weft::detail {
namespace {

constexpr double kLeastRegularization = 1e-6;  // 1/s^2, as of an equilibrium
constexpr double kMostRegularization = 1e12;   // 1/s^2

/// The exact Hessian factorized, with as little of the mass matrix added as makes it positive
/// definite. False if it is not positive definite by itself.
bool factorize(const VecX& masses, SparseMatrix hessian, SparseCholesky<double>& cholesky) {
  const std::vector<int> diagonal = diagonal_slots(hessian);
  double added = 0;
  for (double wanted = kLeastRegularization; wanted < kMostRegularization; wanted *= 10) {
    for (std::size_t i = 0; i < diagonal.size(); ++i)
      hessian.valuePtr()[diagonal[i]] +=
          (wanted - added) * masses[static_cast<Eigen::Index>(i / 3)];
    added = wanted;
    if (cholesky.factorize(hessian)) return wanted == kLeastRegularization;
  }
  throw Error("equilibrium: the stiffness matrix cannot be factorized; it is not finite");
}

/// Solves for all columns of `b` (3 n x any), kDirections at a time.
void solve_columns(const SparseCholesky<double>& cholesky, MatX& b) {
  Directions block = Directions::Zero(b.rows(), kDirections);
  for (Eigen::Index first = 0; first < b.cols(); first += kDirections) {
    const Eigen::Index count = std::min<Eigen::Index>(kDirections, b.cols() - first);
    block.setZero();
    block.leftCols(count) = b.middleCols(first, count);
    cholesky.solve(block);
    b.middleCols(first, count) = block.leftCols(count);
  }
}

/// The exact Hessian at `x`, lower triangle.
SparseMatrix hessian_at(const HeavyCloth& cloth, const Points& x) {
  SparseMatrix hessian = cloth.hessian_pattern();
  hessian.coeffs().setZero();
  Points gradient;
  cloth.hessian(x, HessianKind::exact, gradient, hessian);
  return hessian;
}

void zero_free_rows(const std::vector<char>& held, MatX& rows) {
  for (std::size_t i = 0; i < held.size(); ++i)
    if (!held[i]) rows.middleRows(3 * static_cast<Eigen::Index>(i), 3).setZero();
}

}  // namespace

EquilibriumDerivatives equilibrium_derivatives(const HeavyCloth& cloth,
                                               const std::vector<char>& held, const Points& x,
                                               const MatX& history_derivative) {
  const SparseMatrix hessian = hessian_at(cloth, x);
  SparseCholesky<double> cholesky(hessian, held, cloth.mesh().material);
  EquilibriumDerivatives result;
  result.inexact = !factorize(cloth.masses(), hessian, cholesky);
  cloth.model().parameter_derivative(x, result.gradient);
  if (history_derivative.size() > 0)
    cloth.model().add_history_derivative(x, history_derivative, result.gradient);
  result.x = -result.gradient;
  solve_columns(cholesky, result.x);
  result.gradient += hessian.selfadjointView<Eigen::Lower>() * result.x;
  zero_free_rows(held, result.gradient);
  return result;
}

MatX held_stiffness(const HeavyCloth& cloth, const std::vector<char>& held, const Points& x,
                    const MatX& moves) {
  const SparseMatrix hessian = hessian_at(cloth, x);
  SparseCholesky<double> cholesky(hessian, held, cloth.mesh().material);
  factorize(cloth.masses(), hessian, cholesky);
  MatX shift = -(hessian.selfadjointView<Eigen::Lower>() * moves);
  solve_columns(cholesky, shift);
  shift += moves;
  MatX forces = hessian.selfadjointView<Eigen::Lower>() * shift;
  zero_free_rows(held, forces);
  return forces;
}

}  // namespace weft::detail
