#pragma once
#include <atomic>

#include "weft/base/parallel.h"
#include "weft/estimate/problem.h"

namespace weft {

/// evaluate() with another scene than the trial's (another start).
TrialEvaluation evaluate_scene(const Trial& trial, Scene scene, const Fabric& fabric,
                               int frame_count, Trajectory* trajectory, int threads);

/// How many workers share `count` tasks on up to `threads` threads (0: all cores); at least 1.
std::size_t worker_count(std::size_t count, int threads);

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

}  // namespace weft
