#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "weft/base/error.h"
#include "weft/base/parallel.h"
#include "weft/estimate/content_hash.h"
#include "weft/estimate/evaluate_trial.h"
#include "weft/estimate/extract_features.h"
#include "weft/estimate/feature_cache.h"
#include "weft/estimate/first_frame.h"
#include "weft/estimate/problem.h"
#include "weft/registration/stripe_surface.h"
#include "weft/vision/silhouette.h"

namespace weft {
namespace {

void check(const TrialOptions& options) {
  const auto require_grid = [](int count, const char* name) {
    if (count < 2 || count > 1000)
      throw Error(fmt::format("{} = {} vertices, valid: 2 to 1000", name, count));
  };
  require_grid(options.columns, "columns");
  require_grid(options.rows, "rows");
  if (!(options.alpha >= 0) || !std::isfinite(options.alpha))
    throw Error(fmt::format("alpha = {}, valid: 0 or more", options.alpha));
}

}  // namespace

std::vector<FrameFeatures> extract_features(const std::vector<Image>& frames,
                                            const Capture& capture, const AngleMapOptions& options,
                                            int threads) {
  std::vector<FrameFeatures> features(frames.size());
  const SilhouetteOptions silhouette{.stripe_period = image_stripe_period(capture)};
  Vec3 reference = Vec3::Zero();
  for (const CaptureFixture& fixture : capture.fixtures)
    reference += fixture.motion.position(0) / double(capture.fixtures.size());
  const std::size_t workers = worker_count(frames.size(), threads);
  parallel_for(workers, threads, [&](std::size_t worker) {
    AngleMapper mapper(capture.rig.width, capture.rig.height, options);
    for (std::size_t i = worker; i < frames.size(); i += workers) {
      FrameFeatures& f = features[i];
      f.silhouette = find_silhouette(frames[i], silhouette).silhouette;
      f.angles = mapper.compute(frames[i], f.silhouette);
      f.fold_mask = gradient_mask(f.angles, options.mask_threshold);
      f.phase = stripe_phase_samples(frames[i], f.silhouette, capture.rig, reference);
      f.angles.strength.resize(0, 0);
      // Whatever stands where the angle is undefined means nothing; zero compares and stores well.
      f.angles.angle = (f.angles.valid != 0).select(f.angles.angle, 0.0f);
    }
  });
  return features;
}

namespace {

/// Settles every generic start under the default fabric and keeps the one that looks most like the
/// first compared frame.
void choose_generic_start(Trial& trial, const std::string& model, int threads) {
  const std::vector<StartShape> starts = generic_starts(trial.scene);
  const Fabric fabric = Fabric::with_defaults("default", model);
  std::vector<double> errors(starts.size());
  parallel_for(starts.size(), threads, [&](std::size_t i) {
    Scene scene = trial.scene;
    scene.start = starts[i].x;
    errors[i] = evaluate_scene(trial, std::move(scene), fabric, 1, nullptr, 1).error;
  });
  const auto best =
      static_cast<std::size_t>(std::min_element(errors.begin(), errors.end()) - errors.begin());
  trial.scene.start = starts[best].x;
  trial.start_name = starts[best].name;
}

void set_start(Trial& trial, const Image& first_frame, int threads) {
  const Capture& capture = trial.capture;
  if (capture.start_surface) {
    trial.scene.start = read_start_surface(capture, trial.scene.mesh);
    trial.start_name = "measured surface";
    trial.start_note = capture.start_surface->filename().string();
    return;
  }
  const FirstFrame frame = decode_first_frame(first_frame, capture, trial.scene);
  SurfaceFit fit = fit_surface(frame.points, frame.silhouette, capture.rig, trial.scene,
                               {.others = true, .threads = threads});
  trial.start_note = fit.note;
  if (fit.usable) {
    trial.scene.start = std::move(fit.x);
    trial.other_starts = std::move(fit.others);
    trial.start_name = "measured surface";
    trial.start_residual = fit.residual_median;
  } else {
    choose_generic_start(trial, "baraff-witkin", threads);
  }
}

void measure(Trial& trial, int last, int threads) {
  const Capture& capture = trial.capture;
  const std::vector<Image> frames = read_video(capture, trial.first_frame, last);
  trial.features = extract_features(frames, capture, trial.options.angle_map, threads);
  if (trial.first_frame == 0) {
    set_start(trial, frames.front(), threads);
  } else {
    set_start(trial, read_video(capture, 0, 0).front(), threads);
  }
}

}  // namespace

std::shared_ptr<const Trial> prepare_trial(const Capture& capture, int first, int last,
                                           const TrialOptions& options, int threads,
                                           const std::filesystem::path& cache_folder) {
  check(options);
  if (first < 0 || last < first || last >= capture.frame_count)
    throw Error(fmt::format("{}: frames {} to {} asked for, the video has 0 to {}",
                            capture.folder.string(), first, last, capture.frame_count - 1));
  auto trial = std::make_shared<Trial>();
  trial->capture = capture;
  trial->options = options;
  trial->first_frame = first;
  trial->scene = make_scene(capture, options.columns, options.rows, 0, last);
  if (cache_folder.empty()) {
    measure(*trial, last, threads);
    return trial;
  }
  const std::string key = preparation_key(capture, first, last, options);
  const std::filesystem::path file = cache_file(cache_folder, capture, key);
  if (!read_cached(file, key, *trial)) {
    measure(*trial, last, threads);
    write_cached(file, key, *trial);
  }
  return trial;
}

}  // namespace weft
