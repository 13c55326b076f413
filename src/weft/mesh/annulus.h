#pragma once
#include <vector>

#include "weft/mesh/triangle_mesh.h"

namespace weft {

/// A ring-shaped piece of fabric: circles of vertices with `radii` (m, increasing, above 0, at
/// least two) about (u, v) = 0, `sectors` vertices on each, from +u counter-clockwise. Vertex ring
/// * sectors + sector. The quads between two circles are split as in make_swatch. Throws Error for
/// radii out of order, fewer than 6 sectors, and an odd number of them with
/// GridPattern::alternating.
TriangleMesh make_annulus(const std::vector<double>& radii, int sectors,
                          GridPattern pattern = GridPattern::alternating);

}  // namespace weft
