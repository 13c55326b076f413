/// Picture frames beside the closed form of an evenly sheared sheet, F = A W' / d'.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "weft/estimate/curve_fit.h"
#include "weft/estimate/mechanical_fit.h"
#include "weft/estimate/mechanical_strains.h"
#include "weft/model/friction.h"

namespace weft::picture_frame_test {
namespace {

constexpr double kFrame = 0.2, kFabric = 0.14;  // m
constexpr double kShear = 60;                   // N/m

MechanicalCapture frame_capture(const VecX& shear, double grain_angle = 0) {
  MechanicalCapture capture;
  capture.name = "frame";
  capture.width = capture.height = kFabric;
  capture.areal_density = 0.15;
  capture.grain_angle = grain_angle;
  capture.gravity = Vec3::Zero();
  capture.frame_count = static_cast<int>(shear.size());
  capture.picture_frame = PictureFrame{kFrame, shear};
  MechanicalFixture fixture;
  fixture.name = "frame";
  Clip clip;
  clip.region = {{0, 0}, {kFabric, kFabric}};
  fixture.frames.assign(static_cast<std::size_t>(shear.size()), clip);
  fixture.forces = Points::Constant(3, shear.size(), std::nan(""));
  fixture.forces.row(0).setZero();
  capture.fixtures = {fixture};
  return capture;
}

std::vector<MechanicalFrame> simulate(
    const MechanicalCapture& capture, const Fabric& fabric, int cells,
    MechanicalDerivatives derivatives = MechanicalDerivatives::none) {
  MechanicalOptions options;
  options.cells = cells;
  return simulate_mechanical({prepare_mechanical(capture, options)}, fabric, derivatives)[0];
}

/// F of a density whose derivative by the shear angle is `slope`. Written out: bars of length L at
/// half the angle of the pulled corner from the diagonal.
double crosshead(double shear, double slope) {
  const double half = 0.5 * (0.5 * std::acos(-1.0) - shear);
  return kFabric * kFabric * slope / (kFrame * std::sin(half));
}

struct ShearCase {
  Fabric fabric;
  std::function<double(double)> slope;  ///< dW / dgamma, N/m
};

/// Of every elastic model, with A66 = kShear and threads along the bars, which keep their length.
std::vector<ShearCase> shear_cases() {
  std::vector<ShearCase> cases;
  // W = A66 sin^2 gamma / 2: the engineering Green strain 2 E_uv is w_u . w_v = sin gamma.
  const auto green = [](double g) { return kShear * std::sin(g) * std::cos(g); };
  Fabric stvk = Fabric::with_defaults("case", "stvk");
  stvk.set("membrane_shear", kShear);
  cases.push_back({stvk, green});
  for (const char* model : {"soft-constraints", "stvk-diagonal"}) {
    Fabric fabric = Fabric::with_defaults("case", model);
    fabric.set("shear", kShear);
    cases.push_back({fabric, green});
  }
  // A curve: k = 20 + 200 |c|.
  Fabric curve = Fabric::with_defaults("case", "stvk-diagonal");
  curve.set_curve("shear", {Vec2(0, 1), Vec2(20, 220)});
  cases.push_back({curve, [](double g) {
                     const double c = std::sin(g);
                     return (20 + 200 * std::abs(c)) * c * std::cos(g);
                   }});
  // The same matrix everywhere in the table, N_uv = k E_uv: A66 = k / 2.
  Fabric table = Fabric::with_defaults("case", "piecewise-linear");
  for (const char* row : {"rest", "weft", "deg22", "deg45", "deg67", "warp"})
    table.set(row + std::string("_shear"), 2 * kShear);
  cases.push_back({table, green});
  // Springs along both diagonals of square cells, each with the weight 2 A and the elongation
  // sqrt(1 +- sin gamma) - 1; those of the second ring as weak as may be.
  Fabric springs = Fabric::with_defaults("case", "springs");
  springs.set("shear", kShear);
  for (const char* row : {"weft_bend", "warp_bend", "diagonal_bend"}) springs.set(row, 1e-6);
  cases.push_back(
      {springs, [](double g) {
         const double longer = std::sqrt(1 + std::sin(g)), shorter = std::sqrt(1 - std::sin(g));
         return kShear * std::cos(g) * ((longer - 1) / longer - (shorter - 1) / shorter);
       }});
  // W = k C^2 / 2 with C = w_u . w_v; one of the diagonals is taut, longer by sqrt(1 + |sin gamma|)
  // - 1.
  Fabric bhat = Fabric::with_defaults("case", "baraff-witkin");
  bhat.set("shear_stiffness", kShear);
  cases.push_back({bhat, green});
  for (const char* model : {"baraff-witkin-diagonals", "baraff-witkin-hinges"}) {
    Fabric fabric = Fabric::with_defaults("case", model);
    fabric.set("shear_stiffness", kShear);
    fabric.set("diagonal_stiffness", 100);
    cases.push_back({fabric, [green](double g) {
                       const double length = std::sqrt(1 + std::abs(std::sin(g)));
                       const double taut = 100 * (length - 1) * std::cos(g) / (2 * length);
                       return green(g) + std::copysign(taut, g);
                     }});
  }
  return cases;
}

// One deformation of all cells: nothing depends on the mesh but the rounding of some hundred
// vertices' sums. Springs of the second ring, 1e-6 of the others, are left over.
TEST(PictureFrame, ForceIsTheClosedForm) {
  VecX shear(7);
  shear << -0.9, -0.2, 0, 0.01, 0.3, 0.7, 1.2;
  for (const ShearCase& c : shear_cases()) {
    for (const int cells : {2, 7, 16}) {
      const auto frames = simulate(frame_capture(shear), c.fabric, cells);
      for (const MechanicalFrame& frame : frames) {
        const double g = shear[frame.frame], expected = crosshead(g, c.slope(g));
        EXPECT_TRUE(frame.converged);
        EXPECT_NEAR(frame.forces(0, 0), expected, 1e-6 * std::abs(expected) + 1e-9)
            << c.fabric.model << ", " << cells << " cells, shear " << g;
      }
    }
  }
}

// At small angles F = sqrt(2) A66 A gamma / L = 2 A66 A d / L^2.
TEST(PictureFrame, StiffnessAtTheStart) {
  const double displacement = 1e-5;
  const VecX shear = VecX::Constant(1, frame_shear(kFrame, displacement));
  const auto frames = simulate(frame_capture(shear), shear_cases()[0].fabric, 4);
  const double expected = 2 * kShear * kFabric * kFabric * displacement / (kFrame * kFrame);
  EXPECT_NEAR(frames[0].forces(0, 0), expected, 1e-3 * expected);
}

// With threads along the diagonals the frame pulls the weft and shortens the warp: (1 + sin gamma)
// and (1 - sin gamma) are the squares of their stretches.
TEST(PictureFrame, ThreadsMayLieAtAnAngle) {
  Fabric fabric = Fabric::with_defaults("case", "stvk");
  const double a11 = 500, a12 = 40, a22 = 200;
  fabric.set("membrane_uu", a11);
  fabric.set("membrane_uv", a12);
  fabric.set("membrane_vv", a22);
  VecX shear(2);
  shear << -0.3, 0.4;
  const auto frames = simulate(frame_capture(shear, std::acos(-1.0) / 4), fabric, 5);
  for (const MechanicalFrame& frame : frames) {
    const double g = shear[frame.frame], e = 0.5 * std::sin(g);
    const double slope = (a11 - 2 * a12 + a22) * e * 0.5 * std::cos(g);
    EXPECT_NEAR(frame.forces(0, 0), crosshead(g, slope), 1e-9);
  }
}

// Where the bars have the border, the inside is at rest at the even shear, for every model of a
// sheet and whatever the cells: to hold it there changes nothing.
TEST(PictureFrame, TheInsideIsAtRest) {
  const VecX shear = VecX::Constant(1, 0.6);
  for (const ShearCase& c : shear_cases()) {
    if (c.fabric.model == "springs") continue;  // those of the second ring end at the border
    const MechanicalCapture capture = frame_capture(shear);
    MechanicalOptions options;
    options.cells = 6;
    for (const GridPattern pattern : {GridPattern::alternating, GridPattern::uniform}) {
      options.pattern = pattern;
      const auto trial = prepare_mechanical(capture, options);
      const Points x = simulate_mechanical({trial}, c.fabric)[0][0].x;
      const TriangleMesh& mesh = trial->stages[0].mesh;
      Points force;
      make_elastic_model(mesh, c.fabric)->gradient(x, force);
      double inside = 0, border = 0;
      for (Eigen::Index i = 0; i < force.cols(); ++i) {
        const Vec2 uv = mesh.material.col(i);
        const bool free = uv.minCoeff() > 1e-6 && uv.maxCoeff() < kFabric - 1e-6;
        double& largest = free ? inside : border;
        largest = std::max(largest, force.col(i).norm());
      }
      EXPECT_LT(inside, 1e-9 * border) << c.fabric.model;
    }
  }
}

// The stress of the spring and of a Dahl element, forth and back, on c = sin gamma.
TEST(PictureFrame, FrictionGoesAlong) {
  Fabric fabric = Fabric::with_defaults("case", "stvk-diagonal");
  fabric.set("shear", kShear);
  for (const char* row : {"shear_friction", "shear_friction_scale"}) fabric.include(row);
  fabric.set("shear_friction", 3);
  fabric.set("shear_friction_scale", 0.02);
  VecX shear(5);
  shear << 0.1, 0.4, 0.6, 0.4, 0.1;
  const auto frames = simulate(frame_capture(shear), fabric, 3, MechanicalDerivatives::all);
  double strain = 0, stress = 0;
  for (const MechanicalFrame& frame : frames) {
    const double g = shear[frame.frame], next = std::sin(g);
    stress = detail::respond({3, 0.02}, next, strain, stress).stress;
    strain = next;
    EXPECT_NEAR(frame.forces(0, 0), crosshead(g, (kShear * next + stress) * std::cos(g)), 1e-8);
  }
  for (const char* name : {"shear", "shear_friction", "shear_friction_scale"}) {
    const int p = fabric.value_index(name);
    const double h = 1e-5 * fabric.values[p];
    Fabric more = fabric, less = fabric;
    more.values[p] += h;
    less.values[p] -= h;
    const auto above = simulate(frame_capture(shear), more, 3),
               below = simulate(frame_capture(shear), less, 3);
    for (std::size_t k = 0; k < frames.size(); ++k) {
      const double difference = (above[k].forces(0, 0) - below[k].forces(0, 0)) / (2 * h);
      // Forces of some 10 N to 1e-15, over steps of 2e-7 and more.
      EXPECT_NEAR(frames[k].force_derivative(0, p), difference, 1e-6 * std::abs(difference) + 1e-7)
          << name << ", frame " << k;
    }
  }
}

TEST(PictureFrame, FitFindsTheShearAndMarksItsStrain) {
  const VecX shear = VecX::LinSpaced(8, 0.05, 0.7);
  MechanicalCapture capture = frame_capture(shear);
  const ShearCase truth = shear_cases()[0];
  for (int k = 0; k < shear.size(); ++k)
    capture.fixtures[0].forces(0, k) = crosshead(shear[k], truth.slope(shear[k]));
  const auto trial = prepare_mechanical(capture);
  Fabric start = truth.fabric;
  start.set("membrane_shear", 5 * kShear);
  const MechanicalFitResult fit =
      fit_mechanical(MechanicalProblem({trial}, start, {"membrane_shear"}), start);
  EXPECT_NEAR(fit.fabric.value("membrane_shear"), kShear, 1e-4 * kShear);
  EXPECT_EQ(fit.residual_count, 8);
  EXPECT_EQ(isolated_strain(capture), IsolatedStrain::shear);
  // Half of the area is at the 4th or 5th of the angles.
  const auto samples = strain_samples(*trial, simulate_mechanical({trial}, start)[0]);
  EXPECT_NEAR(quantile(samples[2], 0.5), std::tan(shear[3]), 1e-6);
  EXPECT_NEAR(quantile(samples[0], 0.99), 0, 1e-9);
}

// The order of Miguel et al. fits shear to forces along the clips; there is one alone here.
TEST(PictureFrame, IsAShearTestOfTheIncrementalOrder) {
  const VecX shear = VecX::LinSpaced(6, 0.1, 0.6);
  MechanicalCapture capture = frame_capture(shear);
  for (int k = 0; k < shear.size(); ++k)
    capture.fixtures[0].forces(0, k) =
        crosshead(shear[k], kShear * std::sin(shear[k]) * std::cos(shear[k]));
  const Fabric start = Fabric::with_defaults("case", "stvk-diagonal");
  MechanicalCostOptions options;
  options.forces = MechanicalForces::along_clips;
  const MechanicalProblem problem({prepare_mechanical(capture)}, start, {"shear"}, options);
  EXPECT_EQ(problem.residual_count(), 6);
  EXPECT_NEAR(fit_mechanical(problem, start).fabric.value("shear"), kShear, 1e-4 * kShear);
}

}  // namespace
}  // namespace weft::picture_frame_test
