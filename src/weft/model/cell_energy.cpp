#include "weft/model/cell_energy.h"

namespace weft::detail {
namespace {

using CellVectors = std::array<Vector3<Lanes>, CellStencil::vertices>;

MembraneStrains<Lanes> strains_in_cell(const CellTriangle& triangle,
                                       const std::array<std::size_t, 3>& corners,
                                       const CellVectors& x) {
  return membrane_strains(triangle.shape, x[corners[0]], x[corners[1]], x[corners[2]]);
}

std::array<Lanes, CellStencil::hinges> angle_values(const CellVectors& x) {
  std::array<Lanes, CellStencil::hinges> out;
  for (std::size_t j = 0; j < out.size(); ++j) {
    const auto v = CellStencil::hinge(j);
    out[j] = dihedral_angle_value(x[v[0]], x[v[1]], x[v[2]], x[v[3]]);
  }
  return out;
}

void add(const Vector3<Lanes>& a, Vector3<Lanes>& to) { to = to + a; }

void add_membrane_gradient(const CellTriangle& triangle, const std::array<std::size_t, 3>& corners,
                           const MembraneGradient<Lanes>& g, CellVectors& to) {
  const auto& s = triangle.shape;
  const Vector3<Lanes> g1 = (s.area * s.du1) * g.u + (s.area * s.dv1) * g.v;
  const Vector3<Lanes> g2 = (s.area * s.du2) * g.u + (s.area * s.dv2) * g.v;
  add(-(g1 + g2), to[corners[0]]);
  add(g1, to[corners[1]]);
  add(g2, to[corners[2]]);
}

CellVectors bend_gradient(const CellAngles<Lanes>& angles,
                          const std::array<HingeLaw<Lanes>, CellStencil::hinges>& laws) {
  CellVectors out{};
  for (std::size_t j = 0; j < CellStencil::hinges; ++j) {
    const auto v = CellStencil::hinge(j);
    const auto g = angles[j].gradient();
    for (std::size_t i = 0; i < 4; ++i) add(laws[j].moment * g[i], out[v[i]]);
  }
  return out;
}

void add(const SymmetricMatrix3<Lanes>& block, std::size_t vertex, CellHessian<Lanes>& to) {
  to.diagonal[vertex] = to.diagonal[vertex] + block;
}
void add(const Matrix3<Lanes>& block, std::size_t row, std::size_t column, CellHessian<Lanes>& to) {
  if (row > column)
    add_to(to.lower[CellStencil::pair_index(row, column)], block);
  else
    add_transposed(to.lower[CellStencil::pair_index(column, row)], block);
}

void add_triangle(const TriangleHessian<Lanes>& h, const std::array<std::size_t, 3>& corners,
                  CellHessian<Lanes>& to) {
  add(h.b00, corners[0], to);
  add(h.b11, corners[1], to);
  add(h.b22, corners[2], to);
  add(h.b10, corners[1], corners[0], to);
  add(h.b20, corners[2], corners[0], to);
  add(h.b21, corners[2], corners[1], to);
}

std::array<Vector3<Lanes>, 4> gather_corners(const CellGroup& group, const Points& points) {
  std::array<Vector3<Lanes>, 4> out;
  for (std::size_t i = 0; i < 4; ++i) out[i] = gather(points.data(), group.vertices[i]);
  return out;
}

void add_drag_damping(const CellEnergy::Drag& drag, const CellGroup& group, const CellVectors& x,
                      CellHessian<Lanes>& to) {
  const auto v = gather_corners(group, drag.velocity);
  const auto all_corners = cell_corners(group.splits_02);
  for (std::size_t t = 0; t < 2; ++t) {
    const auto& corners = all_corners[t];
    const auto& shares = group.triangles[t].shares;
    const Vector3<Lanes> n = unit_normal(x[corners[0]], x[corners[1]], x[corners[2]]);
    const Vector3<Lanes> mean =
        shares[0] * v[corners[0]] + shares[1] * v[corners[1]] + shares[2] * v[corners[2]];
    const SymmetricMatrix3<Lanes> block =
        (drag.factor * group.triangles[t].shape.area) * drag.law.damping(dot(mean, n), n);
    for (std::size_t i = 0; i < 3; ++i) {
      add((shares[i] * shares[i]) * block, corners[i], to);
      for (std::size_t j = 0; j < i; ++j)
        add(((shares[i] * shares[j]) * block).full(), corners[i], corners[j], to);
    }
  }
}

}  // namespace

Lanes CellEnergy::history(const LaneIndices& first, int offset) const {
  Lanes out{};
  if (history_)
    for (int lane = 0; lane < kLanes; ++lane) out[lane] = (*history_)[first[at(lane)] + offset];
  return out;
}

MembraneTension<Lanes> CellEnergy::membrane_history(const CellTriangle& triangle) const {
  return {history(triangle.components, 0), history(triangle.components, 1),
          history(triangle.components, 2)};
}

MembraneTension<Lanes> CellEnergy::tension(const CellTriangle& triangle,
                                           const MembraneStrains<Lanes>& c) const {
  const auto h = membrane_history(triangle);
  return {triangle.u_layers * law_.stretch.tension(c.u.value, h.u),
          triangle.v_layers * law_.stretch.tension(c.v.value, h.v),
          law_.shear.tension(c.shear, h.s)};
}

const DampedStiffness& CellEnergy::stiffness(std::size_t strain) const {
  return CellBends::hinge[strain] == CellStencil::diagonal ? law_.twist : law_.bend;
}

std::array<HingeLaw<Lanes>, CellStencil::hinges> CellEnergy::hinge_laws(
    const CellGroup& group, const CellAngles<Lanes>& angles) const {
  std::array<HingeLaw<Lanes>, CellStencil::hinges> laws{};
  for (std::size_t s = 0; s < CellBends::strains; ++s) {
    const std::size_t j = CellBends::hinge[s];
    const Lanes factor = group.factors[j], scale = group.areas[s] * factor;
    const Lanes h = history(group.components[s], 0);
    laws[j].moment += scale * stiffness(s).tension(Lanes(factor * angles[j].value), h);
    laws[j].stiffness += scale * factor * stiffness(s).total();
  }
  return laws;
}

double CellEnergy::value(const Points& x) const {
  Lanes sum{};
  for (const CellGroup& group : groups_) {
    const CellVectors p = gather(x.data(), group.vertices);
    const auto corners = cell_corners(group.splits_02);
    for (std::size_t t = 0; t < 2; ++t) {
      const CellTriangle& triangle = group.triangles[t];
      const auto c = strains_in_cell(triangle, corners[t], p);
      const auto h = membrane_history(triangle);
      sum += triangle.shape.area * (triangle.u_layers * law_.stretch.energy(c.u.value, h.u) +
                                    triangle.v_layers * law_.stretch.energy(c.v.value, h.v) +
                                    law_.shear.energy(c.shear, h.s));
    }
    const auto angles = angle_values(p);
    for (std::size_t s = 0; s < CellBends::strains; ++s) {
      const std::size_t j = CellBends::hinge[s];
      const Lanes curvature = group.factors[j] * angles[j];
      sum += group.areas[s] * stiffness(s).energy(curvature, history(group.components[s], 0));
    }
  }
  return sum_lanes(sum);
}

void CellEnergy::add_gradient(const Points& x, Points& gradient) const {
  for (const CellGroup& group : groups_) {
    const CellVectors p = gather(x.data(), group.vertices);
    const auto angles = cell_angles(p);
    CellVectors g = bend_gradient(angles, hinge_laws(group, angles));
    const auto corners = cell_corners(group.splits_02);
    for (std::size_t t = 0; t < 2; ++t) {
      const CellTriangle& triangle = group.triangles[t];
      const auto c = strains_in_cell(triangle, corners[t], p);
      add_membrane_gradient(triangle, corners[t], membrane_gradient(c, tension(triangle, c)), g);
    }
    scatter_add(g, group.vertices, gradient.data());
  }
}

void CellEnergy::add_triangles(const CellGroup& group, const Vectors& x, HessianKind kind,
                               Vectors& gradient, CellHessian<Lanes>& hessian) const {
  const auto corners = cell_corners(group.splits_02);
  for (std::size_t t = 0; t < 2; ++t) {
    const CellTriangle& triangle = group.triangles[t];
    const auto c = strains_in_cell(triangle, corners[t], x);
    const auto n = tension(triangle, c);
    add_membrane_gradient(triangle, corners[t], membrane_gradient(c, n), gradient);
    const MembraneStiffness<Lanes> k = {law_.stretch.total() * triangle.u_layers,
                                        law_.stretch.total() * triangle.v_layers,
                                        broadcast<Lanes>(law_.shear.total())};
    const auto of_density =
        kind == HessianKind::exact ? exact_hessian(c, n, k) : projected_hessian(c, n, k);
    add_triangle(by_vertices(triangle.shape, of_density), corners[t], hessian);
  }
}

void CellEnergy::add_hessian(const Points& x, HessianKind kind, const Drag* drag, Points& gradient,
                             SparseMatrix& hessian,
                             const std::vector<ColumnLayout>& columns) const {
  CellHessian<Lanes> h;
  BlockWriter writer(hessian.valuePtr(), columns);
  for (const CellGroup& group : groups_) {
    const CellVectors p = gather(x.data(), group.vertices);
    const auto angles = cell_angles(p);
    const auto laws = hinge_laws(group, angles);
    CellVectors g = bend_gradient(angles, laws);
    if (kind == HessianKind::exact)
      cell_hessian<true>(angles, laws, h);
    else
      cell_hessian<false>(angles, laws, h);
    add_triangles(group, p, kind, g, h);
    if (drag) add_drag_damping(*drag, group, p, h);
    scatter_add(g, group.vertices, gradient.data());
    writer.add(h, group.vertices, group.slots, group.lengths);
  }
}

void store_cell_strains(const std::vector<CellGroup>& groups, const Points& x, VecX& strains) {
  for (const CellGroup& group : groups) {
    const CellVectors p = gather(x.data(), group.vertices);
    const auto store = [&](const Lanes& values, const LaneIndices& first, int offset) {
      for (int lane = 0; lane < group.count; ++lane)
        strains[first[at(lane)] + offset] = values[lane];
    };
    const auto corners = cell_corners(group.splits_02);
    for (std::size_t t = 0; t < 2; ++t) {
      const auto c = strains_in_cell(group.triangles[t], corners[t], p);
      store(c.u.value, group.triangles[t].components, 0);
      store(c.v.value, group.triangles[t].components, 1);
      store(c.shear, group.triangles[t].components, 2);
    }
    const auto angles = angle_values(p);
    for (std::size_t s = 0; s < CellBends::strains; ++s) {
      const std::size_t j = CellBends::hinge[s];
      store(group.factors[j] * angles[j], group.components[s], 0);
    }
  }
}

}  // namespace weft::detail
