#include "weft/estimate/force_weights.h"

#include "weft/base/dense.h"
#include "weft/dynamics/clip_poses.h"

namespace weft {
namespace {

/// Standard deviations of all poses: 6 a clip.
VecX pose_deviations(const std::vector<Clip>& clips, double clip_noise) {
  VecX deviations(6 * static_cast<Eigen::Index>(clips.size()));
  for (std::size_t c = 0; c < clips.size(); ++c) {
    const auto first = 6 * static_cast<Eigen::Index>(c);
    deviations.segment<3>(first).setConstant(clip_noise);
    deviations.segment<3>(first + 3).setConstant(clip_noise / half_length(clips[c]));
  }
  return deviations;
}

}  // namespace

MatX force_weight(const MatX& pose_derivative, const std::vector<Clip>& clips,
                  const MatX& directions, double clip_noise, double force_noise) {
  const Eigen::Index count = directions.rows();
  const MatX by_poses =
      directions * pose_derivative * pose_deviations(clips, clip_noise / force_noise).asDiagonal();
  const MatX covariance = MatX::Identity(count, count) + by_poses * by_poses.transpose();
  return inverse_of_cholesky_factor(covariance);
}

}  // namespace weft
