#include "weft/dynamics/implicit_stepper.h"

#include <fmt/format.h>

#include <cmath>

namespace weft {

namespace {

constexpr int kMaxHalvings = 8;
constexpr double kMaxStepGrowth = 2.2;
const double kStartFraction = 2 - std::sqrt(2.0);

}  // namespace

ImplicitStepper::ImplicitStepper(const ClothModel& model, const std::vector<PointFixture>& fixtures,
                                 const SimulationOptions& options)
    : model_(model),
      fixtures_(fixtures),
      options_(options),
      held_(held_vertices(fixtures, model.vertex_count())),
      cholesky_(model.hessian_pattern(), held_, model.mesh().material),
      hessian_(model.hessian_pattern()) {}

void ImplicitStepper::start(State state) {
  current_ = std::move(state);
  previous_.reset();
}

bool ImplicitStepper::needs_start_step(double h) const {
  if (options_.integrator != Integrator::bdf2) return false;
  return !previous_ || h > kMaxStepGrowth * (current_.time - previous_->time);
}

namespace {

struct Bdf2 {
  double rate, current, previous;
};

Bdf2 bdf2(double h, double h_before) {
  const double w = h / h_before;
  return {(1 + 2 * w) / ((1 + w) * h), (1 + w) / h, -w * w / ((1 + w) * h)};
}

}  // namespace

ImplicitStepper::Formula ImplicitStepper::formula(double h) const {
  switch (options_.integrator) {
    case Integrator::newmark:
      return {2 / h, 2 / h, 0, 1};
    case Integrator::bdf2: {
      const Bdf2 f = bdf2(h, current_.time - previous_->time);
      return {f.rate, f.current, f.previous, 0};
    }
    default:
      return {1 / h, 1 / h, 0, 0};
  }
}

bool ImplicitStepper::advance(double time, Trajectory& counts, const StepObserver& observer,
                              std::string& reason) {
  // Targets still ahead, nearest last: a step that fails puts the middle of its interval in front.
  std::vector<double> targets{time};
  while (!targets.empty()) {
    if (take_step(targets.back(), counts, reason)) {
      targets.pop_back();
      ++counts.steps;
      if (observer) observer(current_.time, current_.x, current_.v);
    } else {
      if (targets.size() > kMaxHalvings) return false;
      targets.push_back(0.5 * (current_.time + targets.back()));
    }
  }
  return true;
}

bool ImplicitStepper::take_step(double time, Trajectory& counts, std::string& reason) {
  const double h = time - current_.time;
  State next;
  if (needs_start_step(h)) {
    State middle;
    const double part = kStartFraction * h;
    const double rate = 2 / part;
    if (!solve_stage(current_.time + part, {rate, rate, 0, 1}, nullptr, middle, counts, reason)) {
      return false;
    }
    const Bdf2 f = bdf2(h - part, part);
    std::swap(current_, middle);  // the second part starts from the middle
    const bool solved =
        solve_stage(time, {f.rate, f.current, f.previous, 0}, &middle, next, counts, reason);
    std::swap(current_, middle);
    if (!solved) return false;
  } else {
    const State* previous = previous_ ? &*previous_ : nullptr;
    if (!solve_stage(time, formula(h), previous, next, counts, reason)) return false;
  }
  previous_ = std::move(current_);
  current_ = std::move(next);
  return true;
}

bool ImplicitStepper::solve_stage(double time, const Formula& f, const State* previous, State& next,
                                  Trajectory& counts, std::string& reason) {
  const State& now = current_;
  x_history_ = f.current * now.x + f.derivative * now.v;
  v_history_ = f.current * now.v + f.derivative * now.a;
  c_history_ = f.current * now.c + f.derivative * now.c_rate;
  if (f.previous != 0) {
    x_history_ += f.previous * previous->x;
    v_history_ += f.previous * previous->v;
    c_history_ += f.previous * previous->c;
  }
  next.time = time;
  predict(time, next.x);
  if (!newton(next, f.rate, counts, reason)) return false;
  next.v = f.rate * next.x - x_history_;
  prescribe_velocities(fixtures_, time, next.v);
  next.a = f.rate * next.v - v_history_;
  prescribe_accelerations(fixtures_, time, next.a);
  model_.strains(next.x, next.c);
  next.c_rate = f.rate * next.c - c_history_;
  return true;
}

void ImplicitStepper::predict(double time, Points& x) const {
  const double h = time - current_.time;
  x = current_.x + h * current_.v + 0.5 * h * h * current_.a;
  prescribe_positions(fixtures_, time, x);
}

double ImplicitStepper::step_energy(const Points& x, double rate, const Points& drag) const {
  double inertia = 0;
  double drag_work = 0;
  for (Eigen::Index i = 0; i < x.cols(); ++i) {
    const Vec3 acceleration = rate * (rate * x.col(i) - x_history_.col(i)) - v_history_.col(i);
    inertia += model_.masses()(i) * acceleration.squaredNorm();
    drag_work += drag.col(i).dot(x.col(i));
  }
  return inertia / (2 * rate * rate) + model_.potential(x, {rate, &c_history_}) - drag_work;
}

bool ImplicitStepper::newton(State& next, double rate, Trajectory& counts, std::string& reason) {
  const DampingRate damping{rate, &c_history_};
  const VecX& masses = model_.masses();
  const auto diagonal = model_.diagonal_slots();
  Points velocity;
  for (int iteration = 0; iteration < options_.max_newton_iterations; ++iteration) {
    ++counts.newton_iterations;
    hessian_.coeffs().setZero();
    model_.potential_hessian(next.x, damping, HessianKind::positive_semidefinite, gradient_,
                             hessian_);
    velocity = rate * next.x - x_history_;
    prescribe_velocities(fixtures_, next.time, velocity);
    drag_.setZero(3, velocity.cols());
    model_.add_drag(next.x, velocity, drag_);
    model_.add_drag_damping(next.x, velocity, rate, hessian_);
    for (Eigen::Index i = 0; i < masses.size(); ++i) {
      gradient_.col(i) += masses(i) * (rate * velocity.col(i) - v_history_.col(i)) - drag_.col(i);
      for (int k = 0; k < 3; ++k) {
        hessian_.valuePtr()[diagonal[static_cast<std::size_t>(3 * i + k)]] +=
            masses(i) * rate * rate;
      }
    }
    direction_ = -gradient_;
    ++counts.factorizations;
    if (!cholesky_.factorize(hessian_)) {
      reason = "the matrix of a step is not positive definite";
      return false;
    }
    cholesky_.solve(direction_);
    const double largest = direction_.cwiseAbs().maxCoeff();
    if (!std::isfinite(largest)) {
      reason = "the solution ceased to be finite";
      return false;
    }
    const double slope = (gradient_.cwiseProduct(direction_)).sum();
    double fraction = 1;
    if (largest > options_.newton_tolerance) {
      const double before = step_energy(next.x, rate, drag_);
      for (; fraction > 1e-4; fraction *= 0.5) {
        trial_ = next.x + fraction * direction_;
        const double after = step_energy(trial_, rate, drag_);
        if (after <= before + 1e-4 * fraction * slope + 1e-13 * std::abs(before)) break;
      }
    }
    next.x += fraction * direction_;
    if (fraction * largest < options_.newton_tolerance) return true;
  }
  reason = "Newton's method did not converge";
  return false;
}

}  // namespace weft
