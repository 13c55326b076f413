#pragma once
/// How the noise of the clips' poses is told from what a fabric does. A pose that is off by d makes
/// the forces of its frame wrong by J d, with stiff cloth by far more than a gauge is, and the
/// measured points by what the cloth between the clips follows: hundreds of points know the way
/// between two clips better than the clips do.
#include <vector>

#include "weft/dynamics/clips.h"
#include "weft/estimate/shared_errors.h"

namespace weft {

/// Of a frame, by which its differences over their noise are weighed.
///
/// What a pose does is linear near it only: a sheet that is hardly taut goes slack within the noise
/// of its clips. So frames are computed where the clips are most probably, and r + J (d - d_0) with
/// the noise of d about zero is what is weighed, as in a bundle adjustment.
struct PoseErrors {
  SharedErrors shared;  ///< J: what one standard deviation of each pose's coordinates does
  /// d_0: moves (clip_poses.h) of the measured poses to where the frame is computed and J taken, in
  /// standard deviations, 6 a fixture. Empty: as measured.
  VecX moves{};
};

/// Of each trial and frame; none in trials that state no noise of their clips. No trials: none has
/// been asked for.
using ForceWeights = std::vector<std::vector<PoseErrors>>;

/// One standard deviation of each coordinate of all poses, 6 a clip: `clip_noise` (m) for positions
/// and clip_noise / half of the clip's longer side for rotations. Errors of poses are independent
/// of each other; those that they make in the differences of a frame are not: both ends of a strip
/// see the same one.
VecX pose_deviations(const std::vector<Clip>& clips, double clip_noise);

}  // namespace weft
