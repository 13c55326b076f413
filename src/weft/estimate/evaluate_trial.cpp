#include "weft/estimate/evaluate_trial.h"

#include <algorithm>
#include <cmath>

#include "weft/base/clock.h"

namespace weft {
namespace {

/// What looks at simulated shapes; one a thread.
class Eye {
 public:
  explicit Eye(const Trial& trial)
      : renderer_(trial.capture.rig, trial.scene.mesh, trial.options.render),
        mapper_(trial.capture.rig.width, trial.capture.rig.height, trial.options.angle_map) {}

  FrameError compare_with(const FrameFeatures& measured, const Points& x) {
    const RenderedFrame& image = renderer_.render(x);
    return compare(measured, mapper_.compute(image.intensity, image.silhouette), image.silhouette);
  }

  SimulatedFrame look(const Points& x) {
    const RenderedFrame& image = renderer_.render(x);
    return {image, mapper_.compute(image.intensity, image.silhouette)};
  }

 private:
  Renderer renderer_;
  AngleMapper mapper_;
};

void sum_up(TrialEvaluation& evaluation, double alpha) {
  if (evaluation.diverged) {
    evaluation.error = evaluation.fold = evaluation.silhouette = evaluation.error_per_mask_pixel =
        kInfinity;
    return;
  }
  double mask_pixels = 0;
  for (const FrameError& frame : evaluation.frames) {
    evaluation.fold += frame.fold;
    evaluation.silhouette += frame.silhouette;
    mask_pixels += frame.mask_pixels;
  }
  const auto count = double(evaluation.frames.size());
  evaluation.fold /= count;
  evaluation.silhouette /= count;
  evaluation.error = evaluation.fold + alpha * evaluation.silhouette;
  evaluation.error_per_mask_pixel = evaluation.error / std::max(1.0, mask_pixels / count);
}

}  // namespace

std::size_t worker_count(std::size_t count, int threads) {
  const int limit = all_threads(threads);
  return std::clamp<std::size_t>(count, 1, static_cast<std::size_t>(limit));
}

int threads_each(std::size_t tasks, int threads) {
  return std::max(1, all_threads(threads) / static_cast<int>(tasks));
}

TrialEvaluation evaluate_scene(const Trial& trial, Scene scene, const Fabric& fabric,
                               int frame_count, Trajectory* trajectory, int threads) {
  const auto start = Clock::now();
  const int compared =
      frame_count > 0 ? std::min(frame_count, trial.frame_count()) : trial.frame_count();
  scene.frame_times.resize(static_cast<std::size_t>(trial.first_frame + compared));

  TrialEvaluation evaluation;
  evaluation.frames.resize(static_cast<std::size_t>(compared));
  Trajectory motion;
  std::vector<Points> shapes(evaluation.frames.size());
  const std::size_t reached = for_each_while_made(
      shapes.size(), threads, [&] { return Eye(trial); },
      [&](const auto& ready) {
        motion = simulate_compared(trial, scene, fabric, shapes, ready);
        evaluation.simulation_s = seconds_since(start);
      },
      [&](Eye& eye, std::size_t i) {
        evaluation.frames[i] = eye.compare_with(trial.features[i], shapes[i]);
      });
  evaluation.frames.resize(reached);
  evaluation.diverged = motion.diverged;
  evaluation.divergence = motion.divergence;
  sum_up(evaluation, trial.options.alpha);
  if (trajectory) *trajectory = std::move(motion);
  evaluation.wall_s = seconds_since(start);
  return evaluation;
}

TrialEvaluation evaluate(const Trial& trial, const Fabric& fabric, int frame_count,
                         Trajectory* trajectory, int threads) {
  return evaluate_scene(trial, trial.scene, fabric, frame_count, trajectory, threads);
}

SimulatedFrame look_at(const Trial& trial, const Points& x) { return Eye(trial).look(x); }

}  // namespace weft
