#include "weft/model/sheet_model.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "weft/base/dense.h"

namespace weft::detail {
namespace {

using Mat2 = Eigen::Matrix2d;
using Mat63 = Eigen::Matrix<double, 6, 3>;
using Mat6 = Eigen::Matrix<double, 6, 6>;
using Mat9 = Eigen::Matrix<double, 9, 9>;
using Mat18x3 = Eigen::Matrix<double, 18, 3>;

/// (w_u, w_v) of a triangle.
Mat32 deformation(const TriangleShape<double>& shape, const std::array<int, 3>& v,
                  const Points& x) {
  const Vec3 a = x.col(v[1]) - x.col(v[0]), b = x.col(v[2]) - x.col(v[0]);
  Mat32 w;
  w.col(0) = shape.du1 * a + shape.du2 * b;
  w.col(1) = shape.dv1 * a + shape.dv2 * b;
  return w;
}

Vec3 green_strain(const Mat32& w) {
  return {0.5 * (w.col(0).squaredNorm() - 1), 0.5 * (w.col(1).squaredNorm() - 1),
          w.col(0).dot(w.col(1))};
}

/// Derivative of the Green strain by (w_u, w_v), a column a strain.
template <class Derived>
auto strain_gradient(const Eigen::MatrixBase<Derived>& w) {
  constexpr int n = Derived::RowsAtCompileTime;
  Eigen::Matrix<double, 2 * n, 3> b;
  b.setZero();
  b.template block<n, 1>(0, 0) = w.col(0);
  b.template block<n, 1>(n, 1) = w.col(1);
  b.template block<n, 1>(0, 2) = w.col(1);
  b.template block<n, 1>(n, 2) = w.col(0);
  return b;
}

Mat2 stress_matrix(const Vec3& stress) {
  Mat2 s;
  s << stress[0], stress[2], stress[2], stress[1];
  return s;
}

/// Without its negative eigenvalues.
Mat2 positive_part(const Mat2& a) {
  if (is_positive_definite(a)) return a;
  const double mean = 0.5 * a.trace(), radius = std::hypot(0.5 * (a(0, 0) - a(1, 1)), a(1, 0));
  if (mean + radius <= 0) return Mat2::Zero();
  return (mean + radius) / (2 * radius) * (a - (mean - radius) * Mat2::Identity());
}
Mat3 positive_part(const Mat3& a) {
  if (is_positive_definite(a)) return a;
  const auto [values, vectors] = symmetric_eigen_3(a);
  return vectors * values.cwiseMax(0).asDiagonal() * vectors.transpose();
}

/// h += s x a: the 3 x 3 matrix `a` in each block, times the entry of `s`.
void add_kronecker(const Mat2& s, const Mat3& a, Mat6& h) {
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j) h.block<3, 3>(3 * i, 3 * j) += s(i, j) * a;
}

/// Is the exact Hessian positive definite against what stays in the plane?
bool positive_in_the_plane(const Mat32& w, const Vec3& normal, const SheetResponse& r) {
  const Vec3 first = w.col(0).normalized(), second = normal.cross(first);
  Mat2 plane;
  plane << first.dot(w.col(0)), first.dot(w.col(1)), second.dot(w.col(0)), second.dot(w.col(1));
  const auto b = strain_gradient(plane);
  Eigen::Matrix4d h = b * r.stiffness * b.transpose();
  const Mat2 s = stress_matrix(r.stress);
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j) h.block<2, 2>(2 * i, 2 * j).diagonal().array() += s(i, j);
  return is_positive_definite(h);
}

