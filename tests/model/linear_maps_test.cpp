#include "weft/model/linear_maps.h"

#include <gtest/gtest.h>

#include "common/gradient_check.h"
#include "weft/base/random.h"
#include "weft/model/cloth_model.h"

namespace weft::linear_maps_test {
namespace {

using testing::near;

ClothModel test_model() {
  Fabric fabric = Fabric::with_defaults("test");
  fabric.set("drag_linear", 0.4);
  fabric.set("drag_quadratic", 0.9);
  fabric.set("drag_degradation", 0.3);
  fabric.include("drag_normal_linear");
  const double hem_width = 0.005;
  return {make_swatch(0.08, 0.06, 5, 4, GridPattern::alternating), fabric, 0.2, Vec3(0, 0, -9.81),
          hem_width};
}

/// Crumpled by a tenth of a cell, stretched and compressed here and there.
VecX random_state(const ClothModel& model, Rng& rng) {
  VecX x(3 * model.vertex_count());
  for (int i = 0; i < model.vertex_count(); ++i) {
    x.segment<2>(3 * i) = model.mesh().material.col(i);
    x[3 * i + 2] = 0;
    for (int k = 0; k < 3; ++k) x[3 * i + k] += 0.002 * rng.normal();
  }
  return x;
}

Points as_points(const VecX& x) { return x.reshaped(3, x.size() / 3); }

Directions random_directions(Eigen::Index rows, Rng& rng) {
  Directions d(rows, kDirections);
  for (Eigen::Index i = 0; i < d.size(); ++i) d.data()[i] = rng.normal();
  return d;
}

/// Column by column, derivatives of f along the directions.
template <class F>
MatX along(const F& f, const VecX& x, const Directions& directions, double step) {
  MatX out;
  for (Eigen::Index j = 0; j < directions.cols(); ++j) {
    const VecX column = testing::derivative(f, x, directions.col(j), step);
    if (j == 0) out.resize(column.size(), directions.cols());
    out.col(j) = column;
  }
  return out;
}

TEST(StrainJacobian, IsTheDerivativeOfTheStrains) {
  const ClothModel model = test_model();
  Rng rng(3);
  const VecX x = random_state(model, rng);
  StrainJacobian jacobian;
  model.strain_jacobian(as_points(x), jacobian);
  const Directions d = random_directions(x.size(), rng);
  Directions strains;
  jacobian.multiply(d, strains);
  const auto f = [&](const VecX& at) {
    VecX c;
    model.strains(as_points(at), c);
    return c;
  };
  // Lengths of 0.02 m; the directions have entries of 1.
  EXPECT_TRUE(near(strains, along(f, x, d, 1e-5)));

  // The transposed product has the same inner products.
  const Directions factors = random_directions(strains.rows(), rng);
  Directions forces = Directions::Zero(x.size(), kDirections);
  jacobian.add_transposed(factors, forces);
  const double right = factors.cwiseProduct(strains).sum();
  EXPECT_NEAR(forces.cwiseProduct(d).sum(), right, 1e-12 * factors.norm() * strains.norm());
}

TEST(DragJacobian, IsTheDerivativeByPositionAndVelocity) {
  const ClothModel model = test_model();
  Rng rng(5);
  const VecX x = random_state(model, rng);
  // Upwards nearly everywhere: the quadratic drag has a kink where a triangle's normal speed is 0.
  VecX v(x.size());
  for (Eigen::Index i = 0; i < v.size(); ++i) v[i] = 0.1 * rng.normal() + (i % 3 == 2 ? 1 : 0.3);
  DragJacobian jacobian;
  model.drag_jacobian(as_points(x), as_points(v), jacobian);
  const Directions d = random_directions(x.size(), rng);
  const auto drag = [&](const VecX& at, const VecX& velocity) {
    Points force = Points::Zero(3, model.vertex_count());
    model.add_drag(as_points(at), as_points(velocity), force);
    return VecX(flat(force));
  };
  Directions by_position = Directions::Zero(x.size(), kDirections);
  jacobian.add_by_position(d, by_position);
  EXPECT_TRUE(near(by_position, along([&](const VecX& at) { return drag(at, v); }, x, d, 1e-5)));
  Directions by_velocity = Directions::Zero(x.size(), kDirections);
  jacobian.add_by_velocity(-2, d, by_velocity);
  EXPECT_TRUE(
      near(by_velocity, -2 * along([&](const VecX& at) { return drag(x, at); }, v, d, 1e-4)));
}

TEST(ComponentTable, WeightsAndParametersMakeTheEnergy) {
  const ClothModel model = test_model();
  Rng rng(7);
  const Points x = as_points(random_state(model, rng));
  VecX c;
  model.strains(x, c);
  const ComponentTable& table = model.components();
  ASSERT_EQ(table.weight.size(), c.size());
  double energy = 0;
  for (Eigen::Index i = 0; i < c.size(); ++i)
    energy += 0.5 * table.weight[i] * model.values()[table.stiffness[static_cast<std::size_t>(i)]] *
              c[i] * c[i];
  EXPECT_NEAR(energy, model.elastic_energy(x), 1e-13 * energy);
}

}  // namespace
}  // namespace weft::linear_maps_test
