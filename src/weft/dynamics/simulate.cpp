#include "weft/dynamics/simulate.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "weft/base/conveyor.h"
#include "weft/base/error.h"
#include "weft/dynamics/air.h"
#include "weft/dynamics/implicit_stepper.h"
#include "weft/dynamics/motion_derivatives.h"
#include "weft/dynamics/runge_kutta.h"
#include "weft/dynamics/sensitivity.h"
#include "weft/dynamics/state.h"

namespace weft {

namespace {

constexpr std::array<std::pair<std::string_view, Integrator>, 4> kIntegrators{{
    {"bdf2", Integrator::bdf2},
    {"newmark", Integrator::newmark},
    {"implicit-euler", Integrator::implicit_euler},
    {"runge-kutta", Integrator::runge_kutta},
}};

}  // namespace

Integrator integrator_from_name(std::string_view name) {
  for (const auto& [known, integrator] : kIntegrators) {
    if (name == known) return integrator;
  }
  throw Error(fmt::format(
      "integrator: \"{}\" is not known; one of bdf2, newmark, implicit-euler, runge-kutta", name));
}

std::string_view name_of(Integrator integrator) {
  for (const auto& [name, known] : kIntegrators) {
    if (integrator == known) return name;
  }
  return "";
}

namespace {

void check_positive(std::string_view name, double value) {
  if (!(value > 0) || !std::isfinite(value)) {
    throw Error(fmt::format("{}: {} is not a positive number", name, value));
  }
}

void check(const SimulationOptions& options) {
  if (options.steps_per_frame < 1 || options.steps_per_frame > 10000) {
    throw Error(fmt::format("steps_per_frame: {} is not in [1, 10000]", options.steps_per_frame));
  }
  check_positive("newton_tolerance", options.newton_tolerance);
  check_positive("absolute_tolerance", options.absolute_tolerance);
  check_positive("force_tolerance", options.static_options.force_tolerance);
  check_positive("max_newton_iterations", options.max_newton_iterations);
  if (!(options.relative_tolerance >= 0)) {
    throw Error(fmt::format("relative_tolerance: {} is negative", options.relative_tolerance));
  }
}

void check(const Scene& scene, const SimulationOptions& options) {
  const int n = scene.mesh.vertex_count();
  if (scene.start.cols() != n) {
    throw Error(
        fmt::format("scene: the start has {} vertices, the mesh {}", scene.start.cols(), n));
  }
  if (!scene.start.allFinite()) throw Error("scene: the start has a position that is not finite");
  if (scene.frame_times.empty()) throw Error("scene: no frame times; at least one is needed");
  for (std::size_t k = 0; k < scene.frame_times.size(); ++k) {
    if (!std::isfinite(scene.frame_times[k]) ||
        (k > 0 && scene.frame_times[k] <= scene.frame_times[k - 1])) {
      throw Error(
          fmt::format("scene: frame times must be finite and increase, but frame {} is at {} s", k,
                      scene.frame_times[k]));
    }
  }
  std::vector<char> held(static_cast<std::size_t>(n), 0);
  for (const PointFixture& fixture : scene.fixtures) {
    if (fixture.vertex < 0 || fixture.vertex >= n) {
      throw Error(fmt::format("fixture \"{}\": vertex {} is not in [0, {}]", fixture.name,
                              fixture.vertex, n - 1));
    }
    if (held[static_cast<std::size_t>(fixture.vertex)]++) {
      throw Error(fmt::format("fixture \"{}\": vertex {} is already held by another fixture",
                              fixture.name, fixture.vertex));
    }
  }
  check(options);
}

void check(const AirMotion& air, const Scene& scene, const SimulationOptions& options) {
  if (air.still()) return;
  if (options.integrator == Integrator::runge_kutta)
    throw Error("moving air: not with runge-kutta; use bdf2, newmark or implicit-euler");
  if (air.velocity.size() != air.times.size())
    throw Error(
        fmt::format("air: {} times but {} velocities", air.times.size(), air.velocity.size()));
  for (std::size_t k = 0; k < air.times.size(); ++k) {
    if (!std::isfinite(air.times[k]) || (k > 0 && air.times[k] <= air.times[k - 1]))
      throw Error(fmt::format("air: times must be finite and increase, but sample {} is at {} s", k,
                              air.times[k]));
    if (air.velocity[k].cols() != scene.mesh.vertex_count() || !air.velocity[k].allFinite())
      throw Error(
          fmt::format("air: sample {} is not {} finite velocities", k, scene.mesh.vertex_count()));
  }
}

void diverge(Trajectory& trajectory, std::string reason) {
  trajectory.diverged = true;
  trajectory.divergence = std::move(reason);
}

/// Steps that end in one frame interval: a fixed number for implicit integrators; Runge-Kutta
/// chooses its own.
int steps_per_frame(const SimulationOptions& options) {
  return options.integrator == Integrator::runge_kutta ? 1 : options.steps_per_frame;
}

/// Derivatives on their way behind the motion: steps that were taken, and where frames are due.
class DerivativesBehind {
 public:
  DerivativesBehind(MotionDerivatives& derivatives, Sensitivities& sensitivities, int threads)
      : derivatives_(derivatives),
        sensitivities_(sensitivities),
        conveyor_(threads, kItems, [this](Item& item) { use(item); }) {}

