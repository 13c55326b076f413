#pragma once
#include <cmath>
#include <vector>

#include "weft/optics/float_lanes.h"
#include "weft/optics/stripes.h"

namespace weft {

/// The stripe pattern averaged over an interval of projector rows, from a table of its
/// antiderivative: mean over [y - w/2, y + w/2] = (F(y + w/2) - F(y - w/2)) / w. Accurate to about
/// 1e-4 for w above a hundredth of a period; narrower intervals are widened to that.
class StripeFilter {
 public:
  /// Throws Error unless period and edge_gain are positive and black_level is in [0, 1].
  explicit StripeFilter(const StripePattern& pattern);
  /// `y` and `width` in projector px. Of several intervals; what is not finite gives no number.
  FloatLanes mean(FloatLanes y, FloatLanes width) const {
    const FloatLanes t = y * frequency_, periods = width * frequency_;
    const FloatLanes half = 0.5f * (periods < kNarrowest ? FloatLanes{} + kNarrowest : periods);
    return mean_ + (deviation(t + half) - deviation(t - half)) / (2 * half);
  }
  float mean(float y, float width) const { return mean(FloatLanes{} + y, FloatLanes{} + width)[0]; }

 private:
  static constexpr int kEntries = 1024;
  static constexpr float kNarrowest = 0.01f;
  /// Integral from 0 to t (in periods) of light - mean: periodic.
  FloatLanes deviation(FloatLanes t) const {
    FloatLanes entry = (t - floor_of(t)) * kEntries;
    entry = ((entry >= 0) & (entry <= kEntries)) ? entry : FloatLanes{};  // not finite: anywhere
    const IntLanes place = to_int(entry);
    const auto [before, after] = load_pairs(table_.data(), place);
    return before + (entry - to_float(place)) * (after - before);
  }
  float frequency_ = 0;  ///< periods per projector px
  float mean_ = 0;
  std::vector<float> table_;
};

}  // namespace weft
