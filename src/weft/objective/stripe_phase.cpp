#include "weft/objective/stripe_phase.h"

#include <cmath>
#include <numbers>

#include "weft/registration/stripe_edges.h"

namespace weft {

std::vector<PhaseSample> stripe_phase_samples(const Image& intensity, const Mask& silhouette,
                                              const Rig& rig, const Vec3& reference) {
  const Vec3 image = rig.camera.project(reference);
  const Vec3 below = rig.camera.unproject({image.x(), image.y() + 1}, image.z());
  const double rows = rig.projector.project(below).y() - rig.projector.project(reference).y();
  const double period = rig.pattern.period / std::max(std::abs(rows), 1e-9);
  // Longer than the image: there is nothing to find, and plateaus would reach beyond it.
  if (!(period < double(intensity.rows()))) return {};
  std::vector<PhaseSample> samples;
  for (const StripeEdge& edge : find_stripe_edges(intensity, silhouette, period)) {
    const bool brightens = edge.rising == (rows > 0);
    samples.push_back({edge.column, float(edge.y), brightens ? 0.0f : std::numbers::pi_v<float>});
  }
  return samples;
}

}  // namespace weft
