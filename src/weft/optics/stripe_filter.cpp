#include "weft/optics/stripe_filter.h"

#include <fmt/format.h>

#include "weft/base/error.h"

namespace weft {
namespace {

void check(const StripePattern& pattern) {
  const auto positive = [](double value) { return value > 0 && std::isfinite(value); };
  if (!positive(pattern.period))
    throw Error(fmt::format("stripe period is {}; must be positive, px", pattern.period));
  if (!positive(pattern.edge_gain))
    throw Error(fmt::format("stripe edge gain is {}; must be positive", pattern.edge_gain));
  if (!(pattern.black_level >= 0 && pattern.black_level <= 1))
    throw Error(fmt::format("black level is {}; must be in [0, 1]", pattern.black_level));
}

}  // namespace

StripeFilter::StripeFilter(const StripePattern& pattern) {
  check(pattern);
  frequency_ = static_cast<float>(1 / pattern.period);
  constexpr int kSteps = 16;  // of the midpoint rule between two entries
  std::vector<double> integral(kEntries + 1, 0.0);
  for (int k = 0; k < kEntries; ++k) {
    double sum = 0;
    for (int s = 0; s < kSteps; ++s)
      sum += pattern.light(pattern.period * (k + (s + 0.5) / kSteps) / kEntries);
    integral[k + 1] = integral[k] + sum / (kSteps * kEntries);
  }
  const double mean = integral[kEntries];
  mean_ = static_cast<float>(mean);
  // Two entries more than a period: rounding may put t - floor(t) at 1.
  table_.resize(kEntries + 2);
  for (int k = 0; k <= kEntries; ++k)
    table_[k] = static_cast<float>(integral[k] - mean * k / kEntries);
  table_[kEntries + 1] = table_[1];
}

}  // namespace weft
