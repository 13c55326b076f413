#include "weft/model/diagonals.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

#include "common/cloth_battery.h"
#include "weft/base/error.h"
#include "weft/base/random.h"
#include "weft/mesh/grid_lines.h"
#include "weft/model/cloth_model.h"

namespace weft::diagonals_test {
namespace {

using testing::crumpled;
using testing::Energy;
using testing::near;
using testing::points;
using testing::potential_of;

constexpr double kSize = 0.02;     // m, edge of a grid cell
constexpr double kStep = 2e-5;     // of kSize: few diagonals go slack or taut within it
constexpr double kDiagonal = 60;   // N/m
constexpr double kDamping = 0.25;  // N s/m

/// All terms of a size that lets each show.
Fabric test_fabric() {
  Fabric fabric = Fabric::with_defaults("test", "baraff-witkin-diagonals");
  fabric.values << 40, 5, 5e-3, 0.3, 0.05, 1e-5, 0.4, 0.9, 0.3, kDiagonal, kDamping;
  return fabric;
}

/// The diagonals alone.
Fabric diagonals_alone() {
  Fabric fabric = test_fabric();
  fabric.values.head<9>().setZero();
  return fabric;
}

TriangleMesh small_mesh(GridPattern pattern = GridPattern::alternating) {
  return make_swatch(3 * kSize, 2 * kSize, 4, 3, pattern);
}

/// A grid whose inner vertices were moved: no cells, one element a triangle.
TriangleMesh mesh_without_cells() {
  TriangleMesh mesh = make_swatch(4 * kSize, 3 * kSize, 5, 4);
  Rng rng(11);
  for (const int vertex : {6, 7, 8, 11, 12, 13})
    mesh.material.col(vertex) += 0.2 * kSize * Vec2(rng.uniform() - 0.5, rng.uniform() - 0.5);
  return mesh;
}

ClothModel model_of(const Fabric& fabric, const TriangleMesh& mesh = small_mesh()) {
  return {mesh, fabric, 0.2, Vec3::Zero()};
}

TEST(Diagonals, Battery) {
  Rng rng(4);
  for (const TriangleMesh& mesh : {small_mesh(GridPattern::alternating),
                                   small_mesh(GridPattern::uniform), mesh_without_cells()}) {
    for (const Fabric& fabric : {test_fabric(), diagonals_alone()}) {
      const ClothModel model = model_of(fabric, mesh);
      VecX history;
      model.strains(points(crumpled(mesh, 1.1, 0.1 * kSize, rng)), history);
      history *= 200;
      for (const double scale : {0.6, 1.0, 1.3}) {
        const VecX x = crumpled(mesh, scale, 0.15 * kSize, rng);
        testing::expect_rigid_invariance(potential_of(model, {}), x);
        for (const DampingRate& damping : {DampingRate{}, DampingRate{200, &history}}) {
          const Energy energy = potential_of(model, damping);
          testing::expect_gradient(energy, x, kStep * kSize);
          testing::expect_hessian(energy, x, kStep * kSize);
          testing::expect_positive_semidefinite(energy.projected_hessian(x));
        }
      }
    }
  }
}

/// Energy per area of the diagonals under a homogeneous deformation with columns w_u and w_v: the
/// same on every mesh.
double density(const Vec3& wu, const Vec3& wv) {
  Eigen::Matrix<double, 3, 2> f;
  f << wu, wv;
  const auto on = [&](const TriangleMesh& mesh) {
    const Points x = f * mesh.material;
    return model_of(diagonals_alone(), mesh).elastic_energy(x) / vertex_areas(mesh).sum();
  };
  const double on_grid = on(small_mesh());
  for (const TriangleMesh& mesh :
       {make_swatch({0, 0.02, 0.05}, {0, 0.01, 0.04}, GridPattern::alternating),
        mesh_without_cells()})
    EXPECT_NEAR(on(mesh), on_grid, 1e-14 * kDiagonal);
  return on_grid;
}

TEST(Diagonals, EnergyOfHomogeneousDeformations) {
  const auto taut = [](double length) { return 0.5 * kDiagonal * (length - 1) * (length - 1); };
  // Along a thread both are stretched, to sqrt((1 + (1 + e)^2) / 2).
  const double along = std::sqrt((1 + 1.1 * 1.1) / 2);
  EXPECT_NEAR(density({1.1, 0, 0}, {0, 1, 0}), 2 * taut(along), 1e-14 * kDiagonal);
  // Sheared, one is longer and one shorter, and the shorter one does not count.
  const double g = 0.2, longer = std::sqrt(((1 + g) * (1 + g) + 1) / 2);
  EXPECT_NEAR(density({1, 0, 0}, {g, 1, 0}), taut(longer), 1e-14 * kDiagonal);
  EXPECT_NEAR(density({1, 0, 0}, {-g, 1, 0}), taut(longer), 1e-14 * kDiagonal);
  // Shortening costs nothing, in any direction.
  EXPECT_EQ(density({0.9, 0, 0}, {0, 1, 0}), 0);
  EXPECT_EQ(density({0.9, 0, 0}, {0, 0.8, 0.1}), 0);
}

// A fold over either diagonal of a cell shortens the other one, which is slack then: it is free
// however the cell is split. Opened by a pull at two opposite corners it is not.
TEST(Diagonals, CellsFoldOverBothDiagonals) {
  const TriangleMesh alternating = make_swatch(kSize, kSize, 2, 2);
  TriangleMesh other = alternating;
  other.triangles = {{0, 1, 2}, {1, 3, 2}};
  if (alternating.triangles == other.triangles) other.triangles = {{0, 1, 3}, {0, 3, 2}};
  const double half = kSize / std::numbers::sqrt2;
  for (const TriangleMesh& mesh : {alternating, other}) {
    const ClothModel model = model_of(diagonals_alone(), mesh);
    for (const std::array<int, 4>& fold : {std::array{0, 3, 1, 2}, std::array{1, 2, 0, 3}}) {
      const double angle = 0.6;  // by which both sides are raised
      Points x(3, 4);
      x.col(fold[0]) = Vec3(-half, 0, 0);
      x.col(fold[1]) = Vec3(half, 0, 0);
      x.col(fold[2]) = half * Vec3(0, -std::cos(angle), std::sin(angle));
      x.col(fold[3]) = half * Vec3(0, std::cos(angle), std::sin(angle));
      // Lengths at rest are known to rounding.
      EXPECT_NEAR(model.elastic_energy(x), 0, 1e-28 * kDiagonal);
      x.col(fold[1]).x() = 1.2 * half;  // 10 % longer from corner to corner
      EXPECT_NEAR(model.elastic_energy(x), 0.5 * kDiagonal * kSize * kSize * 0.01,
                  1e-14 * kDiagonal);
    }
  }
}

TEST(Diagonals, CoupleWeftAndWarpInTension) {
  // From a state with both taut, so small that lengths are linear: k / 2 along each thread, k / 2
  // between them, k / 2 against shear. Second differences of the energy density.
  const double e = 1e-3, h = 1e-4;
  const auto at = [&](double u, double v, double g) {
    return density({1 + e + u, 0, 0}, {g, 1 + e + v, 0});
  };
  const double uu = (at(h, 0, 0) - 2 * at(0, 0, 0) + at(-h, 0, 0)) / (h * h);
  const double uv = (at(h, h, 0) - at(h, -h, 0) - at(-h, h, 0) + at(-h, -h, 0)) / (4 * h * h);
  const double gg = (at(0, 0, h) - 2 * at(0, 0, 0) + at(0, 0, -h)) / (h * h);
  // Lengths are linear up to the strain itself, 1e-3.
  EXPECT_NEAR(uu, 0.5 * kDiagonal, 3e-3 * kDiagonal);
  EXPECT_NEAR(uv, 0.5 * kDiagonal, 3e-3 * kDiagonal);
  EXPECT_NEAR(gg, 0.5 * kDiagonal, 3e-3 * kDiagonal);
}

TEST(Diagonals, WithoutStiffnessTheModelIsTheOneWithoutThem) {
  Fabric with = test_fabric();
  with.values.tail<2>().setZero();
  Fabric without = Fabric::with_defaults("without");
  without.values = with.values.head<9>();
  const ClothModel a = model_of(with), b = model_of(without);
  Rng rng(8);
  const VecX x = crumpled(a.mesh(), 1.1, 0.2 * kSize, rng);
  const Energy with_energy = potential_of(a, {}), energy = potential_of(b, {});
  EXPECT_EQ(with_energy.value(x), energy.value(x));
  EXPECT_TRUE(near(with_energy.gradient(x), energy.gradient(x), 1e-15));
  EXPECT_TRUE(near(with_energy.hessian(x), energy.hessian(x), 1e-15));
  EXPECT_THROW(model_of(with).set_fabric(without), Error);
  EXPECT_THROW(model_of(without).set_fabric(with), Error);
}

TEST(Diagonals, DampingForceIsThatOfThePotential) {
  // forces() with velocities against the potential of an implicit Euler step from x - v / rate:
  // they agree to first order in the step, so that a rate of 1e7 1/s leaves 1e-5.
  const double rate = 1e7;
  const ClothModel model = model_of(diagonals_alone());
  Rng rng(9);
  const VecX x = crumpled(model.mesh(), 1.05, 0.2 * kSize, rng);
  VecX v(x.size());
  for (auto& value : v) value = rng.normal();
  VecX history;
  model.strains(points(x - v / rate), history);
  history *= rate;
  Points gradient, force;
  model.potential_gradient(points(x), {rate, &history}, gradient);
  model.forces(points(x), points(v), force);
  EXPECT_TRUE(near(-gradient, force, 1e-4));
  // Power of the damping: what the part of the force that is linear in v takes.
  Points still;
  model.forces(points(x), Points::Zero(3, model.vertex_count()), still);
  const double power = -flat(Points(force - still)).dot(v);
  EXPECT_GT(power, 0);
  EXPECT_NEAR(model.damping_power(points(x), points(v)), power, 1e-12 * power);
}

TEST(Diagonals, LinearMapsForSensitivities) {
  const ClothModel model = model_of(test_fabric());
  Rng rng(5);
  const VecX x = crumpled(model.mesh(), 1.05, 0.15 * kSize, rng);
  StrainJacobian jacobian;
  model.strain_jacobian(points(x), jacobian);
  Directions directions(x.size(), kDirections);
  for (Eigen::Index i = 0; i < directions.size(); ++i) directions.data()[i] = rng.normal();
  Directions strains;
  jacobian.multiply(directions, strains);
  const auto f = [&](const VecX& at) {
    VecX c;
    model.strains(points(at), c);
    return c;
  };
  ASSERT_EQ(strains.rows(), model.component_count());
  for (Eigen::Index j = 0; j < kDirections; ++j)
    EXPECT_TRUE(near(strains.col(j), testing::derivative(f, x, directions.col(j), kStep * kSize)));

  const ComponentTable& table = model.components();
  const VecX c = f(x);
  double energy = 0;
  for (Eigen::Index i = 0; i < c.size(); ++i)
    energy += 0.5 * table.weight[i] * model.values()[table.stiffness[static_cast<std::size_t>(i)]] *
              c[i] * c[i];
  EXPECT_NEAR(energy, model.elastic_energy(points(x)), 1e-13 * energy);
}

TEST(Diagonals, ForceDerivativeByItsParameters) {
  Fabric fabric = test_fabric();
  Rng rng(6);
  const ClothModel model = model_of(fabric);
  const Points x = points(crumpled(model.mesh(), 1.05, 0.15 * kSize, rng));
  const Points v = points(crumpled(model.mesh(), 10, 5 * kSize, rng));
  for (const int parameter : {0, 9, 10}) {
    Points analytic, ahead, behind;
    model.force_derivative(x, v, parameter, analytic);
    // Forces are linear in these: any step will do.
    const double step = 0.5 * fabric.values[parameter];
    Fabric changed = fabric;
    changed.values[parameter] += step;
    model_of(changed).forces(x, v, ahead);
    changed.values[parameter] -= 2 * step;
    model_of(changed).forces(x, v, behind);
    EXPECT_TRUE(near(analytic, (ahead - behind) / (2 * step), 1e-10)) << parameter;
    EXPECT_GT(analytic.norm(), 0);
  }
}

}  // namespace
}  // namespace weft::diagonals_test
