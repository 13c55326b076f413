#pragma once
/// Energy of the membrane and of the bends of a grid, cell by cell (cells.h), and its derivatives.
#include <vector>

#include "weft/model/cells.h"

namespace weft::detail {

class CellEnergy {
 public:
  struct Law {
    DampedStiffness stretch, shear, bend, twist;
  };
  /// Keeps references to groups and history. `history`: as in DampingRate, or null.
  CellEnergy(const std::vector<CellGroup>& groups, const Law& law, const VecX* history)
      : groups_(groups), law_(law), history_(history) {}

  double value(const Points& x) const;
  void add_gradient(const Points& x, Points& gradient) const;

  /// The damping of the drag, as ClothModel::add_drag_damping() adds it.
  struct Drag {
    const DragLaw& law;
    const Points& velocity;
    double factor;
  };
  /// The gradient and, in the same pass, the Hessian, with the damping of the drag unless `drag` is
  /// null. `columns` are those of the pattern.
  void add_hessian(const Points& x, HessianKind kind, const Drag* drag, Points& gradient,
                   SparseMatrix& hessian, const std::vector<ColumnLayout>& columns) const;

 private:
  using Vectors = std::array<Vector3<Lanes>, CellStencil::vertices>;
  Lanes history(const LaneIndices& first, int offset) const;
  MembraneTension<Lanes> membrane_history(const CellTriangle& triangle) const;
  MembraneTension<Lanes> tension(const CellTriangle& triangle,
                                 const MembraneStrains<Lanes>& c) const;
  const DampedStiffness& stiffness(std::size_t strain) const;
  std::array<HingeLaw<Lanes>, CellStencil::hinges> hinge_laws(
      const CellGroup& group, const CellAngles<Lanes>& angles) const;

  void add_triangles(const CellGroup& group, const Vectors& x, HessianKind kind, Vectors& gradient,
                     CellHessian<Lanes>& hessian) const;

  const std::vector<CellGroup>& groups_;
  Law law_;
  const VecX* history_;
};

/// Strains of the membrane and curvatures into the places of their components.
void store_cell_strains(const std::vector<CellGroup>& groups, const Points& x, VecX& strains);

}  // namespace weft::detail
