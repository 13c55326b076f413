#include <algorithm>
#include <cmath>

#include "weft/dynamics/simulate.h"
#include "weft/dynamics/sparse_cholesky.h"
#include "weft/dynamics/state.h"

namespace weft {

namespace {

constexpr double kFirstRegularization = 1e4;  // 1/s^2
constexpr double kLastRegularization = 1e-6;  // 1/s^2; keeps free rigid motions regular
constexpr double kMaxRegularization = 1e12;   // 1/s^2

class Equilibrium {
 public:
  Equilibrium(const ClothModel& model, const std::vector<PointFixture>& fixtures,
              const StaticOptions& options)
      : model_(model),
        options_(options),
        held_(held_vertices(fixtures, model.vertex_count())),
        cholesky_(model.hessian_pattern(), held_, model.mesh().material),
        hessian_(model.hessian_pattern()) {}

  StaticResult solve(Points start);

 private:
  double largest_free_force() const;
  bool factorize(HessianKind kind);
  double step(double potential);

  const ClothModel& model_;
  StaticOptions options_;
  std::vector<char> held_;
  SparseCholesky<double> cholesky_;
  SparseMatrix hessian_;
  Points x_, gradient_, direction_, trial_;
  double regularization_ = kFirstRegularization;
};

double Equilibrium::largest_free_force() const {
  double largest = 0;
  for (Eigen::Index i = 0; i < gradient_.cols(); ++i) {
    if (held_[static_cast<std::size_t>(i)]) continue;
    const double force = gradient_.col(i).norm();
    if (!(force <= largest)) largest = force;  // NaN, too
  }
  return largest;
}

bool Equilibrium::factorize(HessianKind kind) {
  hessian_.coeffs().setZero();
  model_.potential_hessian(x_, {}, kind, gradient_, hessian_);
  const auto diagonal = model_.diagonal_slots();
  for (Eigen::Index i = 0; i < gradient_.cols(); ++i) {
    for (int k = 0; k < 3; ++k) {
      hessian_.valuePtr()[diagonal[static_cast<std::size_t>(3 * i + k)]] +=
          regularization_ * model_.masses()(i);
    }
  }
  return cholesky_.factorize(hessian_);
}

StaticResult Equilibrium::solve(Points start) {
  x_ = std::move(start);
  StaticResult result;
  double potential = model_.potential(x_, {});
  for (; result.iterations < options_.max_iterations; ++result.iterations) {
    if (!factorize(HessianKind::positive_semidefinite)) {
      regularization_ *= 10;
      if (regularization_ > kMaxRegularization) break;
      continue;
    }
    result.residual = largest_free_force();
    if (result.residual < options_.force_tolerance) {
      result.converged = true;
      break;
    }
    if (!std::isfinite(result.residual)) break;
    direction_ = -gradient_;
    cholesky_.solve(direction_);
    const double slope = (gradient_.cwiseProduct(direction_)).sum();
    double fraction = 1;
    double after = potential;
    for (; fraction > 1e-4; fraction *= 0.5) {
      trial_ = x_ + fraction * direction_;
      after = model_.potential(trial_, {});
      if (after <= potential + 1e-4 * fraction * slope + 1e-14 * std::abs(potential)) break;
    }
    x_ = trial_;
    potential = after;
    if (fraction == 1) {
      regularization_ = std::max(regularization_ / 4, kLastRegularization);
    } else {
      regularization_ = std::min(regularization_ * 4, kMaxRegularization);
    }
  }
  result.x = std::move(x_);
  return result;
}

}  // namespace

StaticResult solve_static(const ClothModel& model, const Points& start,
                          const std::vector<PointFixture>& fixtures, double time,
                          const StaticOptions& options) {
  Points x = start;
  prescribe_positions(fixtures, time, x);
  return Equilibrium(model, fixtures, options).solve(std::move(x));
}

}  // namespace weft
