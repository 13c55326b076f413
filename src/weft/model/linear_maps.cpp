#include "weft/model/linear_maps.h"

namespace weft {
namespace {

template <std::size_t kVertices>
void multiply(const StrainJacobian::Group<kVertices>& group, const Directions& directions,
              int first, Directions& strains) {
  const auto& g = group.gradient;
  for (int lane = 0; lane < group.count; ++lane, first += 3) {
    DirectionsRow c[3] = {DirectionsRow::Zero(), DirectionsRow::Zero(), DirectionsRow::Zero()};
    for (std::size_t v = 0; v < kVertices; ++v) {
      const int row = 3 * group.vertices[v][static_cast<std::size_t>(lane)];
      const DirectionsRow x = row_of(directions, row), y = row_of(directions, row + 1),
                          z = row_of(directions, row + 2);
      for (std::size_t k = 0; k < 3; ++k)
        c[k] += g[k][v].x[lane] * x + g[k][v].y[lane] * y + g[k][v].z[lane] * z;
    }
    for (int k = 0; k < 3; ++k) row_of(strains, first + k) = c[k];
  }
}

/// sum += m d, with d the three rows of a vertex.
void add_product(const Matrix3<Lanes>& m, int lane, const Directions& directions, int vertex,
                 std::array<DirectionsRow, 3>& sum) {
  const DirectionsRow x = row_of(directions, 3 * vertex), y = row_of(directions, 3 * vertex + 1),
                      z = row_of(directions, 3 * vertex + 2);
  for (std::size_t i = 0; i < 3; ++i)
    sum[i] += m.m[3 * i][lane] * x + m.m[3 * i + 1][lane] * y + m.m[3 * i + 2][lane] * z;
}

void add_to_vertices(const DragJacobian::Group& group, int lane, double factor,
                     const std::array<DirectionsRow, 3>& force, Directions& forces) {
  for (std::size_t v = 0; v < 3; ++v) {
    const int vertex = group.vertices[v][static_cast<std::size_t>(lane)];
    const double share = factor * group.shares[v][lane];
    for (int i = 0; i < 3; ++i)
      row_of(forces, 3 * vertex + i) += share * force[static_cast<std::size_t>(i)];
  }
}

}  // namespace

void StrainJacobian::multiply(const Directions& directions, Directions& strains) const {
  const int components = for_each_group([](const auto&, int) {});
  strains.resize(components, kDirections);
  for_each_group(
      [&](const auto& group, int first) { weft::multiply(group, directions, first, strains); });
}

void StrainJacobian::add_transposed(const Directions& factors, Directions& forces) const {
  add_transposed_rows([&](int component) { return row_of(factors, component); }, forces);
}

void DragJacobian::add_by_position(const Directions& directions, Directions& forces) const {
  for (const Group& group : groups)
    for (int lane = 0; lane < group.count; ++lane) {
      const auto l = static_cast<std::size_t>(lane);
      std::array<DirectionsRow, 3> force{DirectionsRow::Zero(), DirectionsRow::Zero(),
                                         DirectionsRow::Zero()};
      for (std::size_t v = 0; v < 3; ++v)
        add_product(group.by_position[v], lane, directions, group.vertices[v][l], force);
      add_to_vertices(group, lane, 1, force, forces);
    }
}

void DragJacobian::add_by_velocity(double factor, const Directions& directions,
                                   Directions& forces) const {
  for (const Group& group : groups)
    for (int lane = 0; lane < group.count; ++lane) {
      const auto l = static_cast<std::size_t>(lane);
      std::array<DirectionsRow, 3> mean;
      for (std::size_t i = 0; i < 3; ++i) {
        const auto of_vertex = [&](std::size_t v) {
          return group.shares[v][lane] *
                 row_of(directions, 3 * group.vertices[v][l] + static_cast<int>(i));
        };
        mean[i] = of_vertex(0) + of_vertex(1) + of_vertex(2);
      }
      std::array<DirectionsRow, 3> force;
      for (std::size_t i = 0; i < 3; ++i)
        force[i] = group.by_velocity.m[3 * i][lane] * mean[0] +
                   group.by_velocity.m[3 * i + 1][lane] * mean[1] +
                   group.by_velocity.m[3 * i + 2][lane] * mean[2];
      add_to_vertices(group, lane, factor, force, forces);
    }
}

}  // namespace weft
