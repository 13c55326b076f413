#include "weft/objective/shape_descriptor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "common/gradient_check.h"
#include "weft/base/error.h"
#include "weft/base/random.h"
#include "weft/fabric/fabric.h"
#include "weft/model/elastic_model.h"

namespace weft::shape_descriptor_test {
namespace {

constexpr DescriptorKind kAll[] = {DescriptorKind::position, DescriptorKind::strain,
                                   DescriptorKind::energy, DescriptorKind::fourier};
constexpr int kColumns = 6, kRows = 5;
constexpr double kWidth = 0.05, kHeight = 0.04;  // m

DescriptorGrid small_grid() {
  return {make_swatch(kWidth, kHeight, kColumns, kRows, GridPattern::uniform), kColumns, kRows, {}};
}

Points flat_cloth(const DescriptorGrid& grid) {
  Points x = Points::Zero(3, grid.mesh.vertex_count());
  x.topRows(2) = grid.mesh.material;
  return x;
}

Points wrinkled(const DescriptorGrid& grid) {
  Points x = flat_cloth(grid);
  Rng rng(5);
  for (Eigen::Index i = 0; i < x.cols(); ++i)
    x.col(i) += 1e-3 * Vec3(rng.normal(), rng.normal(), 2 * rng.normal());
  return x;
}

VecX material_values() {
  VecX m(8);
  m << 180, 90, 500, 40, 5e-6, 1e-6, 8e-6, 2e-6;
  return m;
}

/// x and the material move with eight parameters.
MatX motion(Eigen::Index rows) {
  Rng rng(9);
  MatX dx(rows, 8);
  for (double& d : dx.reshaped()) d = rng.normal();
  return dx;
}

TEST(ShapeDescriptor, DerivativesAgreeWithDifferences) {
  DescriptorGrid grid = small_grid();
  grid.weights = VecX::Ones(grid.mesh.vertex_count());
  grid.weights[7] = 0;
  grid.weights[12] = 0.5;
  const Points x0 = wrinkled(grid);
  const VecX m0 = material_values();
  const MatX dx = motion(x0.size());
  for (const DescriptorKind kind : kAll) {
    SCOPED_TRACE(name_of(kind));
    for (const double smoothing : {0.0, 2e-4}) {
      const auto descriptor = make_shape_descriptor(kind, grid, smoothing);
      // A unit of a parameter moves vertices by 1e-3 m and the material by its own size.
      const auto f = [&](const VecX& theta) {
        const VecX moved = flat(x0) + 1e-3 * dx * theta;
        const Points x = Points::Map(moved.data(), 3, x0.cols());
        return descriptor->value(x, m0 + m0.cwiseProduct(theta));
      };
      const MatX numeric = testing::numeric_jacobian(f, VecX::Zero(8), 1e-3);
      // derivative() is by the material's values: theta = value / m0.
      const MatX by_value = 1e-3 * dx * m0.cwiseInverse().asDiagonal();
      const MatX analytic = descriptor->derivative(x0, m0, by_value) * m0.asDiagonal();
      ASSERT_EQ(analytic.rows(), descriptor->size());
      EXPECT_TRUE(testing::near(analytic, numeric, 1e-7));
    }
  }
}

TEST(ShapeDescriptor, TargetsOfTheEnergyMoveWithTheMaterialAlone) {
  const DescriptorGrid grid = small_grid();
  const auto descriptor = make_shape_descriptor(DescriptorKind::energy, grid);
  const Points x = wrinkled(grid);
  const MatX derivative = descriptor->derivative(x, material_values(), MatX());
  // Linear in the material.
  EXPECT_TRUE(testing::near(derivative * material_values(), descriptor->value(x, material_values()),
                            1e-12));
  const auto fourier = make_shape_descriptor(DescriptorKind::fourier, grid);
  EXPECT_EQ(fourier->derivative(x, material_values(), MatX()).norm(), 0);
}

TEST(ShapeDescriptor, EnergiesOfTrianglesAddUpToTheModelsInThePlane) {
  const DescriptorGrid grid = small_grid();
  Points x = flat_cloth(grid);
  x.row(0) *= 1.1;
  x.row(1) += 0.2 * x.row(0);
  Fabric fabric = Fabric::with_defaults("f", "stvk");
  fabric.values = material_values();
  const auto model = make_elastic_model(grid.mesh, fabric);
  const auto descriptor = make_shape_descriptor(DescriptorKind::energy, grid);
  EXPECT_NEAR(descriptor->value(x, fabric.values).sum(), model->energy(x),
              1e-12 * model->energy(x));
}

// A cylinder of radius R along the grid: the plate stores 1/2 D / R^2 an area. The hinges across
// the curvature carry it with the weight l^2 / (A_1 + A_2); those on the diagonals of a uniform
// grid do not turn. The rim has no hinges: half a cell on either side is missing.
TEST(ShapeDescriptor, HingesOfACylinderStoreThePlatesEnergy) {
  const DescriptorGrid grid = small_grid();
  const double radius = 0.5;
  Points x(3, grid.mesh.vertex_count());
  for (Eigen::Index i = 0; i < x.cols(); ++i) {
    const Vec2 uv = grid.mesh.material.col(i);
    x.col(i) = Vec3(radius * std::sin(uv.x() / radius), uv.y(), radius * std::cos(uv.x() / radius));
  }
  const VecX m = material_values();
  const auto descriptor = make_shape_descriptor(DescriptorKind::energy, grid);
  const VecX energies = descriptor->value(x, m);
  const double hinges = energies.tail(energies.size() - grid.mesh.triangle_count()).sum();
  const double cell = kWidth / (kColumns - 1);
  const double plate = 0.5 * m[4] / (radius * radius) * (kWidth - cell) * kHeight;
  EXPECT_NEAR(hinges / plate, 1, 1e-3);
}

TEST(ShapeDescriptor, GreenStrainOfAStretch) {
  const DescriptorGrid grid = small_grid();
  Points x = flat_cloth(grid);
  x.row(0) *= 1.2;
  x.row(1) *= 0.9;
  const auto descriptor = make_shape_descriptor(DescriptorKind::strain, grid);
  const VecX s = descriptor->value(x, material_values());
  for (int t = 0; t < grid.mesh.triangle_count(); ++t) {
    EXPECT_NEAR(s[3 * t], 0.22, 1e-14);        // (1.44 - 1) / 2
    EXPECT_NEAR(s[3 * t + 1], -0.095, 1e-14);  // (0.81 - 1) / 2
    EXPECT_NEAR(s[3 * t + 2], 0, 1e-14);
  }
  EXPECT_EQ(s.tail(s.size() - 3 * grid.mesh.triangle_count()).norm(), 0);
}

TEST(ShapeDescriptor, FourierKeepsTheSumOfSquares) {
  const DescriptorGrid grid = small_grid();
  const Points x = wrinkled(grid);
  const auto descriptor = make_shape_descriptor(DescriptorKind::fourier, grid);
  const VecX s = descriptor->value(x, {});
  EXPECT_NEAR(s.squaredNorm(), x.squaredNorm(), 1e-13 * x.squaredNorm());
  // 5 x 6 numbers a coordinate: of the coefficients two are real, (0, 0) and (3, 0).
  EXPECT_EQ(s.size(), 3 * (2 + (30 - 2) / 2));
}

// The phase of a wrinkle, and its sign, are what two equilibria of one cloth differ in.
TEST(ShapeDescriptor, FourierDoesNotSeeThePlaceOfAWave) {
  const DescriptorGrid grid = small_grid();
  const auto wave = [&](double phase, double amplitude) {
    Points x = flat_cloth(grid);
    for (int row = 0; row < kRows; ++row)
      for (int column = 0; column < kColumns; ++column)
        x(2, row * kColumns + column) =
            amplitude * std::cos(2 * std::numbers::pi * 2 * column / kColumns + phase);
    return x;
  };
  const auto descriptor = make_shape_descriptor(DescriptorKind::fourier, grid);
  const VecX s = descriptor->value(wave(0, 1e-3), {});
  EXPECT_NEAR((descriptor->value(wave(1, 1e-3), {}) - s).norm(), 0, 1e-15);
  EXPECT_NEAR((descriptor->value(wave(0.3, -1e-3), {}) - s).norm(), 0, 1e-15);
  // An amplitude that is off by 1e-4 m: the difference is that of the coordinates, sqrt(N / 2)
  // 1e-4.
  EXPECT_NEAR((descriptor->value(wave(1, 1.1e-3), {}) - s).norm(), 1e-4 * std::sqrt(15), 1e-15);
}

TEST(ShapeDescriptor, NoiseIsThatOfTheEntries) {
  const DescriptorGrid grid = small_grid();
  const Points x = wrinkled(grid);
  const double sigma = 1e-7;  // so small that first order holds
  constexpr int kDraws = 2000;
  Rng rng(3);
  for (const DescriptorKind kind : kAll) {
    SCOPED_TRACE(name_of(kind));
    const auto descriptor = make_shape_descriptor(kind, grid);
    const VecX m = material_values(), s = descriptor->value(x, m);
    const VecX expected = descriptor->noise(x, m, sigma);
    VecX squares = VecX::Zero(s.size());
    for (int draw = 0; draw < kDraws; ++draw) {
      Points noisy = x;
      for (double& c : noisy.reshaped()) c += sigma * rng.normal();
      squares += (descriptor->value(noisy, m) - s).cwiseAbs2();
    }
    // A standard deviation from 2000 draws is within 1.6 % (one sigma); of some 100 entries the
    // worst is within five of those.
    for (Eigen::Index i = 0; i < s.size(); ++i) {
      if (expected[i] < 2e-3 * expected.maxCoeff()) continue;  // kept from vanishing
      EXPECT_NEAR(std::sqrt(squares[i] / kDraws) / expected[i], 1, 0.08) << i;
    }
  }
}

TEST(ShapeDescriptor, NoiseMakesSquaresOfTheSizeThatIsCounted) {
  DescriptorGrid grid = small_grid();
  grid.weights = VecX::Ones(grid.mesh.vertex_count());
  for (int i = 0; i < grid.weights.size(); i += 3) grid.weights[i] = 0;
  grid.weights[1] = 0.5;
  const Points x = wrinkled(grid);
  const double sigma = 1e-7;
  constexpr int kDraws = 500;
  for (const DescriptorKind kind : kAll) {
    SCOPED_TRACE(name_of(kind));
    const auto descriptor = make_shape_descriptor(kind, grid);
    const VecX m = material_values(), s = descriptor->value(x, m);
    const VecX noise = descriptor->noise(x, m, sigma);
    EXPECT_LT(descriptor->counted(), 0.8 * double(descriptor->size()));
    Rng rng(4);
    double sum = 0;
    for (int draw = 0; draw < kDraws; ++draw) {
      Points noisy = x;
      for (double& c : noisy.reshaped()) c += sigma * rng.normal();
      sum += (descriptor->value(noisy, m) - s).cwiseQuotient(noise).squaredNorm();
    }
    // The mean of 500 draws is known within 1 %. Half of a coefficient's variance is along its
    // phase, on average: with these few weights within 10 %.
    EXPECT_NEAR(sum / kDraws / descriptor->counted(), 1, 0.1);
    EXPECT_EQ(make_shape_descriptor(kind, small_grid())->counted(), double(descriptor->size()));
  }
}

TEST(ShapeDescriptor, WhatWasNotMeasuredDoesNotCount) {
  DescriptorGrid grid = small_grid();
  grid.weights = VecX::Ones(grid.mesh.vertex_count());
  grid.weights[8] = 0;
  const Points x = wrinkled(grid);
  Points other = x;
  other.col(8) += Vec3(1, 2, 3);
  for (const DescriptorKind kind : kAll) {
    const auto descriptor = make_shape_descriptor(kind, grid);
    EXPECT_EQ(descriptor->value(x, material_values()), descriptor->value(other, material_values()))
        << name_of(kind);
  }
}

TEST(ShapeDescriptor, RefusesWhatDoesNotFit) {
  DescriptorGrid grid = small_grid();
  grid.columns = 5;
  EXPECT_THROW(make_shape_descriptor(DescriptorKind::fourier, grid), Error);
  grid = small_grid();
  grid.weights = VecX::Constant(grid.mesh.vertex_count(), 1.5);
  EXPECT_THROW(make_shape_descriptor(DescriptorKind::position, grid), Error);
  EXPECT_THROW(make_shape_descriptor(DescriptorKind::fourier, small_grid(), -1), Error);
  EXPECT_THROW(descriptor_from_name("wavelet"), Error);
  EXPECT_EQ(descriptor_from_name("fourier"), DescriptorKind::fourier);
}

}  // namespace
}  // namespace weft::shape_descriptor_test
