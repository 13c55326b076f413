/// Whole simulations: a 0.5 m swatch that hangs by two corners, one of which is waved for 50 frames
/// at 30 frames a second. `slowdown` of the explicit reference is relative to BDF2 with 4 steps a
/// frame.
#include <benchmark/benchmark.h>

#include <cmath>
#include <ctime>

#include "weft/dynamics/simulate.h"
#include "weft/dynamics/sparse_cholesky.h"
#include "weft/fabric/fabric.h"

namespace {

using namespace weft;

constexpr const char* kFabrics[] = {"linen-waving", "fleece-waving", "satin-waving", "knit-waving"};

Scene waved_swatch(int n, int frames) {
  Scene scene;
  scene.mesh = make_swatch(0.5, 0.5, n, n);
  scene.areal_density = 0.3;
  scene.start.resize(3, n * n);
  for (int i = 0; i < n * n; ++i) {
    const double s = scene.mesh.material(0, i) / 0.5 - 0.5;
    const double v = scene.mesh.material(1, i);
    const double sag = 0.16 * (1 - 4 * s * s) * std::exp(-v / 0.25);
    scene.start.col(i) = Vec3(s * (0.375 + 0.16 * v),
                              -0.1 * std::cos(M_PI * s) * (1 - v) - 0.01 * s, 1 - 0.97 * v - sag);
  }
  std::vector<double> times;
  Points path(3, 61);
  for (int k = 0; k <= 60; ++k) {
    times.push_back(k / 30.0);
    const double phase = M_PI * times.back();
    path.col(k) = scene.start.col(n - 1) +
                  Vec3(0, 0.12 * std::pow(std::sin(phase), 2), 0.04 * std::pow(std::sin(phase), 2));
  }
  scene.fixtures = {{"left", 0, Motion::fixed(scene.start.col(0))},
                    {"right", n - 1, Motion(times, path)}};
  for (int k = 0; k < frames; ++k) scene.frame_times.push_back(k / 30.0);
  return scene;
}

void count(benchmark::State& state, const Trajectory& trajectory) {
  if (trajectory.diverged) state.SkipWithError(trajectory.divergence.c_str());
  state.counters["steps"] = static_cast<double>(trajectory.steps);
  state.counters["newton"] = static_cast<double>(trajectory.newton_iterations);
  state.counters["factors"] = static_cast<double>(trajectory.factorizations);
  state.counters["forces"] = static_cast<double>(trajectory.force_evaluations);
}

/// Settle and 50 frames, as in one evaluation of a fit.
void settle_and_simulate(benchmark::State& state, Integrator integrator) {
  const Scene scene = waved_swatch(static_cast<int>(state.range(0)), 50);
  const Fabric fabric = find_fabric(kFabrics[state.range(1)]);
  SimulationOptions options;
  options.integrator = integrator;
  Trajectory trajectory;
  for (auto _ : state) trajectory = simulate(scene, fabric, options);
  state.SetLabel(fabric.name);
  count(state, trajectory);
}
BENCHMARK_CAPTURE(settle_and_simulate, bdf2, Integrator::bdf2)
    ->ArgsProduct({{25}, {0, 1, 2, 3}})
    ->Args({37, 1})
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(settle_and_simulate, newmark, Integrator::newmark)
    ->ArgsProduct({{25}, {0, 1, 2, 3}})
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(settle_and_simulate, implicit_euler, Integrator::implicit_euler)
    ->ArgsProduct({{25}, {0, 1, 2, 3}})
    ->Unit(benchmark::kMillisecond);

/// Processor time.
double seconds_since(std::clock_t begin) {
  return static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
}

/// The explicit reference over 2 frames; `seconds_for_50_frames` is its time for 49 intervals at
/// that pace, `implicit_seconds` that of BDF2 from the same settled start.
void explicit_reference(benchmark::State& state) {
  Scene scene = waved_swatch(25, 50);
  const Fabric fabric = find_fabric(kFabrics[state.range(0)]);
  SimulationOptions options;
  const ClothModel model(scene.mesh, fabric, scene.areal_density, scene.gravity);
  scene.start = solve_static(model, scene.start, scene.fixtures, 0).x;
  options.settle = SimulationOptions::Settle::none;
  const std::clock_t begin = std::clock();
  benchmark::DoNotOptimize(simulate(scene, fabric, options));
  const double implicit = seconds_since(begin);
  options.integrator = Integrator::runge_kutta;
  scene.frame_times.resize(2);
  Trajectory trajectory;
  double seconds = 0;
  for (auto _ : state) {
    const std::clock_t start = std::clock();
    trajectory = simulate(scene, fabric, options);
    seconds += seconds_since(start);
  }
  seconds *= 49.0 / static_cast<double>(state.iterations());
  state.SetLabel(fabric.name);
  count(state, trajectory);
  state.counters["seconds_for_50_frames"] = seconds;
  state.counters["implicit_seconds"] = implicit;
  state.counters["slowdown"] = seconds / implicit;
}
BENCHMARK(explicit_reference)->DenseRange(0, 3)->Unit(benchmark::kMillisecond)->Iterations(1);

void settle(benchmark::State& state) {
  const Scene scene = waved_swatch(static_cast<int>(state.range(0)), 1);
  const Fabric fabric = find_fabric(kFabrics[state.range(1)]);
  const ClothModel model(scene.mesh, fabric, scene.areal_density, scene.gravity);
  StaticResult result;
  for (auto _ : state) result = solve_static(model, scene.start, scene.fixtures, 0);
  if (!result.converged) state.SkipWithError("no equilibrium");
  state.SetLabel(fabric.name);
  state.counters["iterations"] = result.iterations;
}
BENCHMARK(settle)->ArgsProduct({{25}, {0, 1, 2, 3}})->Unit(benchmark::kMillisecond);

/// The matrix of a step of that size, factorized and solved once.
template <class Scalar>
void factorize(benchmark::State& state) {
  const int n = static_cast<int>(state.range(0));
  const Scene scene = waved_swatch(n, 1);
  const ClothModel model(scene.mesh, find_fabric("linen-waving"), 0.3, scene.gravity);
  SparseMatrix matrix = model.hessian_pattern();
  Points gradient;
  model.potential_hessian(scene.start, {}, HessianKind::positive_semidefinite, gradient, matrix);
  for (const int slot : model.diagonal_slots()) matrix.valuePtr()[slot] += 4.0;
  SparseCholesky<Scalar> cholesky(matrix, std::vector<char>(static_cast<std::size_t>(n * n), 0),
                                  scene.mesh.material);
  for (auto _ : state) {
    if (!cholesky.factorize(matrix)) state.SkipWithError("not positive definite");
    cholesky.solve(gradient);
  }
}
BENCHMARK_TEMPLATE(factorize, double)->Arg(13)->Arg(25)->Arg(49)->Unit(benchmark::kMicrosecond);
BENCHMARK_TEMPLATE(factorize, float)->Arg(13)->Arg(25)->Arg(49)->Unit(benchmark::kMicrosecond);

}  // namespace

BENCHMARK_MAIN();
