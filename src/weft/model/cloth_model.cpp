#include "weft/model/cloth_model.h"

#include <fmt/format.h>

#include <cassert>
#include <cmath>
#include <optional>
#include <type_traits>

#include "weft/base/error.h"
#include "weft/model/cell_energy.h"
#include "weft/model/drag.h"
#include "weft/model/elements.h"
#include "weft/model/lane_blocks.h"
#include "weft/model/membrane.h"

namespace weft {
namespace {

using detail::BlockWriter;
using detail::DampedStiffness;
using detail::DiagonalGroup;
using detail::DragLaw;
using detail::gather;
using detail::scatter_add;
using detail::StencilGroup;
using detail::TriangleGroup;

/// Entries first, first + stride, ... of a vector into the lanes that are in use; zero elsewhere,
/// and everywhere if there is no vector.
Lanes load(const VecX* values, int first, int stride, int count) {
  Lanes out{};
  if (values)
    for (int lane = 0; lane < count; ++lane) out[lane] = (*values)[first + lane * stride];
  return out;
}

void store(const Lanes& lanes, int first, int stride, int count, VecX& values) {
  for (int lane = 0; lane < count; ++lane) values[first + lane * stride] = lanes[lane];
}

/// Of the values of a fabric.
enum Index {
  kStretch,
  kShear,
  kBend,
  kStretchDamping,
  kShearDamping,
  kBendDamping,
  kDragTangential,
  kDragNormal,
  kDragDegradation,
  kDiagonal,  ///< from here on: of a model with diagonals only
  kDiagonalDamping
};

/// What else differs between fabrics.
struct Indices {
  bool diagonals;
  std::optional<int> twist;        ///< left out: bend
  std::optional<int> drag_linear;  ///< left out: none

  static Indices of(const Fabric& fabric) {
    const auto optional_row = [&](const char* name) {
      return fabric.value_count(name) > 0 ? std::optional(fabric.first_value(name)) : std::nullopt;
    };
    return {fabric.model != "baraff-witkin", optional_row("twist_stiffness"),
            optional_row("drag_normal_linear")};
  }
};

detail::ElementKinds kinds_of(const Fabric& fabric) {
  return {
      fabric.model == "baraff-witkin" ? detail::Diagonals::none : detail::Diagonals::all,
      fabric.model == "baraff-witkin-hinges" ? detail::Bends::of_hinges : detail::Bends::of_plate};
}

/// The coefficients of a fabric; those of the diagonals are zero for a model without them.
struct Coefficients {
  DampedStiffness stretch, shear, bend, twist;
  DragLaw drag;
  DampedStiffness diagonal;

