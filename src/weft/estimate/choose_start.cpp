#include "weft/estimate/choose_start.h"

#include <algorithm>
#include <cmath>
#include <mutex>
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
// Shapes nearer to each other are one, m, mean over the vertices.
constexpr double kSame = 1e-4;
constexpr double kOther = 5e-4;  // those that are moved are further apart
// A search goes on while that lowers the error to this part.
constexpr double kGained = 0.97;
// As many are moved, of those that look most like the first frame.
constexpr std::size_t kMoved = 3;

double mean_distance(const Points& a, const Points& b) { return (a - b).colwise().norm().mean(); }

/// Calls an observer from one thread at a time, and remembers that it said stop.
class Watch {
 public:
  explicit Watch(const StartObserver& observer) : observer_(observer) {}
  void tell() {
    const std::lock_guard lock(mutex_);
    if (observer_ && !stopped_) stopped_ = !observer_();
  }
  bool stopped() {
    const std::lock_guard lock(mutex_);
    return stopped_;
  }

 private:
  const StartObserver& observer_;
  std::mutex mutex_;
  bool stopped_ = false;
};

/// A start, and where the cloth hangs from there.
struct Settled {
  Points start, shape;
  double error = kInfinity;  ///< of the first compared frame
  bool gone_out_from = false;
};

/// The starts of one trial for one fabric, by the error of the first compared frame.
class StartSearch {
 public:
  StartSearch(const Trial& trial, const Fabric& fabric, int threads, Watch& watch)
      : trial_(trial),
        fabric_(fabric),
        frame_(decode_first_frame(trial.capture, trial.scene)),
        threads_(threads),
        watch_(watch) {}

  /// Refines and settles these.
  void begin(const std::vector<Points>& starts) { add(starts); }

  /// The same from the shapes that were found, the best first, while that finds better ones:
  /// refine_surfaces() tries ways out from there, and a shape that has settled is another place to
  /// begin than the surface that it settled from.
  void go_on() {
    for (double before = kInfinity; !found_.empty() && found_.front().error < kGained * before;) {
      const auto next = std::ranges::find(found_, false, &Settled::gone_out_from);
      if (next == found_.end()) return;
      next->gone_out_from = true;
      before = found_.front().error;
      add({next->shape});
    }
  }

  /// The best `count` starts of those that hang differently, from each other and from `own`.
  std::vector<Points> best(std::size_t count, const Settled& own) const {
    std::vector<const Settled*> known;
    if (std::isfinite(own.error)) known.push_back(&own);
    std::vector<Points> starts;
    for (const Settled& s : found_) {
      if (starts.size() == count) break;
      if (std::ranges::any_of(
              known, [&](const Settled* k) { return mean_distance(k->shape, s.shape) < kOther; }))
        continue;
      known.push_back(&s);
      starts.push_back(s.start);
    }
    return starts;
  }

  Settled settle(Points start) const {
    Settled result;
    if (watch_.stopped()) return result;
    Scene scene = trial_.scene;
    scene.start = start;
    Trajectory there;
    result.error = evaluate_scene(trial_, std::move(scene), fabric_, 1, &there, 1).error;
    if (std::isfinite(result.error)) result.shape = std::move(there.frames.front());
    result.start = std::move(start);
    watch_.tell();
    return result;
  }

 private:
  void add(const std::vector<Points>& from) {
    if (watch_.stopped()) return;
    std::vector<RefinedSurface> surfaces =
        refine_surfaces(frame_.points, frame_.silhouette, trial_.capture.rig, trial_.scene, fabric_,
                        from, threads_);
    std::vector<Settled> settled(surfaces.size());
    parallel_for(settled.size(), threads_,
                 [&](std::size_t i) { settled[i] = settle(std::move(surfaces[i].x)); });
    for (Settled& s : settled)
      if (std::isfinite(s.error)) found_.push_back(std::move(s));
    keep_distinct();
  }

