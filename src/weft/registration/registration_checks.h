#pragma once
/// Whether a scan can be one of the swatch, and whether a registration found the swatch on it.
#include <string>
#include <vector>

#include "weft/registration/nonrigid_icp.h"

namespace weft {

/// What errors name.
struct ScanSource {
  std::string scan;       ///< the file; in a sequence with the frame
  std::string unit;       ///< what states the unit of its coordinates: "--unit"
  std::string landmarks;  ///< the file with points of the fabric on it; empty: none
};

/// Sides of the box along the axes about a scan's points, m, without the outermost hundredth of
/// them at either end of each axis: strays.
Vec3 scan_extent(const Scan& scan);

/// Throws Error for a scan whose longest side is 30 times the swatch's longer side or more, or a
/// thirtieth of it or less: its unit is another one. What stands beside the cloth may be larger.
void check_scan_extent(const Scan& scan, const GridTemplate& grid, const ScanSource& source);

/// Throws Error for a registration without a supported vertex.
void check_registration(const ScanRegistration& registration, const Scan& scan,
                        const GridTemplate& grid, const ScanSource& source);

int unsupported_vertices(const ScanRegistration& registration);

/// What makes a registration doubtful, a line each: more than a quarter of its vertices without
/// support, more than 5 % of strain (rms).
std::vector<std::string> registration_doubts(const ScanRegistration& registration);

}  // namespace weft
