#pragma once
#include <atomic>
#include <limits>

#include "weft/base/parallel.h"
#include "weft/estimate/problem.h"

namespace weft {

/// evaluate() with another scene than the trial's (another start).
TrialEvaluation evaluate_scene(const Trial& trial, Scene scene, const Fabric& fabric,
                               int frame_count, Trajectory* trajectory, int threads);

/// Simulates `scene`, the trial's or a part of it, and puts each compared frame into `shapes` as it
/// is reached, and then calls ready().
template <class Ready>
Trajectory simulate_compared(const Trial& trial, const Scene& scene, const Fabric& fabric,
                             std::vector<Points>& shapes, const Ready& ready) {
  const auto first = static_cast<std::size_t>(trial.first_frame);
  return simulate_frames(scene, fabric, trial.options.simulation,
                         [&](std::size_t frame, const Points& x) {
                           if (frame < first) return;
                           shapes[frame - first] = x;
                           ready();
                         });
}

/// How many workers share `count` tasks on up to `threads` threads (0: all cores); at least 1.
std::size_t worker_count(std::size_t count, int threads);
/// How many of `threads` threads (0: all cores) are there for each of `tasks` tasks; at least 1.
int threads_each(std::size_t tasks, int threads);

/// Runs task(tool, 0) ... task(tool, count - 1) on up to `threads` threads (0: all cores), each
/// with a tool of its own, which make_tool() returns. A worker takes what is next, so that one that
/// comes late (its core was busy elsewhere) finds less to do, or nothing and makes no tool.
template <class MakeTool, class Task>
void for_each_with_tool(std::size_t count, int threads, const MakeTool& make_tool,
                        const Task& task) {
  std::atomic<std::size_t> next = 0;
  parallel_for(worker_count(count, threads), threads, [&](std::size_t) {
    std::size_t i = next++;
    if (i >= count) return;
    auto tool = make_tool();
    for (; i < count; i = next++) task(tool, i);
  });
}

/// The same while what the tasks look at is made, in their order: make(ready), on one of the
/// threads, calls ready() once for each. Tasks of what was not made are left out. Returns how many
/// were made.
template <class MakeTool, class Make, class Task>
std::size_t for_each_while_made(std::size_t count, int threads, const MakeTool& make_tool,
                                const Make& make, const Task& task) {
  constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max();
  std::atomic<bool> being_made = false;
  std::atomic<std::size_t> next = 0, ready = 0;  // ready: kAll once no more come
  std::size_t made = 0;
  const auto finish = [&] {
    ready = kAll;
    ready.notify_all();
  };
  parallel_for(worker_count(count + 1, threads), threads, [&](std::size_t) {
    // The first to come, so that nobody waits for one who does not.
    if (!being_made.exchange(true)) {
      try {
        make([&] {
          ready = ++made;
          ready.notify_all();
        });
      } catch (...) {
        finish();
        throw;
      }
      finish();
    }
    const auto is_ready = [&](std::size_t i) {
      for (std::size_t now = ready; now <= i; now = ready) ready.wait(now);
      return ready != kAll || i < made;
    };
    std::size_t i = next++;
    if (i >= count || !is_ready(i)) return;
    auto tool = make_tool();
    for (; i < count && is_ready(i); i = next++) task(tool, i);
  });
  return made;
}

}  // namespace weft
