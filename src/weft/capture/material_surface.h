#pragma once
#include <filesystem>

#include "weft/mesh/triangle_mesh.h"

namespace weft {

/// A surface whose points are known on the fabric.
struct MaterialSurface {
  TriangleMesh mesh;
  Points x;  ///< m
};

/// From an OBJ whose `vt` are (u, v) in m, one for each vertex; faces may be wound either way
/// round. Throws Error.
MaterialSurface read_material_surface(const std::filesystem::path& path);

}  // namespace weft
