#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "dynamics/elastica.h"
#include "dynamics/scenes.h"
#include "weft/base/random.h"
#include "weft/dynamics/state.h"
#include "weft/dynamics/static_potential.h"

namespace weft::equilibrium_test {
namespace {

using namespace test;

double largest_free_force(const ClothModel& model, const Points& x,
                          const std::vector<PointFixture>& fixtures) {
  Points gradient;
  model.potential_gradient(x, {}, gradient);
  for (const PointFixture& fixture : fixtures) gradient.col(fixture.vertex).setZero();
  return gradient.colwise().norm().maxCoeff();
}

TEST(SolveStatic, HangingStripStretchesByItsOwnWeight) {
  // With tension k C per width and the weight below, the strip is at
  //   y(s) = s + rho g (L s - s^2 / 2) / k,
  // and the lumped strip is exact at its rows of vertices: the midpoint rule is for a linear
  // tension.
  const double length = 1.0;
  const double density = 0.4;
  for (const auto& [columns, rows] : {std::pair{2, 6}, {3, 21}, {5, 41}}) {
    const TriangleMesh mesh = make_swatch(0.1, length, columns, rows, GridPattern::uniform);
    for (const double k : {10.0, 40.0, 1000.0}) {
      const ClothModel model(mesh, make_fabric({.stretch = k, .shear = 0.1 * k, .bend = 1e-7}),
                             density, Vec3(0, 0, -kGravity));
      const Points start = place(mesh, [](double u, double v) { return Vec3(u, 0, -v); });
      std::vector<PointFixture> fixtures;
      for (int i = 0; i < columns; ++i) fixtures.push_back(hold(i, start));
      const StaticResult result = solve_static(model, start, fixtures, 0);
      ASSERT_TRUE(result.converged);
      for (int row = 1; row < rows; ++row) {
        const double s = length * row / (rows - 1);
        const double stretch = density * kGravity * (length * s - s * s / 2) / k;
        const double mean = -result.x.row(2).segment(row * columns, columns).mean();
        // What is left: the end corners carry unequal shares of the weight.
        EXPECT_NEAR(mean - s, stretch, 0.01 * stretch) << columns << " x " << rows << ", k " << k;
      }
    }
  }
}

struct CantileverCase {
  int cells;
  GridPattern pattern;
  const char* model = "baraff-witkin";
};

class HeavyCantilever : public ::testing::TestWithParam<CantileverCase> {};

TEST_P(HeavyCantilever, FollowsTheElastica) {
  const auto [cells, pattern, model] = GetParam();
  for (const double load : {0.5, 2.0, 5.0, 20.0, 50.0}) {
    const Cantilever cantilever(cells, pattern, load, model);
    const double expected = cantilever.free_length * elastica_tip_deflection(load);
    EXPECT_NEAR(cantilever.deflection(), expected, 0.01 * expected) << "load " << load;
  }
}

std::vector<CantileverCase> cantilever_cases() {
  std::vector<CantileverCase> cases;
  for (const char* model : {"baraff-witkin", "baraff-witkin-diagonals", "baraff-witkin-hinges"})
    for (const GridPattern pattern : {GridPattern::alternating, GridPattern::uniform})
      for (const int cells : {10, 16, 24}) cases.push_back({cells, pattern, model});
  return cases;
}

INSTANTIATE_TEST_SUITE_P(Meshes, HeavyCantilever, ::testing::ValuesIn(cantilever_cases()),
                         [](const auto& info) {
                           std::string name = info.param.model;
                           std::erase(name, '-');
                           return name +
                                  (info.param.pattern == GridPattern::uniform ? "Uniform"
                                                                              : "Alternating") +
                                  std::to_string(info.param.cells);
                         });

/// Tip of a heavy strip of unit length and rigidity whose width falls to zero at the tip, clamped
/// level: ((1 - t) theta')' + load / 2 (1 - t)^2 cos theta = 0, by shooting.
double narrowing_strip_deflection(double load) {
  constexpr int kSteps = 20000;
  constexpr double h = 1.0 / kSteps;
  double deflection = 0;
  const auto moment_left = [&](double root_curvature) {
    double angle = 0, moment = root_curvature;
    deflection = 0;
    for (int i = 0; i + 1 < kSteps; ++i) {  // the midpoint rule
      const double left = 1 - i * h, middle = left - 0.5 * h;
      const double half_angle = angle + 0.5 * h * moment / left;
      const double half_moment = moment - 0.25 * h * load * left * left * std::cos(angle);
      angle += h * half_moment / middle;
      moment -= 0.5 * h * load * middle * middle * std::cos(half_angle);
      deflection += h * std::sin(half_angle);
    }
    return moment;
  };
  double lower = 0, upper = load;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (lower + upper);
    (moment_left(middle) > 0 ? upper : lower) = middle;
  }
  return deflection;
}

// A corner of a square, held along the diagonal, bends about a line at 45 degrees to the grid. Half
// a cell of the zigzag that holds it gives way; equal diagonals would be 46 % off on 8 cells, and a
// curvature for each triangle 32 %.
TEST(SolveStatic, ACornerThatHangsBendsAsAPlateDoes) {
  const double side = 0.2, density = 0.2, load = 10, length = side / std::sqrt(2.0);
  const double bend = density * kGravity * std::pow(length, 3) / load;
  const double expected = length * narrowing_strip_deflection(load);
  for (const int cells : {8, 16}) {
    const TriangleMesh mesh = make_swatch(side, side, cells + 1, cells + 1);
    const ClothModel model(mesh,
                           make_fabric({.stretch = 1e8 * bend, .shear = 5e7 * bend, .bend = bend}),
                           density, Vec3(0, 0, -kGravity));
    Points start = place(mesh, [](double u, double v) { return Vec3(u, v, 0); });
    std::vector<PointFixture> fixtures;
    for (int i = 0; i < mesh.vertex_count(); ++i) {
      const double beyond = (mesh.material.col(i).sum() - side) / std::sqrt(2.0);
      if (beyond < 1e-9)
        fixtures.push_back(hold(i, start));
      else
        start(2, i) = -0.3 * beyond * beyond / length;
    }
    const StaticResult result = solve_static(model, start, fixtures, 0);
    ASSERT_TRUE(result.converged);
    EXPECT_NEAR(-result.x(2, mesh.vertex_count() - 1), expected, 0.05 * expected) << cells;
  }
}

TEST(Elastica, AgreesWithLinearBeamTheoryAndWithAVerticalRope) {
  // The oracle itself: w = rho g L^4 / (8 B) for small loads; nearly all of the length for large
  // ones.
  EXPECT_NEAR(elastica_tip_deflection(0.01), 0.01 / 8, 1e-6);
  const double rope = elastica_tip_deflection(200);
  EXPECT_GT(rope, 0.9);
  EXPECT_LT(rope, 1.0);
}

struct Hang {
  Scene scene;
  ClothModel model;
};

Hang sagging_swatch(int n, const FabricValues& values) {
  Scene scene;
  scene.mesh = make_swatch(0.5, 0.5, n, n);
  scene.areal_density = 0.3;
  scene.start = sagging_start(scene.mesh);
  scene.fixtures = {hold(0, scene.start), hold(n - 1, scene.start)};
  ClothModel model(scene.mesh, make_fabric(values), scene.areal_density, scene.gravity);
  return {std::move(scene), std::move(model)};
}

TEST(SolveStatic, ReactionsAndForcesBalance) {
  const Hang hang = sagging_swatch(13, {.stretch = 300, .shear = 100, .bend = 1e-5});
  const StaticResult result = solve_static(hang.model, hang.scene.start, hang.scene.fixtures, 0);
  ASSERT_TRUE(result.converged);
  EXPECT_LT(largest_free_force(hang.model, result.x, hang.scene.fixtures), 1e-7);
  EXPECT_LT(result.residual, 1e-7);
  Points gradient;
  hang.model.potential_gradient(result.x, {}, gradient);
  const Vec3 held = gradient.col(0) + gradient.col(12);
  EXPECT_LT((held - Vec3(0, 0, 0.3 * 0.25 * kGravity)).norm(), 1e-5);
}

TEST(SolveStatic, EndsAtAMinimumNotAtASaddle) {
  // Held flat between corners that are too close, the flat compressed shape is an equilibrium by
  // symmetry, and unstable.
  const TriangleMesh mesh = make_swatch(0.3, 0.3, 7, 7);
  const Points start = place(mesh, [](double u, double v) { return Vec3(0.9 * u, 0, -v); });
  const std::vector<PointFixture> fixtures{hold(0, start), hold(6, start)};
  const ClothModel model(mesh, make_fabric({.stretch = 500, .shear = 50, .bend = 1e-6}), 0.2,
                         Vec3(0, 0, -kGravity));
  const StaticResult result = solve_static(model, start, fixtures, 0);
  ASSERT_TRUE(result.converged);
  EXPECT_GT(result.x.row(1).cwiseAbs().maxCoeff(), 0.01);
  // Any small displacement raises the potential.
  Rng rng(3);
  const double bottom = model.potential(result.x, {});
  for (int trial = 0; trial < 20; ++trial) {
    Points x = result.x;
    for (Eigen::Index i = 0; i < x.size(); ++i) x.data()[i] += 1e-5 * rng.normal();
    x.col(0) = result.x.col(0);
    x.col(6) = result.x.col(6);
    EXPECT_GT(model.potential(x, {}), bottom);
  }
}

TEST(SolveStatic, LeavesASaddleWithAWeakCurvature) {
  // Two sides held 0.1 % too close, no weight: flat it balances at once, and its curvature, -2e3
  // 1/s^2 of the masses, is less than what a search from anywhere begins to add to the Hessian.
  const TriangleMesh mesh = make_swatch(0.1, 0.1, 9, 9);
  const Points start = place(mesh, [](double u, double v) { return Vec3(0.999 * u, v, 0); });
  std::vector<PointFixture> fixtures;
  for (int row = 0; row < 9; ++row)
    for (const int i : {9 * row, 9 * row + 8}) fixtures.push_back(hold(i, start));
  const ClothModel model(mesh, make_fabric({.stretch = 500, .shear = 50, .bend = 1e-4}), 0.2,
                         Vec3::Zero());
  const StaticResult result = solve_static(model, start, fixtures, 0);
  ASSERT_TRUE(result.converged);
  // A wave of this length is (2 / pi) sqrt(0.001) 0.1 m = 2 mm high.
  EXPECT_GT(result.x.row(2).cwiseAbs().maxCoeff(), 1e-3);
}

TEST(SolveStatic, StaysOnTheBranchOfARoughStart) {
  // A measured surface: the equilibrium with 2 mm of noise on each vertex, at cells of 42 mm.
  // Relaxing it leads back to the same equilibrium.
  const Hang hang = sagging_swatch(13, {.stretch = 300, .shear = 100, .bend = 1e-4});
  const StaticResult smooth = solve_static(hang.model, hang.scene.start, hang.scene.fixtures, 0);
  ASSERT_TRUE(smooth.converged);
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    Rng rng(seed);
    Points rough = smooth.x;
    for (Eigen::Index i = 0; i < rough.size(); ++i) rough.data()[i] += 0.002 * rng.normal();
    const StaticResult result = solve_static(hang.model, rough, hang.scene.fixtures, 0);
    ASSERT_TRUE(result.converged);
    EXPECT_LT(largest_distance(result.x, smooth.x), 1e-4) << "seed " << seed;
  }
}

