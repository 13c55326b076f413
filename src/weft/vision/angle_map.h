#pragma once
#include <memory>

#include "weft/base/types.h"

namespace weft {

/// Settings of the angle map (Bhat 2003, section 4).
struct AngleMapOptions {
  /// px, 2 to 64, rounded; taps at integers from -radius to radius ("kernel size 12"). Suits
  /// stripes of 1.3 to 5 radii a period: 8 to 32 px at 6.
  double kernel_radius = 6;
  /// px, 0.1 to 64, of the Gaussian that blurs the coefficients. Noise of the angle falls with its
  /// square; folds narrower than it blur.
  double blur_sigma = 4;
  /// tau, rad/px: gradient of the angle map from which on there is a fold.
  double mask_threshold = 0.012;
  /// 0 to 1: strength below this fraction of the frame's 95th percentile has no defined angle.
  double energy_threshold = 0.1;
  /// 0 to 1: coherence |(C2, C3)| / C1 below this fraction of a grating's has no defined angle.
  /// There two directions meet within the blur: an edge of shadow or of cloth across the stripes.
  double coherence_threshold = 0.7;
};

/// Orientation of the stripes in an image.
struct AngleMap {
  Image angle;  ///< rad, modulo pi, in (-pi/2, pi/2]: direction along the stripes, x axis towards y
  Image strength;  ///< amplitude of the energy's second angular harmonic, relative: 0 to 1.3
  Mask valid;      ///< 1 where the angle is defined
};

/// G2/H2 quadrature steerable filters; dominant orientation from the coefficients C2 and C3 of the
/// oriented energy (Freeman and Adelson 1991, appendix I), blurred first:
/// angle = atan2(-C3, -C2) / 2, the signs turning it from across the stripes to along them.
///
/// Before the filters, light is taken relative to its local mean inside the region (Gaussian of 1.6
/// kernel radii), and is 0 outside: shading, albedo and the background's level drop out, and the
/// silhouette is no edge. Before the blur, the coefficients are divided by the local energy C1
/// (plus a floor), so that stripes of low and of high contrast count alike. Outside the region and
/// on its rim of one pixel the angle is not valid. Keeps its buffers: after the first frame nothing
/// is allocated unless the region's bounding box grows. One an evaluation thread.
class AngleMapper {
 public:
  /// Throws Error for an option outside its range.
  AngleMapper(int width, int height, const AngleMapOptions& options = {});
  ~AngleMapper();
  AngleMapper(AngleMapper&&) noexcept;
  /// `intensity` in linear light. Only pixels inside the bounding box of `region` are computed. An
  /// empty (0 x 0) region means everywhere. Throws Error if a size differs from the mapper's. The
  /// result lives until the next call.
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
