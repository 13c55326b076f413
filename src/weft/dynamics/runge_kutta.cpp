#include "weft/dynamics/runge_kutta.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace weft {

namespace {

constexpr std::array<double, 7> kTimes{0, 1.0 / 5, 3.0 / 10, 4.0 / 5, 8.0 / 9, 1, 1};
// Row s: how stage s mixes the derivatives of the stages before it. The last row is also the
// fifth-order solution.
constexpr double kStage[7][6] = {
    {},
    {1.0 / 5},
    {3.0 / 40, 9.0 / 40},
    {44.0 / 45, -56.0 / 15, 32.0 / 9},
    {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729},
    {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656},
    {35.0 / 384, 0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84}};
// Fifth-order less fourth-order weights.
constexpr std::array<double, 7> kError{71.0 / 57600,      0,          -71.0 / 16695, 71.0 / 1920,
                                       -17253.0 / 339200, 22.0 / 525, -1.0 / 40};
constexpr double kSafety = 0.9;
constexpr double kMostShrink = 0.2;
constexpr double kMostGrowth = 5;
constexpr double kSmallestStep = 1e-10;  // s

}  // namespace

RungeKuttaStepper::RungeKuttaStepper(const ClothModel& model,
                                     const std::vector<PointFixture>& fixtures,
                                     const SimulationOptions& options)
    : model_(model),
      fixtures_(fixtures),
      options_(options),
      held_(held_vertices(fixtures, model.vertex_count())) {}

void RungeKuttaStepper::start(State state) {
  state_ = std::move(state);
  stage_a_[0] = state_.a;
  step_ = 0;
}

bool RungeKuttaStepper::accelerations(double time, Points& x, Points& v, Points& a,
                                      Trajectory& counts) {
  prescribe_positions(fixtures_, time, x);
  prescribe_velocities(fixtures_, time, v);
  ++counts.force_evaluations;
  model_.forces(x, v, a);
  for (Eigen::Index i = 0; i < a.cols(); ++i) a.col(i) /= model_.masses()(i);
  prescribe_accelerations(fixtures_, time, a);
  return a.allFinite();
}

bool RungeKuttaStepper::try_step(double h, Trajectory& counts, double& error) {
  stage_v_[0] = state_.v;
  for (int s = 1; s < kStages; ++s) {
    Points& x = stage_x_[s];
    Points& v = stage_v_[s];
    x = state_.x;
    v = state_.v;
    for (int j = 0; j < s; ++j) {
      x += h * kStage[s][j] * stage_v_[j];
      v += h * kStage[s][j] * stage_a_[j];
    }
    if (!accelerations(state_.time + kTimes[static_cast<std::size_t>(s)] * h, x, v, stage_a_[s],
                       counts)) {
      return false;
    }
  }
  // Free vertices only: a held one follows its path, whatever the step.
  error = 0;
  for (Eigen::Index i = 0; i < state_.x.cols(); ++i) {
    if (held_[static_cast<std::size_t>(i)]) continue;
    Vec3 x_error = Vec3::Zero();
    Vec3 v_error = Vec3::Zero();
    for (int s = 0; s < kStages; ++s) {
      x_error += h * kError[static_cast<std::size_t>(s)] * stage_v_[s].col(i);
      v_error += h * kError[static_cast<std::size_t>(s)] * stage_a_[s].col(i);
    }
    const double moved = (stage_x_[6].col(i) - state_.x.col(i)).cwiseAbs().maxCoeff();
    const double speed = stage_v_[6].col(i).cwiseAbs().maxCoeff();
    const double x_scale = options_.absolute_tolerance + options_.relative_tolerance * moved;
    const double v_scale = options_.absolute_tolerance + options_.relative_tolerance * speed;
    error = std::max(
        {error, x_error.cwiseAbs().maxCoeff() / x_scale, v_error.cwiseAbs().maxCoeff() / v_scale});
  }
  return std::isfinite(error);
}

double RungeKuttaStepper::first_step() const {
  const double speed = state_.v.cwiseAbs().maxCoeff();
  const double acceleration = state_.a.cwiseAbs().maxCoeff();
  // So small that the velocity changes by about its tolerance.
  const double tolerance = options_.absolute_tolerance + options_.relative_tolerance * speed;
  return std::clamp(tolerance / std::max(acceleration, 1e-3), 1e-7, 1e-3);
}

bool RungeKuttaStepper::advance(double time, Trajectory& counts, const StepObserver& observer,
                                std::string& reason) {
  if (step_ == 0) step_ = first_step();
  while (state_.time < time) {
    if (counts.force_evaluations >= options_.max_force_evaluations) {
      reason = fmt::format("more than {} force evaluations", options_.max_force_evaluations);
      return false;
    }
    const double left = time - state_.time;
    const bool last = step_ >= left;
    // Two equal steps rather than one and a sliver.
    const double h = last ? left : std::min(step_, 0.5 * left);
    double error = 0;
    if (!try_step(h, counts, error)) {
      step_ = 0.1 * h;
    } else {
      const double factor =
          std::clamp(kSafety * std::pow(std::max(error, 1e-12), -0.2), kMostShrink, kMostGrowth);
      if (error <= 1) {
        state_.time = last ? time : state_.time + h;
        std::swap(state_.x, stage_x_[6]);
        std::swap(state_.v, stage_v_[6]);
        std::swap(stage_a_[0], stage_a_[6]);
        state_.a = stage_a_[0];
        ++counts.steps;
        if (observer) observer(state_.time, state_.x, state_.v);
        // A step cut short by a frame says little about the one to try next.
        step_ = last ? std::max(step_, h * factor) : h * factor;
      } else {
        step_ = h * factor;
      }
    }
    if (step_ < kSmallestStep) {
      reason = "the step fell below 1e-10 s";
      return false;
    }
  }
  return true;
}

}  // namespace weft
