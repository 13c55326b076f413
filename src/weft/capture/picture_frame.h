#pragma once
/// The picture frame, a test of shear (trellis shear; Cao et al. 2008, "Characterization of
/// mechanical behavior of woven fabrics: experimental methods and benchmark results"): four rigid
/// bars of one length with hinges at their ends, in which a square of fabric is clamped, are pulled
/// at one corner along the diagonal.
///
/// With the bars' length L and the shear angle gamma, by which the angle at the pulled corner is
/// below a right one, the diagonal is 2 L cos(pi / 4 - gamma / 2) long. The crosshead has moved by
/// d = that - sqrt(2) L, d' = dd / dgamma = L sin(pi / 4 - gamma / 2). A fabric of the area A that
/// is sheared evenly, with the energy W(gamma) per area, pulls back by virtual work with
///
///     F = A (dW / dgamma) / d'.
///
/// Two pairs of bars of no width that turn about the fabric's corners shear it evenly; so do longer
/// ones on the arms of a cross whose inner square is the fabric.
#include "weft/base/types.h"
#include "weft/mesh/triangle_mesh.h"

namespace weft {

/// Of one test.
struct PictureFrame {
  double side = 0;  ///< m, of a bar between its hinges, > 0
  VecX shear;       ///< rad, of the fabric, one a frame; within most_frame_shear, either sign
};

/// rad, either sign: 80 degrees. At 90 the bars lie on each other.
inline constexpr double most_frame_shear = 1.3962634015954636;

/// d, m, of a frame with bars of `side` m at a shear in rad.
double frame_displacement(double side, double shear);
/// Its inverse, rad, for a displacement (m) of a shear within most_frame_shear.
double frame_shear(double side, double displacement);
/// d', m/rad.
double frame_displacement_rate(double side, double shear);

/// Vectors of an evenly sheared fabric along both material axes: 3 x 2, unit lengths, in the plane
/// z = 0. The diagonal on which they add up, that of the crosshead, is along x.
struct FrameThreads {
  Eigen::Matrix<double, 3, 2> along;
  Eigen::Matrix<double, 3, 2> rate;  ///< by the shear, 1/rad
};
FrameThreads frame_threads(double shear);

}  // namespace weft
