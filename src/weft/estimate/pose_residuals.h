#pragma once
/// Differences between where loaded clips are found and where they were measured to be: what a fit
/// compares of clips that are pulled with known forces.
#include "weft/estimate/mechanical_trial.h"

namespace weft {

/// Numbers that are compared of all frames: six a loaded clip and frame.
std::size_t pose_residual_count(const MechanicalCapture& capture);

/// Of one frame, six a loaded clip in the order of the fixtures: the shift, then the rotation
/// vector from the measured to the found pose (pose_difference()), each divided by its standard
/// deviation (MechanicalCapture::pose_deviations()).
struct PoseResiduals {
  VecX values;
  /// By moves of all clips, 6 fixtures columns (1/m, 1/rad): chains with the derivatives of a
  /// MechanicalFrame.
  MatX by_moves;
};
/// `point_noise`: m, of captures that state no noise of their clips; > 0.
PoseResiduals pose_residuals(const MechanicalTrial& trial, const MechanicalFrame& frame,
                             double point_noise);

}  // namespace weft
