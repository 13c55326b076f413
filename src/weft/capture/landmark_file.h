#pragma once
#include <filesystem>
#include <vector>

#include "weft/registration/nonrigid_icp.h"

namespace weft {

/// Points of the fabric on a scan: a CSV with u_m, v_m, x_m, y_m, z_m and perhaps weight, >= 0, 1
/// without. Throws Error for a file that is none, and for a point off the swatch.
std::vector<Landmark> read_landmarks(const std::filesystem::path& path, const GridTemplate& swatch);
/// Writes what read_landmarks reads back.
void write_landmarks(const std::filesystem::path& path, const std::vector<Landmark>& landmarks);

}  // namespace weft
