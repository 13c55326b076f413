#pragma once
/// Scans: measured surfaces as points, with what belongs to each.
#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "weft/base/types.h"

namespace weft {

/// A picture on a mesh, as photogrammetry makes it.
struct ScanTexture {
  int width = 0, height = 0;  ///< px
  Eigen::Matrix3Xf pixels;  ///< row by row from the top: red, green, blue, 0 to 1 as stored (sRGB)
  /// (s, t) of each triangle's corners: s to the right, t upwards, the picture is [0, 1] x [0, 1].
  std::vector<std::array<Vec2, 3>> corners;

  /// Bilinear; repeated beyond the picture.
  Eigen::Vector3f at(const Vec2& st) const;
};

/// A measured surface. `triangles` is empty for a cloud; `colour` where the file has none.
struct Scan {
  Points position;          ///< 3 x n, m
  Eigen::Matrix3Xf colour;  ///< 3 x n or empty; red, green, blue, 0 to 1 as stored (sRGB)
  std::vector<std::array<int, 3>> triangles;
  std::optional<ScanTexture> texture;

  int size() const { return static_cast<int>(position.cols()); }
};

/// Reads a scan by its ending (docs/formats.md): `.ply` (ascii or binary, vertices with x, y, z and
/// perhaps red, green, blue; faces are fanned into triangles), `.obj` (with r g b behind x y z, or
/// the picture that its material names as map_Kd, if any), or a list of points, `.xyz`,
/// `.txt`, `.pts` or `.csv` (three numbers a line, or six with the colour, 0 to 255 or 0 to 1;
/// lines that begin with # are skipped; a header with x, y and z, and perhaps r, g and b, says
/// which columns these are). Positions are multiplied by `unit`, m. Throws Error for a file that
/// cannot be read, of another ending, cut short or longer than its header says, with a number that
/// is not finite, or without points; for a `.csv` whose header names no x, y and z.
Scan read_scan(const std::filesystem::path& path, double unit = 1);

/// Several scans in the order of time: a folder (files of one ending that read_scan knows, in the
/// order of their names), a `.pcseq` file (32-bit count of frames, then for each frame a 32-bit
/// count of points and three 16-bit integers a point, little-endian), or a `.csv` with columns
/// frame, x, y, z (frames 0, 1, 2 ... in order). Anything else is one scan. Throws Error as
/// read_scan does.
std::vector<Scan> read_scans(const std::filesystem::path& path, double unit = 1);

/// A mesh as points no further apart than about `spacing`, m: its vertices, and points inside of
/// triangles that are larger. Colours are interpolated, or looked up in the texture. A cloud is
/// returned as it is. Throws Error for a mesh of which that makes more than 20 million points.
Scan sample_scan(const Scan& scan, double spacing);

/// What registration needs to know about each point.
struct ScanGeometry {
  Points normal;  ///< 3 x n, unit, of arbitrary sign: the plane of the nearest points
  VecX spacing;   ///< m, radius of a disc that holds one point on average
  /// n flags: 0 where the neighbours are much further than is usual in the scan, or lie on no
  /// surface.
  std::vector<char> on_surface;
};

/// Planes through the `neighbours` nearest points of each point (Hoppe et al. 1992). A point is on
/// no surface if its spacing is more than 4 times the median, or its neighbourhood is thicker than
/// 0.6 of its width.
ScanGeometry scan_geometry(const Scan& scan, int neighbours = 16, int threads = 0);

}  // namespace weft
