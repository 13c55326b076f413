#pragma once
/// A hem: along the whole rim of a grid, the cloth of a strip counts twice, as if its edge were
/// folded over and sewn down. With the strip's width w, the second layer has the mass rho w per
/// length (kg/m), the stretch stiffness k w (N) and the flexural rigidity B w (N m^2) along the
/// rim, and the damping that goes with both. It lies on the line of the rim: it adds nothing across
/// it, to shear, or to the drag. A model that bends by hinges (hinges.h) has none on the rim, and
/// no bend of a hem.
///
/// Lattices of equal masses and springs, in which much cloth is animated, are sheets with a hem of
/// half a cell: their rim has one row of threads where a sheet has half of one.
#include <map>

#include "weft/mesh/grid_cells.h"

namespace weft::detail {

class Hem {
 public:
  /// `width` >= 0, m; 0: no hem. Throws Error for a mesh with a hem unless it is a grid with sides
  /// along weft and warp.
  Hem(const TriangleMesh& mesh, double width);

  /// Area of the second layer at the edge between two vertices, m^2, as cloth that stretches and
  /// bends along (u, v); zero unless the edge is on the rim.
  Vec2 area(int a, int b) const;
  /// The same by vertices: half of each edge's, for the mass.
  const VecX& vertex_areas() const { return vertex_areas_; }

 private:
  std::map<MeshEdge, Vec2> areas_;
  VecX vertex_areas_;
};

}  // namespace weft::detail
