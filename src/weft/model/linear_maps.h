#pragma once
/// Derivatives of a ClothModel at a state as linear maps, kept element by element: what the
/// sensitivities of a motion apply to many directions at once.
#include <array>
#include <vector>

#include "weft/base/types.h"
#include "weft/strain/lanes.h"

namespace weft {

/// One row of Directions: what belongs to an entry, by parameter.
using DirectionsRow = Eigen::Array<double, 1, kDirections>;

/// Row `index`: 3 vertex + coordinate, or a component.
inline Eigen::Map<const DirectionsRow, Eigen::Aligned16> row_of(const Directions& m, int index) {
  return Eigen::Map<const DirectionsRow, Eigen::Aligned16>(m.data() +
                                                           std::ptrdiff_t{kDirections} * index);
}
inline Eigen::Map<DirectionsRow, Eigen::Aligned16> row_of(Directions& m, int index) {
  return Eigen::Map<DirectionsRow, Eigen::Aligned16>(m.data() +
                                                     std::ptrdiff_t{kDirections} * index);
}

/// G = dC/dx: the gradients of all strains at one shape, three components an element.
class StrainJacobian {
 public:
  /// `strains` = G `directions`: (components x kDirections) from (3 vertices x kDirections).
  void multiply(const Directions& directions, Directions& strains) const;
  /// `forces` += G^T `factors`.
  void add_transposed(const Directions& factors, Directions& forces) const;
  /// The same, with the row of factors of each component from `factor(component)`.
  template <class Factor>
  void add_transposed_rows(const Factor& factor, Directions& forces) const;

  /// kLanes elements, the first `count` of which are in use.
  template <std::size_t kVertices>
  struct Group {
    int count;
    std::array<std::array<int, kLanes>, kVertices> vertices;
    std::array<std::array<Vector3<Lanes>, kVertices>, 3> gradient;  ///< [component][vertex]
  };
  /// Element e of `triangles` has the components 3 e to 3 e + 2; those of `diagonals` follow all of
  /// them, then those of `bending`.
  std::vector<Group<3>> triangles;
  std::vector<Group<4>> diagonals;
  std::vector<Group<6>> bending;

 private:
  /// Calls `visit` with each group and its first component; how many components there are.
  template <class Visit>
  int for_each_group(const Visit& visit) const;
  template <std::size_t kVertices, class Factor>
  static void add_transposed_rows(const Group<kVertices>& group, int first, const Factor& factor,
                                  Directions& forces);
};

template <std::size_t kVertices, class Factor>
void StrainJacobian::add_transposed_rows(const Group<kVertices>& group, int first,
                                         const Factor& factor, Directions& forces) {
  const auto& g = group.gradient;
  for (int lane = 0; lane < group.count; ++lane, first += 3) {
    const DirectionsRow c0 = factor(first), c1 = factor(first + 1), c2 = factor(first + 2);
    for (std::size_t v = 0; v < kVertices; ++v) {
      const int row = 3 * group.vertices[v][static_cast<std::size_t>(lane)];
      row_of(forces, row) += g[0][v].x[lane] * c0 + g[1][v].x[lane] * c1 + g[2][v].x[lane] * c2;
      row_of(forces, row + 1) += g[0][v].y[lane] * c0 + g[1][v].y[lane] * c1 + g[2][v].y[lane] * c2;
      row_of(forces, row + 2) += g[0][v].z[lane] * c0 + g[1][v].z[lane] * c1 + g[2][v].z[lane] * c2;
    }
  }
}

template <class Visit>
int StrainJacobian::for_each_group(const Visit& visit) const {
  int first = 0;
  const auto each = [&](const auto& groups) {
    for (const auto& group : groups) {
      visit(group, first);
      first += 3 * group.count;
    }
  };
  each(triangles);
  each(diagonals);
  each(bending);
  return first;
}

template <class Factor>
void StrainJacobian::add_transposed_rows(const Factor& factor, Directions& forces) const {
  for_each_group(
      [&](const auto& group, int first) { add_transposed_rows(group, first, factor, forces); });
}

/// The derivatives of the air drag by positions and velocities at one state. The drag of a triangle
/// is shared by its vertices, and depends on the mean of their velocities, both by their shares of
/// its area.
class DragJacobian {
 public:
  /// `forces` += df_drag/dx `directions`.
  void add_by_position(const Directions& directions, Directions& forces) const;
  /// `forces` += `factor` df_drag/dv `directions`.
  void add_by_velocity(double factor, const Directions& directions, Directions& forces) const;

  /// kLanes triangles, the first `count` of which are in use.
  struct Group {
    int count;
    std::array<std::array<int, kLanes>, 3> vertices;
    std::array<Lanes, 3> shares;  ///< of the vertices
    /// Of the drag of the whole triangle, by the position of each vertex and by the mean velocity.
    std::array<Matrix3<Lanes>, 3> by_position;
    Matrix3<Lanes> by_velocity;
  };
  std::vector<Group> groups;
};

/// What each component of a model is made of.
struct ComponentTable {
  VecX weight;                 ///< area it stands for, m^2
  std::vector<int> stiffness;  ///< index of its stiffness in the model's table of parameters
  std::vector<int> damping;    ///< of its damping
};

}  // namespace weft
