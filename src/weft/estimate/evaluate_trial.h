#pragma once
#include "weft/estimate/problem.h"

namespace weft {

/// evaluate() with another scene than the trial's (another start).
TrialEvaluation evaluate_scene(const Trial& trial, Scene scene, const Fabric& fabric,
                               int frame_count, Trajectory* trajectory, int threads);

/// How many workers share `count` tasks on up to `threads` threads (0: all cores); at least 1.
std::size_t worker_count(std::size_t count, int threads);

}  // namespace weft