  static Coefficients from(const VecX& p, const Indices& index) {
    Coefficients out{{p[kStretch], p[kStretchDamping], 0},
                     {p[kShear], p[kShearDamping], 0},
                     {p[kBend], p[kBendDamping], 0},
                     {p[index.twist.value_or(kBend)], p[kBendDamping], 0},
                     {p[kDragTangential], p[kDragNormal], p[kDragDegradation]},
                     {}};
    if (index.diagonals) out.diagonal = {p[kDiagonal], p[kDiagonalDamping], 0};
    if (index.drag_linear) out.drag.linear = p[*index.drag_linear];
    return out;
  }
  Coefficients with_rate(double rate) const {
    Coefficients out = *this;
    out.stretch.rate = out.shear.rate = out.bend.rate = out.twist.rate = out.diagonal.rate = rate;
    return out;
  }
  /// Of the components of a stencil.
  template <class Stencil>
  std::array<const DampedStiffness*, 3> curvatures() const {
    if constexpr (std::is_same_v<Stencil, EdgeStencil>) return {&bend, &twist, &twist};
    return {&bend, &bend, &twist};
  }
};

struct TrianglePositions {
  Vector3<Lanes> x0, x1, x2;
};
TrianglePositions positions(const TriangleGroup& group, const Points& x) {
  return {gather(x.data(), group.vertices[0]), gather(x.data(), group.vertices[1]),
          gather(x.data(), group.vertices[2])};
}

/// By the vertices' shares of the area.
Vector3<Lanes> mean_velocity(const TriangleGroup& group, const Points& v) {
  const TrianglePositions q = positions(group, v);
  return group.shares[0] * q.x0 + group.shares[1] * q.x1 + group.shares[2] * q.x2;
}

detail::MembraneStrains<Lanes> strains_of(const TriangleGroup& group, const Points& x) {
  const TrianglePositions p = positions(group, x);
  return detail::membrane_strains(group.shape, p.x0, p.x1, p.x2);
}

template <class Stencil>
StencilCurvature<Lanes, Stencil> curvature_of(const StencilGroup<Stencil>& group, const Points& x) {
  return stencil_curvature(group.map, gather(x.data(), group.vertices));
}

template <class Stencil>
std::array<Lanes, 3> curvature_value(const StencilGroup<Stencil>& group, const Points& x) {
  return stencil_curvature_value(group.map, gather(x.data(), group.vertices));
}

/// Something of each of the two diagonals.
template <class T>
struct OfDiagonals {
  T rising, falling;
};
using DiagonalStrains = OfDiagonals<Stretch<Lanes>>;

/// The two vectors w.
OfDiagonals<Vector3<Lanes>> diagonal_vectors(const DiagonalGroup& group, const Points& x) {
  const Lanes none{};
  OfDiagonals<Vector3<Lanes>> w{{none, none, none}, {none, none, none}};
  for (std::size_t i = 0; i < 4; ++i) {
    const Vector3<Lanes> xi = gather(x.data(), group.vertices[i]);
    w.rising = w.rising + group.rising[i] * xi;
    w.falling = w.falling + group.falling[i] * xi;
  }
  return w;
}

DiagonalStrains strains_of(const DiagonalGroup& group, const Points& x) {
  const auto w = diagonal_vectors(group, x);
  return {diagonal_stretch(w.rising), diagonal_stretch(w.falling)};
}

void add_blocks(const detail::TriangleHessian<Lanes>& block, const TriangleGroup& group,
                BlockWriter& writer) {
  writer.add(block.b00, group.vertices[0]);
  writer.add(block.b11, group.vertices[1]);
  writer.add(block.b22, group.vertices[2]);
  writer.add(block.b10, group.slots[0], group.vertices[1], group.vertices[0]);
  writer.add(block.b20, group.slots[1], group.vertices[2], group.vertices[0]);
  writer.add(block.b21, group.slots[2], group.vertices[2], group.vertices[1]);
}

void add_gradient(const TriangleGroup& group, const detail::MembraneGradient<Lanes>& g,
                  Points& gradient) {
  const auto& s = group.shape;
  const Vector3<Lanes> g1 = (s.area * s.du1) * g.u + (s.area * s.dv1) * g.v;
  const Vector3<Lanes> g2 = (s.area * s.du2) * g.u + (s.area * s.dv2) * g.v;
  scatter_add(std::array{-(g1 + g2), g1, g2}, group.vertices, gradient.data());
}

/// `tension`: derivatives of the energy density by the two strains, N/m.
void add_gradient(const DiagonalGroup& group, const DiagonalStrains& c,
                  const OfDiagonals<Lanes>& tension, Points& gradient) {
  const Vector3<Lanes> rising = (group.area * tension.rising) * c.rising.direction;
  const Vector3<Lanes> falling = (group.area * tension.falling) * c.falling.direction;
  std::array<Vector3<Lanes>, 4> g;
  for (std::size_t i = 0; i < 4; ++i) g[i] = group.rising[i] * rising + group.falling[i] * falling;
  scatter_add(g, group.vertices, gradient.data());
}

/// `moment`: derivative of the energy by the three curvature components.
template <class Stencil>
void add_gradient(const StencilGroup<Stencil>& group,
                  const StencilCurvature<Lanes, Stencil>& curvature,
                  const std::array<Lanes, 3>& moment, Points& gradient) {
  scatter_add(curvature_gradient(group.map, curvature, moment), group.vertices, gradient.data());
}

/// Rates of the three strains under the velocities `v`.
detail::MembraneTension<Lanes> strain_rates(const TriangleGroup& group,
                                            const detail::MembraneStrains<Lanes>& c,
                                            const Points& v) {
  const TrianglePositions p = positions(group, v);
  const auto rate = deformation_gradient(group.shape, p.x0, p.x1, p.x2);
  return {dot(c.u.direction, rate.wu), dot(c.v.direction, rate.wv),
          dot(c.w.wv, rate.wu) + dot(c.w.wu, rate.wv)};
}

OfDiagonals<Lanes> strain_rates(const DiagonalGroup& group, const DiagonalStrains& c,
                                const Points& v) {
  const auto rate = diagonal_vectors(group, v);
  return {dot(c.rising.direction, rate.rising), dot(c.falling.direction, rate.falling)};
}

template <class Stencil>
std::array<Lanes, 3> curvature_rates(const StencilGroup<Stencil>& group,
                                     const StencilCurvature<Lanes, Stencil>& curvature,
                                     const Points& v) {
  const auto velocity = gather(v.data(), group.vertices);
  std::array<Lanes, Stencil::hinges> angle_rate;
  for (std::size_t j = 0; j < Stencil::hinges; ++j) {
    const auto g = curvature.angles[j].gradient();
    const auto vertices = Stencil::hinge(j);
    angle_rate[j] = dot(g[0], velocity[vertices[0]]) + dot(g[1], velocity[vertices[1]]) +
                    dot(g[2], velocity[vertices[2]]) + dot(g[3], velocity[vertices[3]]);
  }
  std::array<Lanes, 3> out{};
  for (std::size_t k = 0; k < 3; ++k)
    for (std::size_t j = 0; j < Stencil::hinges; ++j) out[k] += group.map.r[k][j] * angle_rate[j];
  return out;
}

ComponentTable component_table(const detail::Elements& elements, int count, const Indices& index) {
  ComponentTable table;
  table.weight.resize(count);
  int component = 0;
  const auto add_as = [&](double weight, int stiffness, int damping) {
    table.weight[component++] = weight;
    table.stiffness.push_back(stiffness);
    table.damping.push_back(damping);
  };
  const auto add = [&](double weight, int stiffness) {
    add_as(weight, stiffness,
           stiffness == kDiagonal ? kDiagonalDamping : stiffness + kStretchDamping);
  };
  for (const TriangleGroup& group : elements.triangles)
    for (int lane = 0; lane < group.count; ++lane) {
      add(group.shape.area[lane] * group.u_layers[lane], kStretch);
      add(group.shape.area[lane] * group.v_layers[lane], kStretch);
      add(group.shape.area[lane], kShear);
    }
  for (const DiagonalGroup& group : elements.diagonals)
    for (int lane = 0; lane < group.count; ++lane) {
      add(group.area[lane], kDiagonal);
      add(group.area[lane], kDiagonal);
      add(0, kDiagonal);  // a group of components is one of three
    }
  const int twist = index.twist.value_or(kBend);
  for (const detail::BendingGroup& group : elements.bending)
    for (int lane = 0; lane < group.count; ++lane) {
      add(group.areas[0][lane], kBend);
      add(group.areas[1][lane], kBend);
      add_as(group.areas[2][lane], twist, kBendDamping);
    }
  for (const detail::HingeGroup& group : elements.hinges)
    for (int lane = 0; lane < group.count; ++lane) {
      add(group.areas[0][lane], kBend);
      add_as(group.areas[1][lane], twist, kBendDamping);
      add_as(group.areas[2][lane], twist, kBendDamping);
    }
  assert(component == count);
  return table;
}

Matrix3<Lanes> product(const Matrix3<Lanes>& a, const Matrix3<Lanes>& b) {
  Matrix3<Lanes> out;
  for (std::size_t r = 0; r < 3; ++r)
    for (std::size_t c = 0; c < 3; ++c)
      out.m[3 * r + c] =
          a.m[3 * r] * b.m[c] + a.m[3 * r + 1] * b.m[3 + c] + a.m[3 * r + 2] * b.m[6 + c];
  return out;
}

/// The matrix of b -> a x b.
Matrix3<Lanes> cross_matrix(const Vector3<Lanes>& a) {
  const Lanes zero{};
  return {{zero, -a.z, a.y, a.z, zero, -a.x, -a.y, a.x, zero}};
}

}  // namespace

struct ClothModel::Impl {
  TriangleMesh mesh;
  std::string model;
  Indices index;
  VecX values;
  ComponentTable components;
  Vec3 gravity;
  Coefficients coefficients;
  detail::Elements elements;
  VecX masses;