TEST(SolveStatic, ConvergesForLimpClothFromARoughStart) {
  Hang hang = sagging_swatch(13, {.stretch = 300, .shear = 30, .bend = 1e-7});
  Rng rng(11);
  for (Eigen::Index i = 0; i < hang.scene.start.size(); ++i) {
    hang.scene.start.data()[i] += 0.003 * rng.normal();
  }
  const StaticResult result = solve_static(hang.model, hang.scene.start, hang.scene.fixtures, 0);
  EXPECT_TRUE(result.converged) << result.residual;
  EXPECT_LT(result.iterations, 200);
}

TEST(SolveStatic, ShapeDoesNotDependOnTheMesh) {
  // The same swatch at 13, 25 and 49 vertices a side, from one start: distances at the 13 x 13
  // common material points. They shrink with the mesh.
  const FabricValues values{.stretch = 300, .shear = 100, .bend = 3e-4};
  auto common = [&](int n) {
    const Hang hang = sagging_swatch(n, values);
    const StaticResult result = solve_static(hang.model, hang.scene.start, hang.scene.fixtures, 0);
    EXPECT_TRUE(result.converged);
    Points x(3, 169);
    const int stride = (n - 1) / 12;
    for (int i = 0; i < 169; ++i)
      x.col(i) = result.x.col((i / 13) * stride * n + (i % 13) * stride);
    return x;
  };
  const Points coarse = common(13);
  const Points middle = common(25);
  const Points fine = common(49);
  const double coarse_distance = (coarse - fine).colwise().norm().mean();
  const double middle_distance = (middle - fine).colwise().norm().mean();
  EXPECT_LT(middle_distance, 0.5 * coarse_distance);
  EXPECT_LT(middle_distance, 0.002);
}

