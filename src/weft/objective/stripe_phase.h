#pragma once
#include <vector>

#include "weft/optics/render.h"

namespace weft {

/// What a measured frame says about the phase of the stripes at a point of the image. With a
/// calibrated projector the phase says, up to whole periods, in which plane of light the surface
/// lies that the pixel sees: its depth along the ray.
struct PhaseSample {
  int column = 0;  ///< x = column + 0.5, px
  float y = 0;     ///< continuous image coordinate, px
  float phase =
      0;  ///< rad, in [0, 2 pi): 2 pi times the projector row over the period, modulo 2 pi
};

/// One sample a stripe edge (find_stripe_edges): phase 0 where projector rows pass from a dark to a
/// bright stripe, pi where they pass from bright to dark. By column, then y.
///
/// `intensity`: linear light; `silhouette`: of the same size; `reference`: a point of the cloth, m,
/// which says whether the projector's rows run the image's way (surfaces so steep that they run
/// against it there are taken for the other kind of edge). Few or none if the stripes run along
/// the image's columns or their period in the image is below 4 px there.
std::vector<PhaseSample> stripe_phase_samples(const Image& intensity, const Mask& silhouette,
                                              const Rig& rig, const Vec3& reference);

}  // namespace weft
