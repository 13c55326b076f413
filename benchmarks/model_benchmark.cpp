/// Cost of a ClothModel's evaluations, 0.5 m swatch of N x N vertices in a wavy, strained state.
#include <benchmark/benchmark.h>

#include <cmath>

#include "weft/model/cloth_model.h"

namespace weft {
namespace {

struct State {
  ClothModel model;
  Points x, v, gradient;
  VecX strains, history;
  SparseMatrix hessian;

  explicit State(int vertices)
      : model(make_swatch(0.5, 0.5, vertices, vertices), find_fabric("satin"), 0.15,
              Vec3(0, 0, -9.81)),
        x(3, model.vertex_count()),
        v(3, model.vertex_count()),
        hessian(model.hessian_pattern()) {
    for (int i = 0; i < x.cols(); ++i) {
      const double a = model.mesh().material(0, i), b = model.mesh().material(1, i);
      x.col(i) =
          Vec3(0.95 * a + 0.003 * std::sin(40 * b), 1.01 * b, 0.03 * std::sin(20 * a + 5 * b));
      v.col(i) = Vec3(0.1 * b, 0.2 * a, std::cos(15 * a));
    }
    model.strains(x, strains);
    history = 0.99 * 180 * strains;
  }
  DampingRate damping() const { return {180, &history}; }
};

void BM_Potential(benchmark::State& run) {
  State s(static_cast<int>(run.range(0)));
  for (auto _ : run) benchmark::DoNotOptimize(s.model.potential(s.x, s.damping()));
}
void BM_Strains(benchmark::State& run) {
  State s(static_cast<int>(run.range(0)));
  for (auto _ : run) s.model.strains(s.x, s.strains);
}
void BM_Gradient(benchmark::State& run) {
  State s(static_cast<int>(run.range(0)));
  for (auto _ : run) s.model.potential_gradient(s.x, s.damping(), s.gradient);
}
void BM_ClearHessian(benchmark::State& run) {
  State s(static_cast<int>(run.range(0)));
  for (auto _ : run) {
    s.hessian.coeffs().setZero();
    benchmark::ClobberMemory();
  }
}
void hessian(benchmark::State& run, HessianKind kind) {
  State s(static_cast<int>(run.range(0)));
  for (auto _ : run) {
    s.hessian.coeffs().setZero();
    s.model.potential_hessian(s.x, s.damping(), kind, s.gradient, s.hessian);
  }
}
void BM_HessianExact(benchmark::State& run) { hessian(run, HessianKind::exact); }
void BM_HessianProjected(benchmark::State& run) {
  hessian(run, HessianKind::positive_semidefinite);
}
void BM_StepHessian(benchmark::State& run) {
  State s(static_cast<int>(run.range(0)));
  for (auto _ : run) {
    s.hessian.coeffs().setZero();
    s.model.step_hessian(s.x, s.damping(), HessianKind::exact, s.v, 180, s.gradient, s.hessian);
  }
}
void BM_Forces(benchmark::State& run) {
  State s(static_cast<int>(run.range(0)));
  for (auto _ : run) s.model.forces(s.x, s.v, s.gradient);
}
void BM_Drag(benchmark::State& run) {
  State s(static_cast<int>(run.range(0)));
  s.gradient.setZero(3, s.x.cols());
  for (auto _ : run) s.model.add_drag(s.x, s.v, s.gradient);
}
void BM_DragDamping(benchmark::State& run) {
  State s(static_cast<int>(run.range(0)));
  for (auto _ : run) s.model.add_drag_damping(s.x, s.v, 1e-3, s.hessian);
}

#define WEFT_BENCHMARK(name) BENCHMARK(name)->Arg(25)->Arg(49)->Unit(benchmark::kMicrosecond)
WEFT_BENCHMARK(BM_Potential);
WEFT_BENCHMARK(BM_Strains);
WEFT_BENCHMARK(BM_Gradient);
WEFT_BENCHMARK(BM_ClearHessian);
WEFT_BENCHMARK(BM_HessianExact);
WEFT_BENCHMARK(BM_HessianProjected);
WEFT_BENCHMARK(BM_StepHessian);
WEFT_BENCHMARK(BM_Forces);
WEFT_BENCHMARK(BM_Drag);
WEFT_BENCHMARK(BM_DragDamping);

}  // namespace
}  // namespace weft

BENCHMARK_MAIN();
