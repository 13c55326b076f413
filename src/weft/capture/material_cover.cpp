#include "weft/capture/material_cover.h"

#include <fmt/format.h>

#include <algorithm>

#include "weft/base/error.h"

namespace weft {

void check_on_swatch(const TriangleMesh& mesh, double width, double height,
                     const std::filesystem::path& file) {
  const Vec2 lower = mesh.material.rowwise().minCoeff(), upper = mesh.material.rowwise().maxCoeff();
  if (lower.minCoeff() >= -kOnSwatch && upper.x() <= width + kOnSwatch &&
      upper.y() <= height + kOnSwatch)
    return;
  throw error_at({file, 0, "vt"},
                 fmt::format("(u, v) from ({:g}, {:g}) to ({:g}, {:g}) m; the swatch is {:g} x "
                             "{:g} m",
                             lower.x(), lower.y(), upper.x(), upper.y(), width, height));
}

void check_covers_swatch(const TriangleMesh& mesh, double width, double height,
                         const std::filesystem::path& file, double slack) {
  const Vec2 lower = mesh.material.rowwise().minCoeff(), upper = mesh.material.rowwise().maxCoeff();
  const Vec2 size(width, height);
  const double most = slack * size.maxCoeff();
  if (lower.cwiseAbs().maxCoeff() <= most && (upper - size).cwiseAbs().maxCoeff() <= most) return;
  throw error_at({file, 0, "vt"},
                 fmt::format("(u, v) from ({:g}, {:g}) to ({:g}, {:g}); the swatch is from (0, 0) "
                             "to ({:g}, {:g}) m",
                             lower.x(), lower.y(), upper.x(), upper.y(), size.x(), size.y()));
}

}  // namespace weft
