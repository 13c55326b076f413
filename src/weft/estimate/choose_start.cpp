#include "weft/estimate/choose_start.h"

#include <algorithm>
#include <numeric>
#include <utility>
#include <vector>

#include "weft/base/parallel.h"
#include "weft/estimate/evaluate_trial.h"
#include "weft/estimate/first_frame.h"
#include "weft/registration/stripe_surface.h"

namespace weft {
namespace {

// Of the error of the trial's own start. Starts that settle alike differ by less.
constexpr double kLowered = 0.9;
// As many as are settled, of the least energy, and as many as are moved, of those that look most
// like the first frame.
constexpr std::size_t kSettled = 6, kMoved = 3;

std::vector<RefinedSurface> refined_starts(const Trial& trial, const Fabric& fabric, int threads) {
  const FirstFrame frame = decode_first_frame(trial.capture, trial.scene);
  std::vector<Points> starts{trial.scene.start};
  starts.insert(starts.end(), trial.other_starts.begin(), trial.other_starts.end());
  return refine_surfaces(frame.points, frame.silhouette, trial.capture.rig, trial.scene, fabric,
                         starts, threads);
}

/// Of the first compared frames.
std::vector<double> errors_of(const Trial& trial, const std::vector<RefinedSurface>& starts,
                              const Fabric& fabric, int frame_count, int threads) {
  std::vector<double> errors(starts.size());
  parallel_for(errors.size(), threads, [&](std::size_t i) {
    Scene scene = trial.scene;
    scene.start = starts[i].x;
    errors[i] = evaluate_scene(trial, std::move(scene), fabric, frame_count, nullptr, 1).error;
  });
  return errors;
}

/// Of those after the first, the `count` with the smallest errors.
void keep_best(std::vector<RefinedSurface>& starts, const std::vector<double>& errors,
               std::size_t count) {
  std::vector<std::size_t> order(starts.size() - 1);
  std::iota(order.begin(), order.end(), std::size_t{1});
  std::ranges::stable_sort(order, {}, [&](std::size_t i) { return errors[i]; });
  if (order.size() > count) order.resize(count);
  std::vector<RefinedSurface> kept{std::move(starts.front())};
  for (const std::size_t i : order) kept.push_back(std::move(starts[i]));
  starts = std::move(kept);
}

}  // namespace

std::shared_ptr<const Trial> with_start_for(std::shared_ptr<const Trial> trial,
                                            const Fabric& fabric, int frame_count, int threads) {
  if (trial->other_starts.empty()) return trial;
  std::vector<RefinedSurface> starts = refined_starts(*trial, fabric, threads);
  if (starts.size() > kSettled) starts.resize(kSettled);
  starts.insert(starts.begin(), {trial->scene.start});
  std::vector<double> errors = errors_of(*trial, starts, fabric, 1, threads);
  const int fit_frames = std::min(trial->capture.fit_last - trial->first_frame + 1,
                                  frame_count == 0 ? trial->frame_count() : frame_count);
  if (fit_frames > 1) {
    keep_best(starts, errors, kMoved);
    errors = errors_of(*trial, starts, fabric, fit_frames, threads);
  }
  const auto best = static_cast<std::size_t>(std::ranges::min_element(errors) - errors.begin());
  if (!(errors[best] < kLowered * errors.front())) return trial;
  auto changed = std::make_shared<Trial>(*trial);
  changed->other_starts.push_back(std::move(changed->scene.start));
  changed->scene.start = std::move(starts[best].x);
  return changed;
}

std::vector<std::shared_ptr<const Trial>> with_starts_for(
    std::vector<std::shared_ptr<const Trial>> trials, const Fabric& fabric, int frame_count,
    int threads) {
  for (auto& trial : trials) trial = with_start_for(trial, fabric, frame_count, threads);
  return trials;
}

std::shared_ptr<const Trial> with_start_of(const Trial& other, std::shared_ptr<const Trial> trial) {
  if (trial->scene.start == other.scene.start) return trial;
  auto changed = std::make_shared<Trial>(*trial);
  changed->scene.start = other.scene.start;
  return changed;
}

}  // namespace weft
