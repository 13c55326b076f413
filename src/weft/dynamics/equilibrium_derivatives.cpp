#include "weft/dynamics/equilibrium_derivatives.h"

#include <algorithm>

namespace weft::detail {
namespace {

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

void zero_free_rows(const std::vector<char>& held, MatX& rows) {
  for (std::size_t i = 0; i < held.size(); ++i)
    if (!held[i]) rows.middleRows(3 * static_cast<Eigen::Index>(i), 3).setZero();
}

}  // namespace

EquilibriumDerivatives equilibrium_derivatives(const HeavyCloth& cloth, StaticSystem& system,
                                               const Points& x, const MatX& history_derivative) {
  const StaticSystem::Factor factor = system.factor_at(x);
  EquilibriumDerivatives result;
  result.inexact = factor.inexact();
  cloth.model().parameter_derivative(x, result.gradient);
  if (history_derivative.size() > 0)
    cloth.model().add_history_derivative(x, history_derivative, result.gradient);
  result.x = -result.gradient;
  solve_columns(factor.cholesky, result.x);
  result.gradient += factor.hessian.selfadjointView<Eigen::Lower>() * result.x;
  zero_free_rows(system.held(), result.gradient);
  return result;
}

HeldResponse held_response(StaticSystem& system, const Points& x, const MatX& moves) {
  const StaticSystem::Factor factor = system.factor_at(x);
  HeldResponse response;
  response.x = -(factor.hessian.selfadjointView<Eigen::Lower>() * moves);
  solve_columns(factor.cholesky, response.x);
  response.x += moves;
  response.forces = factor.hessian.selfadjointView<Eigen::Lower>() * response.x;
  for (Eigen::Index i = 0; i < x.cols(); ++i)
    response.forces.middleRows(3 * i, 3) -=
        factor.regularization * factor.masses[i] * moves.middleRows(3 * i, 3);
  zero_free_rows(system.held(), response.forces);
  return response;
}

}  // namespace weft::detail
