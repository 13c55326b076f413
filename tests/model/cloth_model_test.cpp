#include "weft/model/cloth_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "common/energy_battery.h"
#include "weft/base/error.h"
#include "weft/base/random.h"

namespace weft {
namespace {

using testing::Energy;
using testing::near;

constexpr double kSize = 0.02;  // m, edge of a grid cell in most tests
const Vec3 kNoGravity = Vec3::Zero();

/// Stiffness and damping of a size that lets every term show.
Fabric test_fabric() {
  Fabric fabric = Fabric::with_defaults("test");
  fabric.set("stretch_stiffness", 40);
  fabric.set("shear_stiffness", 25);
  fabric.set("bend_stiffness", 5e-3);
  fabric.set("stretch_damping", 0.3);
  fabric.set("shear_damping", 0.2);
  fabric.set("bend_damping", 1e-5);
  fabric.set("drag_linear", 0.4);
  fabric.set("drag_quadratic", 0.9);
  fabric.set("drag_degradation", 0.3);
  return fabric;
}

TriangleMesh small_mesh(GridPattern pattern = GridPattern::alternating) {
  return make_swatch(3 * kSize, 2 * kSize, 4, 3, pattern);
}

Points flat_positions(const TriangleMesh& mesh) {
  Points x = Points::Zero(3, mesh.vertex_count());
  x.topRows<2>() = mesh.material;
  return x;
}

Points random_points(Rng& rng, int count, double scale) {
  Points p(3, count);
  for (auto& value : p.reshaped()) value = scale * rng.normal();
  return p;
}

Points points(const VecX& flat_vector) {
  return Eigen::Map<const Points>(flat_vector.data(), 3, flat_vector.size() / 3);
}
VecX vector(const Points& p) { return Eigen::Map<const VecX>(p.data(), p.size()); }

/// States that a simulation meets, and some that it should not: lightly bent, strongly deformed,
/// compressed to half, sheared, folded.
std::vector<Points> states(const TriangleMesh& mesh) {
  Rng rng(11);
  const Points flat_x = flat_positions(mesh);
  std::vector<Points> out;
  out.push_back(flat_x + random_points(rng, mesh.vertex_count(), 0.02 * kSize));
  out.push_back(flat_x + random_points(rng, mesh.vertex_count(), 0.25 * kSize));
  Points squeezed = 0.5 * flat_x + random_points(rng, mesh.vertex_count(), 0.02 * kSize);
  out.push_back(squeezed);
  Points sheared = flat_x + random_points(rng, mesh.vertex_count(), 0.05 * kSize);
  sheared.row(0) += 0.7 * sheared.row(1);
  out.push_back(sheared);
  Points folded = flat_x + random_points(rng, mesh.vertex_count(), 0.05 * kSize);
  for (int i = 0; i < folded.cols(); ++i)
    if (folded(0, i) > 1.5 * kSize) {
      folded(2, i) += 0.4 * kSize;
      folded(0, i) = 3 * kSize - folded(0, i);
    }
  out.push_back(folded);
  return out;
}

/// The model's potential with the damping of an integrator's step.
Energy potential_of(const ClothModel& model, const DampingRate& damping) {
  const auto hessian = [&model, damping](const VecX& x, HessianKind kind) {
    SparseMatrix h = model.hessian_pattern();
    Points gradient;
    model.potential_hessian(points(x), damping, kind, gradient, h);
    return testing::from_lower(h);
  };
  return {[&model, damping](const VecX& x) { return model.potential(points(x), damping); },
          [&model, damping](const VecX& x) {
            Points gradient;
            model.potential_gradient(points(x), damping, gradient);
            return vector(gradient);
          },
          [hessian](const VecX& x) { return hessian(x, HessianKind::exact); },
          [hessian](const VecX& x) { return hessian(x, HessianKind::positive_semidefinite); }};
}

TEST(ClothModel, NoForceAndNoEnergyAtRest) {
  const TriangleMesh mesh = small_mesh();
  const ClothModel model(mesh, test_fabric(), 0.2, kNoGravity);
  const Points x = flat_positions(mesh);
  Points force;
  model.forces(x, Points::Zero(3, x.cols()), force);
  EXPECT_LT(force.cwiseAbs().maxCoeff(), 1e-14);
  EXPECT_LT(model.elastic_energy(x), 1e-28);
  VecX c;
  model.strains(x, c);
  EXPECT_EQ(c.size(), model.component_count());
  EXPECT_LT(c.cwiseAbs().maxCoeff(), 1e-14);
}

TEST(ClothModel, DerivativesOfTheElasticPotential) {
  for (const GridPattern pattern : {GridPattern::alternating, GridPattern::uniform}) {
    const TriangleMesh mesh = small_mesh(pattern);
    const ClothModel model(mesh, test_fabric(), 0.2, Vec3(0.3, -0.2, -9.81));
    const Energy energy = potential_of(model, {});
    for (const Points& x : states(mesh)) {
      testing::expect_gradient(energy, vector(x), 1e-3 * kSize);
      testing::expect_hessian(energy, vector(x), 1e-3 * kSize);
    }
  }
}

TEST(ClothModel, DerivativesOfTheDampingPotential) {
  const TriangleMesh mesh = small_mesh();
  const ClothModel model(mesh, test_fabric(), 0.2, kNoGravity);
  Rng rng(3);
  for (const Points& x : states(mesh)) {
    VecX history;
    model.strains(x + random_points(rng, static_cast<int>(x.cols()), 0.1 * kSize), history);
    history *= 200;
    const Energy energy = potential_of(model, {200, &history});
    testing::expect_gradient(energy, vector(x), 1e-3 * kSize);
    testing::expect_hessian(energy, vector(x), 1e-3 * kSize);
    testing::expect_positive_semidefinite(energy.projected_hessian(vector(x)));
  }
}

TEST(ClothModel, RigidMotionCostsNothing) {
  const TriangleMesh mesh = small_mesh();
  const ClothModel model(mesh, test_fabric(), 0.2, kNoGravity);
  for (const Points& x : states(mesh))
    testing::expect_rigid_invariance(potential_of(model, {}), vector(x));
}

TEST(ClothModel, ProjectedHessianHasNoNegativeEigenvalue) {
  const TriangleMesh mesh = small_mesh();
  Rng rng(7);
  const ClothModel model(mesh, test_fabric(), 0.2, kNoGravity);
  const Energy energy = potential_of(model, {});
  bool indefinite = false;
  for (const Points& x : states(mesh)) {
    testing::expect_positive_semidefinite(energy.projected_hessian(vector(x)));
    const Eigen::SelfAdjointEigenSolver<MatX> exact(energy.hessian(vector(x)),
                                                    Eigen::EigenvaluesOnly);
    indefinite |= exact.eigenvalues().minCoeff() < -1e-3 * exact.eigenvalues().maxCoeff();
  }
  EXPECT_TRUE(indefinite) << "the states do not exercise the projection";
}

}  // namespace
}  // namespace weft
