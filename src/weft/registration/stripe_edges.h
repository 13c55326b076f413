#pragma once
#include <vector>

#include "weft/base/types.h"

namespace weft {

/// A place on an image column where the light changes between a dark and a bright stripe.
struct StripeEdge {
  int column = 0;         ///< pixel column; x = column + 0.5
  double y = 0;           ///< continuous image coordinate, sub-pixel
  bool rising = false;    ///< dark above, bright below
  double contrast = 0;    ///< bright minus dark level beside the edge, linear light
  double modulation = 0;  ///< contrast over the sum of the two levels, 0 to 1
};

/// Finds the stripe edges along every image column inside `silhouette`, sorted by column and then
/// y. An edge is where the light, smoothed over three columns, crosses the mean of the dark and the
/// bright level measured on the plateaus beside it: half a pixel's integral of a symmetric ramp
/// lies on either side there, so blur does not shift it. Edges within two pixels of the
/// silhouette's rim are left out: there the light ends with the cloth, not with a stripe.
///
/// `period`: stripe period in the image, px, about; sets how far plateaus are looked for. Valid
/// from 4.
std::vector<StripeEdge> find_stripe_edges(const Image& intensity, const Mask& silhouette,
                                          double period);

}  // namespace weft
