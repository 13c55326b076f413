#pragma once
#include <vector>

#include "weft/mesh/triangle_mesh.h"

namespace weft {

/// Lines of a grid over [0, length], m: 0, length and each of `borders` that lies between, and
/// between neighbours of these as few equal intervals as keep each at most `spacing` wide. Borders
/// within 1e-9 m of each other or of an end are one line. Increasing; at least two. Throws Error
/// unless length and spacing are above 0 and the borders are finite.
std::vector<double> grid_lines(double length, std::vector<double> borders, double spacing);

/// Cells that are finer at one end or at both.
struct GridGrading {
  double spacing = 0;   ///< m, widest cell, > 0
  double first = 0;     ///< m, about the width of the cell at a fine end, 0 < first <= spacing
  double growth = 0.1;  ///< of the width of a cell from one to the next, > 0
  bool fine_lower = false, fine_upper = false;  ///< which ends are fine
};
/// Lines over [lower, upper], m, both included: cells of min(spacing, first + growth * distance
/// from the nearest fine end), all narrowed by one factor so that they fit. Throws Error for values
/// out of range.
std::vector<double> graded_lines(double lower, double upper, const GridGrading& grading);

/// The rectangular swatch whose grid has these lines (m, increasing, at least two each): vertex
/// row * columns + column at (u[column], v[row]), split as in make_swatch.
TriangleMesh make_swatch(const std::vector<double>& u, const std::vector<double>& v,
                         GridPattern pattern = GridPattern::alternating);

}  // namespace weft
