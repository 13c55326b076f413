#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "weft/capture/overhang.h"
#include "weft/capture/picture_frame.h"
#include "weft/dynamics/loaded_clips.h"

namespace weft {

/// What a capture.toml says it is, so that a program can choose the reader.
enum class CaptureKind { video, mechanical, scan };
/// Reads nothing but the format and the kind of the capture in `folder`. Throws Error for a folder
/// without capture.toml, another format and another kind.
CaptureKind capture_kind(const std::filesystem::path& folder);

/// A cord that pulls a clip with known forces.
struct FixtureCord {
  Vec3 at{0, 0, 0};            ///< m, in the clip's frame, from the region's centre
  std::optional<Vec3> pulley;  ///< m, where it runs to; none: `forces` have constant directions
  VecX tensions;               ///< N, one a frame, >= 0; of a cord to a pulley
  Points forces;               ///< N, 3 x frames; of one without
};

/// A clip of the experiment over all frames.
struct MechanicalFixture {
  std::string name;
  /// Where it is and what it holds, one a frame. Of a loaded clip where it was measured to be.
  std::vector<Clip> frames;
  /// Measured force of the clip on the cloth, N: 3 x frames, NaN for a component that was not
  /// measured; no columns where none was.
  Points forces;
  std::vector<FixtureCord> cords;  ///< of a loaded clip, whose `forces` have no columns
  double mass = 0;                 ///< of a loaded clip itself, kg

  /// Not held: it is where its cords, its weight and the cloth are in balance.
  bool loaded() const { return !cords.empty() || mass > 0; }
  /// None for a clip that is held.
  std::optional<ClipLoad> load(int frame) const;
};

/// How the clips are moved.
enum class ClipDrive {
  rigid,
  cords  ///< measured forces hold what cords rub on their pulleys
};

/// Where the measured shape is kept.
struct GeometryFiles {
  std::filesystem::path rest_mesh;  ///< OBJ; (u, v) of the points in its vt
  std::filesystem::path points;     ///< PC2, one sample a frame
};

inline constexpr double most_clip_noise = 0.01;  ///< m, that a capture may state

/// A capture folder, format version 1, kind "mechanical" (docs/formats.md): cloth at rest between
/// rigid clips, frame by frame, with the clips' poses and forces and, where measured, the shape.
struct MechanicalCapture {
  std::filesystem::path folder;
  std::string name;
  std::string description;
  double width = 0, height = 0;  ///< of the swatch, m
  double areal_density = 0;      ///< kg/m^2
  /// From the first material axis of the swatch to u of the fabric, counter-clockwise, rad.
  double grain_angle = 0;
  Vec3 gravity{0, 0, -9.81};  ///< m/s^2
  int frame_count = 0;
  ClipDrive drive = ClipDrive::rigid;
  /// m, standard deviation of a coordinate of a clip's position in a frame; divided by half of the
  /// clip's longer side, of a component of its rotation (rad). 0: poses count as exact.
  double clip_noise = 0;
  std::vector<MechanicalFixture> fixtures;
  /// Of a picture frame, which has one fixture. Its clip holds all of the fabric, which is not
  /// rigid then but evenly sheared (frame_threads), about the clip's position. Its force is that of
  /// the crosshead, along x.
  std::optional<PictureFrame> picture_frame;
  /// Of an overhang test, which has one fixture, whose clip ends at the edge: all frames are the
  /// strip as it overhangs by the mean of what was read, along x, under gravity along -z.
  std::optional<OverhangTest> overhang;
  std::optional<GeometryFiles> geometry;
  /// Notes on the true parameters; nothing here reads them.
  std::optional<std::filesystem::path> truth;

  /// All clips at one frame, in the order of the fixtures.
  std::vector<Clip> clips(int frame) const;
  /// Of all fixtures at one frame, in their order; none for those that are held.
  std::vector<std::optional<ClipLoad>> loads(int frame) const;
  bool has_loaded() const;
  /// m and rad: standard deviations of what is measured of a loaded clip's pose, a component of its
  /// position and of its rotation: clip_noise, or `otherwise` (m) where none is stated, and the
  /// same over half of the clip's longer side.
  Vec2 pose_deviations(const Clip& clip, double otherwise) const;
};

/// Reads and checks capture.toml and the tables that it names: every key known, ranges, shapes;
/// regions on the swatch that do not overlap, poses that are rotations, clips no further apart than
/// three times their distance on the undeformed swatch, no column that changes named twice; of
/// loaded clips no forces and one region, tensions of 0 or more, pulleys away from the clip, and
/// one clip that is held. Also reads the short form for standard tests (`test`, docs/formats.md),
/// with a cantilever's profile, whose tip must be beyond the clamp and below its line. Throws
/// Error. Does not open the shape of the general form.
MechanicalCapture read_mechanical_capture(const std::filesystem::path& folder);

/// Measured shapes: points of known (u, v), triangulated, frame by frame.
struct MeasuredGeometry {
  TriangleMesh mesh;
  std::vector<Points> frames;  ///< m, one a frame
};
/// Throws Error unless the capture has [geometry] and its files fit together and to the capture.
MeasuredGeometry read_geometry(const MechanicalCapture& capture);

}  // namespace weft
