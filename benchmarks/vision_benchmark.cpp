// The eye's cost a frame at 640 x 480, for a cloth of about 300 x 400 px under stripes of 17 px.
#include <benchmark/benchmark.h>

#include <cmath>
#include <numbers>

#include "weft/base/random.h"
#include "weft/objective/fold_metric.h"
#include "weft/vision/angle_map.h"
#include "weft/vision/silhouette.h"

namespace {

using namespace weft;

constexpr int kWidth = 640, kHeight = 480;

struct Frame {
  Image image{Image::Zero(kHeight, kWidth)};
  Mask cloth{Mask::Zero(kHeight, kWidth)};
};

Frame make_frame() {
  Frame frame;
  Rng random(1);
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) {
      const bool inside = x >= 170 && x < 470 && y >= 40 && y < 440;
      const double wave = std::sin(2 * std::numbers::pi * (y + 6 * std::sin(x / 25.0)) / 17);
      const double light = inside ? (wave > 0 ? 0.6 : 0.05) : 0.003;
      frame.image(y, x) = float(light + 0.002 * random.normal());
      frame.cloth(y, x) = inside ? 1 : 0;
    }
  return frame;
}

void angle_map(benchmark::State& state) {
  const Frame frame = make_frame();
  AngleMapOptions options;
  options.blur_sigma = double(state.range(0));
  AngleMapper mapper(kWidth, kHeight, options);
  for (auto _ : state) benchmark::DoNotOptimize(mapper.compute(frame.image, frame.cloth));
}
BENCHMARK(angle_map)->Arg(3)->Arg(4)->Arg(8)->ArgName("blur_sigma")->Unit(benchmark::kMillisecond);

void gradient_mask_of_frame(benchmark::State& state) {
  const Frame frame = make_frame();
  AngleMapper mapper(kWidth, kHeight);
  const AngleMap& map = mapper.compute(frame.image, frame.cloth);
  for (auto _ : state) benchmark::DoNotOptimize(gradient_mask(map, 0.012));
}
BENCHMARK(gradient_mask_of_frame)->Unit(benchmark::kMillisecond);

void silhouette(benchmark::State& state) {
  const Frame frame = make_frame();
  for (auto _ : state) benchmark::DoNotOptimize(find_silhouette(frame.image, {}));
}
BENCHMARK(silhouette)->Unit(benchmark::kMillisecond);

void compare_frames(benchmark::State& state) {
  const Frame frame = make_frame();
  AngleMapper mapper(kWidth, kHeight);
  FrameFeatures features;
  features.angles = mapper.compute(frame.image, frame.cloth);
  features.fold_mask = gradient_mask(features.angles, 0.012);
  features.silhouette = frame.cloth;
  const AngleMap simulated = features.angles;
  for (auto _ : state) benchmark::DoNotOptimize(compare(features, simulated, frame.cloth));
}
BENCHMARK(compare_frames)->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
