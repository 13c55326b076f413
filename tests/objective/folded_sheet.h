#pragma once
/// A folded sheet in front of a camera and a projector, and what is measured of a picture of it.
#include <numbers>

#include "optics/rigs.h"
#include "weft/objective/residuals.h"

namespace weft::testing {

/// Twice the resolution of small_rig(): 1 mm is 1 px, stripes of about 16 px.
inline Rig rig() {
  Rig rig;
  rig.width = 320;
  rig.height = 240;
  rig.camera = Pinhole(look_at({0, -1, 0}, {0, 0, 0}, 1000, {160, 120}), {0, 0, 0}, "camera");
  rig.projector =
      Pinhole(look_at({-0.2, -1.1, 0.3}, {0, 0, 0}, 1400, {300, 220}), {0, 0, 0}, "projector");
  rig.pattern.period = 20;
  return rig;
}

inline constexpr double kWidth = 0.2, kHeight = 0.16;

inline TriangleMesh swatch(int columns = 25) {
  return make_swatch(kWidth, kHeight, columns, columns);
}

/// A hanging sheet with folds that run down and to the side, and slide in its plane.
inline Points folded(const TriangleMesh& mesh, double amplitude, double sideways = 0) {
  Points x(3, mesh.vertex_count());
  for (int k = 0; k < mesh.vertex_count(); ++k) {
    const double u = mesh.material(0, k), v = mesh.material(1, k);
    const double phase = 2 * std::numbers::pi * (u / 0.11 + v / 0.3);
    x.col(k) = Vec3(u - kWidth / 2 + sideways, amplitude * std::sin(phase), kHeight / 2 - v);
  }
  return x;
}

/// Derivatives of folded() by the amplitude and by the position.
inline MatX directions(const TriangleMesh& mesh) {
  MatX d(3 * mesh.vertex_count(), 2);
  d.col(0) = flat(Points(folded(mesh, 1) - folded(mesh, 0)));
  d.col(1) = flat(Points(folded(mesh, 0, 1) - folded(mesh, 0, 0)));
  return d;
}

/// What is measured of a picture of `mesh` at `x`.
inline FrameFeatures features_of(const Points& x, double threshold = 0.003,
                                 const TriangleMesh& mesh = swatch()) {
  Renderer renderer(rig(), mesh);
  AngleMapper mapper(320, 240);
  const RenderedFrame& image = renderer.render(x);
  FrameFeatures features;
  features.angles = mapper.compute(image.intensity, image.silhouette);
  features.silhouette = image.silhouette;
  features.fold_mask = gradient_mask(features.angles, threshold);
  features.phase = stripe_phase_samples(image.intensity, image.silhouette, rig(), Vec3::Zero());
  return features;
}

}  // namespace weft::testing
