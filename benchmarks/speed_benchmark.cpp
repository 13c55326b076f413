/// Milliseconds a simulated frame of the bundled capture's waving motion takes by mesh, what they
/// are made of, what the derivatives by all nine parameters add, and how far the motion is from one
/// with 32 steps a frame. Processor time of one thread, which a simulation uses; with derivatives,
/// which can follow on a second one, wall time, too. Settling is not counted.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <ctime>
#include <map>
#include <memory>

#include "weft/base/clock.h"
#include "weft/capture/capture.h"
#include "weft/dynamics/implicit_stepper.h"
#include "weft/dynamics/sensitivity.h"
#include "weft/estimate/problem.h"

namespace {

using namespace weft;

constexpr int kCaptureSide = 25;  // vertices along a side where the capture's start is found

const Scene& captured_scene() {
  static const Scene scene = [] {
    const Capture capture = read_capture(WEFT_SOURCE_DIR "/data/captures/cotton_waving_A");
    TrialOptions options;
    options.columns = options.rows = kCaptureSide;
    return prepare_trial(capture, capture.fit_first, capture.fit_last, options, 1)->scene;
  }();
  return scene;
}

/// 0: a preset with much damping; 1: values in the middle of what fabrics have, with little.
Fabric fabric_of(std::int64_t index) {
  if (index == 0) return find_fabric("satin-waving");
  Fabric fabric = Fabric::with_defaults("moderate");
  fabric.values << 500, 170, 1e-5, 0.1, 0.1, 1e-7, 0.2, 0.2, 0.1;
  return fabric;
}

/// The positions of a square grid, row after row, read bilinearly from those of another.
Points resampled(const Points& x, int from, int to) {
  Points out(3, to * to);
  const auto split = [&](int i) {
    const double at = static_cast<double>(i) * (from - 1) / (to - 1);
    const int low = std::min(static_cast<int>(at), from - 2);
    return std::pair(low, at - low);
  };
  for (int row = 0; row < to; ++row)
    for (int column = 0; column < to; ++column) {
      const auto [r, s] = split(row);
      const auto [c, t] = split(column);
      const int i = r * from + c;
      out.col(row * to + column) = (1 - s) * ((1 - t) * x.col(i) + t * x.col(i + 1)) +
                                   s * ((1 - t) * x.col(i + from) + t * x.col(i + from + 1));
    }
  return out;
}

/// The scene on side x side vertices, at the fabric's equilibrium, which is found from that on half
/// as many along a side.
const Scene& settled_scene(int side, std::int64_t fabric_index) {
  static std::map<std::pair<int, std::int64_t>, Scene> scenes;
  const auto found = scenes.find({side, fabric_index});
  if (found != scenes.end()) return found->second;
  const Scene& captured = captured_scene();
  const Fabric fabric = fabric_of(fabric_index);
  Scene scene = captured;
  const Vec2 size =
      captured.mesh.material.rowwise().maxCoeff() - captured.mesh.material.rowwise().minCoeff();
  scene.mesh = make_swatch(size.x(), size.y(), side, side);
  for (PointFixture& fixture : scene.fixtures) {
    const int row = fixture.vertex / kCaptureSide, column = fixture.vertex % kCaptureSide;
    fixture.vertex = (row * side + column) * (side - 1) / (kCaptureSide - 1);
    if (row == 0) fixture.vertex = column * (side - 1) / (kCaptureSide - 1);
  }
  const int coarse = side / 2;
  scene.start = coarse < kCaptureSide
                    ? resampled(captured.start, kCaptureSide, side)
                    : resampled(settled_scene(coarse, fabric_index).start, coarse, side);
  const ClothModel model(scene.mesh, fabric, scene.areal_density, scene.gravity);
  scene.start = solve_static(model, scene.start, scene.fixtures, scene.frame_times.front()).x;
  return scenes[{side, fabric_index}] = std::move(scene);
}

double processor_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }
double wall_seconds() { return seconds_since(Clock::time_point()); }

/// What one call takes by the clock `now`, s: the least of a few.
template <class F>
double seconds_of(const F& f, double (*now)() = processor_seconds) {
  double least = 1e300;
  for (int i = 0; i < 3; ++i) {
    const double begin = now();
    f();
    least = std::min(least, now() - begin);
  }
  return least;
}

/// What the parts of a step cost at the scene's start, s.
struct PartCosts {
  double hessian, factor, linear_iteration, energy;
};

PartCosts part_costs(const Scene& scene, const Fabric& fabric, double rate) {
  const ClothModel model(scene.mesh, fabric, scene.areal_density, scene.gravity);
  const Points still = Points::Zero(3, scene.start.cols());
  VecX c;
  model.strains(scene.start, c);
  c *= rate;
  const DampingRate damping{rate, &c};
  SparseMatrix hessian = model.hessian_pattern();
  Points gradient, solution, product(3, scene.start.cols());
  PartCosts out{};
  out.hessian = seconds_of([&] {
    hessian.coeffs().setZero();
    model.step_hessian(scene.start, damping, HessianKind::positive_semidefinite, still, rate,
                       gradient, hessian);
  });
  for (std::size_t i = 0; i < model.diagonal_slots().size(); ++i)
    hessian.valuePtr()[model.diagonal_slots()[i]] +=
        rate * rate * model.masses()[static_cast<Eigen::Index>(i / 3)];
  SparseCholesky<float> cholesky(hessian, held_vertices(scene.fixtures, model.vertex_count()),
                                 scene.mesh.material);
  out.factor = seconds_of([&] { cholesky.factorize(hessian); });
  out.linear_iteration = seconds_of([&] {
    solution = gradient;
    cholesky.solve(solution);
    flat(product).noalias() = hessian.selfadjointView<Eigen::Lower>() * flat(solution);
  });
  out.energy = seconds_of([&] { benchmark::DoNotOptimize(model.potential(scene.start, damping)); });
  return out;
}

