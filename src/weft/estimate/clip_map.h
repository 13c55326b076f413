#pragma once
#include <vector>

#include "weft/dynamics/clips.h"

namespace weft {

/// By material coordinates (2 columns): the linear part of the affine map nearest to where the
/// clips have their corners, in the least-squares sense. `clips`: at least one.
Eigen::Matrix<double, 3, 2> map_of_clips(const std::vector<Clip>& clips);

/// The direction, a unit vector, in which a clip's force is of the shear alone: in the plane of
/// the cloth, square to the threads that come out of its long side as map_of_clips() has them.
/// Tension T of those threads has a part T sin(shear angle) along the clip, but none square to
/// them. Along the clip where that map is too flat to say.
Vec3 shear_direction(const std::vector<Clip>& clips, std::size_t clip);

}  // namespace weft
