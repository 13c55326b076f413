#pragma once
#include "weft/base/types.h"

namespace weft {

struct SilhouetteOptions {
  double stripe_period = 17;  ///< px in the image, about; sets the size of what is closed
};

/// The cloth's silhouette in a real frame. Method: see the implementation's header comment and
/// docs/architecture.md. `confidence` is the contrast between inside and outside in units of the
/// background's spread; below 3 there is no cloth to be seen.
struct SilhouetteResult {
  Mask silhouette;
  double confidence = 0;
};
SilhouetteResult find_silhouette(const Image& intensity, const SilhouetteOptions& options);

}  // namespace weft
