#include "weft/model/bending.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "weft/base/random.h"
#include "weft/mesh/grid_lines.h"

namespace weft::bending_test {
namespace {

/// Energy for B = 1 of the triangles for which `counts` holds, at positions x.
template <class Counts>
double energy(const std::vector<BendingElement>& elements, const Points& x, const Counts& counts) {
  double sum = 0;
  for (const BendingElement& element : elements) {
    if (!counts(element)) continue;
    std::array<Vector3<double>, 6> p;
    for (std::size_t i = 0; i < 6; ++i) p[i] = to_vector3(x.col(element.vertices[i]));
    for (const double c : triangle_curvature(element.map, p).value)
      sum += 0.5 * element.area * c * c;
  }
  return sum;
}

bool off_the_rim(const BendingElement& e) {
  return e.vertices[3] != e.vertices[0] && e.vertices[4] != e.vertices[1] &&
         e.vertices[5] != e.vertices[2];
}

/// The mesh rolled onto a cylinder of curvature `kappa` whose curved direction makes the angle
/// `direction` with u. Arc lengths are kept.
Points rolled(const TriangleMesh& mesh, double kappa, double direction) {
  const Vec2 along(std::cos(direction), std::sin(direction)), across(-along.y(), along.x());
  Points x(3, mesh.vertex_count());
  for (int i = 0; i < mesh.vertex_count(); ++i) {
    const double s = along.dot(mesh.material.col(i)), t = across.dot(mesh.material.col(i));
    x.col(i) = Vec3(std::sin(kappa * s) / kappa, t, (1 - std::cos(kappa * s)) / kappa);
  }
  return x;
}

/// Energy of a cylinder over 1/2 kappa^2 area, off the rim.
double cylinder(const TriangleMesh& mesh, double direction, double kappa) {
  const auto elements = bending_elements(mesh);
  double area = 0;
  for (const auto& element : elements)
    if (off_the_rim(element)) area += element.area;
  return energy(elements, rolled(mesh, kappa, direction), off_the_rim) /
         (0.5 * kappa * kappa * area);
}

/// Parallelograms of sides a and b, each halved: a lattice of equal triangles.
TriangleMesh lattice(int n, const Vec2& a, const Vec2& b) {
  TriangleMesh mesh = make_swatch(1, 1, n + 1, n + 1, GridPattern::uniform);
  for (int row = 0; row <= n; ++row)
    for (int column = 0; column <= n; ++column)
      mesh.material.col(row * (n + 1) + column) = column * a + row * b;
  return mesh;
}

// Curvatures are 0.05 per cell. The angle at an edge of a cylinder and the lengths around it differ
// from their limits by about (kappa h)^2 / 12 = 2e-4; stencils are up to three cells wide.
constexpr double kBent = 0.05;

TEST(Bending, CylinderOfAnyDirectionOnLattices) {
  const double size = 0.02;
  const TriangleMesh squares = make_swatch(10 * size, 10 * size, 11, 11, GridPattern::uniform);
  const TriangleMesh rectangles = make_swatch(10 * size, 5 * size, 11, 11, GridPattern::uniform);
  const TriangleMesh equilateral =
      lattice(10, size * Vec2(1, 0), size * Vec2(0.5, std::sqrt(0.75)));
  const TriangleMesh oblique = lattice(10, size * Vec2(1, 0.2), size * Vec2(-0.3, 0.8));
  for (const TriangleMesh* mesh : {&squares, &rectangles, &equilateral, &oblique})
    for (int d = 0; d < 12; ++d)
      EXPECT_NEAR(cylinder(*mesh, std::numbers::pi * d / 12, kBent / size), 1, 2e-3) << d;
}

TEST(Bending, CylinderOfAnyDirectionOnTheAlternatingGrid) {
  const double size = 0.02;
  for (const double height : {size, 0.5 * size, 2 * size}) {
    const TriangleMesh mesh = make_swatch(10 * size, 10 * height, 11, 11);
    const double kappa = kBent / std::max(size, height);
    for (int d = 0; d < 12; ++d)
      EXPECT_NEAR(cylinder(mesh, std::numbers::pi * d / 12, kappa), 1, 2e-3) << d;
  }
}

/// Lines that come nearer to each other along both axes.
TriangleMesh graded(int n, GridPattern pattern) {
  std::vector<double> lines;
  for (int i = 0; i <= n; ++i) lines.push_back(i + 0.03 * i * i);
  std::vector<double> reversed;
  for (const double line : lines) reversed.insert(reversed.begin(), lines.back() - line);
  return make_swatch(lines, reversed, pattern);
}

// How cells are split does not matter, and a turned grid is a grid, too.
TEST(Bending, OfAGridDoesNotDependOnItsDiagonals) {
  Rng rng(6);
  Points x(3, 81);
  const TriangleMesh uniform = graded(8, GridPattern::uniform);
  TriangleMesh turned = graded(8, GridPattern::alternating);
  x.topRows<2>() = uniform.material;
  for (auto& value : x.reshaped()) value += 0.2 * rng.uniform(-1, 1);
  const auto everywhere = [](const BendingElement&) { return true; };
  const double first = energy(bending_elements(uniform), x, everywhere);
  EXPECT_GT(first, 1);
  EXPECT_NEAR(energy(bending_elements(turned), x, everywhere), first, 1e-9 * first);
  turned.material = Eigen::Rotation2Dd(0.4).toRotationMatrix() * turned.material;
  EXPECT_NEAR(energy(bending_elements(turned), x, everywhere), first, 1e-9 * first);
}

TEST(Bending, IrregularMesh) {
  const int n = 16;
  const double size = 1.0 / n;
  TriangleMesh mesh = make_swatch(1, 1, n + 1, n + 1, GridPattern::uniform);
  Rng rng(4);
  for (auto& value : mesh.material.reshaped()) value += 0.15 * size * rng.uniform(-1, 1);
  for (int d = 0; d < 6; ++d)
    EXPECT_NEAR(cylinder(mesh, std::numbers::pi * d / 6, kBent / size), 1, 0.1) << d;
}

/// Largest net force per B kappa that a sheet held in a cylinder along u puts on a vertex off the
/// ends, and the moment per width, by differences of the energy.
TEST(Bending, CylinderIsInEquilibriumAtEachVertex) {
  // Small deflections: the energy is a quadratic form of the heights z. For K_uu alone its gradient
  // must vanish at each vertex that is not at the ends, the free edges v = 0 and v = 1 included.
  const int n = 8;
  for (const TriangleMesh& mesh :
       {make_swatch(n, n, n + 1, n + 1), graded(n, GridPattern::alternating),
        make_swatch(n, n, n + 1, n + 1, GridPattern::uniform)}) {
    const auto elements = bending_elements(mesh);
    const auto everywhere = [](const BendingElement&) { return true; };
    Points x = Points::Zero(3, mesh.vertex_count());
    x.topRows<2>() = mesh.material;
    const double small = 1e-4;
    for (int i = 0; i < x.cols(); ++i) x(2, i) = 0.5 * small * x(0, i) * x(0, i);
    double largest = 0;
    for (int i = 0; i < x.cols(); ++i) {
      if (i % (n + 1) < 2 || i % (n + 1) > n - 2) continue;
      Points up = x, down = x;
      up(2, i) += small;
      down(2, i) -= small;
      largest = std::max(
          largest, std::abs(energy(elements, up, everywhere) - energy(elements, down, everywhere)) /
                       (2 * small * small));
    }
    // Angles are not linear in z: relative error small^2 n^2.
    EXPECT_LT(largest, 1e-4);
  }
}

TEST(Bending, TwistOfASquareLattice) {
  // z = k u v: |K|^2 = 2 k^2.
  const TriangleMesh mesh = make_swatch(8, 8, 9, 9, GridPattern::uniform);
  Points x(3, mesh.vertex_count());
  const double k = 1e-3;
  for (int i = 0; i < x.cols(); ++i) {
    const Vec2 p = mesh.material.col(i);
    x.col(i) = Vec3(p.x(), p.y(), k * (p.x() - 4) * (p.y() - 4));
  }
  // 49 of the 64 vertices' areas are off the rim. Angles are not linear in k: (8 k)^2.
  EXPECT_NEAR(energy(bending_elements(mesh), x, off_the_rim), k * k * 49, 1e-4 * k * k * 49);
}

TEST(Bending, DoesNotDependOnSize) {
  Rng rng(5);
  TriangleMesh mesh = make_swatch(1, 1, 6, 6);
  for (auto& value : mesh.material.reshaped()) value += 0.03 * rng.uniform(-1, 1);
  const auto large = bending_elements(mesh);
  mesh.material *= 0.01;
  const auto small = bending_elements(mesh);
  for (std::size_t t = 0; t < large.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t j = 0; j < 3; ++j)
        EXPECT_NEAR(small[t].map.r[k][j] * 0.01, large[t].map.r[k][j],
                    1e-10 * std::abs(large[t].map.r[k][j]) + 1e-12);
}

}  // namespace
}  // namespace weft::bending_test