  detail::CellEnergy of_cells(const Coefficients& k, const DampingRate& damping) const {
    return {elements.cells, {k.stretch, k.shear, k.bend, k.twist}, damping.strain_history};
  }
  int first_diagonal() const { return 3 * mesh.triangle_count(); }
  int first_curvature() const { return first_diagonal() + 3 * elements.diagonal_count; }
  int component_count() const { return first_curvature() + 3 * elements.bending_count; }

  /// Strain history of a group of triangles: of its strains, and of its curvatures.
  detail::MembraneTension<Lanes> history(const DampingRate& damping, std::size_t group) const {
    const int first = static_cast<int>(group) * kLanes * 3, count = elements.triangles[group].count;
    return {load(damping.strain_history, first, 3, count),
            load(damping.strain_history, first + 1, 3, count),
            load(damping.strain_history, first + 2, 3, count)};
  }
  OfDiagonals<Lanes> diagonal_history(const DampingRate& damping, std::size_t group) const {
    const int first = first_diagonal() + static_cast<int>(group) * kLanes * 3;
    const int count = elements.diagonals[group].count;
    return {load(damping.strain_history, first, 3, count),
            load(damping.strain_history, first + 1, 3, count)};
  }
  OfDiagonals<Lanes> tension(const DampedStiffness& k, const DiagonalStrains& c,
                             const DampingRate& damping, std::size_t group) const {
    const auto h = diagonal_history(damping, group);
    return {k.tension(c.rising.value, h.rising), k.tension(c.falling.value, h.falling)};
  }
  std::array<Lanes, 3> curvature_history(const DampingRate& damping, std::size_t group,
                                         int count) const {
    const int first = first_curvature() + static_cast<int>(group) * kLanes * 3;
    return {load(damping.strain_history, first, 3, count),
            load(damping.strain_history, first + 1, 3, count),
            load(damping.strain_history, first + 2, 3, count)};
  }

  /// Derivatives of the energy density of a group by its three strains.
  detail::MembraneTension<Lanes> tension(const Coefficients& k,
                                         const detail::MembraneStrains<Lanes>& c,
                                         const DampingRate& damping, std::size_t group) const {
    const auto h = history(damping, group);
    const TriangleGroup& triangles = elements.triangles[group];
    return {triangles.u_layers * k.stretch.tension(c.u.value, h.u),
            triangles.v_layers * k.stretch.tension(c.v.value, h.v), k.shear.tension(c.shear, h.s)};
  }

  /// Calls `visit` with each group that bends and its number.
  template <class Visit>
  void for_each_bending(const Visit& visit) const {
    for (std::size_t i = 0; i < elements.bending.size(); ++i) visit(elements.bending[i], i);
    for (std::size_t i = 0; i < elements.hinges.size(); ++i) visit(elements.hinges[i], i);
  }

  /// Derivative of the bending energy of a group by its components; `i` is its number.
  template <class Stencil>
  std::array<Lanes, 3> moments(const Coefficients& k, const StencilGroup<Stencil>& group,
                               const StencilCurvature<Lanes, Stencil>& curvature,
                               const DampingRate& damping, std::size_t i) const {
    const auto h = curvature_history(damping, i, group.count);
    const auto stiffness = k.curvatures<Stencil>();
    std::array<Lanes, 3> out;
    for (std::size_t j = 0; j < 3; ++j)
      out[j] = group.areas[j] * stiffness[j]->tension(curvature.value[j], h[j]);
    return out;
  }

