#include "weft/model/spring_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <map>

#include "weft/base/error.h"
#include "weft/mesh/grid_cells.h"
#include "weft/model/sheet_model.h"

namespace weft::detail {
namespace {

enum Component { kWeftStretch, kWarpStretch, kShear, kWeftBend, kWarpBend, kDiagonalBend };
constexpr std::array<const char*, 6> kNames = {"weft_stretch", "warp_stretch", "shear",
                                               "weft_bend",    "warp_bend",    "diagonal_bend"};
constexpr double kAngleTolerance = 1e-6;  // of the length of an edge

using Spring = SpringModel::Spring;

/// An edge or the other diagonal of a cell, with the area of its triangles.
struct Link {
  Component component;
  double area = 0;
};

Component direction_of(const Vec2& along) {
  if (std::abs(along.y()) < kAngleTolerance * along.norm()) return kWeftStretch;
  if (std::abs(along.x()) < kAngleTolerance * along.norm()) return kWarpStretch;
  return kShear;
}

/// Edges of the mesh and second diagonals. Each triangle's area goes to its two legs and its
/// diagonal alike; a diagonal with two triangles gives half of it to the other diagonal.
std::map<MeshEdge, Link> find_links(const TriangleMesh& mesh) {
  std::map<MeshEdge, Link> links;
  for (int t = 0; t < mesh.triangle_count(); ++t) {
    const auto& v = mesh.triangles[at(t)];
    std::array<int, 3> count{};
    for (std::size_t j = 0; j < 3; ++j) {
      const int a = v[j], b = v[(j + 1) % 3];
      const Component component = direction_of(mesh.material.col(b) - mesh.material.col(a));
      ++count[component];
      Link& link = links[mesh_edge(a, b)];
      link.component = component;
      link.area += material_area(mesh, t);
    }
    if (count != std::array<int, 3>{1, 1, 1})
      throw Error(fmt::format(
          "springs need a regular grid: triangle {} of the mesh has no edge along weft and one "
          "along warp at a right angle",
          t));
  }
  for (const auto& [edge, apex] : edge_apexes(mesh)) {
    Link& link = links.at(edge);
    if (link.component != kShear || apex.size() != 2) continue;
    const Link other{kShear, 0.5 * link.area};
    link.area = other.area;
    links.emplace(mesh_edge(apex[0], apex[1]), other);
  }
  return links;
}

Component bend_of(Component stretch) { return static_cast<Component>(stretch + kWeftBend); }

/// Of two neighbours of one vertex along the same component: on opposite sides of it. Cells need
/// not be of equal size.
bool opposite(Component component, const Vec2& to_a, const Vec2& to_b) {
  if (component != kShear) return to_a.dot(to_b) < 0;
  return to_a.x() * to_b.x() < 0 && to_a.y() * to_b.y() < 0;
}

/// Pairs of neighbours that lie opposite to each other about their vertex.
void add_second_ring(const TriangleMesh& mesh, const std::map<MeshEdge, Link>& links,
                     std::vector<Spring>& springs) {
  std::vector<std::vector<std::pair<int, Link>>> neighbours(at(mesh.vertex_count()));
  for (const auto& [ends, link] : links) {
    neighbours[at(ends.first)].emplace_back(ends.second, link);
    neighbours[at(ends.second)].emplace_back(ends.first, link);
  }
  for (int v = 0; v < mesh.vertex_count(); ++v) {
    const auto& around = neighbours[at(v)];
    for (std::size_t i = 0; i < around.size(); ++i)
      for (std::size_t j = i + 1; j < around.size(); ++j) {
        const Component component = around[i].second.component;
        if (component != around[j].second.component) continue;
        const Vec2 to_a = mesh.material.col(around[i].first) - mesh.material.col(v);
        const Vec2 to_b = mesh.material.col(around[j].first) - mesh.material.col(v);
        if (!opposite(component, to_a, to_b)) continue;
        const auto [a, b] = mesh_edge(around[i].first, around[j].first);
        springs.push_back({a, b, bend_of(component), (to_a - to_b).norm(),
                           0.5 * (around[i].second.area + around[j].second.area), 1, 0});
      }
  }
}

std::vector<Spring> make_springs(const TriangleMesh& mesh) {
  std::vector<Spring> springs;
  const auto links = find_links(mesh);
  for (const auto& [ends, link] : links) {
    const Vec2 along = mesh.material.col(ends.second) - mesh.material.col(ends.first);
    const double length = along.norm();
    double strain = 1;
    if (link.component == kShear) strain = length * length / std::abs(along.x() * along.y());
    springs.push_back(
        {ends.first, ends.second, link.component, length, link.area * strain * strain, strain, 0});
  }
  add_second_ring(mesh, links, springs);
  return springs;
}

}  // namespace

SpringModel::SpringModel(const TriangleMesh& mesh, const Fabric& fabric, double grain_angle)
    : mesh_(mesh),
      fabric_(fabric),
      springs_(make_springs(along_the_threads(mesh, grain_angle))),
      pattern_(mesh.vertex_count()) {
  validate(fabric);
  for (const char* name : kNames) curves_.push_back(fabric.curve(name));
  for (const Spring& spring : springs_) pattern_.add_element(std::array{spring.a, spring.b});
  pattern_.finish();
  for (Spring& spring : springs_) spring.slot = pattern_.slot(spring.b, spring.a);
  int column = 0;
  for (const StiffnessCurve& curve : curves_) column += curve.size();
  friction_column_.fill(-1);
  for (const int i : friction_components(fabric)) {
    friction_column_[at(i)] = column;
    column += 2;
    history_.setZero(2 * static_cast<Eigen::Index>(springs_.size()));
  }
  set_parameters(fabric.values);
}

void SpringModel::set_parameters(const VecX& values) {
  Fabric changed = fabric_;
  changed.values = values;
  validate(changed);
  fabric_.values = values;
  int first = 0;
  for (StiffnessCurve& curve : curves_) {
    curve.set_values(values.segment(first, curve.size()));
    first += curve.size();
  }
  for (std::size_t i = 0; i < friction_.size(); ++i)
    if (const int column = friction_column_[i]; column >= 0)
      friction_[i] = {values[column], values[column + 1]};
}

SpringModel::Reach SpringModel::reach(const Spring& spring, const Points& x) {
  const Vec3 along = x.col(spring.b) - x.col(spring.a);
  const double length = along.norm();
  return {length, length / spring.length - 1,
          length > 0 ? Vec3(along / length) : Vec3(Vec3::Zero())};
}

FrictionResponse SpringModel::rub(std::size_t i, double elongation) const {
  const Spring& s = springs_[i];
  const auto first = 2 * static_cast<Eigen::Index>(i);
  return detail::respond(friction_[at(s.component)], s.strain * elongation, history_[first],
                         history_[first + 1]);
}

StiffnessCurve::Response SpringModel::respond(std::size_t i, double elongation) const {
  const Spring& s = springs_[i];
  StiffnessCurve::Response r = curves_[at(s.component)].respond(elongation);
  if (rubs(s)) {
    const FrictionResponse f = rub(i, elongation);
    r.energy += f.energy / (s.strain * s.strain);
    r.stress += f.stress / s.strain;
    r.tangent += f.tangent;
  }
  return r;
}

double SpringModel::energy(const Points& x) const {
  double sum = 0;
  for (std::size_t i = 0; i < springs_.size(); ++i)
    sum += springs_[i].area * respond(i, reach(springs_[i], x).elongation).energy;
  return sum;
}

void SpringModel::gradient(const Points& x, Points& gradient) const {
  gradient.setZero(3, mesh_.vertex_count());
  for (std::size_t i = 0; i < springs_.size(); ++i) {
    const Spring& s = springs_[i];
    const Reach r = reach(s, x);
    const Vec3 pull = (s.area * respond(i, r.elongation).stress / s.length) * r.direction;
    gradient.col(s.a) -= pull;
    gradient.col(s.b) += pull;
  }
}

void SpringModel::hessian(const Points& x, HessianKind kind, Points& gradient,
                          SparseMatrix& hessian) const {
  assert(hessian.nonZeros() == pattern_.matrix().nonZeros());
  gradient.setZero(3, mesh_.vertex_count());
  for (std::size_t i = 0; i < springs_.size(); ++i) {
    const Spring& s = springs_[i];
    const Reach reached = reach(s, x);
    if (!(reached.length > 0)) continue;  // no direction
    const auto r = respond(i, reached.elongation);
    const Vec3& n = reached.direction;
    const double tension = s.area * r.stress / s.length;
    gradient.col(s.a) -= tension * n;
    gradient.col(s.b) += tension * n;
    double across = tension / reached.length,
           stiffness = s.area * r.tangent / (s.length * s.length);
    if (kind == HessianKind::positive_semidefinite) {
      across = std::max(across, 0.0);
      stiffness = std::max(stiffness, 0.0);
    }
    const Mat3 block = across * Mat3::Identity() + (stiffness - across) * (n * n.transpose());
    const Mat3 opposite = -block;
    pattern_.add_diagonal(hessian.valuePtr(), s.a, block);
    pattern_.add_diagonal(hessian.valuePtr(), s.b, block);
    pattern_.add_off_diagonal(hessian.valuePtr(), s.b, s.a, s.slot, opposite);
  }
}

void SpringModel::add_stress(std::size_t i, const Vec3& direction, double stress,
                             Eigen::Ref<VecX> column) const {
  const Spring& s = springs_[i];
  const Vec3 pull = (s.area * stress / s.length) * direction;
  column.segment<3>(3 * s.a) -= pull;
  column.segment<3>(3 * s.b) += pull;
}

void SpringModel::parameter_derivative(const Points& x, MatX& derivative) const {
  derivative.setZero(3 * mesh_.vertex_count(), fabric_.values.size());
  std::array<int, 7> first{};
  for (std::size_t i = 0; i < 6; ++i) first[i + 1] = first[i] + curves_[i].size();
  VecX basis(StiffnessCurve::kMostKnots);
  for (std::size_t i = 0; i < springs_.size(); ++i) {
    const Spring& s = springs_[i];
    const StiffnessCurve& curve = curves_[at(s.component)];
    const Reach r = reach(s, x);
    curve.stiffness_by_values(r.elongation, basis.head(curve.size()));
    for (int k = 0; k < curve.size(); ++k)
      add_stress(i, r.direction, basis[k] * r.elongation,
                 derivative.col(first[at(s.component)] + k));
    if (!rubs(s)) continue;
    const FrictionResponse f = rub(i, r.elongation);
    const int column = friction_column_[at(s.component)];
    add_stress(i, r.direction, f.by_amplitude / s.strain, derivative.col(column));
    add_stress(i, r.direction, f.by_scale / s.strain, derivative.col(column + 1));
  }
}

void SpringModel::set_history(const VecX& history) {
  ElasticModel::set_history(history);
  history_ = history;
}

VecX SpringModel::next_history(const Points& x) const {
  VecX next = history_;
  for (std::size_t i = 0; i < springs_.size(); ++i) {
    const Spring& s = springs_[i];
    if (!rubs(s)) continue;
    const double elongation = reach(s, x).elongation;
    next.segment<2>(2 * static_cast<Eigen::Index>(i)) << s.strain * elongation,
        rub(i, elongation).stress;
  }
  return next;
}

void SpringModel::add_history_derivative(const Points& x, const MatX& history_derivative,
                                         MatX& derivative) const {
  for (std::size_t i = 0; i < springs_.size(); ++i) {
    const Spring& s = springs_[i];
    if (!rubs(s)) continue;
    const Reach r = reach(s, x);
    const FrictionResponse f = rub(i, r.elongation);
    const auto strain = 2 * static_cast<Eigen::Index>(i), stress = strain + 1;
    for (Eigen::Index p = 0; p < derivative.cols(); ++p)
      add_stress(i, r.direction,
                 (f.by_former_stress * history_derivative(stress, p) -
                  f.tangent * history_derivative(strain, p)) /
                     s.strain,
                 derivative.col(p));
  }
}

MatX SpringModel::next_history_derivative(const Points& x, const MatX& x_derivative,
                                          const MatX& history_derivative) const {
  MatX next = MatX::Zero(history_.size(), x_derivative.cols());
  for (std::size_t i = 0; i < springs_.size(); ++i) {
    const Spring& s = springs_[i];
    if (!rubs(s)) continue;
    const Reach r = reach(s, x);
    const FrictionResponse f = rub(i, r.elongation);
    const auto strain = 2 * static_cast<Eigen::Index>(i), stress = strain + 1;
    next.row(strain) = (s.strain / s.length) * r.direction.transpose() *
                       (x_derivative.middleRows<3>(3 * s.b) - x_derivative.middleRows<3>(3 * s.a));
    next.row(stress) = f.tangent * (next.row(strain) - history_derivative.row(strain)) +
                       f.by_former_stress * history_derivative.row(stress);
    const int column = friction_column_[at(s.component)];
    next(stress, column) += f.by_amplitude;
    next(stress, column + 1) += f.by_scale;
  }
  return next;
}

}  // namespace weft::detail
