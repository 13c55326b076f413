#pragma once
#include <string>
#include <vector>

namespace weft {

/// Where an axis is marked. A label stands for position / 10^exponent; the axis says the power
/// once.
struct Ticks {
  std::vector<double> positions;
  std::vector<std::string> labels;  ///< one a position
  std::vector<double> minor;        ///< marked without a label
  int exponent = 0;                 ///< a multiple of 3, 0 for logarithmic axes
};

/// Which steps between ticks may be chosen.
enum class TickStep { any, whole };

/// The multiples of 1, 2 or 5 times a power of ten inside [lower, upper], in the finest such step
/// that gives at most `most` + 1 of them (`most` >= 1). A whole step is at least 1. An empty
/// or not finite range gives none.
Ticks linear_ticks(double lower, double upper, int most, TickStep kind = TickStep::any);

/// Powers of ten inside [lower, upper], 0 < lower, thinned to about `most`; with 1, 2 and 5 times a
/// power of ten where the range holds less than two decades, and the linear ticks where it holds
/// less than about half of one.
Ticks log_ticks(double lower, double upper, int most);

}  // namespace weft
