#include "weft/dynamics/held_equilibrium.h"

#include <algorithm>
#include <utility>

#include "weft/base/error.h"
#include "weft/dynamics/clips.h"
#include "weft/dynamics/sparse_cholesky.h"

namespace weft {
namespace {

constexpr double kLeastRegularization = 1e-6;  // 1/s^2, as of an equilibrium
constexpr double kMostRegularization = 1e12;   // 1/s^2

/// The exact Hessian with as little of the mass matrix added as makes it positive definite. False
/// if more than the least was needed.
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

void zero_free_columns(const std::vector<char>& held, Points& reactions) {
  for (std::size_t i = 0; i < held.size(); ++i)
    if (!held[i]) reactions.col(static_cast<Eigen::Index>(i)).setZero();
}

class StaticSolver final : public EquilibriumSolver {
 public:
  explicit StaticSolver(const StaticOptions& options) : options_(options) {}

  std::string_view name() const override { return "static"; }

  HeldEquilibrium solve(const HeldCloth& cloth, const Fabric& fabric,
                        HeldDerivatives derivatives) const override {
    const auto model = make_elastic_model(cloth.mesh, fabric, cloth.grain_angle);
    const HeavyCloth heavy(*model, cloth.areal_density, cloth.gravity);
    StaticResult found = solve_static(heavy, cloth.start, cloth.held, options_);
    HeldEquilibrium result;
    result.x = std::move(found.x);
    result.residual = found.residual;
    result.iterations = found.iterations;
    result.converged = found.converged;
    heavy.gradient(result.x, result.reactions);
    zero_free_columns(cloth.held, result.reactions);
    if (derivatives == HeldDerivatives::all) differentiate(heavy, cloth.held, result);
    return result;
  }

 private:
  /// dx_f = -K_ff^-1 g'_f and d reactions = g'_h + K_hf dx_f, as in clips.h.
  static void differentiate(const HeavyCloth& heavy, const std::vector<char>& held,
                            HeldEquilibrium& result) {
    SparseMatrix hessian = heavy.hessian_pattern();
    hessian.coeffs().setZero();
    Points gradient;
    heavy.hessian(result.x, HessianKind::exact, gradient, hessian);
    SparseCholesky<double> cholesky(hessian, held, heavy.mesh().material);
    result.inexact = !factorize(heavy.masses(), hessian, cholesky);
    heavy.model().parameter_derivative(result.x, result.reaction_derivative);
    result.x_derivative = -result.reaction_derivative;
    solve_columns(cholesky, result.x_derivative);
    result.reaction_derivative += hessian.selfadjointView<Eigen::Lower>() * result.x_derivative;
    for (std::size_t i = 0; i < held.size(); ++i)
      if (!held[i])
        result.reaction_derivative.middleRows(3 * static_cast<Eigen::Index>(i), 3).setZero();
  }

  StaticOptions options_;
};

}  // namespace

StaticOptions static_solver_options() {
  StaticOptions options;
  options.max_iterations = 3000;
  return options;
}

std::unique_ptr<EquilibriumSolver> make_static_solver(const StaticOptions& options) {
  return std::make_unique<StaticSolver>(options);
}

}  // namespace weft
