#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "weft/base/error.h"
#include "weft/capture/capture.h"
#include "weft/mesh/mesh_io.h"

namespace weft {
namespace {

TriangleMesh read_truth_mesh(const std::filesystem::path& path) {
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
  return mesh;
}

}  // namespace

TruthSurface read_truth(const Capture& capture) {
  if (!capture.truth) throw Error(fmt::format("capture \"{}\" has no [truth]", capture.name));
  TruthSurface truth;
  truth.mesh = read_truth_mesh(capture.truth->rest_mesh);
  const std::filesystem::path& path = capture.truth->points;
  truth.frames = read_pc2(path).frames;
  if (truth.frames.front().cols() != truth.mesh.vertex_count()) {
    throw error_at(
        {path, 0, {}},
        fmt::format("{} points; {} has {} vertices", truth.frames.front().cols(),
                    capture.truth->rest_mesh.filename().string(), truth.mesh.vertex_count()));
  }
  if (truth.frames.size() != static_cast<std::size_t>(capture.frame_count)) {
    throw error_at({path, 0, {}}, fmt::format("{} samples; the video has {} frames",
                                              truth.frames.size(), capture.frame_count));
  }
  return truth;
}

SurfaceDistance distance_to_truth(const TriangleMesh& mesh, const Points& x,
                                  const TruthSurface& truth, int frame) {
  if (frame < 0 || frame >= static_cast<int>(truth.frames.size())) {
    throw Error(fmt::format("frame {}: the true surface has frames 0 to {}", frame,
                            truth.frames.size() - 1));
  }
  const Points surface = interpolate(mesh, MaterialLocator(mesh), x, truth.mesh.material);
  const Points& expected = truth.frames[static_cast<std::size_t>(frame)];
  const Eigen::RowVectorXd distances = (surface - expected).colwise().norm();
  return {distances.mean(),
          std::sqrt(distances.squaredNorm() / static_cast<double>(distances.size())),
          distances.maxCoeff()};
}

}  // namespace weft