/// By (w_u, w_v), a density.
Mat6 membrane_hessian(const Mat32& w, const SheetResponse& r, HessianKind kind) {
  const Mat63 b = strain_gradient(w);
  const Mat2 s = stress_matrix(r.stress);
  Mat6 h;
  if (kind == HessianKind::exact) {
    h = b * r.stiffness * b.transpose();
    add_kronecker(s, Mat3::Identity(), h);
    return h;
  }
  const Mat2 tension = positive_part(s);
  const Vec3 area_vector = w.col(0).cross(w.col(1));
  const double squares = w.squaredNorm();
  if (area_vector.norm() > 1e-8 * squares) {
    const Vec3 normal = area_vector.normalized();
    if (positive_in_the_plane(w, normal, r)) {
      const Mat3 across = normal * normal.transpose();
      h = b * r.stiffness * b.transpose();
      add_kronecker(s, Mat3::Identity() - across, h);
      add_kronecker(tension, across, h);
      return h;
    }
  }
  h = b * positive_part(r.stiffness) * b.transpose();
  add_kronecker(tension, Mat3::Identity(), h);
  return h;
}

std::array<Vector3<double>, 6> positions(const std::array<int, 6>& vertices, const Points& x) {
  std::array<Vector3<double>, 6> out;
  for (std::size_t i = 0; i < 6; ++i) out[i] = to_vector3(x.col(vertices[i]));
  return out;
}

Vec3 vector(const std::array<double, 3>& a) { return {a[0], a[1], a[2]}; }
std::array<double, 3> array(const Vec3& a) { return {a[0], a[1], a[2]}; }

Vec3 of_lane(const std::array<Lanes, 3>& a, std::size_t lane) {
  const auto i = static_cast<int>(lane);
  return {a[0][i], a[1][i], a[2][i]};
}

/// The gradients of the three curvature components, by vertices.
Mat18x3 curvature_jacobian(const CurvatureMap<double>& map, const TriangleCurvature<double>& c) {
  Mat18x3 out = Mat18x3::Zero();
  for (std::size_t j = 0; j < 3; ++j) {
    const auto g = c.angles[j].gradient();
    const auto v = hinge_vertices(j);
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t i = 0; i < 4; ++i)
        out.block<3, 1>(static_cast<Eigen::Index>(3 * v[i]), static_cast<Eigen::Index>(k)) +=
            map.r[k][j] * to_eigen(g[i]);
  }
  return out;
}

/// Adds the lower blocks of a triangle's Hessian to the matrix.
void add_blocks(const BlockPattern& pattern, const std::array<int, 3>& vertices,
                const std::array<int, 3>& slots, const Mat9& h, double* values) {
  for (std::size_t i = 0; i < 3; ++i) {
    const auto row = static_cast<Eigen::Index>(3 * i);
    pattern.add_diagonal(values, vertices[i], h.block<3, 3>(row, row));
  }
  for (std::size_t k = 0; k < 3; ++k) {
    const auto [i, j] = kPairs[k];
    pattern.add_off_diagonal(
        values, vertices[i], vertices[j], slots[k],
        h.block<3, 3>(static_cast<Eigen::Index>(3 * i), static_cast<Eigen::Index>(3 * j)));
  }
}

/// `stiffness` against the rim's angles, inverted on the span of their directions; `rim` projects
/// onto it.
Mat3 rim_compliance(const Mat3& stiffness, const Mat3& rim) {
  const double size = stiffness.norm() + std::numeric_limits<double>::min();
  const Mat3 h =
      rim * (stiffness + 1e-14 * size * Mat3::Identity()) * rim + size * (Mat3::Identity() - rim);
  return Eigen::LDLT<Mat3>(h).solve(rim);
}

/// Projects onto the span of `directions`.
Mat3 span_projection(const std::vector<Vec3>& directions) {
  Mat3 projection = Mat3::Zero();
  for (const Vec3& direction : directions) {
    const Vec3 rest = direction - projection * direction;
    if (rest.norm() > 1e-9 * direction.norm())
      projection += rest.normalized() * rest.normalized().transpose();
  }
  return projection;
}

}  // namespace

TriangleMesh along_the_threads(const TriangleMesh& mesh, double grain_angle) {
  TriangleMesh turned = mesh;
  if (grain_angle != 0)
    turned.material = Eigen::Rotation2Dd(-grain_angle).toRotationMatrix() * mesh.material;
  return turned;
}

