#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "weft/dynamics/scene.h"
#include "weft/optics/render.h"

namespace weft {

/// Brown-Conrady lens distortion of the camera, in OpenCV's convention (k1, k2, k3 radial, p1, p2
/// tangential, no unit, 0 = none); frames are undistorted when they are read. It acts on normalized
/// camera coordinates; the camera matrix is taken from the projection.
struct LensDistortion {
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0;
};

/// A fixture as the capture names it: a point of the undeformed swatch and its measured path.
struct CaptureFixture {
  std::string name;
  Vec2 at;  ///< (u, v), m
  Motion motion;
};

/// Where a capture keeps the true surface. Read only by evaluation.
struct TruthFiles {
  std::filesystem::path rest_mesh;
  std::filesystem::path points;
};

/// A capture folder, format version 1, kind "video" (docs/formats.md).
struct Capture {
  std::filesystem::path folder;
  std::string name;
  std::string description;
  double width = 0, height = 0;  ///< swatch, m
  double areal_density = 0;      ///< kg/m^2
  double hem_width = 0;          ///< of the cloth that is folded over along the rim, m
  Vec3 gravity{0, 0, -9.81};
  std::filesystem::path video;  ///< file or numbered images, absolute
  double frame_rate = 0;        ///< 1/s
  int frame_count = 0;
  int fit_first = 0, fit_last = 0;  ///< inclusive
  Rig rig;
  std::optional<LensDistortion> distortion;
  std::vector<CaptureFixture> fixtures;
  /// OBJ, the surface of frame 0 as another instrument saw it; see read_start_surface.
  std::optional<std::filesystem::path> start_surface;
  std::optional<TruthFiles> truth;
};

/// Reads and checks capture.toml and the files of motion: every key known, ranges, shapes; a camera
/// and projector that see the fixtures; fixtures no further apart than the cloth can stretch (10 %
/// more than their distance on the undeformed swatch); motion at least as long as the video. Throws
/// Error. Does not open the video or start_surface, and never anything of [truth] but its paths.
Capture read_capture(const std::filesystem::path& folder);

/// Length of a stripe period in the camera image, px: on a plane that faces the camera at the depth
/// of the fixtures' mean position at time 0. What find_silhouette wants to know.
double image_stripe_period(const Capture& capture);

/// The frames first..last as grey linear images (see read_frames), undistorted. Throws Error if
/// their size differs from the capture, if the video has fewer frames, if no cloth is seen in one
/// of them, or if the stripes have a period in the image of less than 4 or more than 200 px.
std::vector<Image> read_video(const Capture& capture, int first, int last);

/// The scene to simulate frames first..last on a grid of columns x rows vertices; `start` empty
/// until the caller sets it. Throws Error if a fixture is not at a vertex of that grid.
Scene make_scene(const Capture& capture, int columns, int rows, int first, int last);

/// Positions (3 x vertices, m) of the vertices of `mesh` on the start_surface of the capture, which
/// must have one. Throws Error unless that is an OBJ with a (u, v) for each vertex, reaches the rim
/// of the swatch to 2 % of its longer side, and is at most a tenth of that side away from each
/// fixture.
Points read_start_surface(const Capture& capture, const TriangleMesh& mesh);

/// The true surface, frame by frame, where the capture has [truth]; for evaluation only.
struct TruthSurface {
  TriangleMesh mesh;
  std::vector<Points> frames;
};
TruthSurface read_truth(const Capture& capture);

/// Distances between two surfaces at the same (u, v), m: over the vertices of `truth`'s mesh.
struct SurfaceDistance {
  double mean = 0, rms = 0, max = 0;
};
SurfaceDistance distance_to_truth(const TriangleMesh& mesh, const Points& x,
                                  const TruthSurface& truth, int frame);

/// Writes a capture folder (capture.toml, motion, video or images, truth if given) that
/// read_capture reads back, without a start_surface: `frames` show their own.
struct CaptureFiles {
  std::vector<Image> frames;  ///< linear light; written as H.264 or as numbered PNG
  bool as_images = false;
  std::optional<TruthSurface> truth;
};
void write_capture(const std::filesystem::path& folder, const Capture& capture,
                   const CaptureFiles& files);

/// Synthetic sensor: shot and read noise on linear light, then 8 bits with the sRGB curve.
struct SensorNoise {
  double full_well = 9000;  ///< electrons at intensity 1
  double read_noise = 10;   ///< electrons rms
};
void add_sensor_noise(Image& linear, const SensorNoise& noise, std::uint64_t seed, int frame);

}  // namespace weft
