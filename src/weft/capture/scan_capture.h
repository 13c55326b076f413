#pragma once
/// Shapes of a swatch at rest, scanned in three dimensions, with what hangs on its clamps
/// (Larionov et al. 2022, sections 3.1 and 3.4).
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "weft/base/error.h"
#include "weft/dynamics/clips.h"
#include "weft/mesh/triangle_mesh.h"
#include "weft/registration/nonrigid_icp.h"

namespace weft {

/// How a clamp holds what is in its region.
enum class ClampKind {
  bar,     ///< rigid and flat, in the pose that is nearest to the scan's vertices
  points,  ///< each vertex where the scan has it
};

struct ScanClamp {
  std::string name;
  ClampKind kind = ClampKind::points;
  /// (u, v), m; closed. May be a line or a point.
  MaterialRectangle region;
  /// Magnitude of the clamp's force on the cloth, N, where it was measured.
  std::optional<double> force;
  double force_noise = 0.01;  ///< N, standard deviation
  SourceLocation where;       ///< of its region in capture.toml
};

/// One shape.
struct ScanTarget {
  std::string name;
  /// OBJ with (u, v) in vt and, without `points`, the measured positions in v. Empty: a raw scan
  /// that no grid was laid on yet.
  std::filesystem::path grid;
  std::filesystem::path points;  ///< PC2 of the same vertices; or empty
  int frame = 0;                 ///< sample of `points`
  std::filesystem::path scan;    ///< the mesh or cloud that `grid` was registered to; or empty
  /// Of a raw scan: m per unit of its coordinates; CSV with points of the fabric on it, or empty;
  /// and without such points, where u and v run, about (unit vectors).
  double unit = 1;
  std::filesystem::path landmarks;
  Vec3 u_axis{1, 0, 0}, v_axis{0, 0, -1};
  std::filesystem::path weights;  ///< CSV, column weight, a row a vertex; or empty
  std::filesystem::path start;    ///< OBJ: where the simulation starts; or empty: at the scan
  double noise = 2e-4;            ///< m, standard deviation of a coordinate
  Vec3 gravity{0, 0, -9.81};      ///< m/s^2
  std::vector<ScanClamp> clamps;
};

/// A capture folder, format version 1, kind "scan" (docs/formats.md).
struct ScanCapture {
  std::filesystem::path folder;
  std::string name, description;
  double width = 0, height = 0;  ///< of the swatch, m
  double areal_density = 0;      ///< kg/m^2
  double grain_angle = 0;        ///< rad, as of a mechanical capture
  double hem_width = 0;          ///< m, as of a video capture
  std::vector<ScanTarget> targets;
  /// Notes on the true parameters; nothing here reads them.
  std::optional<std::filesystem::path> truth;
};

/// Reads and checks capture.toml: every key known, ranges, files that exist, regions on the swatch.
/// Throws Error. Opens no shape but those whose clamps are given by vertices.
ScanCapture read_scan_capture(const std::filesystem::path& folder);

/// Whether a vertex of this weight counts as measured.
inline bool counts_as_measured(double weight) { return weight >= 0.5; }

/// A target's shape: a registered grid.
struct ScanShape {
  TriangleMesh mesh;
  Points x;                     ///< m
  VecX weights;                 ///< a number a vertex, [0, 1]
  std::optional<Points> start;  ///< m
};
/// Throws Error for a target without a grid, and unless its files fit together and to the swatch:
/// (u, v) that cover it to a tenth of its longer side; at most half of the measured edges longer
/// than 3 times their length in (u, v), or shorter than a third of it; a vertex of weight above 0
/// or the force of a clamp.
ScanShape read_scan_shape(const ScanCapture& capture, const ScanTarget& target);

/// A target's scan before a grid is laid on it.
struct RawScan {
  Scan scan;  ///< its points are written
  std::vector<Landmark> landmarks;
};

/// Writes capture.toml and a grid (and start) a target, which read_scan_capture reads back. Of
/// `capture` the paths are not used, but for that of `truth`, which must be relative. `raw`, where
/// it is not empty, has a scan a target; a target whose scan has points is written as this scan, in
/// place of its shape.
void write_scan_capture(const std::filesystem::path& folder, const ScanCapture& capture,
                        const std::vector<ScanShape>& shapes, const std::vector<RawScan>& raw = {});

}  // namespace weft