SheetModel::SheetModel(const TriangleMesh& mesh, const Fabric& fabric, double grain_angle,
                       std::unique_ptr<SheetLaw> membrane, std::unique_ptr<SheetLaw> bending)
    : mesh_(mesh),
      fabric_(fabric),
      membrane_(std::move(membrane)),
      bending_(std::move(bending)),
      pattern_(mesh.vertex_count()) {
  const TriangleMesh turned = along_the_threads(mesh, grain_angle);
  const auto bends = bending_elements(turned, RimAngles::open);
  for (const BendingElement& bend : bends) pattern_.add_element(bend.vertices);
  pattern_.finish();
  for (const auto& vertices : mesh.triangles) {
    Triangle triangle{vertices, {}, {}};
    const auto& v = triangle.vertices;
    triangle.shape = triangle_shape(turned.material.col(v[0]), turned.material.col(v[1]),
                                    turned.material.col(v[2]));
    for (std::size_t k = 0; k < 3; ++k)
      triangle.slots[k] = pattern_.slot(v[kPairs[k][0]], v[kPairs[k][1]]);
    triangles_.push_back(triangle);
  }
  for (const BendingElement& bend : bends) {
    plates_.push_back(
        {bend.vertices, bend.map, bend.area, !bend.rim.empty(), span_projection(bend.rim)});
  }
  plate_groups_ = bending_groups(bends, pattern_);
  rubbing_ = friction_components(fabric);
  if (!rubbing_.empty())
    history_ = VecX::Zero(kHistory * static_cast<Eigen::Index>(element_count()));
  set_parameters(fabric.values);
}

void SheetModel::set_parameters(const VecX& values) {
  Fabric changed = fabric_;
  changed.values = values;
  validate(changed);
  fabric_.values = values;
  membrane_->set_parameters(values.head(membrane_->parameter_count()));
  bending_->set_parameters(
      values.segment(membrane_->parameter_count(), bending_->parameter_count()));
  int next = membrane_->parameter_count() + bending_->parameter_count();
  for (const int i : rubbing_) {
    friction_[static_cast<std::size_t>(i)] = {values[next], values[next + 1]};
    next += 2;
  }
}

SheetModel::Bent SheetModel::bend(const Plate& plate, const Vec3& curvature) const {
  Bent bent{curvature, Mat3::Identity(), bending_->respond(curvature)};
  SheetResponse& r = bent.response;
  if (!plate.on_rim) return bent;
  // Newton's iteration for the angles on the rim: one step where the law is linear.
  constexpr int kMostSteps = 30;
  const double scale = r.stress.norm();
  for (int step = 0; step < kMostSteps; ++step) {
    const Vec3 residual = plate.rim * r.stress;
    if (!(residual.norm() > 1e-13 * scale)) break;
    Vec3 change = -(rim_compliance(positive_part(r.stiffness), plate.rim) * residual);
    SheetResponse next = bending_->respond(bent.strain + change);
    for (int halving = 0; next.energy > r.energy && halving < kMostSteps; ++halving) {
      change *= 0.5;
      next = bending_->respond(bent.strain + change);
    }
    if (next.energy > r.energy) break;  // rounding
    bent.strain += change;
    r = next;
  }
  bent.projection = Mat3::Identity() - r.stiffness * rim_compliance(r.stiffness, plate.rim);
  r.stress = bent.projection * r.stress;
  const Mat3 stiffness = bent.projection * r.stiffness;
  r.stiffness = 0.5 * (stiffness + stiffness.transpose());
  return bent;
}

FrictionResponse SheetModel::rub(std::size_t e, int i, double strain) const {
  const Eigen::Index first = kHistory * static_cast<Eigen::Index>(e) + i % 3;
  return detail::respond(friction_[static_cast<std::size_t>(i)], strain, history_[first],
                         history_[first + 3]);
}

