#include "weft/dynamics/xpbd_sheet.h"

#include "weft/model/bending.h"

namespace weft::xpbd {
namespace {

constexpr int kBendParameter = 4;
// An explicit step would be stable with a lightness below 4 (Gershgorin's bound; about 10 in fact).
// With 16 the number of steps to rest is near its least; from 50 on they may diverge.
constexpr double kLightness = 16;
constexpr double kJacobiLightness = 2;

/// l^2 / (A_1 + A_2) of a hinge.
double hinge_weight(const TriangleMesh& mesh, const Hinge& hinge) {
  const auto point = [&](std::size_t i) -> Vec2 { return mesh.material.col(hinge.vertices[i]); };
  const Vec2 edge = point(1) - point(0);
  const auto area = [&](const Vec2& apex) {
    const Vec2 side = apex - point(0);
    return 0.5 * std::abs(edge.x() * side.y() - edge.y() * side.x());
  };
  return edge.squaredNorm() / (area(point(2)) + area(point(3)));
}

/// Bounds of the sums of the absolute entries in the rows of the stiffness matrix of the flat
/// sheet, one a vertex, N/m.
VecX stiffness_bounds(const TriangleMesh& mesh, const OrthotropicSheet& sheet,
                      XpbdBending bending) {
  const bool weighted = bending != XpbdBending::dihedral;
  VecX k = VecX::Zero(mesh.vertex_count());
  const double membrane = std::max(sheet.c00, sheet.c11) + std::abs(sheet.c01) + sheet.c22;
  for (const auto& t : mesh.triangles) {
    const auto shape =
        triangle_shape(mesh.material.col(t[0]), mesh.material.col(t[1]), mesh.material.col(t[2]));
    const auto du = shape.du(), dv = shape.dv();
    std::array<double, 3> size;
    for (std::size_t i = 0; i < 3; ++i) size[i] = std::hypot(du[i], dv[i]);
    for (std::size_t i = 0; i < 3; ++i)
      k[t[i]] += membrane * shape.area * size[i] * (size[0] + size[1] + size[2]);
  }
  for (const Hinge& hinge : hinges(mesh)) {
    std::array<Vec3, 4> x;
    for (std::size_t i = 0; i < 4; ++i) x[i] << mesh.material.col(hinge.vertices[i]), 0;
    const HingeStrain angle = dihedral_angle_strain(x[0], x[1], x[2], x[3]);
    const double bend = sheet.bend * (weighted ? hinge_weight(mesh, hinge) : 1);
    double sum = 0;
    for (int i = 0; i < 4; ++i) sum += angle.gradient.segment<3>(3 * i).norm();
    for (int i = 0; i < 4; ++i)
      k[hinge.vertices[at(i)]] += bend * sum * angle.gradient.segment<3>(3 * i).norm();
  }
  return k;
}

VecX inverse_masses(const TriangleMesh& mesh, const OrthotropicSheet& sheet,
                    const std::vector<int>& pinned, const XpbdOptions& options) {
  VecX w;
  if (options.time_step > 0) {
    w = (sheet.areal_density * vertex_areas(mesh)).cwiseInverse();
  } else {
    const double lightness = options.sweep == XpbdSweep::jacobi ? kJacobiLightness : kLightness;
    w = lightness * stiffness_bounds(mesh, sheet, options.bending).cwiseInverse();
  }
  for (const int i : pinned) w[i] = 0;
  return w;
}

}  // namespace

SheetSystem::SheetSystem(const TriangleMesh& mesh, const OrthotropicSheet& sheet,
                         const std::vector<int>& pinned, const XpbdOptions& options)
    : sheet_(sheet), system_(mesh, inverse_masses(mesh, sheet, pinned, options), options.threads) {
  std::vector<int> stencils;
  std::vector<GreenTriangle::Rest<double>> triangles;
  for (const auto& t : mesh.triangles) {
    stencils.insert(stencils.end(), t.begin(), t.end());
    triangles.push_back({triangle_shape(mesh.material.col(t[0]), mesh.material.col(t[1]),
                                        mesh.material.col(t[2]))});
  }
  membrane_ = &system_.add<GreenTriangle>(stencils, triangles, BlockLaw(sheet, 1));
  stencils.clear();
  const ScalarLaw law(sheet.bend, kBendParameter, 1);
  if (options.bending == XpbdBending::curvature) {
    std::vector<TriangleBend::Rest<double>> plates;
    for (const BendingElement& element : bending_elements(mesh)) {
      stencils.insert(stencils.end(), element.vertices.begin(), element.vertices.end());
      plates.push_back({element.map, element.area, {}});
    }
    curvatures_ = &system_.add<TriangleBend>(stencils, plates, law);
  } else {
    std::vector<DihedralHinge::Rest<double>> rest;
    for (const Hinge& hinge : hinges(mesh)) {
      stencils.insert(stencils.end(), hinge.vertices.begin(), hinge.vertices.end());
      const bool weighted = options.bending == XpbdBending::weighted_dihedral;
      rest.push_back({weighted ? hinge_weight(mesh, hinge) : 1.0, 0.0, 0.0});
    }
    hinges_ = &system_.add<DihedralHinge>(stencils, rest, law);
  }
}

void SheetSystem::set_step(double step) {
  membrane_->set_law(BlockLaw(sheet_, step));
  const ScalarLaw law(sheet_.bend, kBendParameter, step);
  if (hinges_ != nullptr) hinges_->set_law(law);
  if (curvatures_ != nullptr) curvatures_->set_law(law);
}

}  // namespace weft::xpbd
