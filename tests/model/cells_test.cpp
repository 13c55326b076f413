#include "weft/model/cells.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "common/cloth_battery.h"
#include "weft/base/random.h"
#include "weft/mesh/annulus.h"
#include "weft/model/cloth_model.h"

namespace weft::cells_test {
namespace {

using testing::flat_positions;
using testing::from_lower;
using testing::random_points;
using testing::test_fabric;

constexpr double kSize = 0.02;  // m, the length of a cell

/// The same sheet, but that no line runs along u or v to the last digit: elements without cells.
TriangleMesh turned(TriangleMesh mesh, double angle = 1e-11) {
  mesh.material = Eigen::Rotation2Dd(angle).toRotationMatrix() * mesh.material;
  return mesh;
}

TriangleMesh grid(GridPattern pattern = GridPattern::alternating) {
  return make_swatch(6 * kSize, 5 * kSize, 7, 6, pattern);
}

TriangleMesh annulus() { return make_annulus({0.02, 0.04, 0.06}, 12); }

/// The vertex i becomes `number(i)`.
template <class Number>
TriangleMesh renumbered(const TriangleMesh& mesh, const Number& number) {
  TriangleMesh out = mesh;
  for (int i = 0; i < mesh.vertex_count(); ++i) out.material.col(number(i)) = mesh.material.col(i);
  for (auto& triangle : out.triangles)
    for (int& i : triangle) i = number(i);
  return out;
}

/// Grids split in both ways, and with blocks that are transposed in all, in no and in some lanes.
std::vector<TriangleMesh> grids() {
  return {grid(), grid(GridPattern::uniform), renumbered(grid(), [](int i) { return 41 - i; }),
          renumbered(grid(), [](int i) { return 11 * i % 42; })};
}

struct Motion {
  Points x, v;
  VecX history;

  explicit Motion(const ClothModel& model) {
    Rng rng(5);
    const int n = model.vertex_count();
    x = flat_positions(model.mesh()) + random_points(rng, n, 0.3 * kSize);
    v = random_points(rng, n, 1);
    model.strains(x, history);
    for (double& h : history) h *= 90 * (1 + 0.3 * std::sin(1e4 * h));
  }
  DampingRate damping() const { return {100, &history}; }
};

struct Derivatives {
  Points gradient;
  MatX hessian;
};
Derivatives derivatives(const ClothModel& model, const Motion& motion, HessianKind kind) {
  Derivatives out;
  SparseMatrix h = model.hessian_pattern();
  model.step_hessian(motion.x, motion.damping(), kind, motion.v, 100, out.gradient, h);
  out.hessian = from_lower(h);
  return out;
}

constexpr HessianKind kKinds[] = {HessianKind::exact, HessianKind::positive_semidefinite};

TEST(Cells, AreThoseOfGridsOfEqualCellsAlongTheThreads) {
  EXPECT_EQ(detail::cell_bends(bending_elements(grid())).size(), 30U);
  EXPECT_TRUE(detail::cell_bends(bending_elements(turned(grid()))).empty());
  EXPECT_TRUE(detail::cell_bends(bending_elements(annulus())).empty());
  TriangleMesh uneven = grid();
  uneven.material.row(0) = uneven.material.row(0).array().square() / kSize;
  EXPECT_TRUE(detail::cell_bends(bending_elements(uneven)).empty());
}

TEST(Cells, EnergyAndItsDerivativesAreThoseOfTheElements) {
  for (const TriangleMesh& mesh : grids())
    for (const double hem : {0.0, 0.3 * kSize}) {
      const ClothModel cells(mesh, test_fabric(), 0.2, Vec3(0, 0, -9.81), hem);
      const ClothModel elements(turned(mesh), test_fabric(), 0.2, Vec3(0, 0, -9.81), hem);
      const Motion motion(cells);
      VecX c, of_elements;
      cells.strains(motion.x, c);
      elements.strains(motion.x, of_elements);
      EXPECT_LT((c - of_elements).norm(), 1e-9 * c.norm());
      const double energy = cells.potential(motion.x, motion.damping());
      EXPECT_NEAR(elements.potential(motion.x, motion.damping()), energy, 1e-9 * energy);
      for (const HessianKind kind : kKinds) {
        const Derivatives a = derivatives(cells, motion, kind);
        const Derivatives b = derivatives(elements, motion, kind);
        EXPECT_LT((a.gradient - b.gradient).norm(), 1e-9 * a.gradient.norm());
        EXPECT_LT((a.hessian - b.hessian).norm(), 1e-9 * a.hessian.norm());
      }
    }
}

TEST(Cells, ForcesAtRestAreThoseOfTheElements) {
  for (const char* model : {"baraff-witkin", "baraff-witkin-diagonals"}) {
    const ClothModel cloth(grid(), test_fabric(model), 0.2, Vec3(0, 0, -9.81), 0.3 * kSize);
    const Motion motion(cloth);
    Points gradient, force;
    cloth.potential_gradient(motion.x, {}, gradient);
    cloth.forces(motion.x, Points::Zero(3, cloth.vertex_count()), force);
    EXPECT_LT((gradient + force).norm(), 1e-12 * force.norm());
  }
}

TEST(Cells, StepHessianIsThatOfPotentialAndDrag) {
  for (const TriangleMesh& mesh : {grid(), turned(grid()), annulus()}) {
    const ClothModel model(mesh, test_fabric(), 0.2, Vec3(0, 0, -9.81));
    const Motion motion(model);
    for (const HessianKind kind : kKinds) {
      SparseMatrix h = model.hessian_pattern();
      Points gradient;
      model.potential_hessian(motion.x, motion.damping(), kind, gradient, h);
      model.add_drag_damping(motion.x, motion.v, 100, h);
      const Derivatives step = derivatives(model, motion, kind);
      EXPECT_LT((step.hessian - from_lower(h)).norm(), 1e-14 * step.hessian.norm());
      EXPECT_EQ(step.gradient, gradient);
    }
  }
}

TEST(Cells, CoupleWhatAHingeCouples) {
  // An inner vertex with those around it and two steps away along the threads.
  const ClothModel model(grid(), test_fabric(), 0.2, Vec3(0, 0, -9.81));
  const MatX h = from_lower([&] {
    SparseMatrix pattern = model.hessian_pattern();
    pattern.coeffs().setOnes();
    return pattern;
  }());
  const int inner = 2 * 7 + 3;
  EXPECT_EQ((h.row(3 * inner).array() != 0).count(), 3 * 13);
}

}  // namespace
}  // namespace weft::cells_test