SheetResponse SheetModel::membrane(std::size_t t, const Vec3& strain) const {
  SheetResponse out = membrane_->respond(strain);
  for (const int i : rubbing_) {
    if (i >= 3) break;
    const FrictionResponse r = rub(t, i, strain[i]);
    out.energy += r.energy;
    out.stress[i] += r.stress;
    out.stiffness(i, i) += r.tangent;
  }
  return out;
}

SheetModel::Bent SheetModel::bend(std::size_t p, const Vec3& curvature) const {
  const Plate& plate = plates_[p];
  Bent out = bend(plate, curvature);
  if (rubbing_.empty() || rubbing_.back() < 3) return out;
  const Mat3 kept = Mat3::Identity() - plate.rim;
  const Vec3 rubbed = kept * curvature;
  Vec3 stress = Vec3::Zero(), tangent = Vec3::Zero();
  for (const int i : rubbing_) {
    if (i < 3) continue;
    const FrictionResponse r = rub(triangles_.size() + p, i, rubbed[i - 3]);
    out.response.energy += r.energy;
    stress[i - 3] = r.stress;
    tangent[i - 3] = r.tangent;
  }
  out.response.stress += kept * stress;
  out.response.stiffness += kept * tangent.asDiagonal() * kept;
  return out;
}

double SheetModel::energy(const Points& x) const {
  double sum = 0;
  for (std::size_t t = 0; t < triangles_.size(); ++t)
    sum += triangles_[t].shape.area * membrane(t, membrane_strain(t, x)).energy;
  for_each_group([&](const BendingGroup& group, std::size_t first) {
    const auto c = stencil_curvature(group.map, gather(x.data(), group.vertices));
    const auto bent = bend(group, first, c);
    for (std::size_t lane = 0; lane < at(group.count); ++lane)
      sum += plates_[first + lane].area * bent[lane].response.energy;
  });
  return sum;
}

template <class Visit>
void SheetModel::for_each_group(const Visit& visit) const {
  for (std::size_t i = 0; i < plate_groups_.size(); ++i) visit(plate_groups_[i], i * kLanes);
}

std::array<SheetModel::Bent, kLanes> SheetModel::bend(
    const BendingGroup& group, std::size_t first, const TriangleCurvature<Lanes>& curvature) const {
  std::array<Bent, kLanes> out;
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    // What fills the group is like its last plate, and has no area.
    const std::size_t used = std::min(lane, at(group.count) - 1);
    out[lane] = used == lane ? bend(first + lane, of_lane(curvature.value, lane)) : out[used];
  }
  return out;
}

std::array<Lanes, 3> SheetModel::moments(const BendingGroup& group,
                                         const std::array<Bent, kLanes>& bent) {
  std::array<Lanes, 3> out;
  for (std::size_t k = 0; k < 3; ++k) {
    for (int lane = 0; lane < kLanes; ++lane)
      out[k][lane] = bent[at(lane)].response.stress[static_cast<Eigen::Index>(k)];
    out[k] *= group.areas[k];
  }
  return out;
}

SymmetricMatrix3<Lanes> SheetModel::stiffnesses(const BendingGroup& group,
                                                const std::array<Bent, kLanes>& bent,
                                                HessianKind kind) {
  SymmetricMatrix3<Lanes> out;
  for (int lane = 0; lane < kLanes; ++lane) {
    const Mat3& exact = bent[at(lane)].response.stiffness;
    const Mat3 k = kind == HessianKind::exact ? exact : positive_part(exact);
    std::size_t entry = 0;
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column <= row; ++column) out.m[entry++][lane] = k(row, column);
  }
  return group.areas[0] * out;
}

void SheetModel::gradient(const Points& x, Points& gradient) const {
  gradient.setZero(3, mesh_.vertex_count());
  for (std::size_t t = 0; t < triangles_.size(); ++t) {
    const Mat32 w = deformation(triangles_[t].shape, triangles_[t].vertices, x);
    add_gradient(triangles_[t], w * stress_matrix(membrane(t, green_strain(w)).stress), gradient);
  }
  for_each_group([&](const BendingGroup& group, std::size_t first) {
    const auto c = stencil_curvature(group.map, gather(x.data(), group.vertices));
    const auto moment = moments(group, bend(group, first, c));
    scatter_add(curvature_gradient(group.map, c, moment), group.vertices, gradient.data());
  });
}

