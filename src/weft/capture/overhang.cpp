#include "weft/capture/overhang.h"

#include <algorithm>
#include <cmath>

namespace weft {

double overhang_deviation(const VecX& lengths) {
  constexpr double kReadTo = 1e-3;  // m, as the standard asks
  if (lengths.size() < 3) return kReadTo;
  const double squares = (lengths.array() - lengths.mean()).square().sum();
  const double scatter = std::sqrt(squares / static_cast<double>(lengths.size() - 1));
  return std::max(scatter, kReadTo / std::sqrt(12.0));
}

}  // namespace weft
