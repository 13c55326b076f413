#pragma once
#include <vector>

#include "weft/mesh/triangle_mesh.h"

namespace weft {

/// Lines of a grid over [0, length], m: 0, length and each of `borders` that lies between, and
/// between neighbours of these as few equal intervals as keep each at most `spacing` wide. Borders
/// within 1e-9 m of each other or of an end are one line. Increasing; at least two. Throws Error
/// unless length and spacing are above 0 and the borders are finite.
std::vector<double> grid_lines(double length, std::vector<double> borders, double spacing);

/// The rectangular swatch whose grid has these lines (m, increasing, at least two each): vertex
/// row * columns + column at (u[column], v[row]), split as in make_swatch.
TriangleMesh make_swatch(const std::vector<double>& u, const std::vector<double>& v,
                         GridPattern pattern = GridPattern::alternating);

}  // namespace weft
