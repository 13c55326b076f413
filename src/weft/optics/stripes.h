#pragma once
#include "weft/optics/pinhole.h"

namespace weft {

/// Stripes across the projector's y axis: bright where sin(2 pi y / period) > 0.
struct StripePattern {
  enum class Profile { square, sine } profile = Profile::square;
  double period = 0;  ///< projector px
  /// Square: the sine is scaled by this and clamped, which makes edges of finite width
  /// (period / (pi * gain) from dark to bright).
  double edge_gain = 4;
  double black_level = 0.05;  ///< light in the dark stripes, of the bright ones
  /// Light at projector row y, in [black_level, 1].
  double light(double y) const;
};

}  // namespace weft