/// side, fabric, frame intervals. Of `ms` a frame: Hessians and gradients, factors, conjugate
/// gradients, energies of line searches and predictions (counts times the cost of one each), and
/// the rest. `gradient_ms`: the motion with the derivatives by nine parameters; `gradient_wall_ms`:
/// the same on two threads, wall time. Each the least of three.
void frame(benchmark::State& state) {
  Scene scene = settled_scene(static_cast<int>(state.range(0)), state.range(1));
  const Fabric fabric = fabric_of(state.range(1));
  const int frames = static_cast<int>(state.range(2));
  scene.frame_times.resize(static_cast<std::size_t>(frames) + 1);
  SimulationOptions options;
  options.settle = SimulationOptions::Settle::none;
  const ClothModel model(scene.mesh, fabric, scene.areal_density, scene.gravity);
  const double begin_time = scene.frame_times.front();
  const double h = (scene.frame_times[1] - begin_time) / options.steps_per_frame;
  Trajectory counts;
  ImplicitStepper::Work work;
  double seconds = 1e300;  // the least of the runs
  for (auto _ : state) {
    const double begin = processor_seconds();
    ImplicitStepper stepper(model, scene.fixtures, options);
    stepper.start(state_from_rest(model, scene.fixtures, begin_time, scene.start));
    std::string reason;
    for (int step = 1; step <= frames * options.steps_per_frame; ++step)
      if (!stepper.advance(begin_time + step * h, counts, {}, reason))
        return state.SkipWithError(reason.c_str());
    seconds = std::min(seconds, processor_seconds() - begin);
    work = stepper.work();
  }
  const double runs = static_cast<double>(state.iterations());
  const double ms = 1000 / static_cast<double>(frames);
  const std::vector<int> all{0, 1, 2, 3, 4, 5, 6, 7, 8};
  const auto with_derivatives = [&](int threads) {
    benchmark::DoNotOptimize(simulate_with_sensitivities(scene, fabric, all, options, threads));
  };
  const double with_gradient = seconds_of([&] { with_derivatives(1); });
  const double two_threads = seconds_of([&] { with_derivatives(2); }, wall_seconds);
  const PartCosts cost = part_costs(scene, fabric, 1.5 / h);
  const double hessians = cost.hessian * static_cast<double>(work.hessians);
  const double factors = cost.factor * static_cast<double>(counts.factorizations) / runs;
  const double linear = cost.linear_iteration * static_cast<double>(work.linear_iterations);
  const double energies = cost.energy * static_cast<double>(work.energies);
  state.SetLabel(fabric.name);
  state.counters["ms"] = ms * seconds;
  state.counters["hessian"] = ms * hessians;
  state.counters["factor"] = ms * factors;
  state.counters["linear"] = ms * linear;
  state.counters["energy"] = ms * energies;
  state.counters["other"] = ms * (seconds - hessians - factors - linear - energies);
  state.counters["gradient_ms"] = ms * with_gradient;
  state.counters["gradient_wall_ms"] = ms * two_threads;
  state.counters["ratio"] = with_gradient / seconds;
  state.counters["wall_ratio"] = two_threads / seconds;
}
BENCHMARK(frame)
    ->ArgNames({"side", "fabric", "frames"})
    ->ArgsProduct({{25, 50}, {0, 1}, {49}})
    ->ArgsProduct({{100}, {0, 1}, {5, 20}})
    ->ArgsProduct({{200}, {0, 1}, {5}})
    ->Iterations(3)
    ->Unit(benchmark::kMillisecond);

/// side, fabric, steps a frame: distance (mm) to the motion with 32 steps a frame, root of the mean
/// square over all vertices and frames, and the same of the last frame.
void time_error(benchmark::State& state) {
  const Scene& scene = settled_scene(static_cast<int>(state.range(0)), state.range(1));
  const Fabric fabric = fabric_of(state.range(1));
  SimulationOptions options;
  options.settle = SimulationOptions::Settle::none;
  options.steps_per_frame = 32;
  static std::map<std::pair<std::int64_t, std::int64_t>, Trajectory> fine;
  Trajectory& reference = fine[{state.range(0), state.range(1)}];
  if (reference.frames.empty()) reference = simulate(scene, fabric, options);
  options.steps_per_frame = static_cast<int>(state.range(2));
  Trajectory trajectory;
  for (auto _ : state) trajectory = simulate(scene, fabric, options);
  const std::size_t frames = trajectory.frames.size();
  if (frames != reference.frames.size()) return state.SkipWithError("diverged");
  double sum = 0, last = 0;
  for (std::size_t k = 0; k < frames; ++k) {
    last = (trajectory.frames[k] - reference.frames[k]).squaredNorm() /
           static_cast<double>(scene.start.cols());
    sum += last;
  }
  state.SetLabel(fabric.name);
  state.counters["rms_mm"] = 1000 * std::sqrt(sum / static_cast<double>(frames));
  state.counters["last_mm"] = 1000 * std::sqrt(last);
}
BENCHMARK(time_error)
    ->ArgNames({"side", "fabric", "steps"})
    ->ArgsProduct({{25, 50}, {0, 1}, {2, 4, 8}})
    ->Iterations(1)
    ->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
