/// What a fit to forces is made of: equilibria of cloth between clips, from afar and near a known
/// one, with derivatives, and the Hessian of a sheet model. Argument: cells across the sheet.
#include <benchmark/benchmark.h>

#include "weft/dynamics/clips.h"
#include "weft/mesh/grid_lines.h"

namespace {

using namespace weft;

constexpr double kSide = 0.2, kDepth = 0.005;  // m

Fabric fabric(double factor) {
  Fabric result = Fabric::with_defaults("test", "stvk-diagonal");
  result.set("weft_stretch", 800 * factor);
  result.set("warp_stretch", 500 * factor);
  result.set("shear", 40);
  result.set("weft_bend", 2e-5);
  result.set("warp_bend", 1e-5);
  return result;
}

/// A square between two bars, stretched by 2 % and sheared by 10 mm.
struct Sheet {
  explicit Sheet(int cells, double factor = 1)
      : mesh(make_swatch(grid_lines(kSide, {kDepth, kSide - kDepth}, kSide / cells),
                         grid_lines(kSide, {}, kSide / cells))),
        model(make_elastic_model(mesh, fabric(factor))),
        cloth(*model, 0.2, Vec3(0, 0, -9.81)) {
    Clip left, right;
    left.region = {{0, 0}, {kDepth, kSide}};
    right.region = {{kSide - kDepth, 0}, {kSide, kSide}};
    left.position = Vec3(kDepth / 2, kSide / 2, 0);
    right.position = Vec3(1.02 * kSide - kDepth / 2, kSide / 2 + 0.01, 0);
    clips = {left, right};
  }
  Points between() const { return blend_of_clips(mesh.material, clips); }
  TriangleMesh mesh;
  std::unique_ptr<ElasticModel> model;
  HeavyCloth cloth;
  std::vector<Clip> clips;
};

void count(benchmark::State& state, const Sheet& sheet, const ClipEquilibrium& found) {
  state.counters["vertices"] = sheet.mesh.vertex_count();
  state.counters["iterations"] = found.iterations;
  if (!found.converged) state.SkipWithError("no equilibrium");
}

void equilibrium_from_afar(benchmark::State& state) {
  const Sheet sheet(static_cast<int>(state.range(0)));
  ClipEquilibrium found;
  for (auto _ : state) found = solve_clips(sheet.cloth, sheet.clips, sheet.between());
  count(state, sheet, found);
}

/// Where the stretch is 2 % stiffer: a step of a fit.
void equilibrium_near_another(benchmark::State& state) {
  const Sheet sheet(static_cast<int>(state.range(0)));
  const Sheet before(static_cast<int>(state.range(0)), 1.02);
  const Points start = solve_clips(before.cloth, before.clips, before.between()).x;
  StaticOptions options;
  if (state.range(1) == 1) options.start = StaticOptions::Start::near_equilibrium;
  ClipEquilibrium found;
  for (auto _ : state) found = solve_clips(sheet.cloth, sheet.clips, start, options);
  count(state, sheet, found);
}

void equilibrium_with_derivatives(benchmark::State& state) {
  const Sheet sheet(static_cast<int>(state.range(0)));
  const Points start = solve_clips(sheet.cloth, sheet.clips, sheet.between()).x;
  StaticOptions options;
  options.start = StaticOptions::Start::near_equilibrium;
  for (auto _ : state) {
    ClippedCloth clipped(sheet.cloth, sheet.clips);
    const ClipEquilibrium found = clipped.solve(start, options);
    benchmark::DoNotOptimize(clipped.sensitivities(found.x));
  }
  state.counters["vertices"] = sheet.mesh.vertex_count();
}

void hessian(benchmark::State& state) {
  const Sheet sheet(static_cast<int>(state.range(0)));
  const Points x = sheet.between();
  Points gradient;
  SparseMatrix matrix = sheet.model->hessian_pattern();
  for (auto _ : state) {
    matrix.coeffs().setZero();
    sheet.model->hessian(x, HessianKind::exact, gradient, matrix);
    benchmark::ClobberMemory();
  }
  state.counters["vertices"] = sheet.mesh.vertex_count();
}

BENCHMARK(equilibrium_from_afar)->Arg(12)->Arg(24)->Unit(benchmark::kMillisecond);
BENCHMARK(equilibrium_near_another)
    ->ArgsProduct({{12, 24}, {0, 1}})
    ->ArgNames({"cells", "said"})
    ->Unit(benchmark::kMillisecond);
BENCHMARK(equilibrium_with_derivatives)->Arg(12)->Arg(24)->Unit(benchmark::kMillisecond);
BENCHMARK(hessian)->Arg(12)->Arg(24)->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
