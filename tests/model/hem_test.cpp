#include "weft/model/hem.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "common/cloth_battery.h"
#include "weft/base/error.h"
#include "weft/base/random.h"
#include "weft/model/cloth_model.h"

namespace weft::hem_test {
namespace {

using testing::Energy;
using testing::flat_positions;
using testing::potential_of;
using testing::vector;

constexpr double kSize = 0.02;    // m, edge of a grid cell
constexpr double kStep = 2e-5;    // in cells: few diagonals go slack or taut within it
constexpr double kHem = 0.006;    // m
constexpr double kDensity = 0.2;  // kg/m^2
constexpr double kWidth = 3 * kSize, kHeight = 2 * kSize;

Fabric fabric_of(const char* model) {
  Fabric fabric = Fabric::with_defaults("test", model);
  fabric.set("stretch_stiffness", 40);
  fabric.set("shear_stiffness", 25);
  fabric.set("bend_stiffness", 5e-3);
  fabric.set("bend_damping", 1e-5);
  return fabric;
}

TriangleMesh small_mesh(GridPattern pattern = GridPattern::alternating) {
  return make_swatch(kWidth, kHeight, 4, 3, pattern);
}

ClothModel model_of(const TriangleMesh& mesh, double hem_width,
                    const char* model = "baraff-witkin") {
  return {mesh, fabric_of(model), kDensity, Vec3(0, 0, -9.81), hem_width};
}

TEST(Hem, Battery) {
  Rng rng(8);
  for (const char* name : {"baraff-witkin", "baraff-witkin-diagonals", "baraff-witkin-hinges"}) {
    for (const GridPattern pattern : {GridPattern::alternating, GridPattern::uniform}) {
      const TriangleMesh mesh = small_mesh(pattern);
      const ClothModel model = model_of(mesh, kHem, name);
      for (const double scale : {0.6, 1.0, 1.2}) {
        Points x = scale * flat_positions(mesh);
        for (auto& value : x.reshaped()) value += 0.15 * kSize * rng.normal();
        VecX history;
        model.strains(x, history);
        history *= 150;
        for (const DampingRate& damping : {DampingRate{}, DampingRate{200, &history}}) {
          const Energy energy = potential_of(model, damping);
          testing::expect_gradient(energy, vector(x), kStep * kSize);
          testing::expect_hessian(energy, vector(x), kStep * kSize);
          testing::expect_positive_semidefinite(energy.projected_hessian(vector(x)));
        }
      }
    }
  }
}

TEST(Hem, IsASecondLayerOnTheRim) {
  const TriangleMesh mesh = small_mesh(GridPattern::uniform);
  const ClothModel model = model_of(mesh, kHem), plain = model_of(mesh, 0);
  const VecX added = model.masses() - plain.masses();
  EXPECT_NEAR(added.sum(), kDensity * kHem * 2 * (kWidth + kHeight), 1e-15);
  for (int i = 0; i < mesh.vertex_count(); ++i) {
    const Vec2 p = mesh.material.col(i);
    const bool rim = p.x() == 0 || p.y() == 0 || p.x() == kWidth || p.y() == kHeight;
    EXPECT_NEAR(added[i], rim ? kDensity * kHem * kSize : 0, 1e-15) << i;
  }
}

TEST(Hem, HasItsShareOfTheStretch) {
  const TriangleMesh mesh = small_mesh();
  const ClothModel model = model_of(mesh, kHem), plain = model_of(mesh, 0);
  const auto added = [&](double along_u, double along_v) {
    Points x = flat_positions(mesh);
    x.row(0) *= 1 + along_u;
    x.row(1) *= 1 + along_v;
    return model.elastic_energy(x) - plain.elastic_energy(x);
  };
  const double strain = 0.03, of_length = 0.5 * 40 * kHem * strain * strain;  // J/m
  EXPECT_NEAR(added(strain, 0), of_length * 2 * kWidth, 1e-12 * of_length);
  EXPECT_NEAR(added(0, strain), of_length * 2 * kHeight, 1e-12 * of_length);
}

TEST(Hem, HasItsShareOfTheBend) {
  for (const GridPattern pattern : {GridPattern::alternating, GridPattern::uniform}) {
    const TriangleMesh mesh = small_mesh(pattern);
    // Facets of the length of a cell, each turned by 0.2 from the one before: around v, around u.
    const auto rolled = [&](int along) {
      Points x = flat_positions(mesh);
      for (int i = 0; i < x.cols(); ++i) {
        const auto cells = std::lround(x(along, i) / kSize);
        x(along, i) = 0;
        for (long k = 0; k < cells; ++k) {
          x(along, i) += kSize * std::cos(0.2 * double(k));
          x(2, i) += kSize * std::sin(0.2 * double(k));
        }
      }
      return x;
    };
    const auto ratio = [&](int along) {
      const Points x = rolled(along);
      return model_of(mesh, kHem).elastic_energy(x) / model_of(mesh, 0).elastic_energy(x);
    };
    EXPECT_NEAR(ratio(0), 1 + 2 * kHem / kHeight, 1e-10);
    EXPECT_NEAR(ratio(1), 1 + 2 * kHem / kWidth, 1e-10);
  }
}

// As in a lattice of springs, where the rim has a whole row of them.
TEST(Hem, OfHalfACellMakesTheRimAThreadLikeAnyOther) {
  const TriangleMesh mesh = make_swatch(4 * kSize, 4 * kSize, 5, 5, GridPattern::uniform);
  const ClothModel model = model_of(mesh, 0.5 * kSize);
  SparseMatrix lower = model.hessian_pattern();
  Points gradient;
  model.potential_hessian(flat_positions(mesh), {}, HessianKind::exact, gradient, lower);
  const MatX hessian = testing::from_lower(lower);
  for (const int row : {0, 2, 4}) {
    const auto entry = [&](int column, int other, int axis) {
      return hessian(3 * (5 * row + column) + axis, 3 * (5 * row + other) + axis);
    };
    EXPECT_NEAR(entry(1, 2, 0), -40, 1e-10) << row;  // a spring of k h over its length h
    // 1/2 B h^2 (second difference / h^2)^2 at the vertex between
    EXPECT_NEAR(entry(1, 3, 2), 5e-3 / (kSize * kSize), 1e-10) << row;
    EXPECT_NEAR(model.masses()[5 * row + 2], kDensity * kSize * kSize, 1e-15) << row;
  }
}

TEST(Hem, AsksForAGridAlongTheThreads) {
  EXPECT_NO_THROW(model_of(small_mesh(), kHem));
  TriangleMesh turned = small_mesh();
  turned.material = Eigen::Rotation2Dd(0.3).toRotationMatrix() * turned.material.eval();
  EXPECT_NO_THROW(model_of(turned, 0));
  EXPECT_THROW(model_of(turned, kHem), Error);
  TriangleMesh moved = small_mesh();
  moved.material(0, 5) += 0.2 * kSize;
  EXPECT_NO_THROW(model_of(moved, 0));
  EXPECT_THROW(model_of(moved, kHem), Error);
}

}  // namespace
}  // namespace weft::hem_test
