#pragma once
#include <vector>

namespace weft {

/// The value below which `share`, in [0, 1], of the data lie: entry floor(share n) of the n sorted
/// ones, the last one at most. 0 without data.
double quantile(std::vector<double> values, double share);

}  // namespace weft
