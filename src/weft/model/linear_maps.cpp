#include "weft/model/linear_maps.h"

namespace weft {
namespace {

using Row = Eigen::Array<double, kDirections, 1>;

/// Row 3 vertex + coordinate of a RowMajor matrix.
Eigen::Map<const Row, Eigen::Aligned16> row(const Directions& m, int index) {
  return Eigen::Map<const Row, Eigen::Aligned16>(m.data() + std::ptrdiff_t{kDirections} * index);
}
Eigen::Map<Row, Eigen::Aligned16> row(Directions& m, int index) {
  return Eigen::Map<Row, Eigen::Aligned16>(m.data() + std::ptrdiff_t{kDirections} * index);
}

template <std::size_t kVertices>
void multiply(const StrainJacobian::Element<kVertices>& element, const Directions& directions,
              int first, Directions& strains) {
  Row c0 = Row::Zero(), c1 = Row::Zero(), c2 = Row::Zero();
  const auto& g = element.gradient;
  for (std::size_t v = 0; v < kVertices; ++v) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Row d = row(directions, 3 * element.vertices[v] + static_cast<int>(k));
      c0 += g[0][v][k] * d;
      c1 += g[1][v][k] * d;
      c2 += g[2][v][k] * d;
    }
  }
  row(strains, first) = c0;
  row(strains, first + 1) = c1;
  row(strains, first + 2) = c2;
}

template <std::size_t kVertices>
void add_transposed(const StrainJacobian::Element<kVertices>& element, const Directions& factors,
                    int first, Directions& forces) {
  const Row c0 = row(factors, first), c1 = row(factors, first + 1), c2 = row(factors, first + 2);
  const auto& g = element.gradient;
  for (std::size_t v = 0; v < kVertices; ++v) {
    for (std::size_t k = 0; k < 3; ++k)
      row(forces, 3 * element.vertices[v] + static_cast<int>(k)) +=
          g[0][v][k] * c0 + g[1][v][k] * c1 + g[2][v][k] * c2;
  }
}

/// sum += m d, with d the three rows of a vertex.
void add_product(const std::array<double, 9>& m, const Directions& directions, int vertex,
                 std::array<Row, 3>& sum) {
  for (std::size_t k = 0; k < 3; ++k) {
    const Row d = row(directions, 3 * vertex + static_cast<int>(k));
    for (std::size_t i = 0; i < 3; ++i) sum[i] += m[3 * i + k] * d;
  }
}

void add_to_vertices(const DragJacobian::Element& element, double factor,
                     const std::array<Row, 3>& share, Directions& forces) {
  for (const int vertex : element.vertices)
    for (std::size_t i = 0; i < 3; ++i)
      row(forces, 3 * vertex + static_cast<int>(i)) += factor * share[i];
}

}  // namespace

void StrainJacobian::multiply(const Directions& directions, Directions& strains) const {
  strains.resize(static_cast<Eigen::Index>(3 * (triangles.size() + bending.size())), kDirections);
  int first = 0;
  for (const auto& element : triangles) {
    weft::multiply(element, directions, first, strains);
    first += 3;
  }
  for (const auto& element : bending) {
    weft::multiply(element, directions, first, strains);
    first += 3;
  }
}

void StrainJacobian::add_transposed(const Directions& factors, Directions& forces) const {
  int first = 0;
  for (const auto& element : triangles) {
    weft::add_transposed(element, factors, first, forces);
    first += 3;
  }
  for (const auto& element : bending) {
    weft::add_transposed(element, factors, first, forces);
    first += 3;
  }
}

void DragJacobian::add_by_position(const Directions& directions, Directions& forces) const {
  for (const Element& element : elements) {
    std::array<Row, 3> share{Row::Zero(), Row::Zero(), Row::Zero()};
    for (std::size_t v = 0; v < 3; ++v)
      add_product(element.by_position[v], directions, element.vertices[v], share);
    add_to_vertices(element, 1, share, forces);
  }
}

void DragJacobian::add_by_velocity(double factor, const Directions& directions,
                                   Directions& forces) const {
  for (const Element& element : elements) {
    std::array<Row, 3> share{Row::Zero(), Row::Zero(), Row::Zero()};
    for (const int vertex : element.vertices)
      add_product(element.by_velocity, directions, vertex, share);
    add_to_vertices(element, factor, share, forces);
  }
}

}  // namespace weft
