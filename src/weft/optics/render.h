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
  int supersampling = 2;       ///< samples a pixel along each axis, 1 to 8
  int subdivision = 3;         ///< each triangle is drawn as subdivision^2 ones on its smooth patch
  bool shadows = true;
  double ambient = 0.05;       ///< light everywhere on the cloth, of the projector's
  double albedo = 0.8;
  double background = 0.0;     ///< grey level where there is no cloth
  double shadow_bias = 2e-3;   ///< m
};

struct RenderedFrame {
  Image intensity;  ///< linear light, 0 to 1
  Mask silhouette;  ///< 1 where cloth covers at least half of the pixel
  Image depth;      ///< m along the camera's axis at the pixel's centre; 0 where there is no cloth
};

/// Renders meshes of one topology; keeps its buffers, so one an evaluation thread.
/// Lambertian, both sides alike, perspective correct, light from the projector falls off with the
/// cosine at the surface; no inverse square over the depth of a swatch.
class Renderer {
 public:
  Renderer(const Rig& rig, const TriangleMesh& mesh, const RenderOptions& options = {});
  ~Renderer();
  Renderer(Renderer&&) noexcept;
  const RenderedFrame& render(const Points& x);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace weft
