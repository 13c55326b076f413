/// One whole evaluation of a fit on one thread (settle, 50 frames at 25 x 25 vertices, render at
/// 640 x 480, compare) for the bundled capture, its parts, and the explicit reference. CPU time is
/// what counts; the time to read the video and to find the start surface, once a capture, does not.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <ctime>
#include <memory>

#include "weft/capture/capture.h"
#include "weft/dynamics/sensitivity.h"
#include "weft/estimate/problem.h"

namespace {

using namespace weft;

/// The fit frames (0 to 49) of the bundled capture.
const Trial& trial() {
  static const std::shared_ptr<const Trial> prepared = [] {
    const Capture capture = read_capture(WEFT_SOURCE_DIR "/data/captures/cotton_waving_A");
    TrialOptions options;
    options.columns = options.rows = 25;
    return prepare_trial(capture, capture.fit_first, capture.fit_last, options, 1);
  }();
  return *prepared;
}

/// 0: a preset whose damping asks an explicit integrator for steps of some 10 us; 1: values in the
/// middle of what fabrics have, with little damping.
Fabric fabric_of(std::int64_t index) {
  if (index == 0) return find_fabric("satin-waving");
  Fabric fabric = Fabric::with_defaults("moderate");
  fabric.values << 500, 170, 1e-5, 0.1, 0.1, 1e-7, 0.2, 0.2, 0.1;
  return fabric;
}

/// Processor time, s.
double seconds_since(std::clock_t begin) {
  return static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
}

/// A scene that starts at the fabric's equilibrium.
Scene settled_scene(const Fabric& fabric) {
  Scene scene = trial().scene;
  const ClothModel model(scene.mesh, fabric, scene.areal_density, scene.gravity);
  scene.start = solve_static(model, scene.start, scene.fixtures, scene.frame_times.front()).x;
  return scene;
}

void whole_evaluation(benchmark::State& state) {
  const Fabric fabric = fabric_of(state.range(0));
  const Trial& prepared = trial();
  TrialEvaluation evaluation;
  for (auto _ : state) evaluation = evaluate(prepared, fabric, 0, nullptr, 1);
  if (evaluation.diverged) state.SkipWithError(evaluation.divergence.c_str());
  state.SetLabel(fabric.name);
  state.counters["frames"] = prepared.frame_count();
}
BENCHMARK(whole_evaluation)->DenseRange(0, 1)->ArgName("fabric")->Unit(benchmark::kMillisecond);

/// The simulation with the derivatives by all nine parameters; `ratio` to the simulation alone.
void sensitivities(benchmark::State& state) {
  const Fabric fabric = fabric_of(state.range(0));
  const Trial& prepared = trial();
  const std::vector<int> all{0, 1, 2, 3, 4, 5, 6, 7, 8};
  double with = 0, without = 0;
  for (auto _ : state) {
    std::clock_t begin = std::clock();
    benchmark::DoNotOptimize(
        simulate_with_sensitivities(prepared.scene, fabric, all, prepared.options.simulation));
    with += seconds_since(begin);
    state.PauseTiming();
    begin = std::clock();
    benchmark::DoNotOptimize(simulate(prepared.scene, fabric, prepared.options.simulation));
    without += seconds_since(begin);
    state.ResumeTiming();
  }
  state.SetLabel(fabric.name);
  state.counters["ratio"] = with / without;
}
BENCHMARK(sensitivities)->DenseRange(0, 1)->ArgName("fabric")->Unit(benchmark::kMillisecond);

void settle(benchmark::State& state) {
  const Fabric fabric = fabric_of(state.range(0));
  const Scene& scene = trial().scene;
  const ClothModel model(scene.mesh, fabric, scene.areal_density, scene.gravity);
  StaticResult result;
  for (auto _ : state) result = solve_static(model, scene.start, scene.fixtures, 0);
  if (!result.converged) state.SkipWithError("no equilibrium");
  state.SetLabel(fabric.name);
  state.counters["iterations"] = result.iterations;
}
BENCHMARK(settle)->DenseRange(0, 1)->ArgName("fabric")->Unit(benchmark::kMillisecond);

/// The motion of all frames from the settled start.
void simulate_frames(benchmark::State& state) {
  const Fabric fabric = fabric_of(state.range(0));
  const Scene scene = settled_scene(fabric);
  SimulationOptions options = trial().options.simulation;
  options.settle = SimulationOptions::Settle::none;
  Trajectory trajectory;
  const std::clock_t begin = std::clock();
  for (auto _ : state) trajectory = simulate(scene, fabric, options);
  const double seconds = seconds_since(begin) / static_cast<double>(state.iterations());
  if (trajectory.diverged) state.SkipWithError(trajectory.divergence.c_str());
  const auto steps = static_cast<double>(trajectory.steps);
  state.SetLabel(fabric.name);
  state.counters["ms_per_frame"] =
      1000 * seconds / static_cast<double>(scene.frame_times.size() - 1);
  state.counters["newton_per_step"] = static_cast<double>(trajectory.newton_iterations) / steps;
  state.counters["factorizations"] = static_cast<double>(trajectory.factorizations);
}
BENCHMARK(simulate_frames)->DenseRange(0, 1)->ArgName("fabric")->Unit(benchmark::kMillisecond);

void render_frame(benchmark::State& state) {
  const Trial& prepared = trial();
  const Scene scene = settled_scene(fabric_of(1));
  Renderer renderer(prepared.capture.rig, scene.mesh, prepared.options.render);
  for (auto _ : state) benchmark::DoNotOptimize(&renderer.render(scene.start));
}
BENCHMARK(render_frame)->Unit(benchmark::kMillisecond);

void angle_map_of_frame(benchmark::State& state) {
  const Trial& prepared = trial();
  const Rig& rig = prepared.capture.rig;
  const Scene scene = settled_scene(fabric_of(1));
  Renderer renderer(rig, scene.mesh, prepared.options.render);
  const RenderedFrame& frame = renderer.render(scene.start);
  AngleMapper mapper(rig.width, rig.height, prepared.options.angle_map);
  for (auto _ : state) {
    benchmark::DoNotOptimize(&mapper.compute(frame.intensity, frame.silhouette));
  }
}
BENCHMARK(angle_map_of_frame)->Unit(benchmark::kMillisecond);

void compare_frame(benchmark::State& state) {
  const Trial& prepared = trial();
  const SimulatedFrame seen = look_at(prepared, settled_scene(fabric_of(1)).start);
  for (auto _ : state) {
    benchmark::DoNotOptimize(compare(prepared.features[0], seen.angles, seen.image.silhouette));
  }
}
BENCHMARK(compare_frame)->Unit(benchmark::kMillisecond);

/// The explicit reference of the same motion from the same settled start, over its first 2 frame
/// intervals or, where that is cheap, all of them. Stability sets its steps, so that its cost per
/// frame hardly depends on the motion; `explicit_s` is that cost times all intervals, `implicit_s`
/// what BDF2 took for all intervals, `ratio` the first over the second. Processor time.
void explicit_reference(benchmark::State& state) {
  const Fabric fabric = fabric_of(state.range(0));
  Scene scene = settled_scene(fabric);
  const std::size_t all_intervals = scene.frame_times.size() - 1;
  const auto intervals = std::min(static_cast<std::size_t>(state.range(1)), all_intervals);
  SimulationOptions options = trial().options.simulation;
  options.settle = SimulationOptions::Settle::none;
  std::clock_t begin = std::clock();
  benchmark::DoNotOptimize(simulate(scene, fabric, options));
  const double implicit_s = seconds_since(begin);
  options.integrator = Integrator::runge_kutta;
  scene.frame_times.resize(intervals + 1);
  Trajectory trajectory;
  begin = std::clock();
  for (auto _ : state) trajectory = simulate(scene, fabric, options);
  const double per_interval = seconds_since(begin) / static_cast<double>(state.iterations()) /
                              static_cast<double>(intervals);
  if (trajectory.diverged) state.SkipWithError(trajectory.divergence.c_str());
  const double explicit_s = per_interval * static_cast<double>(all_intervals);
  state.SetLabel(fabric.name);
  state.counters["steps_per_frame"] =
      static_cast<double>(trajectory.steps) / static_cast<double>(intervals);
  state.counters["explicit_s"] = explicit_s;
  state.counters["implicit_s"] = implicit_s;
  state.counters["ratio"] = explicit_s / implicit_s;
}
BENCHMARK(explicit_reference)
    ->ArgNames({"fabric", "intervals"})
    ->Args({0, 2})
    ->Args({1, 2})
    ->Args({1, 49})
    ->Unit(benchmark::kMillisecond)
    ->Iterations(1);

}  // namespace

BENCHMARK_MAIN();
