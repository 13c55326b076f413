#include "weft/mesh/annulus.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "weft/base/error.h"

namespace weft {

TriangleMesh make_annulus(const std::vector<double>& radii, int sectors, GridPattern pattern) {
  if (radii.size() < 2 || !(radii.front() > 0))
    throw Error("annulus: two radii above 0 are needed");
  for (std::size_t i = 1; i < radii.size(); ++i)
    if (!(radii[i] > radii[i - 1]) || !std::isfinite(radii[i]))
      throw Error(fmt::format("annulus: radius {:g} does not follow {:g}", radii[i], radii[i - 1]));
  if (sectors < 6 || (pattern == GridPattern::alternating && sectors % 2 != 0))
    throw Error(
        fmt::format("annulus: {} sectors; at least 6, and an even number where diagonals "
                    "alternate",
                    sectors));
  const int rings = static_cast<int>(radii.size());
  TriangleMesh mesh;
  mesh.material.resize(2, static_cast<Eigen::Index>(rings) * sectors);
  for (int ring = 0; ring < rings; ++ring)
    for (int sector = 0; sector < sectors; ++sector) {
      const double angle = 2 * std::numbers::pi * sector / sectors;
      mesh.material.col(ring * sectors + sector) =
          radii[static_cast<std::size_t>(ring)] * Vec2(std::cos(angle), std::sin(angle));
    }
  for (int ring = 0; ring + 1 < rings; ++ring)
    for (int sector = 0; sector < sectors; ++sector) {
      const int next = (sector + 1) % sectors;
      const int a = ring * sectors + sector, b = a + sectors;
      const int c = (ring + 1) * sectors + next, d = ring * sectors + next;
      if (pattern == GridPattern::alternating && (ring + sector) % 2 != 0) {
        mesh.triangles.push_back({a, b, d});
        mesh.triangles.push_back({b, c, d});
      } else {
        mesh.triangles.push_back({a, b, c});
        mesh.triangles.push_back({a, c, d});
      }
    }
  return mesh;
}

}  // namespace weft
