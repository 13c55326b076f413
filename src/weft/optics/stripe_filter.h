#pragma once
#include <cmath>
#include <vector>

#include "weft/optics/stripes.h"

namespace weft {

/// The stripe pattern averaged over an interval of projector rows, from a table of its
/// antiderivative: mean over [y - w/2, y + w/2] = (F(y + w/2) - F(y - w/2)) / w. Accurate to about
/// 1e-4 for w above a hundredth of a period; narrower intervals are widened to that.
class StripeFilter {
 public:
  /// Throws Error unless period and edge_gain are positive and black_level is in [0, 1].
  explicit StripeFilter(const StripePattern& pattern);
  /// `y` and `width` in projector px.
  float mean(float y, float width) const {
    const float t = y * frequency_;
    const float half = 0.5f * std::max(width * frequency_, kNarrowest);
    return mean_ + (deviation(t + half) - deviation(t - half)) / (2 * half);
  }

 private:
  static constexpr int kEntries = 1024;
  static constexpr float kNarrowest = 0.01f;
  /// Integral from 0 to t (in periods) of light - mean: periodic.
  float deviation(float t) const {
    const float entry = (t - std::floor(t)) * kEntries;
    const int k = static_cast<int>(entry);
    return table_[k] + (entry - static_cast<float>(k)) * (table_[k + 1] - table_[k]);
  }
  float frequency_ = 0;  ///< periods per projector px
  float mean_ = 0;
  std::vector<float> table_;
};

}  // namespace weft