  void step(const ImplicitStep& taken) {
    conveyor_.put([&](Item& item) {
      item.has_middle = taken.middle != nullptr;
      if (taken.middle) item.middle = *taken.middle;
      item.end = taken.end;
      item.is_frame = false;
    });
  }
  void frame() {
    conveyor_.put([](Item& item) { item.is_frame = true; });
  }
  void finish() { conveyor_.finish(); }

 private:
  static constexpr std::size_t kItems = 8;  // two frames of steps that need more or less work

  struct Item {
    bool is_frame = false;  // otherwise a step
    bool has_middle = false;
    Stage middle, end;
  };

  void use(const Item& item) {
    if (!item.is_frame)
      return derivatives_.follow({item.has_middle ? &item.middle : nullptr, item.end});
    sensitivities_.x.push_back(derivatives_.current().x);
    sensitivities_.v.push_back(derivatives_.current().v);
    // Those of the first frame are there: it is no step's end.
    if (sensitivities_.x.size() > 1) sensitivities_.reactions.push_back(derivatives_.reactions());
  }

  MotionDerivatives& derivatives_;
  Sensitivities& sensitivities_;
  Conveyor<Item> conveyor_;
};

struct Observers {
  StepObserver step;
  FrameObserver frame;
};

class Run {
 public:
  Run(const ClothModel& model, const Scene& scene, const AirMotion* air,
      const SimulationOptions& options, const Observers& observers, Trajectory& trajectory)
      : model_(model),
        scene_(scene),
        air_(air),
        options_(options),
        observers_(observers),
        trajectory_(trajectory) {}

  void run_explicit(State start) {
    RungeKuttaStepper stepper(model_, scene_.fixtures, options_);
    stepper.start(std::move(start));
    follow(stepper, [] {});
  }

  void run_implicit(State start) {
    ImplicitStepper stepper(model_, scene_.fixtures, options_, air_);
    stepper.start(std::move(start));
    follow(stepper, [] {});
  }

  void run_with_derivatives(State start, Sensitivities& sensitivities, int threads) {
    Directions held;
    MotionDerivatives derivatives(
        model_, scene_.fixtures, sensitivities.parameters,
        derivatives_at_rest(model_, scene_.fixtures, start, sensitivities.parameters,
                            options_.settle == SimulationOptions::Settle::equilibrium, held,
                            sensitivities.inexact));
    sensitivities.reactions.push_back(std::move(held));
    ImplicitStepper stepper(model_, scene_.fixtures, options_, air_);
    DerivativesBehind behind(derivatives, sensitivities, threads);
    stepper.start(std::move(start), [&](const ImplicitStep& taken) { behind.step(taken); });
    follow(stepper, [&] { behind.frame(); });
    behind.finish();
    sensitivities.inexact += derivatives.inexact();
  }

 private:
  /// Steps from frame to frame; `at_frame` is called at each.
  template <class Stepper, class AtFrame>
  void follow(Stepper& stepper, const AtFrame& at_frame) {
    keep_frame(stepper.state());
    at_frame();
    const int steps = steps_per_frame(options_);
    for (std::size_t k = 1; k < scene_.frame_times.size(); ++k) {
      const double from = scene_.frame_times[k - 1];
      const double to = scene_.frame_times[k];
      for (int step = 1; step <= steps; ++step) {
        const double time = step == steps ? to : from + (to - from) * step / steps;
        std::string reason;
        if (!stepper.advance(time, trajectory_, observers_.step, reason)) {
          return diverge(trajectory_, fmt::format("at {:.6g} s: {}", stepper.state().time, reason));
        }
      }
      keep_frame(stepper.state());
      at_frame();
    }
  }

