#pragma once
/// Explicit Runge-Kutta integration with automatic steps: the pair of Dormand and Prince (1980) of
/// orders 5 and 4. The fifth-order solution is kept; its difference from the embedded fourth-order
/// one controls the step. Damping enters through velocities, as ClothModel::forces has it.
#include <string>

#include "weft/dynamics/simulate.h"
#include "weft/dynamics/state.h"

namespace weft {

/// Advances x and v by the equation of motion; fixtures follow their motions exactly.
class RungeKuttaStepper {
 public:
  RungeKuttaStepper(const ClothModel& model, const std::vector<PointFixture>& fixtures,
                    const SimulationOptions& options);

  void start(State state);
  /// Strains and their rates are not kept up to date.
  const State& state() const { return state_; }
  /// False, with a reason, if the state at `time` could not be reached.
  bool advance(double time, Trajectory& counts, const StepObserver& observer, std::string& reason);

 private:
  bool accelerations(double time, Points& x, Points& v, Points& a, Trajectory& counts);
  bool try_step(double h, Trajectory& counts, double& error);
  double first_step() const;

  static constexpr int kStages = 7;
  const ClothModel& model_;
  const std::vector<PointFixture>& fixtures_;
  SimulationOptions options_;
  std::vector<char> held_;
  State state_;
  double step_ = 0;  // the next one to try, s
  Points stage_x_[kStages], stage_v_[kStages], stage_a_[kStages];
  Points next_x_, next_v_;
};

}  // namespace weft
