#include "weft/dynamics/static_system.h"

#include <algorithm>
#include <cmath>

#include "weft/base/error.h"
#include "weft/base/random.h"

namespace weft {

namespace {

// The regularization is an inverse square of a time step: the step of a motion that forgets its
// velocity. It shrinks as steps succeed.
constexpr double kInitialRegularization = 1e4;   // 1/s^2
constexpr double kLeastRegularization = 1e-6;    // 1/s^2; keeps free rigid motions regular
constexpr double kLargestRegularization = 1e12;  // 1/s^2
constexpr double kEnoughDecrease = 1e-4;
constexpr double kLeastFraction = 1e-3;
constexpr double kPotentialRounding = 1e-14;  // of the potential
constexpr int kLongestExactPause = 16;        // iterations before the exact Hessian is tried again
constexpr double kFirstEscape = 1e-4;         // m, along a direction of negative curvature
constexpr double kFirstLeap = 1e-5;           // m, the furthest vertex
constexpr int kMostLeaps = 8;
constexpr double kStillServes = 0.2;  // of the forces before, that a former factor may leave

}  // namespace

StaticSystem::StaticSystem(const StaticPotential& potential, std::vector<char> held,
                           const StaticSystem* like)
    : model_(potential),
      held_(std::move(held)),
      cholesky_(like && like->held_ == held_
                    ? like->cholesky_.another()
                    : SparseCholesky<double>(potential.hessian_pattern(), held_,
                                             potential.mesh().material)),
      hessian_(potential.hessian_pattern()),
      diagonal_(diagonal_slots(hessian_)),
      exact_pause_(kLongestExactPause) {}

bool StaticSystem::Factor::inexact() const { return regularization > kLeastRegularization; }

double StaticSystem::largest_free_force() const {
  double largest = 0;
  for (Eigen::Index i = 0; i < gradient_.cols(); ++i) {
    if (held_[static_cast<std::size_t>(i)]) continue;
    const double force = gradient_.col(i).norm();
    if (!(force <= largest)) largest = force;  // NaN, too
  }
  return largest;
}

/// Adds this times the masses to the diagonal.
void StaticSystem::regularize(double regularization) {
  for (std::size_t i = 0; i < diagonal_.size(); ++i)
    hessian_.valuePtr()[diagonal_[i]] +=
        regularization * model_.masses()[static_cast<Eigen::Index>(i / 3)];
}

bool StaticSystem::factorize(HessianKind kind) {
  factored_at_.reset();
  hessian_.coeffs().setZero();
  model_.hessian(x_, kind, gradient_, hessian_);
  regularize(regularization_);
  return cholesky_.factorize(hessian_);
}

/// The exact Hessian converges fast, where it is positive definite; the projected one always leads
/// downhill.
bool StaticSystem::factorize_for_direction() {
  if (exact_pause_.is_due()) {
    exact_ = factorize(HessianKind::exact);
    exact_pause_.note(exact_);
    if (exact_) return true;
  }
  exact_ = false;
  while (!factorize(HessianKind::positive_semidefinite)) {
    regularization_ *= 10;
    if (!(regularization_ < kLargestRegularization)) return false;
  }
  return true;
}

/// Moves x_ along the Newton direction. False if the potential cannot be lowered.
bool StaticSystem::find_step() {
  direction_ = -gradient_;
  cholesky_.solve(direction_);
  const double slope = gradient_.cwiseProduct(direction_).sum();
  for (double fraction = 1; fraction > kLeastFraction; fraction *= 0.5) {
    trial_ = x_ + fraction * direction_;
    const double after = model_.value(trial_);
    const double allowed =
        kEnoughDecrease * fraction * slope + kPotentialRounding * std::abs(potential_);
    if (after - potential_ <= allowed) {
      // Half of the slope is what a quadratic function yields.
      as_predicted_ = fraction == 1 && after - potential_ <= 0.25 * slope + kPotentialRounding;
      regularization_ *= as_predicted_ ? (exact_ ? 0.1 : 0.25) : (fraction == 1 ? 1 : 2);
      regularization_ = std::clamp(regularization_, kLeastRegularization, kLargestRegularization);
      std::swap(x_, trial_);
      potential_ = after;
      return true;
    }
  }
  as_predicted_ = false;
  regularization_ *= 16;
  return regularization_ < kLargestRegularization;
}

/// Past a step of the potential that no descent climbs: an angle that turns through 180 degrees
/// jumps, and with it the mean of several. The forces are those of the lower side: the cloth is
/// moved along them, each time further than the time before. False where that was done too often.
bool StaticSystem::leap() {
  if (leaps_ >= kMostLeaps) return false;
  regularization_ = kInitialRegularization;
  if (!factorize_for_direction()) return false;
  direction_ = -gradient_;
  cholesky_.solve(direction_);
  const double length = kFirstLeap * std::pow(2, leaps_++);
  x_ += length / direction_.colwise().norm().maxCoeff() * direction_;
  potential_ = model_.value(x_);
  return true;
}

/// More steps by the factor at hand, to convergence. False where it no longer serves.
bool StaticSystem::finish_by_factor(double force_tolerance, StaticResult& result) {
  for (double before = result.residual;; before = result.residual) {
    model_.gradient(x_, gradient_);
    const double after = largest_free_force();
    if (!(after < kStillServes * before)) break;
    result.residual = after;
    if (after < force_tolerance) return true;
    direction_ = -gradient_;
    cholesky_.solve(direction_);
    x_ += direction_;
  }
  potential_ = model_.value(x_);
  return false;
}

/// Whether the exact Hessian is positive definite, and then factored: a regularization hides a
/// curvature that is less negative than itself.
bool StaticSystem::is_stable() {
  if (exact_ && regularization_ == kLeastRegularization) return true;
  const double kept = regularization_;
  regularization_ = kLeastRegularization;
  exact_ = factorize(HessianKind::exact);
  if (!exact_) regularization_ = kept;
  return exact_;
}

/// Leaves a saddle along its direction of most negative curvature, found by inverse iteration, on
/// the side and as far as the potential falls. False where kFirstEscape to either side does not
/// lower it: a curvature that weak moves nothing that is seen.
bool StaticSystem::escape() {
  do {
    regularization_ = std::max(4 * regularization_, 1.0);
  } while (!factorize(HessianKind::exact) && regularization_ < kLargestRegularization);
  Rng rng(1);
  direction_.resizeLike(x_);
  for (Eigen::Index i = 0; i < direction_.size(); ++i) direction_.data()[i] = rng.normal();
  for (int iteration = 0; iteration < 5; ++iteration) {
    for (Eigen::Index i = 0; i < direction_.cols(); ++i) direction_.col(i) *= model_.masses()(i);
    cholesky_.solve(direction_);
    direction_ /= direction_.cwiseAbs().maxCoeff();
  }
  double step = kFirstEscape;
  trial_ = x_ + step * direction_;
  const Points other = x_ - step * direction_;
  if (model_.value(other) < model_.value(trial_)) step = -step;
  double best = potential_;
  Points from = x_;
  for (;; step *= 2) {
    trial_ = from + step * direction_;
    const double potential = model_.value(trial_);
    if (!(potential < best)) break;
    best = potential;
    std::swap(x_, trial_);
  }
  const bool fell = best < potential_;
  potential_ = best;
  return fell;
}

StaticResult StaticSystem::solve(Points start, const StaticOptions& options) {
  const bool near = options.start == StaticOptions::Start::near_equilibrium;
  regularization_ = near ? kLeastRegularization : kInitialRegularization;
  exact_pause_ = RetryPause(kLongestExactPause);
  leaps_ = 0;
  x_ = std::move(start);
  StaticResult result;
  potential_ = model_.value(x_);
  for (; result.iterations < options.max_iterations; ++result.iterations) {
    if (!factorize_for_direction()) break;
    result.residual = largest_free_force();
    if (!std::isfinite(result.residual)) break;
    if (result.residual < options.force_tolerance) {
      const bool stable = is_stable();
      if (stable) factored_at_ = x_;
      if (stable || !escape()) {
        result.converged = true;
        break;
      }
      continue;
    }
    if (!find_step()) {
      if (!leap()) break;
      continue;
    }
    if (near && exact_ && as_predicted_ && finish_by_factor(options.force_tolerance, result)) {
      result.converged = true;
      ++result.iterations;
      break;
    }
  }
  result.x = std::move(x_);
  return result;
}

StaticSystem::Factor StaticSystem::factor_at(const Points& x) {
  regularization_ = kLeastRegularization;
  if (factored_at_ && *factored_at_ == x)
    return {hessian_, cholesky_, regularization_, model_.masses()};
  x_ = x;
  bool definite = factorize(HessianKind::exact);
  while (!definite) {
    if (!(regularization_ < kLargestRegularization))
      throw Error("equilibrium: the stiffness matrix cannot be factorized; it is not finite");
    regularize(9 * regularization_);
    regularization_ *= 10;
    definite = cholesky_.factorize(hessian_);
  }
  if (regularization_ == kLeastRegularization) factored_at_ = x;
  return {hessian_, cholesky_, regularization_, model_.masses()};
}

}  // namespace weft
