#pragma once
#include <filesystem>

#include "weft/mesh/triangle_mesh.h"

namespace weft {

/// How far a region or a point on the swatch may lie beyond its border, for rounding, m.
inline constexpr double kOnSwatch = 1e-6;

/// Throws Error, for the `vt` of `file`, unless the (u, v) of the mesh are on the swatch from (0,
/// 0) to (width, height), m, but for kOnSwatch.
void check_on_swatch(const TriangleMesh& mesh, double width, double height,
                     const std::filesystem::path& file);

/// Throws Error, for the `vt` of `file`, unless the (u, v) of the mesh reach from (0, 0) to (width,
/// height), m, each to `slack` of the longer side.
void check_covers_swatch(const TriangleMesh& mesh, double width, double height,
                         const std::filesystem::path& file, double slack = 0.02);

}  // namespace weft
