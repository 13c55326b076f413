#pragma once
#include <vector>

#include "weft/estimate/linearize_trial.h"

namespace weft {

/// Part of the cost: one patch of one frame.
struct PatchPart {
  CostPart part;
  int patch = 0;  ///< of the trial's grid
};

/// The parts of linearize(), each frame split among 4 x 4 patches of the smallest box that holds
/// the measured silhouettes of its trial; in order of trials, frames, patches. Empty if a
/// simulation diverged. What estimate_uncertainty() wants.
std::vector<PatchPart> linearize_patches(const Problem& problem, const VecX& scaled,
                                         const LinearizationOptions& options = {});

/// The patches of each frame added up.
std::vector<CostPart> frames_of(const std::vector<PatchPart>& parts);
/// The frames of each patch added up; `frame` is then the patch's number.
std::vector<CostPart> patches_of(const std::vector<PatchPart>& parts);

}  // namespace weft