  void keep_distinct() {
    std::ranges::stable_sort(found_, {}, &Settled::error);
    std::vector<Settled> kept;
    for (Settled& s : found_) {
      const auto same = std::ranges::find_if(
          kept, [&](const Settled& k) { return mean_distance(k.shape, s.shape) < kSame; });
      if (same == kept.end())
        kept.push_back(std::move(s));
      else
        same->gone_out_from |= s.gone_out_from;
    }
    found_ = std::move(kept);
  }

  const Trial& trial_;
  const Fabric& fabric_;
  FirstFrame frame_;
  int threads_;
  Watch& watch_;
  std::vector<Settled> found_;
};

/// Of the first compared frames.
std::vector<double> errors_of(const Trial& trial, const std::vector<Points>& starts,
                              const Fabric& fabric, int frame_count, int threads, Watch& watch) {
  std::vector<double> errors(starts.size(), kInfinity);
  parallel_for(errors.size(), threads, [&](std::size_t i) {
    if (watch.stopped()) return;
    Scene scene = trial.scene;
    scene.start = starts[i];
    errors[i] = evaluate_scene(trial, std::move(scene), fabric, frame_count, nullptr, 1).error;
    watch.tell();
  });
  return errors;
}

}  // namespace

std::shared_ptr<const Trial> with_start_for(std::shared_ptr<const Trial> trial,
                                            const Fabric& fabric, int frame_count, int threads,
                                            const StartObserver& observer) {
  if (trial->other_starts.empty()) return trial;
  Watch watch(observer);
  std::vector<Points> starts{trial->scene.start};
  starts.insert(starts.end(), trial->other_starts.begin(), trial->other_starts.end());
  StartSearch search(*trial, fabric, threads, watch);
  search.begin(starts);
  search.go_on();
  starts = search.best(kMoved, search.settle(trial->scene.start));
  if (starts.empty()) return trial;
  starts.insert(starts.begin(), trial->scene.start);
  const int fit_frames = std::min(trial->capture.fit_last - trial->first_frame + 1,
                                  frame_count == 0 ? trial->frame_count() : frame_count);
  const std::vector<double> errors =
      errors_of(*trial, starts, fabric, std::max(fit_frames, 1), threads, watch);
  if (watch.stopped()) return trial;
  const auto best = static_cast<std::size_t>(std::ranges::min_element(errors) - errors.begin());
  if (!(errors[best] < kLowered * errors.front())) return trial;
  return with_start_beside_own(*trial, std::move(starts[best]));
}

std::vector<std::shared_ptr<const Trial>> with_starts_for(
    std::vector<std::shared_ptr<const Trial>> trials, const Fabric& fabric, int frame_count,
    int threads, const StartObserver& observer) {
  for (auto& trial : trials) trial = with_start_for(trial, fabric, frame_count, threads, observer);
  return trials;
}

std::vector<std::shared_ptr<const Trial>> with_settled_starts(
    std::vector<std::shared_ptr<const Trial>> trials, const Fabric& fabric, int threads) {
  parallel_for(trials.size(), threads, [&](std::size_t i) {
    if (trials[i]->other_starts.empty()) return;
    const Scene& scene = trials[i]->scene;
    const ClothModel model(scene.mesh, fabric, scene.areal_density, scene.gravity, scene.hem_width);
    StaticResult settled =
        solve_static(model, scene.start, scene.fixtures, scene.frame_times.front(),
                     trials[i]->options.simulation.static_options);
    if (!settled.converged) return;
    trials[i] = with_start(*trials[i], std::move(settled.x));
  });
  return trials;
}

std::shared_ptr<const Trial> with_start(const Trial& trial, Points start) {
  auto changed = std::make_shared<Trial>(trial);
  changed->scene.start = std::move(start);
  return changed;
}

std::shared_ptr<const Trial> with_start_beside_own(const Trial& trial, Points start) {
  auto changed = std::make_shared<Trial>(trial);
  changed->other_starts.push_back(std::move(changed->scene.start));
  changed->scene.start = std::move(start);
  return changed;
}

std::shared_ptr<const Trial> with_start_of(const Trial& other, std::shared_ptr<const Trial> trial) {
  if (trial->scene.start == other.scene.start) return trial;
  return with_start(*trial, other.scene.start);
}

}  // namespace weft
