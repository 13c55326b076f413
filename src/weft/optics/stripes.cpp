#include "weft/optics/stripes.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace weft {

double StripePattern::light(double y) const {
  const double sine = std::sin(2 * std::numbers::pi * y / period);
  const double wave = profile == Profile::sine ? sine : std::clamp(edge_gain * sine, -1.0, 1.0);
  return black_level + (1 - black_level) * 0.5 * (1 + wave);
}

}  // namespace weft
