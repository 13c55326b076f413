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
/// y.
///
/// An edge is where the light, averaged over three columns (1, 2, 1), crosses the mean of the dark
/// and the bright level, which are measured on the plateaus beside it. The pattern's ramp and the
/// pixel's footprint are symmetric, so that blur does not shift that crossing; nor does a sloping
/// stripe. Left out are steps of less than 8 % of the frame's median contrast (noise), edges whose
/// modulation is below 45 % of the median one (shading dims bright and dark alike), and edges
/// within two pixels of the silhouette's rim (there the light ends with the cloth, not with a
/// stripe).
///
/// `intensity`: linear light; `silhouette`: of the same size; `period`: stripe period in the image,
/// px, about: sets how far plateaus reach. None are found below 4 px.
std::vector<StripeEdge> find_stripe_edges(const Image& intensity, const Mask& silhouette,
                                          double period);

}  // namespace weft
