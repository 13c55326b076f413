#pragma once
/// Implicit time integrators in position form.
///
/// Each of them writes the derivative of any quantity y at the end of a step as
///
///     dy/dt(n+1) = r y(n+1) - H(y),      H(y) = p y(n) + q y(n-1) + s dy/dt(n),
///
/// with a rate r and a history H that is known when the step begins:
///
///     integrator          r                      p            q                    s
///     implicit Euler      1 / h                  1 / h        0                    0
///     BDF2                (1+2w) / ((1+w) h)     (1+w) / h    -w^2 / ((1+w) h)     0
///     Newmark             2 / h                  2 / h        0                    1
///
/// w = h / (previous h); with equal steps BDF2 is r = 3 / 2h, p = 2 / h, q = -1 / 2h. Newmark's
/// (beta = 1/4, gamma = 1/2) x(n+1) = x(n) + h v(n) + h^2 / 4 (a(n) + a(n+1)), v(n+1) = v(n) + h /
/// 2 (a(n) + a(n+1)) is the trapezoidal rule for x and for v, and solving each for its derivative
/// at the end of the step gives the line above: the forces enter at the end of the step, those at
/// its start through a(n).
///
/// Applied to x and then to v:
///
///     v(n+1) = r x(n+1) - H(x),   a(n+1) = r v(n+1) - H(v) = r^2 (x(n+1) - xhat),
///     xhat = (r H(x) + H(v)) / r^2,
///
/// and the equation of motion M a = F at the end of the step is the stationarity in x of
///
///     r^2 / 2 (x - xhat)^T M (x - xhat) + potential(x; r, H(C)) - (work of drag).
///
/// Damping acts on strain rates, and the rate of a strain C follows the same formula,
/// Cdot(n+1) = r C(x(n+1)) - H(C), so that damping is the gradient of a function of x. Newmark
/// takes BDF2's formula for the strains (but for the first step): with its own, the rates of
/// strongly damped strains alternate in sign from step to step and nothing damps that. Drag is
/// evaluated at the end of the step; it has no potential, so the line search holds it at its last
/// value, and the matrix has its derivative with respect to velocity, times r, without the one with
/// respect to position.
///
/// The first step of BDF2 has no previous state. It is a TR-BDF2 step (Bank et al. 1985): the
/// trapezoidal rule over (2 - sqrt 2) h, then BDF2 to the end of the step with that as the previous
/// state. Both parts have the same r; the step is of second order and, as BDF2, damps what it
/// cannot resolve. It also restarts BDF2 where a step is more than 2.2 times the one before (BDF2
/// is stable up to 1 + sqrt 2).
#include <functional>
#include <optional>
#include <string>

#include "weft/dynamics/retry_pause.h"
#include "weft/dynamics/simulate.h"
#include "weft/dynamics/state.h"
#include "weft/dynamics/step_matrix.h"

namespace weft {

/// r, p, q and s of the table above.
struct StageFormula {
  double rate, current, previous, derivative;
};

/// A solved equation of motion: the state it leads to, and by which formulas.
struct Stage {
  State state;
  StageFormula formula;         ///< of x and v
  StageFormula strain_formula;  ///< of the strains
};

/// A step that was taken. The first of BDF2 has a stage in its middle: its end has the middle as
/// the current state and the start as the previous one.
struct ImplicitStep {
  const Stage* middle;  ///< null: there is none
  const Stage& end;
};
using ImplicitStepObserver = std::function<void(const ImplicitStep&)>;

/// Advances a state with one of the implicit integrators. A step that cannot be solved is halved.
///
/// Newton's method solves a step: exact Hessians (the projected one in the first iteration, where
/// the exact one is often indefinite), conjugate gradients for the linear systems, a line search on
/// the step's energy. The preconditioner is a factor in single precision that is kept from
/// iteration to iteration and from step to step until it no longer serves. A step ends when the
/// last change of each coordinate is below newton_tolerance.
class ImplicitStepper {
 public:
  ImplicitStepper(const ClothModel& model, const std::vector<PointFixture>& fixtures,
                  const SimulationOptions& options, const AirMotion* air = nullptr);

  /// `observer`: called after each step.
  void start(State state, ImplicitStepObserver observer = {});
  const State& state() const { return current_.state; }
  /// What the steps were made of so far, besides what Trajectory counts.
  struct Work {
    long hessians = 0;           // assembled
    long linear_iterations = 0;  // conjugate gradients: a product and a solve each
    long energies = 0;           // evaluations of a step's energy
  };
  const Work& work() const { return work_; }
  /// False, with a reason, if the state at `time` could not be reached.
  bool advance(double time, Trajectory& counts, const StepObserver& observer, std::string& reason);

 private:
  StageFormula formula(double h) const;
  StageFormula strain_formula(double h, const StageFormula& f) const;
  bool needs_start_step(double h) const;
  bool take_step(double time, Trajectory& counts, std::string& reason);
  bool solve_stage(double time, const StageFormula& f, const State* previous, Stage& next,
                   Trajectory& counts, std::string& reason);
  bool newton(State& next, double rate, Trajectory& counts, std::string& reason);
  void predict(double time, double rate, Points& x);
  double step_energy(const Points& x, double rate) const;
  void linearize(const State& next, double rate, std::optional<HessianKind> kind);
  StepPoint point(const Points& x, double rate) const;
  bool refactorize(const Points& x, double rate, Trajectory& counts);
  bool find_direction();
  bool find_direction_by_old_factor(double rate, bool first_iteration);
  double search_line(const Points& x, double rate);

  const ClothModel& model_;
  const std::vector<PointFixture>& fixtures_;
  SimulationOptions options_;
  const AirMotion* air_;  // null: still
  ImplicitStepObserver observer_;
  std::vector<char> held_;
  int max_linear_iterations_;
  StepMatrix matrix_;            // its factor is kept as a preconditioner
  double factor_rate_ = 0;       // of the step that the factor was made for; 0: none yet
  bool factor_is_worn_ = false;  // it served the last time, but barely
  RetryPause first_pause_;       // of tries of that factor by the first iteration of a step
  Stage current_;                // its formulas are those of the last step
  std::optional<State> previous_;
  Stage middle_, next_;
  // Of the step at hand.
  Points x_history_, v_history_;
  VecX c_history_;
  double strain_rate_ = 0;
  double energy_ = 0;  // of the step, at the positions at hand, but for drag
  Work work_;
  // Work space.
  Points velocity_;
  Points velocity_in_air_;  // in moving air only
  Points gradient_, drag_, direction_, trial_;
  Points residual_, scaled_residual_, search_, product_;
};

}  // namespace weft
