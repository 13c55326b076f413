#pragma once
#include <vector>

#include "weft/objective/stripe_phase.h"
#include "weft/vision/angle_map.h"

namespace weft {

/// What the metric and the residuals need of one measured frame; computed once and kept.
struct FrameFeatures {
  AngleMap angles;
  Mask fold_mask;                  ///< M_k, equation 4
  Mask silhouette;                 ///< A_k, equation 7
  std::vector<PhaseSample> phase;  ///< of the stripes; not part of the metric
};

/// Bhat 2003, equations 5 to 8, for one frame.
struct FrameError {
  double fold = 0;  ///< equation 5, rad^2: over pixels where mask is 1 and both angles are valid
  double silhouette = 0;      ///< equation 6, pixels
  double mask_pixels = 0;     ///< sum of the mask
  double overlap_pixels = 0;  ///< masked pixels where both angles are valid
  double total(double alpha) const { return fold + alpha * silhouette; }
};

FrameError compare(const FrameFeatures& measured, const AngleMap& simulated,
                   const Mask& simulated_silhouette);

}  // namespace weft
