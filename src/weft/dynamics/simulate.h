#pragma once
#include <functional>
#include <string_view>

#include "weft/dynamics/scene.h"
#include "weft/model/cloth_model.h"

namespace weft {

/// The formulas of the implicit ones are in implicit_stepper.h, that of Runge-Kutta in
/// runge_kutta.h.
enum class Integrator {
  bdf2,     ///< second order; damps what a step cannot resolve, and little else
  newmark,  ///< second order, damps nothing by itself: what a step cannot resolve keeps ringing,
            ///< and in limp fabrics with little damping it may grow
  implicit_euler,  ///< first order; takes energy from every motion
  runge_kutta      ///< explicit, fifth order with automatic steps: the reference, 2 times slower
                   ///< for little damping, 180 times for much
};
/// "bdf2", "newmark", "implicit-euler", "runge-kutta". Throws Error for another name.
Integrator integrator_from_name(std::string_view name);
std::string_view name_of(Integrator integrator);

struct StaticOptions {
  double force_tolerance = 1e-7;  ///< N, largest net force on a free vertex at equilibrium; > 0
  int max_iterations = 1000;
  /// What the start is. From a stable equilibrium of nearly the same cloth Newton's method begins
  /// without the regularization that is for other starts, and once a whole step by an exact Hessian
  /// has done what was foreseen, that step's factor serves as long as it lowers the forces fivefold
  /// at a time: stability is that of the factor's shape then.
  enum class Start { any, near_equilibrium } start = Start::any;
};

struct StaticResult {
  Points x;
  double residual = 0;  ///< N, largest net force on a free vertex
  int iterations = 0;
  bool converged = false;
};

/// A stable equilibrium near `start` with `fixtures` held at `time`: Newton's method with a line
/// search on the potential, so that it only goes down. A regularization in proportion to the
/// masses, 1e4 1/s^2 at first and less with each step that succeeds, makes the first steps those of
/// a slow motion (implicit Euler without memory of the velocity) and keeps them on the branch of
/// equilibria that the start belongs to. It ends at exact Hessians, which converge fast and tell a
/// minimum from a saddle; a saddle is left along its most negative curvature. 10 to 100 iterations
/// are usual, up to 750 of 41 x 41 vertices of a limp fabric that finds its wrinkles.
StaticResult solve_static(const ClothModel& model, const Points& start,
                          const std::vector<PointFixture>& fixtures, double time,
                          const StaticOptions& options = {});

struct SimulationOptions {
  Integrator integrator = Integrator::bdf2;
  int steps_per_frame = 4;  ///< implicit integrators, 1 to 10000
  /// m, largest change of a coordinate in the last iteration. From 1e-7 to 1e-5 the motion of a
  /// swatch that swings by centimetres changes less than with the step; a swing by millimetres
  /// wants it smaller (its period is off by 0.6 % at 1e-5).
  double newton_tolerance = 1e-5;
  int max_newton_iterations = 30;
  double relative_tolerance = 1e-4;        ///< Runge-Kutta: error per step relative to the motion
  double absolute_tolerance = 1e-6;        ///< Runge-Kutta: m, and m/s
  long max_force_evaluations = 5'000'000;  ///< Runge-Kutta: beyond, the run counts as diverged
  /// Relax to an equilibrium before the first frame; otherwise the motion starts from scene.start
  /// at rest.
  enum class Settle { none, equilibrium } settle = Settle::equilibrium;
  StaticOptions static_options;
};

/// Called after each finished step with time, positions and velocities.
using StepObserver = std::function<void(double time, const Points& x, const Points& v)>;

/// Called with each frame as it is reached, in order.
using FrameObserver = std::function<void(std::size_t frame, const Points& x)>;

/// Simulates `fabric` in `scene`. Never throws for a simulation that goes wrong: see
/// Trajectory::diverged. Frames that were reached are kept.
Trajectory simulate(const Scene& scene, const Fabric& fabric, const SimulationOptions& options = {},
                    const StepObserver& observer = {});

/// The same, with an observer of frames instead of steps: what looks at them need not wait for the
/// end.
Trajectory simulate_frames(const Scene& scene, const Fabric& fabric,
                           const SimulationOptions& options, const FrameObserver& observer);

}  // namespace weft
