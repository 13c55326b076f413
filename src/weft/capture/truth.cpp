#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "weft/base/error.h"
#include "weft/capture/capture.h"
#include "weft/mesh/mesh_io.h"

namespace weft {
TruthSurface read_truth(const Capture& capture) {
  if (!capture.truth) throw Error(fmt::format("capture \"{}\" has no [truth]", capture.name));
  TruthSurface truth;
  truth.mesh = read_material_surface(capture.truth->rest_mesh).mesh;
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
