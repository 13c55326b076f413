#include <benchmark/benchmark.h>

#include <cmath>
#include <numbers>

#include "weft/optics/render.h"

namespace weft {
namespace {

/// Camera 1.5 m in front of the swatch, projector 0.35 m to its left and above, stripes about 8 px
/// high in a camera image of 640 x 480.
Rig make_rig() {
  const auto look = [](const Vec3& from, double focal, const Vec2& middle) {
    // x right, y down, looking along +y of the world.
    Projection projection;
    projection << focal, middle.x(), 0, 0, 0, middle.y(), -focal, 0, 0, 1, 0, 0;
    projection.col(3) = -projection.leftCols<3>() * from;
    return projection;
  };
  Rig rig;
  rig.width = 640;
  rig.height = 480;
  rig.camera = Pinhole(look({0.25, -1.5, -0.25}, 1000, {320, 240}), {0.25, 0, -0.25}, "camera");
  rig.projector = Pinhole(look({-0.1, -1.6, 0.1}, 1300, {200, 300}), {0.25, 0, -0.25}, "projector");
  rig.pattern.period = 22.8;
  return rig;
}

/// A hanging swatch with folds of 3 cm down its length.
Points folded(const TriangleMesh& mesh) {
  Points x(3, mesh.vertex_count());
  for (int v = 0; v < mesh.vertex_count(); ++v) {
    const Vec2 uv = mesh.material.col(v);
    const double fold = 0.03 * std::sin(2 * std::numbers::pi * (uv.x() + 0.3 * uv.y()) / 0.2);
    x.col(v) = Vec3(uv.x(), fold * uv.y() / 0.5, -uv.y());
  }
  return x;
}

/// One frame of 640 x 480: supersampling, subdivision, filtered stripes, shadows, vertices a side.
void render_frame(benchmark::State& state) {
  const int side = static_cast<int>(state.range(4));
  const TriangleMesh mesh = make_swatch(0.5, 0.5, side, side);
  const Points x = folded(mesh);
  RenderOptions options;
  options.supersampling = static_cast<int>(state.range(0));
  options.subdivision = static_cast<int>(state.range(1));
  options.filter_stripes = state.range(2) != 0;
  options.shadows = state.range(3) != 0;
  Renderer renderer(make_rig(), mesh, options);
  const RenderedFrame* frame = nullptr;
  for (auto _ : state) {
    frame = &renderer.render(x);
    benchmark::DoNotOptimize(frame);
  }
  state.counters["cloth_pixels"] = frame->silhouette.cast<double>().sum();
}
BENCHMARK(render_frame)
    ->ArgNames({"samples", "subdivision", "filter", "shadows", "side"})
    ->Args({2, 3, 1, 1, 25})
    ->Args({2, 3, 1, 0, 25})
    ->Args({1, 3, 1, 1, 25})
    ->Args({2, 1, 1, 1, 25})
    ->Args({2, 3, 0, 1, 25})
    ->Args({3, 3, 1, 1, 25})
    ->Args({6, 3, 0, 1, 25})
    ->Args({2, 3, 1, 1, 49})
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace weft

BENCHMARK_MAIN();
