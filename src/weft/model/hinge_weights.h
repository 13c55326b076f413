#pragma once
#include <vector>

#include "weft/mesh/triangle_mesh.h"

namespace weft {

/// Weights (dimensionless) of the hinges, in the order of `hinges`, such that 1/2 sum w B theta^2
/// is the bending energy of a sheet of flexural rigidity B.
VecX hinge_weights(const TriangleMesh& mesh, const std::vector<Hinge>& hinges);

}  // namespace weft
