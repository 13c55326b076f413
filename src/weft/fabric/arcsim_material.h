#pragma once
#include <filesystem>

#include "weft/fabric/fabric.h"

namespace weft {

/// Reads a material in the JSON format of the simulator ARCSim, in which the measurements of Wang,
/// O'Brien and Ramamoorthi 2011 are published: `density` (kg/m^2), `stretching` (six rows of four
/// numbers, N/m: at rest, then at 0, 22.5, 45, 67.5 and 90 degrees) and `bending` (three rows of
/// five, N m: 0, 45 and 90 degrees). Lines of comment are allowed. The numbers are taken as they
/// stand (that simulator doubles those of stretching). The result is of model "piecewise-linear",
/// named as the file. Throws Error, with file and key, for anything else.
Fabric read_arcsim_material(const std::filesystem::path& path);

}  // namespace weft
