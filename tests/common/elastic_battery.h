#pragma once
/// The battery of energy_battery.h for an ElasticModel, with the derivative by the parameters.
#include "common/energy_battery.h"
#include "weft/base/dense.h"
#include "weft/base/random.h"
#include "weft/model/elastic_model.h"

namespace weft::testing {

inline Points flat_positions(const TriangleMesh& mesh) {
  Points x = Points::Zero(3, mesh.vertex_count());
  x.topRows<2>() = mesh.material;
  return x;
}
/// The sheet scaled in its plane by `scale`, with `noise` (m) in each coordinate.
inline VecX crumpled(const TriangleMesh& mesh, double scale, double noise, Rng& rng) {
  VecX x = VecX::Zero(3 * mesh.vertex_count());
  for (int i = 0; i < mesh.vertex_count(); ++i) x.segment<2>(3 * i) = scale * mesh.material.col(i);
  for (auto& value : x) value += noise * rng.normal();
  return x;
}
/// Three triangles about a vertex: each has the third corner of the other two as the apex across
/// two of its edges.
inline TriangleMesh three_triangles(double size) {
  TriangleMesh mesh;
  mesh.material.resize(2, 4);
  mesh.material << 0, size, 0.4 * size, 0.5 * size, 0, 0.1 * size, size, 0.4 * size;
  mesh.triangles = {{0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
  return mesh;
}
inline Points random_points(Rng& rng, int count, double scale) {
  Points p(3, count);
  for (auto& value : p.reshaped()) value = scale * rng.normal();
  return p;
}
inline Points points(const VecX& vector) {
  return Eigen::Map<const Points>(vector.data(), 3, vector.size() / 3);
}
inline VecX vector(const Points& p) { return Eigen::Map<const VecX>(p.data(), p.size()); }

/// Shapes that a fit meets, and some that it should not: lightly bent, strongly deformed,
/// compressed to half, sheared. `size` is the edge of a cell.
inline std::vector<Points> states(const TriangleMesh& mesh, double size) {
  Rng rng(11);
  const Points flat = flat_positions(mesh);
  const int n = mesh.vertex_count();
  std::vector<Points> out = {
      flat + random_points(rng, n, 0.02 * size), flat + random_points(rng, n, 0.2 * size),
      0.5 * flat + random_points(rng, n, 0.02 * size), flat + random_points(rng, n, 0.05 * size)};
  out.back().row(0) += 0.7 * out.back().row(1);
  return out;
}

inline Energy energy_of(const ElasticModel& model) {
  const auto hessian = [&model](const VecX& x, HessianKind kind) {
    SparseMatrix h = model.hessian_pattern();
    Points gradient, same;
    model.hessian(points(x), kind, gradient, h);
    model.gradient(points(x), same);
    EXPECT_TRUE(near(gradient, same, kRounding));
    return from_lower(h);
  };
  return {[&model](const VecX& x) { return model.energy(points(x)); },
          [&model](const VecX& x) {
            Points gradient;
            model.gradient(points(x), gradient);
            return vector(gradient);
          },
          [hessian](const VecX& x) { return hessian(x, HessianKind::exact); },
          [hessian](const VecX& x) { return hessian(x, HessianKind::positive_semidefinite); }};
}

/// d gradient / d parameters against differences, each parameter in turn.
inline void expect_parameter_derivative(ElasticModel& model, const Points& x) {
  const VecX values = model.parameters();
  MatX derivative;
  model.parameter_derivative(x, derivative);
  ASSERT_EQ(derivative.rows(), x.size());
  ASSERT_EQ(derivative.cols(), values.size());
  for (Eigen::Index p = 0; p < values.size(); ++p) {
    const auto gradient = [&](const VecX& value) {
      VecX changed = values;
      changed[p] = value[0];
      model.set_parameters(changed);
      Points g;
      model.gradient(x, g);
      return vector(g);
    };
    // Relative to what the parameter contributes; where that is little, to the forces.
    const VecX at = VecX::Constant(1, values[p]);
    const VecX numeric = weft::testing::derivative(gradient, at, VecX::Ones(1), 1e-2 * values[p]);
    model.set_parameters(values);
    Points g;
    model.gradient(x, g);
    const double floor = 1e-5 * g.cwiseAbs().maxCoeff() / std::abs(values[p]);
    // The angles on the rim give way, so that forces are not linear in the parameter: steps of 1 %
    // leave (1e-2)^4 of what is curved.
    EXPECT_TRUE(near(derivative.col(p), numeric, 1e-7, floor)) << "parameter " << p;
  }
}

/// All of it. `size` is the edge of a cell of the mesh.
inline void expect_elastic_model(const TriangleMesh& mesh, const Fabric& fabric, double size,
                                 double grain_angle = 0) {
  const auto model = make_elastic_model(mesh, fabric, grain_angle);
  EXPECT_EQ(model->parameters(), fabric.values);
  const Energy energy = energy_of(*model);
  const VecX rest = vector(flat_positions(mesh));
  const double scale = energy.gradient(1.01 * rest).lpNorm<Eigen::Infinity>();
  EXPECT_LT(energy.gradient(rest).lpNorm<Eigen::Infinity>(), 1e-12 * scale);
  EXPECT_LT(energy.value(rest), 1e-12 * energy.value(1.01 * rest));
  bool indefinite = false;
  for (const Points& x : states(mesh, size)) {
    // Steps so small that hardly one straddles a knot, where second derivatives have a kink.
    expect_gradient(energy, vector(x), 2e-5 * size);
    expect_hessian(energy, vector(x), 2e-5 * size);
    expect_rigid_invariance(energy, vector(x));
    const MatX projected = energy.projected_hessian(vector(x));
    expect_positive_semidefinite(projected);
    const VecX exact = symmetric_eigen(energy.hessian(vector(x))).values;
    indefinite |= exact.minCoeff() < -1e-3 * exact.maxCoeff();
    expect_parameter_derivative(*model, x);
  }
  EXPECT_TRUE(indefinite) << "the states do not exercise the projection";
}

}  // namespace weft::testing