void SheetModel::hessian(const Points& x, HessianKind kind, Points& gradient,
                         SparseMatrix& hessian) const {
  assert(hessian.nonZeros() == pattern_.matrix().nonZeros());
  gradient.setZero(3, mesh_.vertex_count());
  for (std::size_t t = 0; t < triangles_.size(); ++t)
    add_membrane(t, x, kind, gradient, hessian.valuePtr());
  BlockWriter writer(hessian.valuePtr(), pattern_.columns());
  for_each_group([&](const BendingGroup& group, std::size_t first) {
    add_bending(group, first, x, kind, gradient, writer);
  });
}

void SheetModel::add_gradient(const Triangle& t, const Mat32& by_deformation,
                              Points& gradient) const {
  const auto& s = t.shape;
  const Vec3 g1 = s.area * (s.du1 * by_deformation.col(0) + s.dv1 * by_deformation.col(1));
  const Vec3 g2 = s.area * (s.du2 * by_deformation.col(0) + s.dv2 * by_deformation.col(1));
  gradient.col(t.vertices[0]) -= g1 + g2;
  gradient.col(t.vertices[1]) += g1;
  gradient.col(t.vertices[2]) += g2;
}

void SheetModel::add_membrane(std::size_t index, const Points& x, HessianKind kind,
                              Points& gradient, double* values) const {
  const Triangle& t = triangles_[index];
  const Mat32 w = deformation(t.shape, t.vertices, x);
  const SheetResponse r = membrane(index, green_strain(w));
  add_gradient(t, w * stress_matrix(r.stress), gradient);
  const Mat6 h = t.shape.area * membrane_hessian(w, r, kind);
  const auto du = t.shape.du(), dv = t.shape.dv();
  Mat9 blocks;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j <= i; ++j)
      blocks.block<3, 3>(static_cast<Eigen::Index>(3 * i), static_cast<Eigen::Index>(3 * j)) =
          (du[i] * du[j]) * h.block<3, 3>(0, 0) + (du[i] * dv[j]) * h.block<3, 3>(0, 3) +
          (dv[i] * du[j]) * h.block<3, 3>(3, 0) + (dv[i] * dv[j]) * h.block<3, 3>(3, 3);
  add_blocks(pattern_, t.vertices, t.slots, blocks, values);
}

void SheetModel::add_bending(const BendingGroup& group, std::size_t first, const Points& x,
                             HessianKind kind, Points& gradient, BlockWriter& writer) const {
  const auto c = stencil_curvature(group.map, gather(x.data(), group.vertices));
  const auto bent = bend(group, first, c);
  const auto moment = moments(group, bent);
  scatter_add(curvature_gradient(group.map, c, moment), group.vertices, gradient.data());
  auto h = curvature_gauss_newton(group.map, c, stiffnesses(group, bent, kind));
  if (kind == HessianKind::exact) add_curvature_hessian(group.map, c, moment, h);
  writer.add(h, group.vertices, group.slots);
}

