#pragma once
/// Friction of the cords that pull the clips of a rig: a force of one size along each clip's
/// motion, which the gauges read with the cloth's (Miguel et al. 2012, section 3.3: between loading
/// and unloading some 0.1 N).
#include <vector>

#include "weft/capture/mechanical_capture.h"
#include "weft/estimate/mechanical_trial.h"

namespace weft {

/// m: six times the noise of a clip that is located by some dozens of points to 0.075 mm each.
inline constexpr double least_clip_way = 75e-6;

/// Where friction points to: 3 x frames, unit vectors or zero. The way into a frame; where the clip
/// stood still, the way out of it, for then the motion turns, and the cords are about to go there;
/// zero at the first frame and where the clip stands still before and after.
///
/// Steps may be smaller than the noise of a clip's position, so the way is not the difference of
/// two frames but the direction of a piece of the motion: pieces of even motion from which no frame
/// lies farther off than `least_way` (m, > 0), broken where one does, the farthest first (Douglas
/// and Peucker 1973, against where the clip would be at that time). A piece no longer than that is
/// a standstill.
Points ways_of_clip(const std::vector<Clip>& frames, double least_way = least_clip_way);

/// The same of all clips of a capture, one matrix a fixture. Where the capture states a noise of
/// its clips, they are looked at together. Motions are broken where any of them lies farther off,
/// at the frame from which all together are farthest. A piece in which the ways of all are noise is
/// a standstill; one in which they are not, but none is longer than twice `least_way`, has no ways,
/// nor that out of it at its end. Of a way the components in the clip's axes that are no longer
/// than `least_way` are left out. Loaded clips have no ways: what pulls them is known.
///
/// For forces that are weighed with the noise of poses (force_weights.h) are known to the noise of
/// the gauges in some directions, such as their sum over the clips and across the motion: a
/// friction that points there by mistake, if only by some degrees, would be found to be none.
std::vector<Points> ways_of_clips(const MechanicalCapture& capture,
                                  double least_way = least_clip_way);

/// Adds `friction` (N) along the ways to the computed forces of a trial: what the gauges would
/// read.
void add_cord_friction(const MechanicalTrial& trial, double friction, double least_way,
                       std::vector<MechanicalFrame>& frames);

}  // namespace weft
