#pragma once
#include <memory>
#include <vector>

#include "weft/mesh/triangle_mesh.h"
#include "weft/optics/stripes.h"

namespace weft {

/// The rig: who looks, who shines.
struct Rig {
  int width = 0, height = 0;  ///< camera image, px
  Pinhole camera;
  Pinhole projector;
  StripePattern pattern;
  double projector_width = 0, projector_height = 0;  ///< px; 0: unlimited
};

struct RenderOptions {
  /// Samples of coverage and visibility a pixel along each axis, 1 to 8.
  int supersampling = 2;
  /// Each triangle is drawn as subdivision^2 ones on its smooth patch, 1 to 16 (1: flat triangles).
  int subdivision = 3;
  /// true: the stripe profile is averaged over the pixel's footprint in the projector's rows by its
  /// antiderivative, and a pixel that one smooth piece of surface fills is shaded once. false:
  /// every sample is shaded at its point and only averaging them softens the stripes.
  bool filter_stripes = true;
  bool shadows = true;         ///< of the cloth on itself, from the projector
  double ambient = 0.05;       ///< light everywhere on the cloth, of the projector's, 0 to 1
  double albedo = 0.8;         ///< 0 to 1
  double background = 0.0;     ///< grey level where there is no cloth, 0 to 1
  double shadow_bias = 2e-3;   ///< m, nearer surfaces do not shadow each other; > 0
  double shadow_scale = 1;     ///< texels of the shadow map a projector px, (0, 8]
  bool projector_row = false;  ///< fill RenderedFrame::projector_row
};

struct RenderedFrame {
  Image intensity;  ///< linear light, 0 to 1
  /// 1 where cloth covers more than half of the pixel's samples, or half of them and its centre.
  Mask silhouette;
  Image depth;  ///< m along the camera's axis at the pixel's centre; 0 where silhouette is 0
  /// Projector row y (continuous, px) that lights the surface at the pixel's centre; NaN where
  /// silhouette is 0 or the projector does not light it. Empty unless asked for.
  Image projector_row;
};

/// Renders meshes of one topology; keeps its buffers, so one an evaluation thread.
///
/// The surface is the mesh's smooth patch (SmoothSurface), drawn with a z-buffer; image and
/// projector coordinates are perspective correct. Intensity = albedo (ambient + light(y) cos s),
/// with y the projector row, cos >= 0 the cosine between the normal on the camera's side and the
/// direction to the projector, and s the fraction that is not in shadow. Both sides of the cloth
/// are alike; a side turned away from the projector has ambient light only (cloth is opaque). No
/// inverse square over the depth of a swatch. Points nearer than 1 mm to a device's plane, or
/// behind it, are not seen by it.
class Renderer {
 public:
  /// Throws Error for an option outside its range, a rig without image size or devices, an invalid
  /// stripe pattern or an invalid mesh.
  Renderer(const Rig& rig, const TriangleMesh& mesh, const RenderOptions& options = {});
  ~Renderer();
  Renderer(Renderer&&) noexcept;
  /// The mesh at `x`, 3 x vertices, m, world. Valid until the next call. Triangles with a vertex
  /// that is not finite are left out.
  const RenderedFrame& render(const Points& x);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace weft
