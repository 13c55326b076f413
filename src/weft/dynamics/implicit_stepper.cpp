#include "weft/dynamics/implicit_stepper.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "weft/dynamics/air.h"

namespace weft {

namespace {

constexpr int kMaxHalvings = 8;
constexpr double kMaxStepGrowth = 2.2;
// Conjugate gradients stop when the residual (in the norm of the preconditioner) has fallen by
// this.
constexpr double kLinearTolerance = 0.01;
// If it has fallen by this alone when they are given up, the direction serves, and the factor no
// longer does.
constexpr double kLooseTolerance = 0.1;
// Steps until the first iteration of one tries the factor at hand again, at most.
constexpr int kLongestPause = 8;
// More iterations than this cost about half as much as a new factor. A factor's cost over that of a
// solve grows as the side of the mesh until, near 100 vertices, the factor no longer fits into the
// cache: then a solve waits for memory and a factor does not.
int most_linear_iterations(int vertices) {
  return std::clamp(static_cast<int>(0.2 * std::sqrt(vertices)), 5, 10);
}
constexpr double kMaxRateChange = 1.3;  // between the step of a factor and the step it serves
constexpr double kNearSolution = 6e-5;  // m; after a change below it, try the factor at hand alone
// A change by the factor at hand is an estimate of the distance that is left, good to this.
constexpr double kLastChange = 0.3;
constexpr double kSufficientDecrease = 1e-4;
constexpr double kSmallestFraction = 1e-4;
constexpr double kRounding = 1e-11;  // of an energy
const double kStartFraction = 2 - std::sqrt(2.0);

}  // namespace

ImplicitStepper::ImplicitStepper(const ClothModel& model, const std::vector<PointFixture>& fixtures,
                                 const SimulationOptions& options, const AirMotion* air)
    : model_(model),
      fixtures_(fixtures),
      options_(options),
      air_(air),
      held_(held_vertices(fixtures, model.vertex_count())),
      max_linear_iterations_(most_linear_iterations(model.vertex_count())),
      matrix_(model, held_),
      first_pause_(kLongestPause),
      product_(3, model.vertex_count()) {}

void ImplicitStepper::start(State state, ImplicitStepObserver observer) {
  current_.state = std::move(state);
  observer_ = std::move(observer);
  previous_.reset();
}

bool ImplicitStepper::needs_start_step(double h) const {
  if (options_.integrator != Integrator::bdf2) return false;
  return !previous_ || h > kMaxStepGrowth * (current_.state.time - previous_->time);
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

StageFormula ImplicitStepper::formula(double h) const {
  switch (options_.integrator) {
    case Integrator::newmark:
      return {2 / h, 2 / h, 0, 1};
    case Integrator::bdf2: {
      const Bdf2 f = bdf2(h, current_.state.time - previous_->time);
      return {f.rate, f.current, f.previous, 0};
    }
    default:
      return {1 / h, 1 / h, 0, 0};
  }
}

StageFormula ImplicitStepper::strain_formula(double h, const StageFormula& f) const {
  if (options_.integrator != Integrator::newmark || !previous_) return f;
  const Bdf2 c = bdf2(h, current_.state.time - previous_->time);
  return {c.rate, c.current, c.previous, 0};
}

bool ImplicitStepper::advance(double time, Trajectory& counts, const StepObserver& observer,
                              std::string& reason) {
  // Targets still ahead, nearest last: a step that fails puts the middle of its interval in front.
  std::vector<double> targets{time};
  while (!targets.empty()) {
    if (take_step(targets.back(), counts, reason)) {
      targets.pop_back();
      ++counts.steps;
      const State& now = state();
      if (observer) observer(now.time, now.x, now.v);
    } else {
      if (targets.size() > kMaxHalvings) return false;
      targets.push_back(0.5 * (state().time + targets.back()));
    }
  }
  return true;
}

bool ImplicitStepper::take_step(double time, Trajectory& counts, std::string& reason) {
  const double start_time = state().time;
  const double h = time - start_time;
  const bool two_stages = needs_start_step(h);
  if (two_stages) {
    const double part = kStartFraction * h;
    const double rate = 2 / part;
    if (!solve_stage(start_time + part, {rate, rate, 0, 1}, nullptr, middle_, counts, reason))
      return false;
    const Bdf2 f = bdf2(h - part, part);
    std::swap(current_, middle_);  // the second part starts from the middle
    const bool solved = solve_stage(time, {f.rate, f.current, f.previous, 0}, &middle_.state, next_,
                                    counts, reason);
    std::swap(current_, middle_);
    if (!solved) return false;
  } else {
    const State* previous = previous_ ? &*previous_ : nullptr;
    if (!solve_stage(time, formula(h), previous, next_, counts, reason)) return false;
  }
  if (!previous_) previous_.emplace();
  std::swap(*previous_, current_.state);
  std::swap(current_, next_);
  if (observer_) observer_({two_stages ? &middle_ : nullptr, current_});
  return true;
}

bool ImplicitStepper::solve_stage(double time, const StageFormula& f, const State* previous,
                                  Stage& stage, Trajectory& counts, std::string& reason) {
  const State& now = state();
  State& next = stage.state;
  x_history_ = f.current * now.x + f.derivative * now.v;
  v_history_ = f.current * now.v + f.derivative * now.a;
  if (previous && f.previous != 0) {
    x_history_ += f.previous * previous->x;
    v_history_ += f.previous * previous->v;
  }
  const StageFormula c = strain_formula(time - now.time, f);
  strain_rate_ = c.rate;
  c_history_ = c.current * now.c + c.derivative * now.c_rate;
  if (previous && c.previous != 0) c_history_ += c.previous * previous->c;
  stage.formula = f;
  stage.strain_formula = c;
  next.time = time;
  if (air_) air_->at(time, next.air);
  predict(time, f.rate, next.x);
  work_.energies += 2;
  if (!newton(next, f.rate, counts, reason)) return false;
  next.v = f.rate * next.x - x_history_;
  prescribe_velocities(fixtures_, time, next.v);
  next.a = f.rate * next.v - v_history_;
  prescribe_accelerations(fixtures_, time, next.a);
  model_.strains(next.x, next.c);
  next.c_rate = strain_rate_ * next.c - c_history_;
  return true;
}

double ImplicitStepper::step_energy(const Points& x, double rate) const {
  double inertia = 0;
  for (Eigen::Index i = 0; i < x.cols(); ++i) {
    const Vec3 acceleration = rate * (rate * x.col(i) - x_history_.col(i)) - v_history_.col(i);
    inertia += model_.masses()(i) * acceleration.squaredNorm();
  }
  return inertia / (2 * rate * rate) + model_.potential(x, {strain_rate_, &c_history_});
}

void ImplicitStepper::predict(double time, double rate, Points& x) {
  // Where the fabric is soft or slow, its accelerations go on; where it is stiff, those of
  // stretching come and go within a step, and the path without forces is nearer. The step's own
  // energy tells.
  const State& now = state();
  const double h = time - now.time;
  x = now.x + h * now.v + 0.5 * h * h * now.a;
  trial_ = (rate * x_history_ + v_history_) / (rate * rate);
  prescribe_positions(fixtures_, time, x);
  prescribe_positions(fixtures_, time, trial_);
  energy_ = step_energy(x, rate);
  const double other = step_energy(trial_, rate);
  if (!(energy_ <= other)) {
    std::swap(x, trial_);
    energy_ = other;
  }
}

/// gradient_ of the step's energy (with drag as a force) at the free vertices and, unless `kind` is
/// empty, the matrix.
void ImplicitStepper::linearize(const State& next, double rate, std::optional<HessianKind> kind) {
  velocity_ = rate * next.x - x_history_;
  prescribe_velocities(fixtures_, next.time, velocity_);
  drag_.setZero(3, velocity_.cols());
  if (air_) velocity_in_air_ = velocity_ - next.air;
  const StepPoint at = point(next.x, rate);
  model_.add_drag(at.x, at.velocity_in_air, drag_);
  if (kind) {
    matrix_.assemble(at, *kind, gradient_);
    ++work_.hessians;
  } else {
    model_.potential_gradient(at.x, at.damping, gradient_);
  }
  for (Eigen::Index i = 0; i < gradient_.cols(); ++i) {
    if (held_[static_cast<std::size_t>(i)]) {
      gradient_.col(i).setZero();
    } else {
      gradient_.col(i) +=
          model_.masses()(i) * (rate * velocity_.col(i) - v_history_.col(i)) - drag_.col(i);
    }
  }
}

StepPoint ImplicitStepper::point(const Points& x, double rate) const {
  return {x, air_ ? velocity_in_air_ : velocity_, {strain_rate_, &c_history_}, rate};
}

bool ImplicitStepper::refactorize(const Points& x, double rate, Trajectory& counts) {
  const StepMatrix::Factor factor = matrix_.factorize(point(x, rate));
  ++counts.factorizations;
  if (factor != StepMatrix::Factor::of_matrix) {
    ++counts.factorizations;
    ++work_.hessians;
  }
  factor_rate_ = factor == StepMatrix::Factor::none ? 0 : rate;
  factor_is_worn_ = false;
  return factor_rate_ > 0;
}

/// direction_ = - matrix^-1 gradient_, nearly, by conjugate gradients that start from the factor
/// at hand. They stop early where the matrix turns out to be indefinite: what they have by then
/// leads downhill. False if the factor is too far from the matrix; factor_is_worn_ where it is
/// nearly so.
bool ImplicitStepper::find_direction() {
  residual_ = -gradient_;
  scaled_residual_ = residual_;
  matrix_.factor().solve(scaled_residual_);
  search_ = scaled_residual_;
  direction_.setZero(3, gradient_.cols());
  double square = residual_.cwiseProduct(scaled_residual_).sum();
  const double goal = kLinearTolerance * kLinearTolerance * square;
  const double loose_goal = kLooseTolerance * kLooseTolerance * square;
  for (int iteration = 0; iteration < max_linear_iterations_; ++iteration) {
    ++work_.linear_iterations;
    matrix_.multiply(search_, product_);
    for (const PointFixture& fixture : fixtures_) product_.col(fixture.vertex).setZero();
    const double curvature = search_.cwiseProduct(product_).sum();
    if (!(curvature > 0)) {
      if (iteration == 0) direction_ = search_;
      return true;
    }
    const double length = square / curvature;
    direction_ += length * search_;
    residual_ -= length * product_;
    scaled_residual_ = residual_;
    matrix_.factor().solve(scaled_residual_);
    const double next_square = residual_.cwiseProduct(scaled_residual_).sum();
    if (next_square <= goal) return true;
    search_ = scaled_residual_ + next_square / square * search_;
    square = next_square;
  }
  factor_is_worn_ = true;
  return square <= loose_goal;
}

/// find_direction with the factor at hand. The first iteration of a step follows another
/// iteration's matrix by a whole step, and is often too far from its factor, as those of the steps
/// before were: then not every step tries.
bool ImplicitStepper::find_direction_by_old_factor(double rate, bool first_iteration) {
  if (factor_is_worn_ || factor_rate_ <= 0 ||
      std::abs(std::log(rate / factor_rate_)) >= std::log(kMaxRateChange))
    return false;
  if (!first_iteration) return find_direction();
  if (!first_pause_.is_due()) return false;
  const bool found = find_direction();
  first_pause_.note(found);
  return found;
}

/// `energy_` is that of x, and becomes that of where this leads (as far as it can be told from it).
/// Largest fraction 1, 1/2, 1/4 ... of direction_ that lowers the step's energy enough; 0 if none
/// does. Drag enters as a constant force.
double ImplicitStepper::search_line(const Points& x, double rate) {
  const double slope = gradient_.cwiseProduct(direction_).sum();
  const double drag_slope = drag_.cwiseProduct(direction_).sum();
  const double before = energy_;
  if (-slope < kRounding * std::abs(before)) return 1;  // too little to be seen in the energy
  for (double fraction = 1; fraction > kSmallestFraction; fraction *= 0.5) {
    trial_ = x + fraction * direction_;
    energy_ = step_energy(trial_, rate);
    ++work_.energies;
    const double change = energy_ - before - fraction * drag_slope;
    if (change <= kSufficientDecrease * fraction * slope) return fraction;
  }
  return 0;
}

bool ImplicitStepper::newton(State& next, double rate, Trajectory& counts, std::string& reason) {
  const double tolerance = options_.newton_tolerance;
  const auto fail = [&](const char* why) {
    reason = why;
    factor_rate_ = 0;  // whatever led here, do not trust this factor
    return false;
  };
  double change = kInfinity;
  for (int iteration = 0; iteration < options_.max_newton_iterations; ++iteration) {
    ++counts.newton_iterations;
    const bool near = change < std::max(kNearSolution, tolerance);
    if (near) {
      linearize(next, rate, std::nullopt);
      direction_ = -gradient_;
      matrix_.factor().solve(direction_);
      if (direction_.cwiseAbs().maxCoeff() < kLastChange * tolerance) {
        next.x += direction_;
        return true;
      }
    }
    // Far from the solution the exact Hessian is often indefinite.
    linearize(next, rate, iteration == 0 ? HessianKind::positive_semidefinite : HessianKind::exact);
    if (!find_direction_by_old_factor(rate, iteration == 0)) {
      if (!refactorize(next.x, rate, counts))
        return fail("the matrix of a step is not positive definite");
      find_direction();
    }
    const double largest = direction_.cwiseAbs().maxCoeff();
    if (!std::isfinite(largest)) return fail("the solution ceased to be finite");
    const double fraction = largest > tolerance ? search_line(next.x, rate) : 1;
    if (fraction == 0) return fail("no step along Newton's direction lowers the energy");
    change = fraction * largest;
    next.x += fraction * direction_;
    if (change < tolerance) return true;
  }
  return fail("Newton's method did not converge");
}

}  // namespace weft
