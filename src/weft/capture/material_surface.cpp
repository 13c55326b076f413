#include "weft/capture/material_surface.h"

#include <utility>

#include "weft/base/error.h"
#include "weft/mesh/mesh_io.h"

namespace weft {

MaterialSurface read_material_surface(const std::filesystem::path& path) {
  ObjMesh obj = read_obj(path);
  if (!obj.texture) {
    throw error_at({path, 0, "vt"}, "each vertex needs one vt: its (u, v) in m");
  }
  TriangleMesh mesh{std::move(*obj.texture), std::move(obj.triangles)};
  // Programs that write OBJ with v upwards wind their faces the other way round.
  for (int t = 0; t < mesh.triangle_count(); ++t) {
    auto& triangle = mesh.triangles[static_cast<std::size_t>(t)];
    if (material_area(mesh, t) < 0) std::swap(triangle[1], triangle[2]);
  }
  validate(mesh, path.string());
  return {std::move(mesh), std::move(obj.positions)};
}

}  // namespace weft