void SheetModel::parameter_derivative(const Points& x, MatX& derivative) const {
  const int of_membrane = membrane_->parameter_count(), of_bending = bending_->parameter_count();
  derivative.setZero(3 * mesh_.vertex_count(), fabric_.values.size());
  Eigen::Matrix3Xd stress(3, of_membrane), moment(3, of_bending);
  for (const Triangle& t : triangles_) {
    const Mat32 w = deformation(t.shape, t.vertices, x);
    membrane_->stress_derivative(green_strain(w), stress);
    const auto du = t.shape.du(), dv = t.shape.dv();
    for (int p = 0; p < of_membrane; ++p) {
      const Mat32 g = t.shape.area * w * stress_matrix(stress.col(p));
      for (std::size_t i = 0; i < 3; ++i)
        derivative.col(p).segment<3>(3 * t.vertices[i]) += du[i] * g.col(0) + dv[i] * g.col(1);
    }
  }
  for (const Plate& plate : plates_) {
    const auto c = triangle_curvature(plate.map, positions(plate.vertices, x));
    const Bent bent = bend(plate, vector(c.value));
    bending_->stress_derivative(bent.strain, moment);
    const Mat18x3 jacobian = curvature_jacobian(plate.map, c) * (plate.area * bent.projection);
    for (int p = 0; p < of_bending; ++p)
      for (std::size_t i = 0; i < 6; ++i)
        derivative.col(of_membrane + p).segment<3>(3 * plate.vertices[i]) +=
            jacobian.middleRows<3>(static_cast<Eigen::Index>(3 * i)) * moment.col(p);
  }
  for (std::size_t e = 0; !rubbing_.empty() && e < element_count(); ++e) {
    const Vec3 strain = rubbed_strain(e, x);
    int column = of_membrane + of_bending;
    for (const int i : rubbing_) {
      if (acts_on(i, e)) {
        const FrictionResponse r = rub(e, i, strain[i % 3]);
        add_stress(e, x, r.by_amplitude * Vec3::Unit(i % 3), derivative.col(column));
        add_stress(e, x, r.by_scale * Vec3::Unit(i % 3), derivative.col(column + 1));
      }
      column += 2;
    }
  }
}

Vec3 SheetModel::membrane_strain(std::size_t t, const Points& x) const {
  return green_strain(deformation(triangles_[t].shape, triangles_[t].vertices, x));
}

std::vector<SheetModel::ElementStrain> SheetModel::element_strains(const Points& x,
                                                                   int component) const {
  std::vector<ElementStrain> out;
  for (std::size_t e = 0; e < element_count(); ++e) {
    if (!acts_on(component, e)) continue;
    const double strain = rubbed_strain(e, x)[component % 3];
    if (e < triangles_.size()) {
      out.push_back({triangles_[e].vertices, triangles_[e].shape.area, strain});
    } else {
      const Plate& plate = plates_[e - triangles_.size()];
      out.push_back(
          {{plate.vertices[0], plate.vertices[1], plate.vertices[2]}, plate.area, strain});
    }
  }
  return out;
}

Vec3 SheetModel::rubbed_strain(std::size_t e, const Points& x) const {
  if (e < triangles_.size()) return membrane_strain(e, x);
  const Plate& plate = plates_[e - triangles_.size()];
  const auto c = triangle_curvature(plate.map, positions(plate.vertices, x));
  return vector(c.value) - plate.rim * vector(c.value);
}

void SheetModel::add_stress(std::size_t e, const Points& x, const Vec3& stress,
                            Eigen::Ref<VecX> column) const {
  if (e < triangles_.size()) {
    const Triangle& t = triangles_[e];
    const Mat32 g = t.shape.area * deformation(t.shape, t.vertices, x) * stress_matrix(stress);
    const auto du = t.shape.du(), dv = t.shape.dv();
    for (std::size_t i = 0; i < 3; ++i)
      column.segment<3>(3 * t.vertices[i]) += du[i] * g.col(0) + dv[i] * g.col(1);
    return;
  }
  const Plate& plate = plates_[e - triangles_.size()];
  const auto c = triangle_curvature(plate.map, positions(plate.vertices, x));
  const auto by_vertex =
      curvature_gradient(plate.map, c, array(plate.area * (stress - plate.rim * stress)));
  for (std::size_t i = 0; i < 6; ++i)
    column.segment<3>(3 * plate.vertices[i]) += to_eigen(by_vertex[i]);
}

void SheetModel::set_history(const VecX& history) {
  ElasticModel::set_history(history);
  history_ = history;
}

