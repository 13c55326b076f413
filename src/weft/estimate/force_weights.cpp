#include "weft/estimate/force_weights.h"

#include "weft/dynamics/clip_poses.h"

namespace weft {

VecX pose_deviations(const std::vector<Clip>& clips, double clip_noise) {
  VecX deviations(6 * static_cast<Eigen::Index>(clips.size()));
  for (std::size_t c = 0; c < clips.size(); ++c) {
    const auto first = 6 * static_cast<Eigen::Index>(c);
    deviations.segment<3>(first).setConstant(clip_noise);
    deviations.segment<3>(first + 3).setConstant(clip_noise / half_length(clips[c]));
  }
  return deviations;
}

}  // namespace weft
