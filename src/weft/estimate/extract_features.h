#pragma once
#include <vector>

#include "weft/estimate/problem.h"

namespace weft {

/// What the metric needs of measured frames (silhouette, angle map, fold mask), one a frame.
/// `threads` 0: all cores; the result does not depend on it.
std::vector<FrameFeatures> extract_features(const std::vector<Image>& frames,
                                            const Capture& capture, const AngleMapOptions& options,
                                            int threads);

}  // namespace weft
