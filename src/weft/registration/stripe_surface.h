#pragma once
#include <string>
#include <vector>

#include "weft/dynamics/scene.h"
#include "weft/optics/render.h"
#include "weft/vision/angle_map.h"

namespace weft {

/// Points of the surface where the stripes of one frame were decoded.
struct StripePoints {
  MatX pixel;       ///< 2 x n, continuous image coordinates
  Points position;  ///< 3 x n, m
  Image depth;      ///< camera depth in m at pixel centres, 0 where not decoded
};

struct StripeDecodeOptions {
  /// Steepest surface whose stripes are connected: change of depth along the view over distance
  /// across it, from 1 (45 degrees) up. Steeper steps are taken for occlusions.
  double steepest_slope = 4.5;
};

/// Triangulates the stripes of a frame: the phase of the pattern is measured at each pixel,
/// unwrapped by continuity from anchors (projected fixtures, whose positions are known) and by the
/// range of depth that the swatch can reach from its fixtures, and each phase gives the plane of
/// light that the camera ray meets.
StripePoints decode_stripes(const Image& intensity, const Mask& silhouette, const Rig& rig,
                            const Scene& scene, const StripeDecodeOptions& options = {});

struct SurfaceFit {
  Points x;                 ///< 3 x vertices of scene.mesh
  Eigen::VectorXi support;  ///< decoded points near each vertex; 0: placed by the cloth model alone
  double residual_median = 0;  ///< m, decoded points to the fitted surface
  double residual_p95 = 0;
  int points = 0;
  bool usable = false;  ///< false: too few points; x is then a guess
  std::string note;     ///< why
};

/// Fits the swatch mesh of `scene` to the decoded points and the silhouette: nearly inextensible,
/// with its fixtures where they are at the first frame time. The start for settling.
SurfaceFit fit_surface(const StripePoints& points, const Mask& silhouette, const Rig& rig,
                       const Scene& scene);

/// Start shapes for when there is no usable frame: the sheet bulged to either side, and folded
/// alternately. Named, for the report.
struct StartShape {
  std::string name;
  Points x;
};
std::vector<StartShape> generic_starts(const Scene& scene);

}  // namespace weft
