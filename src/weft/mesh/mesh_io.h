#pragma once
/// Reading and writing of meshes and mesh sequences. Every reader throws Error (with the line,
/// where there is one) for a file that is missing, cut short, or not what it says.
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "weft/mesh/triangle_mesh.h"

namespace weft {

/// What an OBJ holds that matters here. Quads and larger polygons are fanned into triangles.
struct ObjMesh {
  Points positions;
  std::vector<std::array<int, 3>> triangles;
  /// One (u, v) a vertex, where the file has `vt` for each; 2 x vertices.
  std::optional<MaterialPoints> texture;
};
ObjMesh read_obj(const std::filesystem::path& path);

/// A surface whose points are known on the fabric.
struct MaterialSurface {
  TriangleMesh mesh;
  Points x;  ///< m
};
/// From an OBJ whose `vt` are (u, v) in m, one for each vertex; faces may be wound either way
/// round.
MaterialSurface read_material_surface(const std::filesystem::path& path);

/// Writes v, vt (the material coordinates in m) and f, with `comment` as a first line. Each number
/// reads back as exactly the same double: motions that snap amplify the last digit.
void write_obj(const std::filesystem::path& path, const TriangleMesh& mesh, const Points& x,
               const std::string& comment = {});
/// Binary little-endian PLY with the material coordinates as u, v.
void write_ply(const std::filesystem::path& path, const TriangleMesh& mesh, const Points& x);

/// Frames of vertex positions in a PC2 file (POINTCACHE2, version 1, 32-bit floats).
struct PointCache {
  double start_frame = 0;
  double sample_rate = 1;  ///< frames a sample
  std::vector<Points> frames;
};
PointCache read_pc2(const std::filesystem::path& path);
void write_pc2(const std::filesystem::path& path, const PointCache& cache);

}  // namespace weft
