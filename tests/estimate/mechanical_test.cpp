/// Mechanical captures: meshes, evaluation and fits.
#include <gtest/gtest.h>

#include <cmath>

#include "common/gradient_check.h"
#include "dynamics/elastica.h"
#include "weft/base/error.h"
#include "weft/base/toml_reader.h"
#include "weft/estimate/estimate_scatter.h"
#include "weft/estimate/homogeneous_strip.h"
#include "weft/estimate/mechanical_fit.h"

namespace weft::mechanical_test {
namespace {

MechanicalOptions with_cells(int cells) {
  MechanicalOptions options;
  options.cells = cells;
  return options;
}

const std::filesystem::path kData = std::filesystem::path(WEFT_SOURCE_DIR) / "data/mechanical";

Fabric true_fabric(const std::string& name) {
  const TomlTable file = TomlTable::parse_file(kData / name / "truth/parameters.toml");
  Fabric fabric = Fabric::with_defaults("truth", "stvk");
  const TomlTable a = file.table("membrane"), d = file.table("bending");
  const Range any{0, 1e6};
  fabric.values << a.number("A11", any), a.number("A12", any), a.number("A22", any),
      a.number("A66", any), d.number("D11", any), d.number("D12", any), d.number("D22", any),
      d.number("D66", any);
  return fabric;
}

/// A bundled capture with only some of its frames.
MechanicalCapture bundled(const std::string& name, const std::vector<int>& frames) {
  MechanicalCapture capture = read_mechanical_capture(kData / name);
  capture.geometry.reset();
  capture.frame_count = static_cast<int>(frames.size());
  for (MechanicalFixture& fixture : capture.fixtures) {
    const MechanicalFixture all = fixture;
    fixture.frames.clear();
    fixture.forces.resize(3, capture.frame_count);
    for (int k = 0; k < capture.frame_count; ++k) {
      const int frame = frames[static_cast<std::size_t>(k)];
      fixture.frames.push_back(all.frames[static_cast<std::size_t>(frame)]);
      fixture.forces.col(k) = all.forces.col(frame);
    }
  }
  return capture;
}

/// A strip held horizontally by one end; `load` = rho g L^3 / D.
MechanicalCapture cantilever(double length, double load, const Fabric& fabric) {
  MechanicalCapture capture;
  capture.name = "cantilever";
  capture.width = length + 0.01;
  capture.height = 0.03;
  capture.areal_density = load * fabric.value("bend_uu") / (9.81 * std::pow(length, 3));
  capture.frame_count = 1;
  MechanicalFixture table;
  table.name = "table";
  Clip clip;
  clip.region = {{0, 0}, {0.01, capture.height}};
  clip.position = Vec3(0.005, capture.height / 2, 0);
  table.frames = {clip};
  table.forces.resize(3, 0);
  capture.fixtures = {table};
  return capture;
}

TEST(PrepareMechanical, GridLinesLieOnTheClipsBorders) {
  const auto trial =
      prepare_mechanical(read_mechanical_capture(kData / "knit_bend_u"), with_cells(4));
  EXPECT_EQ(trial->stages.size(), 15u);  // one a frame: the region changes
  for (const MechanicalStage& stage : trial->stages) {
    const Clip clip = trial->capture.clips(stage.frames.front())[0];
    EXPECT_NO_THROW(validate(stage.mesh, "stage"));
    double beyond = 1;  // the nearest vertices above and below the border
    bool on = false;
    for (Eigen::Index i = 0; i < stage.mesh.material.cols(); ++i) {
      const double d = stage.mesh.material(0, i) - clip.region.upper.x();
      if (std::abs(d) < 1e-9) on = true;
      if (d > 1e-9) beyond = std::min(beyond, d);
    }
    EXPECT_TRUE(on);
    double strip = 1;
    for (Eigen::Index i = 0; i < stage.mesh.material.cols(); ++i) {
      const double d = clip.region.upper.x() - stage.mesh.material(0, i);
      if (d > 1e-9) strip = std::min(strip, d);
    }
    EXPECT_NEAR(strip, 0.02 * beyond, 1e-9);
  }
  EXPECT_THROW(prepare_mechanical(trial->capture, with_cells(1)), Error);
}

// The clamp is where the clip's border is: without the strip inside the clip the tip would sink by
// 7 % more on this mesh.
TEST(SimulateMechanical, CantileverFollowsTheElastica) {
  Fabric fabric = Fabric::with_defaults("test", "stvk");
  fabric.set("membrane_uu", 5000);
  fabric.set("membrane_vv", 5000);
  fabric.set("membrane_uv", 1);
  fabric.set("bend_uv", 1e-10);  // no Poisson effect, so that the strip is a beam
  for (const double load : {1.0, 5.0, 20.0, 50.0}) {
    const auto trial = prepare_mechanical(cantilever(0.1, load, fabric), with_cells(8));
    const auto frames = simulate_mechanical({trial}, fabric);
    const MechanicalFrame& frame = frames[0][0];
    ASSERT_TRUE(frame.converged);
    const double expected = 0.1 * test::elastica_tip_deflection(load);
    EXPECT_NEAR(-frame.x(2, frame.x.cols() - 1), expected, 0.01 * expected) << "load " << load;
    const double weight = 9.81 * trial->capture.areal_density * 0.11 * 0.03;
    EXPECT_NEAR(frame.forces(2, 0), weight, 1e-5);
  }
}

/// A strip between two clips, pulled to each elongation in turn; without gravity.
MechanicalCapture pulled_strip(const VecX& elongations) {
  MechanicalCapture capture;
  capture.name = "strip";
  capture.width = 0.12;
  capture.height = 0.02;
  capture.areal_density = 0.1;
  capture.gravity = Vec3::Zero();
  capture.frame_count = static_cast<int>(elongations.size());
  const double free = capture.width - 0.02;
  for (const double end : {0.0, 1.0}) {
    MechanicalFixture fixture;
    fixture.name = end > 0 ? "right" : "left";
    for (const double e : elongations) {
      Clip clip;
      clip.region = {{end * (capture.width - 0.01), 0},
                     {0.01 + end * (capture.width - 0.01), capture.height}};
      clip.position = Vec3(0.005 + end * (capture.width - 0.01 + e * free), capture.height / 2, 0);
      fixture.frames.push_back(clip);
    }
    fixture.forces = Points::Zero(3, capture.frame_count);
    capture.fixtures.push_back(std::move(fixture));
  }
  return capture;
}

// Without coupling the strip is strained alike everywhere, between clips, too: its forces are those
// of one square of the same law, also on the way back, where friction makes them smaller.
TEST(SimulateMechanical, FrictionGoesAlongFromFrameToFrame) {
  Fabric fabric = Fabric::with_defaults("test", "soft-constraints");
  fabric.set("weft_stretch", 300);
  for (const char* row : {"weft_stretch_friction", "weft_stretch_friction_scale"})
    fabric.include(row);
  fabric.set("weft_stretch_friction", 4);
  fabric.set("weft_stretch_friction_scale", 0.01);
  VecX elongations(7);
  elongations << 0, 0.02, 0.05, 0.08, 0.05, 0.02, 0.04;
  const auto trial = prepare_mechanical(pulled_strip(elongations), with_cells(3));
  const auto frames = simulate_mechanical({trial}, fabric, MechanicalDerivatives::all)[0];
  HomogeneousStrip::Derivatives derivatives;
  const auto expected =
      HomogeneousStrip(fabric).pull((elongations.array() + 1).matrix(), &derivatives);
  for (int k = 0; k < 7; ++k) {
    const auto& frame = frames[static_cast<std::size_t>(k)];
    ASSERT_TRUE(frame.converged);
    const double force = 0.02 * expected[static_cast<std::size_t>(k)].force;
    EXPECT_NEAR(frame.forces(0, 1), force, 1e-6) << "frame " << k;
    for (const char* name : {"weft_stretch", "weft_stretch_friction"}) {
      const int p = fabric.value_index(name);
      EXPECT_NEAR(frame.force_derivative(3, p), 0.02 * derivatives.force(k, p), 1e-6)
          << name << ", frame " << k;
    }
  }
  // The loop: loading and unloading through the same elongation differ by twice the friction.
  EXPECT_NEAR(frames[2].forces(0, 1) - frames[4].forces(0, 1), 0.02 * 8, 0.02 * 8 * 0.06);
}

// Another program's equilibria at the parameters that it ran with. Forces of the strip at 45
// degrees agree to 0.04 % on a fine mesh, shapes of the cantilever to 0.25 mm; this one is coarser.
TEST(CompareMechanical, TrueParametersReproduceAnotherProgram) {
  const auto strip =
      prepare_mechanical(read_mechanical_capture(kData / "blend_strip_45"), with_cells(6));
  const auto frames = simulate_mechanical({strip}, true_fabric("blend_strip_45"));
  const MechanicalEvaluation forces = compare_mechanical(*strip, frames[0]);
  EXPECT_EQ(forces.not_converged, 0);
  EXPECT_NEAR(forces.largest_force, 0.184, 0.001);
  EXPECT_LT(forces.force_relative, 0.005);
  EXPECT_LT(forces.distance.max, 1e-4);

  const auto bend =
      prepare_mechanical(read_mechanical_capture(kData / "knit_bend_u"), with_cells(12));
  const auto bent = simulate_mechanical({bend}, true_fabric("knit_bend_u"));
  const MechanicalEvaluation shapes = compare_mechanical(*bend, bent[0]);
  EXPECT_EQ(shapes.not_converged, 0);
  EXPECT_LT(shapes.distance.max, 5e-4);
  EXPECT_LT(shapes.force_rms, 1e-6);  // the weight of the cloth
}

TEST(CompareMechanical, FramesWithoutEquilibriumAreCounted) {
  MechanicalOptions options;
  options.cells = 4;
  options.statics.max_iterations = 1;
  const auto trial = prepare_mechanical(bundled("blend_strip_45", {11}), options);
  const auto frames = simulate_mechanical({trial}, true_fabric("blend_strip_45"));
  const MechanicalEvaluation e = compare_mechanical(*trial, frames[0]);
  EXPECT_EQ(e.not_converged, 1);
  ASSERT_EQ(e.frames.size(), 1u);
  EXPECT_FALSE(e.frames[0].converged);
  const MechanicalProblem problem({trial}, true_fabric("blend_strip_45"), {"membrane_uu"});
  std::string reason;
  EXPECT_EQ(problem.cost(VecX::Constant(1, 0.5), &reason), INFINITY);
  EXPECT_NE(reason.find("no equilibrium at frame 0"), std::string::npos);
}

const std::vector<std::string> kMembrane{"membrane_uu", "membrane_uv", "membrane_vv",
                                         "membrane_shear"};

TEST(MechanicalProblem, GradientIsThatOfTheCost) {
  const auto trial = prepare_mechanical(bundled("blend_strip_45", {4, 11}), with_cells(4));
  Fabric fabric = true_fabric("blend_strip_45");
  fabric.values.head<4>() *= 1.3;
  const MechanicalProblem problem({trial}, fabric, kMembrane);
  const VecX x = problem.scaled(fabric);
  const auto found = problem.linearize(x);
  EXPECT_EQ(found.parts.size(), 2u);
  EXPECT_NEAR(found.model.cost, problem.cost(x), 1e-9 * found.model.cost);
  const VecX numeric =
      testing::numeric_gradient([&](const VecX& at) { return problem.cost(at); }, x, 1e-4);
  // Equilibria to 1e-7 N of some 0.1 N.
  EXPECT_TRUE(testing::near(found.model.gradient, numeric, 1e-4));
}

TEST(FitMechanical, RecoversWhatMadeTheForces) {
  // Narrow strips hardly see the coupling of weft and warp: it is given.
  MechanicalCapture capture = bundled("blend_strip_45", {2, 6, 11});
  const Fabric truth = true_fabric("blend_strip_45");
  std::vector<std::shared_ptr<const MechanicalTrial>> trials;
  for (const double angle : {0.0, 0.8, 1.57}) {
    capture.grain_angle = angle;
    const auto trial = prepare_mechanical(capture, with_cells(4));
    const auto frames = simulate_mechanical({trial}, truth);
    MechanicalCapture measured = capture;
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t c = 0; c < 2; ++c)
        measured.fixtures[c].forces.col(static_cast<Eigen::Index>(k)) =
            frames[0][k].forces.col(static_cast<Eigen::Index>(c));
    trials.push_back(prepare_mechanical(measured, with_cells(4)));
  }
  Fabric start = truth;
  const std::vector<std::string> free{"membrane_uu", "membrane_vv", "membrane_shear"};
  for (const std::string& name : free) start.set(name, 5 * truth.value(name));
  const MechanicalProblem problem(trials, start, free);
  const MechanicalFitResult fit = fit_mechanical(problem, start);
  EXPECT_LT(fit.cost, 1e-6 * fit.cost_start);
  for (const std::string& name : free)
    EXPECT_NEAR(fit.fabric.value(name), truth.value(name), 0.01 * truth.value(name)) << name;
  ASSERT_EQ(fit.intervals.size(), 3u);
  for (const ParameterInterval& interval : fit.intervals) {
    EXPECT_TRUE(interval.determined);
    // Without noise in the forces, the interval is that of the noise that is stated.
    EXPECT_LT(interval.lower, truth.value(interval.name));
    EXPECT_GT(interval.upper, truth.value(interval.name));
  }
  EXPECT_EQ(fit.history.size(), fit.evaluations - 1);
}

TEST(FitMechanical, BeginsOnHalfTheCells) {
  const auto trial = prepare_mechanical(bundled("blend_strip_45", {2, 6, 11}), with_cells(16));
  Fabric start = true_fabric("blend_strip_45");
  start.set("membrane_shear", 5 * start.value("membrane_shear"));
  start.set("membrane_vv", 5 * start.value("membrane_vv"));
  const MechanicalProblem problem({trial}, start, {"membrane_vv", "membrane_shear"});
  ASSERT_TRUE(problem.on_half_the_cells());
  EXPECT_EQ(problem.on_half_the_cells()->trials()[0]->options.cells, 8);
  MechanicalFitOptions options;
  const MechanicalFitResult found = fit_mechanical(problem, start, options);
  options.first_cells = FirstCells::as_given;
  const MechanicalFitResult straight = fit_mechanical(problem, start, options);
  // A search ends where its steps lower the sum of squares by less than 0.01, a tenth of a standard
  // deviation, to either side of the minimum.
  const VecX apart = problem.scaled(found.fabric) - problem.scaled(straight.fabric);
  ASSERT_EQ(straight.intervals.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i)
    EXPECT_LT(std::abs(apart[static_cast<Eigen::Index>(i)]),
              0.2 * straight.intervals[i].half_width / normal_half_width(0.9));
  EXPECT_EQ(found.start.values, straight.start.values);
  EXPECT_NEAR(found.cost_start, straight.cost_start, 0.05 * straight.cost_start);
  // One numbering of both searches; the two ends that are looked at have no step.
  EXPECT_EQ(found.history.size() + 2, found.evaluations);
  std::size_t far = 0;
  for (std::size_t i = 1; i < found.history.size(); ++i) {
    EXPECT_GT(found.history[i].evaluation, found.history[i - 1].evaluation);
    if (found.history[i].best > found.history[i - 1].best) far = i;
  }
  EXPECT_GT(far, 0u);                                                    // the second one begins
  EXPECT_LT(2 * (found.history.size() - far), straight.history.size());  // near its end

  // A fit that is stopped on the way is looked at on all cells.
  const MechanicalFitResult stopped = fit_mechanical(
      problem, start, {}, [](const MechanicalFitStep& s) { return s.evaluation < 3; });
  EXPECT_EQ(stopped.end, LeastSquaresEnd::stopped);
  EXPECT_NEAR(stopped.cost, problem.cost(problem.scaled(stopped.fabric)), 1e-6 * stopped.cost);
  EXPECT_TRUE(stopped.mesh.unknown.empty());

  EXPECT_FALSE(MechanicalProblem({prepare_mechanical(trial->capture, with_cells(15))}, start,
                                 {"membrane_shear"})
                   .on_half_the_cells());
}

TEST(FitMechanical, IntervalsHoldWhatTheMeshDoes) {
  // Another program's cantilever on cells that are too wide for it.
  const auto trial =
      prepare_mechanical(read_mechanical_capture(kData / "knit_bend_u"), with_cells(5));
  const Fabric truth = true_fabric("knit_bend_u");
  const double expected = truth.value("bend_uu");
  const MechanicalProblem problem({trial}, truth, {"bend_uu"});
  MechanicalFitOptions options;
  const MechanicalFitResult without = fit_mechanical(problem, truth, options);
  EXPECT_EQ(without.mesh.shift.size(), 0);
  ASSERT_EQ(without.intervals.size(), 1u);
  EXPECT_GT(without.intervals[0].lower, expected);
  options.mesh_error = MeshError::included;
  const MechanicalFitResult with = fit_mechanical(problem, truth, options);
  EXPECT_EQ(with.fabric.value("bend_uu"), without.fabric.value("bend_uu"));
  ASSERT_EQ(with.mesh.shift.size(), 1);
  EXPECT_LT(with.mesh.shift[0], 0);
  EXPECT_LT(with.intervals[0].lower, expected);
  EXPECT_GT(with.intervals[0].upper, expected);

  // The shift is where a fit on the finer mesh ends: a Gauss-Newton step of some per cent of a
  // parameter, to a tenth of it.
  const MechanicalProblem finer = problem.refined();
  EXPECT_EQ(finer.trials()[0]->options.cells, 10);
  const MechanicalFitResult there = fit_mechanical(finer, truth);
  const double moved = finer.scaled(there.fabric)[0] - problem.scaled(without.fabric)[0];
  EXPECT_NEAR(with.mesh.shift[0], moved, 0.1 * std::abs(moved));
}

// What the mesh does takes as long as several steps.
TEST(FitMechanical, AStoppedFitDoesNotAskTheMesh) {
  const auto trial = prepare_mechanical(bundled("blend_strip_45", {2, 11}), with_cells(8));
  Fabric start = true_fabric("blend_strip_45");
  start.set("membrane_shear", 5 * start.value("membrane_shear"));
  const MechanicalProblem problem({trial}, start, {"membrane_shear"});
  MechanicalFitOptions options;
  options.mesh_error = MeshError::included;
  for (const FirstCells first : {FirstCells::halved, FirstCells::as_given}) {
    options.first_cells = first;
    const MechanicalFitResult stopped = fit_mechanical(
        problem, start, options, [](const MechanicalFitStep& s) { return s.evaluation < 2; });
    EXPECT_EQ(stopped.end, LeastSquaresEnd::stopped);
    EXPECT_EQ(stopped.mesh.shift.size(), 0);
    EXPECT_EQ(stopped.mesh.unknown, "the fit was stopped");
    EXPECT_EQ(stopped.intervals.size(), 1u);
  }
}

// From the shapes on wider cells the same equilibria, in fewer steps than from where the clips are.
TEST(SimulateMechanical, StartsBetweenTheVerticesOfWiderCells) {
  MechanicalCapture capture = read_mechanical_capture(kData / "knit_bend_u");
  capture.geometry.reset();
  const auto wide = prepare_mechanical(capture, with_cells(5));
  const auto fine = refined(*wide);
  const Fabric fabric = true_fabric("knit_bend_u");
  const MechanicalFrames starts =
      starts_between({wide}, simulate_mechanical({wide}, fabric), {fine});
  const auto none = MechanicalDerivatives::none;
  const auto from_wide = simulate_mechanical({fine}, fabric, none, 0, &starts);
  const auto anew = simulate_mechanical({fine}, fabric);
  int steps = 0, steps_anew = 0;
  for (std::size_t k = 0; k < anew[0].size(); ++k) {
    EXPECT_FALSE(starts[0][k].converged);
    ASSERT_TRUE(from_wide[0][k].converged);
    // Net forces are below 1e-7 N, and the end gives way by some 3 mm for each 1e-6 N.
    EXPECT_LT((from_wide[0][k].x - anew[0][k].x).cwiseAbs().maxCoeff(), 3e-4);
    steps += from_wide[0][k].iterations;
    steps_anew += anew[0][k].iterations;
  }
  EXPECT_LT(steps, steps_anew);
}

TEST(FitMechanical, TheMeshDoesNotMoveWhatItsRangeHolds) {
  const auto trial = prepare_mechanical(bundled("blend_strip_45", {2, 6, 11}), with_cells(3));
  const Fabric truth = true_fabric("blend_strip_45");
  Fabric start = truth;
  // The search may not go up to what made the forces.
  start.lower = start.upper = truth.values;
  for (int i = 0; i < truth.values.size(); ++i) {
    start.lower[i] = truth.info(i).lower;
    start.upper[i] = truth.info(i).upper;
  }
  const int shear = parameter_index(start.model, "membrane_shear");
  start.values[shear] = start.upper[shear] = 0.7 * start.values[shear];
  const auto fit = [&](const Fabric& from, const std::vector<std::string>& free) {
    MechanicalFitOptions options;
    options.mesh_error = MeshError::included;
    return fit_mechanical(MechanicalProblem({trial}, from, free), from, options);
  };
  const MechanicalFitResult both = fit(start, {"membrane_uu", "membrane_shear"});
  ASSERT_EQ(both.mesh.shift.size(), 2);
  EXPECT_EQ(both.fabric.value("membrane_shear"), start.upper[shear]);
  EXPECT_EQ(both.mesh.shift[1], 0);
  // The other one moves as if that were not searched at all, from the same place.
  const MechanicalFitResult alone = fit(both.fabric, {"membrane_uu"});
  ASSERT_EQ(alone.mesh.shift.size(), 1);
  EXPECT_NE(alone.mesh.shift[0], 0);
  // The two searches end within their tolerance of each other.
  EXPECT_NEAR(both.mesh.shift[0], alone.mesh.shift[0], 0.01 * std::abs(alone.mesh.shift[0]));
}

TEST(MechanicalProblem, RefusesWhatCannotBeFitted) {
  const auto trial = prepare_mechanical(bundled("blend_strip_45", {4}), with_cells(4));
  const Fabric fabric = true_fabric("blend_strip_45");
  EXPECT_THROW(MechanicalProblem({trial}, fabric, {}), Error);
  EXPECT_THROW(MechanicalProblem({trial}, fabric, {"bend_uu", "bend_uu"}), Error);
  EXPECT_THROW(MechanicalProblem({trial}, fabric, {"stretch_stiffness"}), Error);
  MechanicalCostOptions options;
  options.force_noise = 0;
  EXPECT_THROW(MechanicalProblem({trial}, fabric, {"bend_uu"}, options), Error);
  options = {};
  options.residuals = MechanicalResiduals::points;  // which this capture lacks
  EXPECT_THROW(MechanicalProblem({trial}, fabric, {"bend_uu"}, options), Error);
}

}  // namespace
}  // namespace weft::mechanical_test
