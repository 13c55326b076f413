#pragma once
/// Weights of measured forces where the poses of the clips are known to a noise: a pose that is off
/// by d makes the forces of its frame wrong by J d, with stiff cloth by far more than a gauge is.
#include <vector>

#include "weft/dynamics/clips.h"

namespace weft {

/// Of each trial and frame what differences of forces, divided by the noise of a force, are
/// multiplied by: a square matrix, a row a compared component; without rows in trials that state no
/// noise of their clips. No trials: none has been asked for.
using ForceWeights = std::vector<std::vector<MatX>>;

/// W of a frame, for differences whose covariance is
///
///     I + S J P J^T S^T / force_noise^2 = L L^T,      W = L^-1.
///
/// J (3 clips x 6 clips) as of clip_pose_sensitivities(); S (compared x 3 clips): the directions of
/// the compared components; P: diagonal, `clip_noise`^2 (m) for positions and (clip_noise / half of
/// the clip's longer side)^2 for rotations; `force_noise` N, > 0. Errors of poses are independent
/// of each other; those that they make in the forces are not: both ends of a strip see the same
/// one.
MatX force_weight(const MatX& pose_derivative, const std::vector<Clip>& clips,
                  const MatX& directions, double clip_noise, double force_noise);

}  // namespace weft
