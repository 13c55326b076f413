#pragma once
/// How the noise of the clips' poses is told from what a fabric does. A pose that is off by d makes
/// the forces of its frame wrong by J d, with stiff cloth by far more than a gauge is, and the
/// measured points by what the cloth between the clips follows: hundreds of points know the way
/// between two clips better than the clips do.
#include <vector>

#include "weft/dynamics/clips.h"
#include "weft/estimate/shared_errors.h"

namespace weft {

/// Of each trial and frame, by which its differences over their noise are weighed; none in trials
/// that state no noise of their clips. No trials: none has been asked for.
using ForceWeights = std::vector<std::vector<SharedErrors>>;

/// One standard deviation of each coordinate of all poses, 6 a clip: `clip_noise` (m) for positions
/// and clip_noise / half of the clip's longer side for rotations. Errors of poses are independent
/// of each other; those that they make in the differences of a frame are not: both ends of a strip
/// see the same one.
VecX pose_deviations(const std::vector<Clip>& clips, double clip_noise);

}  // namespace weft
