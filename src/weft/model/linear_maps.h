#pragma once
/// Derivatives of a ClothModel at a state as linear maps, kept element by element: what the
/// sensitivities of a motion apply to many directions at once.
#include <array>
#include <vector>

#include "weft/base/types.h"

namespace weft {

/// G = dC/dx: the gradients of all strains at one shape, three components an element.
class StrainJacobian {
 public:
  /// `strains` = G `directions`: (components x kDirections) from (3 vertices x kDirections).
  void multiply(const Directions& directions, Directions& strains) const;
  /// `forces` += G^T `factors`.
  void add_transposed(const Directions& factors, Directions& forces) const;

  /// Elements of three and of six vertices: gradient[component][vertex][coordinate]. Element e of
  /// `triangles` has the components 3 e to 3 e + 2; those of `bending` follow all of them.
  template <std::size_t kVertices>
  struct Element {
    std::array<int, kVertices> vertices;
    std::array<std::array<std::array<double, 3>, kVertices>, 3> gradient;
  };
  std::vector<Element<3>> triangles;
  std::vector<Element<6>> bending;
};

/// The derivatives of the air drag by positions and velocities at one state. The drag of a triangle
/// is shared by its vertices in equal parts, and depends on the mean of their velocities.
class DragJacobian {
 public:
  /// `forces` += df_drag/dx `directions`.
  void add_by_position(const Directions& directions, Directions& forces) const;
  /// `forces` += `factor` df_drag/dv `directions`.
  void add_by_velocity(double factor, const Directions& directions, Directions& forces) const;

  struct Element {
    std::array<int, 3> vertices;
    /// by_position[vertex] and by_velocity (the same for each vertex): of the force on each vertex.
    std::array<std::array<double, 9>, 3> by_position;  ///< rows first
    std::array<double, 9> by_velocity;
  };
  std::vector<Element> elements;
};

/// What each component of a model is made of.
struct ComponentTable {
  VecX weight;                 ///< area it stands for, m^2
  std::vector<int> stiffness;  ///< index of its stiffness in the model's table of parameters
  std::vector<int> damping;    ///< of its damping
};

}  // namespace weft