VecX SheetModel::next_history(const Points& x) const {
  VecX next = history_;
  for (std::size_t e = 0; !rubbing_.empty() && e < element_count(); ++e) {
    const Vec3 strain = rubbed_strain(e, x);
    const Eigen::Index first = kHistory * static_cast<Eigen::Index>(e);
    next.segment<3>(first) = strain;
    for (const int i : rubbing_)
      if (acts_on(i, e)) next[first + 3 + i % 3] = rub(e, i, strain[i % 3]).stress;
  }
  return next;
}

void SheetModel::add_history_derivative(const Points& x, const MatX& history_derivative,
                                        MatX& derivative) const {
  for (std::size_t e = 0; !rubbing_.empty() && e < element_count(); ++e) {
    const Vec3 strain = rubbed_strain(e, x);
    const Eigen::Index first = kHistory * static_cast<Eigen::Index>(e);
    Vec3 tangent = Vec3::Zero(), lag = Vec3::Zero();
    for (const int i : rubbing_) {
      if (!acts_on(i, e)) continue;
      const FrictionResponse r = rub(e, i, strain[i % 3]);
      tangent[i % 3] = r.tangent;
      lag[i % 3] = r.by_former_stress;
    }
    for (Eigen::Index p = 0; p < derivative.cols(); ++p) {
      const Vec3 stress = lag.cwiseProduct(history_derivative.col(p).segment<3>(first + 3)) -
                          tangent.cwiseProduct(history_derivative.col(p).segment<3>(first));
      add_stress(e, x, stress, derivative.col(p));
    }
  }
}

MatX SheetModel::strain_derivative(std::size_t e, const Points& x, const MatX& x_derivative) const {
  MatX out = MatX::Zero(3, x_derivative.cols());
  if (e < triangles_.size()) {
    const Triangle& triangle = triangles_[e];
    const Mat63 by_deformation = strain_gradient(deformation(triangle.shape, triangle.vertices, x));
    const auto du = triangle.shape.du(), dv = triangle.shape.dv();
    for (std::size_t i = 0; i < 3; ++i)
      out += (du[i] * by_deformation.topRows<3>() + dv[i] * by_deformation.bottomRows<3>())
                 .transpose() *
             x_derivative.middleRows<3>(3 * triangle.vertices[i]);
    return out;
  }
  const Plate& plate = plates_[e - triangles_.size()];
  const auto c = triangle_curvature(plate.map, positions(plate.vertices, x));
  const Mat18x3 jacobian = curvature_jacobian(plate.map, c) * (Mat3::Identity() - plate.rim);
  for (std::size_t i = 0; i < 6; ++i)
    out += jacobian.middleRows<3>(static_cast<Eigen::Index>(3 * i)).transpose() *
           x_derivative.middleRows<3>(3 * plate.vertices[i]);
  return out;
}

MatX SheetModel::next_history_derivative(const Points& x, const MatX& x_derivative,
                                         const MatX& history_derivative) const {
  MatX next = MatX::Zero(history_.size(), x_derivative.cols());
  for (std::size_t e = 0; !rubbing_.empty() && e < element_count(); ++e) {
    const Vec3 strain = rubbed_strain(e, x);
    const Eigen::Index first = kHistory * static_cast<Eigen::Index>(e);
    next.middleRows<3>(first) = strain_derivative(e, x, x_derivative);
    int own = membrane_->parameter_count() + bending_->parameter_count();
    for (const int i : rubbing_) {
      if (acts_on(i, e)) {
        const FrictionResponse r = rub(e, i, strain[i % 3]);
        const Eigen::Index at_strain = first + i % 3, at_stress = at_strain + 3;
        next.row(at_stress) =
            r.tangent * (next.row(at_strain) - history_derivative.row(at_strain)) +
            r.by_former_stress * history_derivative.row(at_stress);
        next(at_stress, own) += r.by_amplitude;
        next(at_stress, own + 1) += r.by_scale;
      }
      own += 2;
    }
  }
  return next;
}

}  // namespace weft::detail
