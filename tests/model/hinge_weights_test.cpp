#include "weft/model/hinge_weights.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "weft/base/random.h"
#include "weft/strain/dihedral_angle.h"

namespace weft {
namespace {

/// 1/2 sum w theta^2 of a mesh rolled onto a cylinder of curvature `kappa` whose curved direction
/// makes the angle `direction` with u. Arc lengths are kept.
double rolled_energy(const TriangleMesh& mesh, double kappa, double direction) {
  const Vec2 along(std::cos(direction), std::sin(direction)), across(-along.y(), along.x());
  Points x(3, mesh.vertex_count());
  for (int i = 0; i < mesh.vertex_count(); ++i) {
    const double s = along.dot(mesh.material.col(i)), t = across.dot(mesh.material.col(i));
    x.col(i) = Vec3(std::sin(kappa * s) / kappa, t, (1 - std::cos(kappa * s)) / kappa);
  }
  const auto all = hinges(mesh);
  const VecX weights = hinge_weights(mesh, all);
  double energy = 0;
  for (std::size_t e = 0; e < all.size(); ++e) {
    const auto& v = all[e].vertices;
    const double angle =
        dihedral_angle_strain(x.col(v[0]), x.col(v[1]), x.col(v[2]), x.col(v[3])).value;
    energy += 0.5 * weights[static_cast<Eigen::Index>(e)] * angle * angle;
  }
  return energy;
}

/// Energy per area over 1/2 kappa^2, in the limit of a large sheet: with n cells a side the energy
/// is a n^2 - b n (edges on the boundary are no hinges), so that E(2n) - 2 E(n) = 2 a n^2.
double relative_energy(double width, double height, GridPattern pattern, double direction) {
  const int n = 6;  // even, for the alternating pattern to repeat
  const double kappa =
      0.05 / std::max(width, height);  // finite angles change the result by kappa^2
  const auto energy = [&](int cells) {
    return rolled_energy(make_swatch(cells * width, cells * height, cells + 1, cells + 1, pattern),
                         kappa, direction);
  };
  return (energy(2 * n) - 2 * energy(n)) / (2 * n * n) / (0.5 * kappa * kappa * width * height);
}

TEST(HingeWeights, CylinderOfAnyDirectionOnTheAlternatingGrid) {
  for (int d = 0; d < 24; ++d) {
    const double direction = std::numbers::pi * d / 24;
    EXPECT_NEAR(relative_energy(0.02, 0.02, GridPattern::alternating, direction), 1, 0.002) << d;
    EXPECT_NEAR(relative_energy(0.02, 0.05, GridPattern::alternating, direction), 1, 0.002) << d;
  }
}

TEST(HingeWeights, UniformGridIsExactAlongItsAxesOnly) {
  const auto at = [](double degrees) {
    return relative_energy(0.02, 0.02, GridPattern::uniform, degrees * std::numbers::pi / 180);
  };
  EXPECT_NEAR(at(0), 1, 0.002);
  EXPECT_NEAR(at(90), 1, 0.002);
  // Documented in the header: bend and twist are coupled on this pattern. One diagonal is soft, the
  // other stiff.
  EXPECT_NEAR(std::min(at(45), at(135)), 0.5, 0.01);
  EXPECT_NEAR(std::max(at(45), at(135)), 2.5, 0.01);
}

TEST(HingeWeights, EquilateralTriangles) {
  TriangleMesh mesh;
  const double h = std::sqrt(0.75);
  mesh.material.resize(2, 4);
  mesh.material << 0, 1, 0.5, 0.5, 0, 0, h, -h;
  mesh.triangles = {{0, 1, 2}, {1, 0, 3}};
  const VecX w = hinge_weights(mesh, hinges(mesh));
  ASSERT_EQ(w.size(), 1);
  EXPECT_NEAR(w[0], 2 / std::sqrt(3), 1e-12);
}

TEST(HingeWeights, IrregularMeshKeepsTheEnergy) {
  const int n = 16;
  const double size = 1.0, cell = size / n, kappa = 0.5;
  for (int d = 0; d < 6; ++d) {
    const double direction = std::numbers::pi * d / 6;
    TriangleMesh mesh = make_swatch(size, size, n + 1, n + 1);
    const double regular = rolled_energy(mesh, kappa, direction);
    Rng rng(4);
    for (int row = 1; row < n; ++row)
      for (int column = 1; column < n; ++column)
        mesh.material.col(row * (n + 1) + column) +=
            0.2 * cell * Vec2(rng.uniform(-1, 1), rng.uniform(-1, 1));
    EXPECT_NEAR(rolled_energy(mesh, kappa, direction) / regular, 1, 0.05) << d;
  }
}

TEST(HingeWeights, ArePositiveAndDoNotDependOnSize) {
  Rng rng(5);
  TriangleMesh mesh = make_swatch(1, 1, 9, 9, GridPattern::uniform);
  for (auto& value : mesh.material.reshaped()) value += 0.03 * rng.uniform(-1, 1);
  mesh.material.row(0) *= 0.2;  // needles
  const auto all = hinges(mesh);
  const VecX w = hinge_weights(mesh, all);
  EXPECT_GT(w.minCoeff(), 0);
  mesh.material *= 0.01;
  EXPECT_LT((hinge_weights(mesh, all) - w).cwiseAbs().maxCoeff(), 1e-9 * w.maxCoeff());
}

}  // namespace
}  // namespace weft