  void keep_frame(const State& state) {
    if (options_.integrator == Integrator::runge_kutta) {
      model_.forces(state.x, state.v, force_);
    } else {
      total_force(model_, state, force_);
    }
    if (observers_.frame) observers_.frame(trajectory_.frames.size(), state.x);
    trajectory_.frames.push_back(state.x);
    trajectory_.velocities.push_back(state.v);
    trajectory_.reactions.push_back(reactions(model_, scene_.fixtures, state.a, force_));
  }

  const ClothModel& model_;
  const Scene& scene_;
  const AirMotion* air_;  // null: still
  const SimulationOptions& options_;
  const Observers& observers_;
  Trajectory& trajectory_;
  Points force_;
};

/// `sensitivities`: null, or with their parameters; they are computed with `threads`.
Trajectory run(const Scene& scene, const AirMotion& moving_air, const Fabric& fabric,
               const SimulationOptions& options, const Observers& observers,
               Sensitivities* sensitivities, int threads) {
  check(scene, options);
  check(moving_air, scene, options);
  const AirMotion* air = moving_air.still() ? nullptr : &moving_air;
  const ClothModel model(scene.mesh, fabric, scene.areal_density, scene.gravity, scene.hem_width);
  Trajectory trajectory;
  const double start_time = scene.frame_times.front();
  Points start = scene.start;
  if (options.settle == SimulationOptions::Settle::equilibrium) {
    StaticResult settled =
        solve_static(model, start, scene.fixtures, start_time, options.static_options);
    trajectory.factorizations += settled.iterations;
    if (!settled.converged) {
      diverge(trajectory,
              fmt::format("no equilibrium found to start from: net force {:.3g} N after "
                          "{} iterations",
                          settled.residual, settled.iterations));
      return trajectory;
    }
    start = std::move(settled.x);
  }
  State state = state_from_rest(model, scene.fixtures, start_time, start, air);
  if (!state.a.allFinite()) {
    diverge(trajectory, "the forces at the start are not finite");
    return trajectory;
  }
  Run run(model, scene, air, options, observers, trajectory);
  if (options.integrator == Integrator::runge_kutta) {
    run.run_explicit(std::move(state));
  } else if (sensitivities) {
    run.run_with_derivatives(std::move(state), *sensitivities, threads);
  } else {
    run.run_implicit(std::move(state));
  }
  return trajectory;
}

}  // namespace

Trajectory simulate(const Scene& scene, const Fabric& fabric, const SimulationOptions& options,
                    const StepObserver& observer) {
  return run(scene, {}, fabric, options, {observer, {}}, nullptr, 1);
}

Trajectory simulate_frames(const Scene& scene, const Fabric& fabric,
                           const SimulationOptions& options, const FrameObserver& observer) {
  return run(scene, {}, fabric, options, {{}, observer}, nullptr, 1);
}

Trajectory simulate(const Scene& scene, const AirMotion& air, const Fabric& fabric,
                    const SimulationOptions& options) {
  return run(scene, air, fabric, options, {}, nullptr, 1);
}

TrajectoryWithSensitivities simulate_with_sensitivities(const Scene& scene, const Fabric& fabric,
                                                        const std::vector<int>& parameters,
                                                        const SimulationOptions& options,
                                                        int threads) {
  return simulate_with_sensitivities(scene, {}, fabric, parameters, options, threads);
}

TrajectoryWithSensitivities simulate_with_sensitivities(const Scene& scene, const AirMotion& air,
                                                        const Fabric& fabric,
                                                        const std::vector<int>& parameters,
                                                        const SimulationOptions& options,
                                                        int threads) {
  if (options.integrator == Integrator::runge_kutta) {
    throw Error("sensitivities: runge-kutta has none; use bdf2, newmark or implicit-euler");
  }
  const auto count = static_cast<int>(fabric.values.size());
  if (parameters.empty() || parameters.size() > kDirections) {
    throw Error(fmt::format("sensitivities: {} parameters; 1 to {} are possible", parameters.size(),
                            kDirections));
  }
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const auto before = parameters.begin() + static_cast<std::ptrdiff_t>(i);
    if (parameters[i] < 0 || parameters[i] >= count ||
        std::find(parameters.begin(), before, parameters[i]) != before) {
      throw Error(fmt::format("sensitivities: parameter {} is not in [0, {}] or listed twice",
                              parameters[i], count - 1));
    }
  }
  TrajectoryWithSensitivities out;
  out.sensitivities.parameters = parameters;
  out.trajectory = run(scene, air, fabric, options, {}, &out.sensitivities, threads);
  return out;
}

}  // namespace weft
