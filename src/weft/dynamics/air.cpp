#include "weft/dynamics/air.h"

#include <algorithm>

namespace weft {

void AirMotion::at(double time, Points& out) const {
  if (still()) {
    out.resize(3, 0);
    return;
  }
  const auto after = std::upper_bound(times.begin(), times.end(), time);
  if (after == times.begin()) {
    out = velocity.front();
  } else if (after == times.end()) {
    out = velocity.back();
  } else {
    const auto i = static_cast<std::size_t>(after - times.begin());
    const double share = (time - times[i - 1]) / (times[i] - times[i - 1]);
    out = (1 - share) * velocity[i - 1] + share * velocity[i];
  }
}

}  // namespace weft
