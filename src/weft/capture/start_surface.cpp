#include <fmt/format.h>

#include <algorithm>

#include "weft/base/error.h"
#include "weft/capture/capture.h"
#include "weft/capture/material_cover.h"
#include "weft/mesh/mesh_io.h"

namespace weft {
namespace {

constexpr double kFixtureSlack = 0.1;  // of the longer side

void check_is_at_the_fixtures(const MaterialSurface& surface, const MaterialLocator& locator,
                              const Capture& capture, double side) {
  for (const CaptureFixture& fixture : capture.fixtures) {
    const Vec3 there = interpolate(surface.mesh, locator, surface.x, MaterialPoints(fixture.at));
    const double distance = (there - fixture.motion.position(0)).norm();
    if (!(distance <= kFixtureSlack * side))
      throw error_at({*capture.start_surface, 0, "v"},
                     fmt::format("{:.3g} m from the fixture \"{}\" at frame 0; valid: up to {:g} m "
                                 "(in m, in the axes of the fixtures)",
                                 distance, fixture.name, kFixtureSlack * side));
  }
}

}  // namespace

Points read_start_surface(const Capture& capture, const TriangleMesh& mesh) {
  if (!capture.start_surface)
    throw Error(fmt::format("capture \"{}\" has no start_surface", capture.name));
  const MaterialSurface surface = read_material_surface(*capture.start_surface);
  const MaterialLocator locator(surface.mesh);
  const double side = std::max(capture.width, capture.height);
  check_covers_swatch(surface.mesh, capture.width, capture.height, *capture.start_surface);
  check_is_at_the_fixtures(surface, locator, capture, side);
  // The mesh itself, as a fit wrote it: to the last digit.
  if (surface.mesh.material.cols() == mesh.material.cols() &&
      surface.mesh.material == mesh.material)
    return surface.x;
  return interpolate(surface.mesh, locator, surface.x, mesh.material);
}

}  // namespace weft
