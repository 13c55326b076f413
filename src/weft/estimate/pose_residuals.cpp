#include "weft/estimate/pose_residuals.h"

#include <algorithm>

namespace weft {
namespace {

Eigen::Index loaded_count(const MechanicalCapture& capture) {
  return std::ranges::count_if(capture.fixtures, &MechanicalFixture::loaded);
}

}  // namespace

std::size_t pose_residual_count(const MechanicalCapture& capture) {
  return static_cast<std::size_t>(6 * loaded_count(capture) * capture.frame_count);
}

PoseResiduals pose_residuals(const MechanicalTrial& trial, const MechanicalFrame& frame,
                             double point_noise) {
  const MechanicalCapture& capture = trial.capture;
  const auto fixtures = static_cast<Eigen::Index>(capture.fixtures.size());
  const Eigen::Index count = 6 * loaded_count(capture);
  PoseResiduals result{VecX(count), MatX::Zero(count, 6 * fixtures)};
  Eigen::Index row = 0;
  for (Eigen::Index c = 0; c < fixtures; ++c) {
    const MechanicalFixture& fixture = capture.fixtures[static_cast<std::size_t>(c)];
    if (!fixture.loaded()) continue;
    const Clip& found = frame.clips[static_cast<std::size_t>(c)];
    const Clip& measured = fixture.frames[static_cast<std::size_t>(frame.frame)];
    const Vec2 deviations = capture.pose_deviations(measured, point_noise);
    Vec6 weights;
    weights << Vec3::Constant(1 / deviations[0]), Vec3::Constant(1 / deviations[1]);
    const Vec6 difference = pose_difference(found, measured);
    result.values.segment<6>(row) = weights.cwiseProduct(difference);
    result.by_moves.block<6, 6>(row, 6 * c) =
        weights.asDiagonal() * pose_difference_derivative(difference);
    row += 6;
  }
  return result;
}

}  // namespace weft
