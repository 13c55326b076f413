#pragma once
#include <memory>

#include "weft/base/types.h"

namespace weft {

/// Settings of the eye (Bhat 2003, section 4).
struct AngleMapOptions {
  double kernel_radius = 6;  ///< px; taps at integers from -radius to radius ("kernel size 12")
  double blur_sigma = 3;     ///< px, of the Gaussian that blurs the squared-response coefficients
  double mask_threshold = 0.02;    ///< tau, rad/px: gradient of the angle map above which a fold is
  double energy_threshold = 0.02;  ///< oriented energy below this fraction of the frame's 95th
                                   ///< percentile has no defined angle
};

/// Orientation of the stripes in an image.
struct AngleMap {
  Image angle;  ///< rad, modulo pi, in (-pi/2, pi/2]: direction along the stripes, x axis towards y
  Image strength;  ///< amplitude of the second angular harmonic, >= 0
  Mask valid;      ///< 1 where the angle is defined
};

/// G2/H2 quadrature steerable filters; dominant orientation from the coefficients C2 and C3 of the
/// oriented energy (Freeman and Adelson 1991, appendix I), blurred first. Keeps its buffers.
class AngleMapper {
 public:
  AngleMapper(int width, int height, const AngleMapOptions& options = {});
  ~AngleMapper();
  AngleMapper(AngleMapper&&) noexcept;
  /// Only pixels inside the bounding box of `region` (grown by the filters' reach) are computed;
  /// outside `region` the angle is not valid. An empty (0 x 0) region means everywhere.
  const AngleMap& compute(const Image& intensity, const Mask& region);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// a - b for orientations, wrapped to (-pi/2, pi/2].
float orientation_difference(float a, float b);

/// Equation 4: 1 where the gradient of the angle map (taken on the doubled angle) is at least tau
/// and the angle is valid.
Mask gradient_mask(const AngleMap& map, double threshold);

}  // namespace weft
