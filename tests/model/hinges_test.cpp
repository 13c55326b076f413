#include "weft/model/hinges.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

#include "common/cloth_battery.h"
#include "weft/base/error.h"
#include "weft/base/random.h"
#include "weft/mesh/grid_lines.h"
#include "weft/model/cloth_model.h"

namespace weft::hinges_test {
namespace {

using testing::crumpled;
using testing::Energy;
using testing::points;
using testing::potential_of;

constexpr double kSize = 0.02;  // m, edge of a grid cell
constexpr double kBend = 5e-3, kTwist = 8e-3;

/// All terms of a size that lets each show.
Fabric test_fabric() {
  Fabric fabric = Fabric::with_defaults("test", "baraff-witkin-hinges");
  fabric.include("twist_stiffness");
  fabric.values << 40, 5, kBend, 0.3, 0.05, 1e-5, 0.4, 0.9, 0.3, 60, 0.25, kTwist;
  return fabric;
}

/// Bend and twist alone.
Fabric bends_alone() {
  Fabric fabric = test_fabric();
  for (const char* name : {"stretch_stiffness", "shear_stiffness", "diagonal_stiffness"})
    fabric.values[fabric.value_index(name)] = 0;
  return fabric;
}

TriangleMesh small_mesh(GridPattern pattern = GridPattern::alternating) {
  return make_swatch(4 * kSize, 3 * kSize, 5, 4, pattern);
}
TriangleMesh uneven_mesh() {
  return make_swatch({0, 0.02, 0.05, 0.06}, {0, 0.01, 0.04}, GridPattern::alternating);
}

ClothModel model_of(const Fabric& fabric, const TriangleMesh& mesh) {
  return {mesh, fabric, 0.2, Vec3::Zero()};
}

/// Heights of a surface over the flat sheet.
template <class Height>
Points raised(const TriangleMesh& mesh, const Height& height) {
  Points x = Points::Zero(3, mesh.vertex_count());
  x.topRows<2>() = mesh.material;
  for (int i = 0; i < mesh.vertex_count(); ++i) x(2, i) = height(mesh.material.col(i));
  return x;
}

TEST(Hinges, Battery) {
  Rng rng(4);
  for (const TriangleMesh& mesh :
       {small_mesh(), small_mesh(GridPattern::uniform), uneven_mesh(),
        make_swatch(kSize, 3 * kSize, 2, 4), make_swatch(kSize, kSize, 2, 2)}) {
    for (const Fabric& fabric : {test_fabric(), bends_alone()}) {
      const ClothModel model = model_of(fabric, mesh);
      const Points flat = raised(mesh, [](const Vec2&) { return 0; });
      Points gradient;
      model.potential_gradient(flat, {}, gradient);
      EXPECT_LT(gradient.cwiseAbs().maxCoeff(), 1e-14);
      VecX history;
      model.strains(points(crumpled(mesh, 1.1, 0.1 * kSize, rng)), history);
      history *= 200;
      for (const double scale : {0.6, 1.0, 1.3}) {
        const VecX x = crumpled(mesh, scale, 0.15 * kSize, rng);
        testing::expect_rigid_invariance(potential_of(model, {}), x);
        for (const DampingRate& damping : {DampingRate{}, DampingRate{200, &history}}) {
          const Energy energy = potential_of(model, damping);
          testing::expect_gradient(energy, x, 2e-5 * kSize);
          testing::expect_hessian(energy, x, 2e-5 * kSize);
          testing::expect_positive_semidefinite(energy.projected_hessian(x));
        }
      }
    }
  }
}

// Over a length L = n cells a strip has n - 1 hinges: what bends is L less half a cell at each end.
TEST(Hinges, EvenCurvatureAndTwistAreThoseOfAPlate) {
  const double k = 1e-3;  // 1/m: the sheet rises by k L^2 / 2, so that the angles are small
  for (const TriangleMesh& mesh : {small_mesh(), small_mesh(GridPattern::uniform)}) {
    const ClothModel model = model_of(bends_alone(), mesh);
    const double width = 4 * kSize, height = 3 * kSize;
    const auto energy = [&](const auto& surface) {
      return model.elastic_energy(raised(mesh, surface));
    };
    // Rounding: energies of 1e-12 J from heights of 1e-6 m.
    const double along_u = energy([&](const Vec2& p) { return 0.5 * k * p.x() * p.x(); });
    EXPECT_NEAR(along_u, 0.5 * kBend * k * k * (width - kSize) * height, 1e-6 * along_u);
    const double along_v = energy([&](const Vec2& p) { return 0.5 * k * p.y() * p.y(); });
    EXPECT_NEAR(along_v, 0.5 * kBend * k * k * width * (height - kSize), 1e-6 * along_v);
    const double twist = energy([&](const Vec2& p) { return k * p.x() * p.y(); });
    EXPECT_NEAR(twist, 0.5 * kTwist * 2 * k * k * width * height, 1e-6 * twist);
  }
}

TEST(Hinges, UnevenCellsBendAsAPlateDoes) {
  const double k = 1e-3;
  const TriangleMesh mesh = uneven_mesh();
  const ClothModel model = model_of(bends_alone(), mesh);
  // Half of the first and of the last cell do not bend.
  const double along_u =
      model.elastic_energy(raised(mesh, [&](const Vec2& p) { return 0.5 * k * p.x() * p.x(); }));
  EXPECT_NEAR(along_u, 0.5 * kBend * k * k * (0.06 - 0.01 - 0.005) * 0.04, 1e-6 * along_u);
  const double twist =
      model.elastic_energy(raised(mesh, [&](const Vec2& p) { return k * p.x() * p.y(); }));
  EXPECT_NEAR(twist, 0.5 * kTwist * 2 * k * k * 0.06 * 0.04, 1e-6 * twist);
}

// The mean of the angles at its two ends: opposite ones cost nothing.
TEST(Hinges, AnEdgeFeelsTheMeanOfItsAngles) {
  Fabric fabric = bends_alone();
  fabric.values[fabric.value_index("twist_stiffness")] = 0;
  const TriangleMesh mesh = make_swatch(2 * kSize, kSize, 3, 2);
  const ClothModel model = model_of(fabric, mesh);
  const auto folded = [&](double at_start, double at_end) {
    return model.elastic_energy(raised(mesh, [&](const Vec2& p) {
      return std::abs(p.x() - kSize) * (p.y() < 0.5 * kSize ? at_start : at_end);
    }));
  };
  const double slope = 1e-4, angle = 2 * slope, l = kSize;
  // The one edge, of length l between cells of width l.
  EXPECT_NEAR(folded(slope, slope), 0.5 * kBend * (angle / l) * (angle / l) * l * l,
              1e-6 * kBend * angle * angle);
  EXPECT_NEAR(folded(slope, 0), 0.25 * folded(slope, slope), 1e-6 * folded(slope, slope));
  EXPECT_LT(folded(slope, -slope), 1e-6 * folded(slope, slope));
}

// Where the fold at one end passes 180 degrees and that at the other does not, their mean goes on;
// where the mean passes 180 degrees the fold is as far from flat the other way.
TEST(Hinges, OneEndThatPasses180DegreesDoesNotTurnTheEdgeOver) {
  Fabric fabric = bends_alone();
  fabric.values[fabric.value_index("twist_stiffness")] = 0;
  const TriangleMesh mesh = make_swatch(2 * kSize, kSize, 3, 2);
  const ClothModel model = model_of(fabric, mesh);
  const auto folded = [&](double at_start, double at_end) {  // degrees
    Points x = raised(mesh, [](const Vec2&) { return 0; });
    for (int i = 0; i < mesh.vertex_count(); ++i) {
      const Vec2 uv = mesh.material.col(i);
      if (uv.x() < 1.5 * kSize) continue;
      const double angle = (uv.y() < 0.5 * kSize ? at_start : at_end) * std::numbers::pi / 180;
      x(0, i) = kSize * (1 + std::cos(angle));
      x(2, i) = kSize * std::sin(angle);
    }
    return model.elastic_energy(x);
  };
  const auto of_mean = [](double degrees) {
    const double angle = degrees * std::numbers::pi / 180;
    return 0.5 * kBend * angle * angle;
  };
  for (const double sign : {1.0, -1.0}) {
    for (const auto& [at_start, at_end, mean] : {std::array{140.0, 170.0, 155.0},
                                                 {140, 190, 165},
                                                 {190, 140, 165},
                                                 {160, 199, 179.5},
                                                 {160, 201, 179.5},
                                                 {190, 190, 170},
                                                 {100, -60, 20}})
      EXPECT_NEAR(folded(sign * at_start, sign * at_end), of_mean(mean), 1e-9 * kBend)
          << sign * at_start << ' ' << sign * at_end;
  }
}

TEST(Hinges, NeedAGrid) {
  TriangleMesh mesh = small_mesh();
  mesh.material(0, 6) += 0.1 * kSize;
  EXPECT_THROW(hinge_elements(mesh), Error);
  EXPECT_THROW(model_of(test_fabric(), mesh), Error);
}

}  // namespace
}  // namespace weft::hinges_test
