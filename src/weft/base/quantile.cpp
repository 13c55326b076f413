#include "weft/base/quantile.h"

#include <algorithm>
#include <cstddef>

namespace weft {

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto k = std::min(values.size() - 1,
                          static_cast<std::size_t>(share * static_cast<double>(values.size())));
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(k);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace weft
