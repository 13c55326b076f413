#pragma once
#include <vector>

#include "weft/vision/plane.h"
#include "weft/vision/steerable_basis.h"

namespace weft::detail {

/// Mean light around each pixel over the pixels of a mask only (normalized convolution): sums over
/// 4 x 4 blocks, a Gaussian on the blocks, and cubic B-splines between them, for the masked light
/// and the mask alike. Blocks are aligned to the image, so that the result does not depend on the
/// box.
class LocalMean {
 public:
  /// `sigma` in px, of the whole smoothing, at least 4.
  explicit LocalMean(double sigma);
  /// `mask` holds the box's rows, 0 or 1.
  void update(const Image& intensity, const Plane& mask, const Box& box);
  /// The mean at row y of the box, for its columns; 0 far from the mask.
  void row(int y, float* mean);

 private:
  void sum_blocks(const Image& intensity, const Plane& mask);
  void blur_blocks();

  Taps taps_;
  Box box_;
  int first_column_ = 0, first_row_ = 0, columns_ = 0, rows_ = 0;  // of blocks
  Plane light_, count_, scratch_;
  std::vector<float> light_row_, count_row_, mean_row_;
};

}  // namespace weft::detail