/// A cloth whose potential rises by a step once a vertex is below a level: as a mean of angles does
/// when one of them turns through 180 degrees.
class SteppedCloth : public StaticPotential {
 public:
  SteppedCloth(const ClothModel& model, int vertex, double level, double step)
      : model_(model), vertex_(vertex), level_(level), step_(step) {}
  double value(const Points& x) const override {
    return model_.potential(x, {}) + (x(2, vertex_) < level_ ? step_ : 0);
  }
  void gradient(const Points& x, Points& gradient) const override {
    model_.potential_gradient(x, {}, gradient);
  }
  void hessian(const Points& x, HessianKind kind, Points& gradient,
               SparseMatrix& hessian) const override {
    model_.potential_hessian(x, {}, kind, gradient, hessian);
  }
  const SparseMatrix& hessian_pattern() const override { return model_.hessian_pattern(); }
  const VecX& masses() const override { return model_.masses(); }
  const TriangleMesh& mesh() const override { return model_.mesh(); }

 private:
  const ClothModel& model_;
  int vertex_;
  double level_, step_;
};

// No descent climbs the step, however low: without a leap the solver ends before it.
TEST(SolveStatic, GoesOnPastAStepOfThePotential) {
  const int n = 9, lowest = n * n - 1 - n / 2;
  const Hang hang = sagging_swatch(n, {.stretch = 300, .shear = 100, .bend = 3e-4});
  const Points rest = solve_static(hang.model, hang.scene.start, hang.scene.fixtures, 0).x;
  Points start = hang.scene.start;
  prescribe_positions(hang.scene.fixtures, 0, start);
  const double level = 0.5 * (start(2, lowest) + rest(2, lowest));
  ASSERT_GT(start(2, lowest), level + 1e-3);
  const SteppedCloth stepped(hang.model, lowest, level, 0.01);
  const StaticResult result =
      solve_static(stepped, start, held_vertices(hang.scene.fixtures, n * n));
  ASSERT_TRUE(result.converged);
  EXPECT_LT(result.x(2, lowest), level);
  EXPECT_LT(largest_free_force(hang.model, result.x, hang.scene.fixtures),
            StaticOptions().force_tolerance);
}

TEST(SolveStatic, ReportsThatThereIsNoEquilibrium) {
  const TriangleMesh mesh = make_swatch(0.1, 0.1, 3, 3);
  const Points start = place(mesh, [](double u, double v) { return Vec3(u, v, 0); });
  const ClothModel model(mesh, make_fabric({}), 0.2, Vec3(0, 0, -kGravity));
  StaticOptions options;
  options.max_iterations = 40;
  const StaticResult result = solve_static(model, start, {}, 0, options);
  EXPECT_FALSE(result.converged);
  EXPECT_LE(result.iterations, 40);
}

}  // namespace
}  // namespace weft::equilibrium_test