  double energy(const Coefficients& k, const Points& x, const DampingRate& damping) const;
  double diagonal_energy(const Coefficients& k, const Points& x, const DampingRate& damping) const;
  /// Of the potential without gravity and, if `drag` is not null, the damping of the drag.
  void add_hessian(const Coefficients& k, const Points& x, const DampingRate& damping,
                   HessianKind kind, const detail::CellEnergy::Drag* drag, Points& gradient,
                   SparseMatrix& hessian) const;
  void add_drag_damping(const detail::CellEnergy::Drag& drag, const Points& x,
                        SparseMatrix& hessian) const;
  void add_triangle_gradient(const Coefficients& k, const Points& x, const DampingRate& damping,
                             Points& gradient) const;
  void add_diagonal_gradient(const Coefficients& k, const Points& x, const DampingRate& damping,
                             Points& gradient) const;
  void add_bending_gradient(const Coefficients& k, const Points& x, const DampingRate& damping,
                            Points& gradient) const;
  void add_triangles(const Coefficients& k, const Points& x, const DampingRate& damping,
                     HessianKind kind, Points& gradient, SparseMatrix& hessian) const;
  void add_diagonals(const Coefficients& k, const Points& x, const DampingRate& damping,
                     HessianKind kind, Points& gradient, SparseMatrix& hessian) const;
  void add_bending(const Coefficients& k, const Points& x, const DampingRate& damping,
                   HessianKind kind, Points& gradient, SparseMatrix& hessian) const;
  void set_gravity_gradient(Points& gradient) const;
  void add_internal_forces(const Coefficients& k, const Points& x, const Points& v,
                           Points& force) const;
  /// `pressure` along the normal as a function of the normal speed, and k_T along the surface.
  template <class Pressure>
  void add_drag(double tangential, const Pressure& pressure, const Points& x, const Points& v,
                Points& force) const;
};

double ClothModel::Impl::energy(const Coefficients& k, const Points& x,
                                const DampingRate& damping) const {
  if (!elements.cells.empty())
    return of_cells(k, damping).value(x) + diagonal_energy(k, x, damping);
  Lanes sum{};
  for (std::size_t i = 0; i < elements.triangles.size(); ++i) {
    const TriangleGroup& group = elements.triangles[i];
    const auto c = strains_of(group, x);
    const auto h = history(damping, i);
    sum += group.shape.area *
           (group.u_layers * k.stretch.energy(c.u.value, h.u) +
            group.v_layers * k.stretch.energy(c.v.value, h.v) + k.shear.energy(c.shear, h.s));
  }
  for_each_bending([&]<class Stencil>(const StencilGroup<Stencil>& group, std::size_t i) {
    const auto c = curvature_value(group, x);
    const auto h = curvature_history(damping, i, group.count);
    const auto stiffness = k.curvatures<Stencil>();
    for (std::size_t j = 0; j < 3; ++j) sum += group.areas[j] * stiffness[j]->energy(c[j], h[j]);
  });
  return sum_lanes(sum) + diagonal_energy(k, x, damping);
}

double ClothModel::Impl::diagonal_energy(const Coefficients& k, const Points& x,
                                         const DampingRate& damping) const {
  Lanes sum{};
  for (std::size_t i = 0; i < elements.diagonals.size(); ++i) {
    const DiagonalGroup& group = elements.diagonals[i];
    const auto c = strains_of(group, x);
    const auto h = diagonal_history(damping, i);
    sum += group.area * (k.diagonal.energy(c.rising.value, h.rising) +
                         k.diagonal.energy(c.falling.value, h.falling));
  }
  return sum_lanes(sum);
}

void ClothModel::Impl::add_triangle_gradient(const Coefficients& k, const Points& x,
                                             const DampingRate& damping, Points& gradient) const {
  for (std::size_t i = 0; i < elements.triangles.size(); ++i) {
    const TriangleGroup& group = elements.triangles[i];
    const auto c = strains_of(group, x);
    add_gradient(group, membrane_gradient(c, tension(k, c, damping, i)), gradient);
  }
}

void ClothModel::Impl::add_diagonal_gradient(const Coefficients& k, const Points& x,
                                             const DampingRate& damping, Points& gradient) const {
  for (std::size_t i = 0; i < elements.diagonals.size(); ++i) {
    const DiagonalGroup& group = elements.diagonals[i];
    const DiagonalStrains c = strains_of(group, x);
    add_gradient(group, c, tension(k.diagonal, c, damping, i), gradient);
  }
}

void ClothModel::Impl::add_bending_gradient(const Coefficients& k, const Points& x,
                                            const DampingRate& damping, Points& gradient) const {
  for_each_bending([&](const auto& group, std::size_t i) {
    const auto curvature = curvature_of(group, x);
    add_gradient(group, curvature, moments(k, group, curvature, damping, i), gradient);
  });
}

void ClothModel::Impl::add_triangles(const Coefficients& k, const Points& x,
                                     const DampingRate& damping, HessianKind kind, Points& gradient,
                                     SparseMatrix& hessian) const {
  BlockWriter writer(hessian.valuePtr(), elements.columns);
  for (std::size_t i = 0; i < elements.triangles.size(); ++i) {
    const TriangleGroup& group = elements.triangles[i];
    const auto c = strains_of(group, x);
    const auto t = tension(k, c, damping, i);
    add_gradient(group, membrane_gradient(c, t), gradient);
    const detail::MembraneStiffness<Lanes> stiffness = {k.stretch.total() * group.u_layers,
                                                        k.stretch.total() * group.v_layers,
                                                        broadcast<Lanes>(k.shear.total())};
    const auto hessian_of_density = kind == HessianKind::exact
                                        ? detail::exact_hessian(c, t, stiffness)
                                        : detail::projected_hessian(c, t, stiffness);
    add_blocks(detail::by_vertices(group.shape, hessian_of_density), group, writer);
  }
}

void ClothModel::Impl::add_diagonals(const Coefficients& k, const Points& x,
                                     const DampingRate& damping, HessianKind kind, Points& gradient,
                                     SparseMatrix& hessian) const {
  BlockWriter writer(hessian.valuePtr(), elements.columns);
  const double stiffness = k.diagonal.total();
  for (std::size_t i = 0; i < elements.diagonals.size(); ++i) {
    const DiagonalGroup& group = elements.diagonals[i];
    const DiagonalStrains c = strains_of(group, x);
    const OfDiagonals<Lanes> t = tension(k.diagonal, c, damping, i);
    add_gradient(group, c, t, gradient);
    const SymmetricMatrix3<Lanes> rising =
        group.area * detail::diagonal_hessian(c.rising, t.rising, stiffness, kind);
    const SymmetricMatrix3<Lanes> falling =
        group.area * detail::diagonal_hessian(c.falling, t.falling, stiffness, kind);
    const auto block = [&](std::size_t a, std::size_t b) {
      return (group.rising[a] * group.rising[b]) * rising +
             (group.falling[a] * group.falling[b]) * falling;
    };
    for (std::size_t v = 0; v < 4; ++v) writer.add(block(v, v), group.vertices[v]);
    for (std::size_t b = 0; b < group.slots.size(); ++b) {
      const auto [row, column] = detail::kPairs[b];
      writer.add(block(row, column).full(), group.slots[b], group.vertices[row],
                 group.vertices[column]);
    }
  }
}

void ClothModel::Impl::add_bending(const Coefficients& k, const Points& x,
                                   const DampingRate& damping, HessianKind kind, Points& gradient,
                                   SparseMatrix& hessian) const {
  BlockWriter writer(hessian.valuePtr(), elements.columns);
  for_each_bending([&]<class Stencil>(const StencilGroup<Stencil>& group, std::size_t i) {
    const auto curvature = curvature_of(group, x);
    const auto moment = moments(k, group, curvature, damping, i);
    add_gradient(group, curvature, moment, gradient);
    const auto stiffness = k.curvatures<Stencil>();
    std::array<Lanes, 3> rank_one;
    for (std::size_t j = 0; j < 3; ++j) rank_one[j] = group.areas[j] * stiffness[j]->total();
    auto h = curvature_gauss_newton(group.map, curvature, rank_one);
    if (kind == HessianKind::exact) add_curvature_hessian(group.map, curvature, moment, h);
    writer.add(h, group.vertices, group.slots);
  });
}

void ClothModel::Impl::add_hessian(const Coefficients& k, const Points& x,
                                   const DampingRate& damping, HessianKind kind,
                                   const detail::CellEnergy::Drag* drag, Points& gradient,
                                   SparseMatrix& hessian) const {
  add_diagonals(k, x, damping, kind, gradient, hessian);
  if (!elements.cells.empty()) {
    of_cells(k, damping).add_hessian(x, kind, drag, gradient, hessian, elements.columns);
  } else {
    add_triangles(k, x, damping, kind, gradient, hessian);
    add_bending(k, x, damping, kind, gradient, hessian);
    if (drag) add_drag_damping(*drag, x, hessian);
  }
}

void ClothModel::Impl::add_drag_damping(const detail::CellEnergy::Drag& drag, const Points& x,
                                        SparseMatrix& hessian) const {
  BlockWriter writer(hessian.valuePtr(), elements.columns);
  for (const TriangleGroup& group : elements.triangles) {
    const TrianglePositions p = positions(group, x);
    const Vector3<Lanes> n = detail::unit_normal(p.x0, p.x1, p.x2);
    const Lanes s = dot(mean_velocity(group, drag.velocity), n);
    const SymmetricMatrix3<Lanes> block = (drag.factor * group.shape.area) * drag.law.damping(s, n);
    for (std::size_t i = 0; i < 3; ++i)
      writer.add((group.shares[i] * group.shares[i]) * block, group.vertices[i]);
    for (std::size_t k = 0; k < group.slots.size(); ++k) {
      const auto [row, column] = detail::kPairs[k];
      writer.add(((group.shares[row] * group.shares[column]) * block).full(), group.slots[k],
                 group.vertices[row], group.vertices[column]);
    }
  }
}

void ClothModel::Impl::set_gravity_gradient(Points& gradient) const {
  gradient.noalias() = -gravity * masses.transpose();
}

void ClothModel::Impl::add_internal_forces(const Coefficients& k, const Points& x, const Points& v,
                                           Points& force) const {
  for (const TriangleGroup& group : elements.triangles) {
    const auto c = strains_of(group, x);
    const auto rate = strain_rates(group, c, v);
    add_gradient(
        group,
        membrane_gradient(c, {-group.u_layers * (k.stretch.k * c.u.value + k.stretch.kd * rate.u),
                              -group.v_layers * (k.stretch.k * c.v.value + k.stretch.kd * rate.v),
                              -(k.shear.k * c.shear + k.shear.kd * rate.s)}),
        force);
  }
  for (const DiagonalGroup& group : elements.diagonals) {
    const DiagonalStrains c = strains_of(group, x);
    const OfDiagonals<Lanes> rate = strain_rates(group, c, v);
    add_gradient(group, c,
                 {-(k.diagonal.k * c.rising.value + k.diagonal.kd * rate.rising),
                  -(k.diagonal.k * c.falling.value + k.diagonal.kd * rate.falling)},
                 force);
  }
  for_each_bending([&]<class Stencil>(const StencilGroup<Stencil>& group, std::size_t) {
    const auto curvature = curvature_of(group, x);
    const auto rate = curvature_rates(group, curvature, v);
    const auto stiffness = k.curvatures<Stencil>();
    std::array<Lanes, 3> moment;
    for (std::size_t j = 0; j < 3; ++j)
      moment[j] =
          -group.areas[j] * (stiffness[j]->k * curvature.value[j] + stiffness[j]->kd * rate[j]);
    add_gradient(group, curvature, moment, force);
  });
}

template <class Pressure>
void ClothModel::Impl::add_drag(double tangential, const Pressure& pressure, const Points& x,
                                const Points& v, Points& force) const {
  for (const TriangleGroup& group : elements.triangles) {
    const TrianglePositions p = positions(group, x);
    const Vector3<Lanes> n = detail::unit_normal(p.x0, p.x1, p.x2);
    const Vector3<Lanes> mean = mean_velocity(group, v);
    const Lanes s = dot(mean, n);
    const Vector3<Lanes> resistance =
        pressure(s) * n + broadcast<Lanes>(tangential) * (mean - s * n);
    const Vector3<Lanes> of_triangle = -group.shape.area * resistance;
    scatter_add(std::array{group.shares[0] * of_triangle, group.shares[1] * of_triangle,
                           group.shares[2] * of_triangle},
                group.vertices, force.data());
  }
}

ClothModel::ClothModel(const TriangleMesh& mesh, const Fabric& fabric, double areal_density,
                       const Vec3& gravity, double hem_width)
    : impl_(std::make_unique<Impl>()) {
  validate(mesh, "mesh");
  if (!(areal_density > 0 && areal_density <= 100))
    throw Error(fmt::format("areal density {} kg/m^2 is outside (0, 100]", areal_density));
  impl_->mesh = mesh;
  impl_->gravity = gravity;
  require_motion_model(fabric);
  impl_->model = fabric.model;
  impl_->index = Indices::of(fabric);
  const detail::Hem hem(mesh, hem_width);
  impl_->elements = detail::make_elements(mesh, kinds_of(fabric), hem);
  impl_->masses = areal_density * (vertex_areas(mesh) + hem.vertex_areas());
  set_fabric(fabric);
}

ClothModel::~ClothModel() = default;
ClothModel::ClothModel(ClothModel&&) noexcept = default;
ClothModel& ClothModel::operator=(ClothModel&&) noexcept = default;

void ClothModel::set_fabric(const Fabric& fabric) {
  require_model(fabric, impl_->model);
  validate(fabric);
  impl_->index = Indices::of(fabric);
  impl_->coefficients = Coefficients::from(fabric.values, impl_->index);
  impl_->components = component_table(impl_->elements, component_count(), impl_->index);
  impl_->values = fabric.values;
}

const TriangleMesh& ClothModel::mesh() const { return impl_->mesh; }
int ClothModel::vertex_count() const { return impl_->mesh.vertex_count(); }
int ClothModel::component_count() const { return impl_->component_count(); }
const VecX& ClothModel::masses() const { return impl_->masses; }
const Vec3& ClothModel::gravity() const { return impl_->gravity; }
const SparseMatrix& ClothModel::hessian_pattern() const { return impl_->elements.pattern; }
std::span<const int> ClothModel::diagonal_slots() const { return impl_->elements.diagonal_slots; }

double ClothModel::elastic_energy(const Points& x) const {
  return impl_->energy(impl_->coefficients, x, {});
}

double ClothModel::gravity_energy(const Points& x) const {
  return -impl_->gravity.dot(x * impl_->masses);
}

void ClothModel::strains(const Points& x, VecX& c) const {
  c.resize(component_count());
  const auto& elements = impl_->elements;
  for (std::size_t i = 0; i < elements.diagonals.size(); ++i) {
    const DiagonalStrains s = strains_of(elements.diagonals[i], x);
    const int first = impl_->first_diagonal() + static_cast<int>(i) * kLanes * 3;
    const int count = elements.diagonals[i].count;
    store(s.rising.value, first, 3, count, c);
    store(s.falling.value, first + 1, 3, count, c);
    store(Lanes{}, first + 2, 3, count, c);
  }
  if (!elements.cells.empty()) return detail::store_cell_strains(elements.cells, x, c);
  for (std::size_t i = 0; i < elements.triangles.size(); ++i) {
    const auto s = strains_of(elements.triangles[i], x);
    const int first = static_cast<int>(i) * kLanes * 3, count = elements.triangles[i].count;
    store(s.u.value, first, 3, count, c);
    store(s.v.value, first + 1, 3, count, c);
    store(s.shear, first + 2, 3, count, c);
  }
  impl_->for_each_bending([&](const auto& group, std::size_t i) {
    const auto value = curvature_value(group, x);
    const int first = impl_->first_curvature() + static_cast<int>(i) * kLanes * 3;
    for (std::size_t k = 0; k < 3; ++k)
      store(value[k], first + static_cast<int>(k), 3, group.count, c);
  });
}

double ClothModel::potential(const Points& x, const DampingRate& damping) const {
  return impl_->energy(impl_->coefficients.with_rate(damping.rate), x, damping) + gravity_energy(x);
}

void ClothModel::potential_gradient(const Points& x, const DampingRate& damping,
                                    Points& gradient) const {
  const Coefficients k = impl_->coefficients.with_rate(damping.rate);
  impl_->set_gravity_gradient(gradient);
  impl_->add_diagonal_gradient(k, x, damping, gradient);
  if (!impl_->elements.cells.empty()) {
    impl_->of_cells(k, damping).add_gradient(x, gradient);
  } else {
    impl_->add_triangle_gradient(k, x, damping, gradient);
    impl_->add_bending_gradient(k, x, damping, gradient);
  }
}

void ClothModel::potential_hessian(const Points& x, const DampingRate& damping, HessianKind kind,
                                   Points& gradient, SparseMatrix& hessian) const {
  assert(hessian.nonZeros() == impl_->elements.pattern.nonZeros());
  impl_->set_gravity_gradient(gradient);
  impl_->add_hessian(impl_->coefficients.with_rate(damping.rate), x, damping, kind, nullptr,
                     gradient, hessian);
}

void ClothModel::step_hessian(const Points& x, const DampingRate& damping, HessianKind kind,
                              const Points& v, double factor, Points& gradient,
                              SparseMatrix& hessian) const {
  assert(hessian.nonZeros() == impl_->elements.pattern.nonZeros());
  impl_->set_gravity_gradient(gradient);
  const detail::CellEnergy::Drag drag{impl_->coefficients.drag, v, factor};
  impl_->add_hessian(impl_->coefficients.with_rate(damping.rate), x, damping, kind, &drag, gradient,
                     hessian);
}

void ClothModel::add_drag(const Points& x, const Points& v, Points& force) const {
  const DragLaw& law = impl_->coefficients.drag;
  impl_->add_drag(
      law.tangential, [&](const Lanes& s) { return law.pressure(s); }, x, v, force);
}

void ClothModel::add_drag_damping(const Points& x, const Points& v, double factor,
                                  SparseMatrix& hessian) const {
  assert(hessian.nonZeros() == impl_->elements.pattern.nonZeros());
  impl_->add_drag_damping({impl_->coefficients.drag, v, factor}, x, hessian);
}

void ClothModel::forces(const Points& x, const Points& v, Points& force) const {
  force.noalias() = impl_->gravity * impl_->masses.transpose();
  impl_->add_internal_forces(impl_->coefficients, x, v, force);
  add_drag(x, v, force);
}

void ClothModel::force_derivative(const Points& x, const Points& v, int parameter,
                                  Points& derivative) const {
  assert(parameter >= 0 && parameter < impl_->values.size());
  drag_derivative(x, v, parameter, derivative);
  if (drag_depends_on(parameter)) return;
  // Forces are linear in these parameters: those of a fabric that has this one alone.
  const Coefficients k =
      Coefficients::from(VecX::Unit(impl_->values.size(), parameter), impl_->index);
  impl_->add_internal_forces(k, x, v, derivative);
}

bool ClothModel::drag_depends_on(int parameter) const {
  return (parameter >= kDragTangential && parameter <= kDragDegradation) ||
         parameter == impl_->index.drag_linear;
}

void ClothModel::drag_derivative(const Points& x, const Points& v, int parameter,
                                 Points& derivative) const {
  derivative.setZero(3, x.cols());
  const DragLaw& law = impl_->coefficients.drag;
  const auto none = [](const Lanes&) { return Lanes{}; };
  // The drag is proportional to this one: that of a coefficient of 1.
  const auto by_normal = [&](const Lanes& s) {
    return DragLaw{.normal = 1, .degradation = law.degradation}.pressure(s);
  };
  const auto by_degradation = [&](const Lanes& s) { return law.pressure_by_degradation(s); };
  const auto by_linear = [](const Lanes& s) { return s; };
  if (parameter == kDragTangential) impl_->add_drag(1, none, x, v, derivative);
  if (parameter == kDragNormal) impl_->add_drag(0, by_normal, x, v, derivative);
  if (parameter == kDragDegradation) impl_->add_drag(0, by_degradation, x, v, derivative);
  if (parameter == impl_->index.drag_linear) impl_->add_drag(0, by_linear, x, v, derivative);
}

const ComponentTable& ClothModel::components() const { return impl_->components; }
const VecX& ClothModel::values() const { return impl_->values; }

void ClothModel::strain_jacobian(const Points& x, StrainJacobian& jacobian) const {
  const auto& elements = impl_->elements;
  jacobian.triangles.resize(elements.triangles.size());
  jacobian.diagonals.resize(elements.diagonals.size());
  jacobian.bending.resize(elements.bending.size() + elements.hinges.size());
  for (std::size_t i = 0; i < elements.triangles.size(); ++i) {
    const TriangleGroup& group = elements.triangles[i];
    auto& out = jacobian.triangles[i];
    out.count = group.count;
    out.vertices = group.vertices;
    const auto c = strains_of(group, x);
    const auto du = group.shape.du(), dv = group.shape.dv();
    for (std::size_t vertex = 0; vertex < 3; ++vertex) {
      out.gradient[0][vertex] = du[vertex] * c.u.direction;
      out.gradient[1][vertex] = dv[vertex] * c.v.direction;
      out.gradient[2][vertex] = du[vertex] * c.w.wv + dv[vertex] * c.w.wu;
    }
  }
  for (std::size_t i = 0; i < elements.diagonals.size(); ++i) {
    const DiagonalGroup& group = elements.diagonals[i];
    auto& out = jacobian.diagonals[i];
    out.count = group.count;
    out.vertices = group.vertices;
    const DiagonalStrains c = strains_of(group, x);
    for (std::size_t vertex = 0; vertex < 4; ++vertex) {
      out.gradient[0][vertex] = group.rising[vertex] * c.rising.direction;
      out.gradient[1][vertex] = group.falling[vertex] * c.falling.direction;
      out.gradient[2][vertex] = {Lanes{}, Lanes{}, Lanes{}};
    }
  }
  impl_->for_each_bending([&](const auto& group, std::size_t i) {
    auto& out = jacobian.bending[i];
    out.count = group.count;
    out.vertices = group.vertices;
    const auto curvature = curvature_of(group, x);
    for (std::size_t k = 0; k < 3; ++k) {
      std::array<Lanes, 3> one{};
      one[k] = broadcast<Lanes>(1);
      out.gradient[k] = curvature_gradient(group.map, curvature, one);
    }
  });
}

void ClothModel::drag_jacobian(const Points& x, const Points& v, DragJacobian& jacobian) const {
  // The force is -A (P(s) n + k_T (m - s n)) with the mean velocity m, s = m . n and n = N / |N|,
  // N = (x1 - x0) x (x2 - x0).
  const DragLaw& law = impl_->coefficients.drag;
  jacobian.groups.resize(impl_->elements.triangles.size());
  for (std::size_t i = 0; i < impl_->elements.triangles.size(); ++i) {
    const TriangleGroup& group = impl_->elements.triangles[i];
    const TrianglePositions p = positions(group, x);
    const Vector3<Lanes> area_vector = cross(p.x1 - p.x0, p.x2 - p.x0);
    const Vector3<Lanes> n = detail::unit_normal(p.x0, p.x1, p.x2);
    const Vector3<Lanes> mean = mean_velocity(group, v);
    const Lanes s = dot(mean, n), zero{}, one = broadcast<Lanes>(1);
    const Lanes scale = -group.shape.area;
    const Lanes length = dot(area_vector, n);
    const Lanes inverse = select(length > zero, one / length, zero);
    // By n: scale ((P' - k_T) n m^T + (P - k_T s) I); then dn = (I - n n^T) / |N| dN.
    Matrix3<Lanes> by_normal = outer((scale * (law.pressure_rate(s) - law.tangential)) * n, mean);
    detail::add_to_diagonal(Lanes(scale * (law.pressure(s) - law.tangential * s)), by_normal);
    SymmetricMatrix3<Lanes> across = (-inverse) * outer(n);
    detail::add_to_diagonal(inverse, across);
    const Matrix3<Lanes> by_area_vector = product(by_normal, across.full());
    // dN by vertex: (x1 - x2) x . and so on, cyclic, with the sign of d(e1 x e2).
    DragJacobian::Group& out = jacobian.groups[i];
    out.count = group.count;
    out.vertices = group.vertices;
    out.by_position = {product(by_area_vector, cross_matrix(p.x2 - p.x1)),
                       product(by_area_vector, cross_matrix(p.x0 - p.x2)),
                       product(by_area_vector, cross_matrix(p.x1 - p.x0))};
    out.shares = group.shares;
    SymmetricMatrix3<Lanes> by_velocity =
        (scale * (law.pressure_rate(s) - law.tangential)) * outer(n);
    detail::add_to_diagonal(Lanes(scale * law.tangential), by_velocity);
    out.by_velocity = by_velocity.full();
  }
}

double ClothModel::damping_power(const Points& x, const Points& v) const {
  const Coefficients& k = impl_->coefficients;
  Lanes power{};
  for (const TriangleGroup& group : impl_->elements.triangles) {
    const auto rate = strain_rates(group, strains_of(group, x), v);
    power += group.shape.area *
             (k.stretch.kd * (group.u_layers * rate.u * rate.u + group.v_layers * rate.v * rate.v) +
              k.shear.kd * rate.s * rate.s);
  }
  for (const DiagonalGroup& group : impl_->elements.diagonals) {
    const OfDiagonals<Lanes> rate = strain_rates(group, strains_of(group, x), v);
    power +=
        group.area * (k.diagonal.kd * (rate.rising * rate.rising + rate.falling * rate.falling));
  }
  impl_->for_each_bending([&]<class Stencil>(const StencilGroup<Stencil>& group, std::size_t) {
    const auto rate = curvature_rates(group, curvature_of(group, x), v);
    const auto stiffness = k.curvatures<Stencil>();
    for (std::size_t j = 0; j < 3; ++j)
      power += group.areas[j] * stiffness[j]->kd * rate[j] * rate[j];
  });
  return sum_lanes(power);
}

double ClothModel::drag_power(const Points& x, const Points& v) const {
  const DragLaw& law = impl_->coefficients.drag;
  Lanes power{};
  for (const TriangleGroup& group : impl_->elements.triangles) {
    const TrianglePositions p = positions(group, x);
    const Vector3<Lanes> n = detail::unit_normal(p.x0, p.x1, p.x2);
    const Vector3<Lanes> mean = mean_velocity(group, v);
    const Lanes s = dot(mean, n);
    const Vector3<Lanes> tangential = mean - s * n;
    power +=
        group.shape.area * (law.pressure(s) * s + law.tangential * dot(tangential, tangential));
  }
  return sum_lanes(power);
}

}  // namespace weft
