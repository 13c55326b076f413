#include "weft/estimate/motion_fit.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "common/gradient_check.h"
#include "weft/base/error.h"
#include "weft/base/random.h"

namespace weft::motion_fit_test {
namespace {

using ::testing::HasSubstr;

constexpr double kSide = 0.3;     // m
constexpr double kDensity = 0.2;  // kg/m^2
constexpr double kEnd = 1.6;      // s
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

Fabric fabric_of(double bend, double drag) {
  Fabric f = Fabric::with_defaults("test");
  f.set("bend_stiffness", bend);
  f.set("drag_quadratic", drag);
  return f;
}
Fabric true_fabric() { return fabric_of(3e-4, 1.2); }

/// A swatch that hangs from a bar along its upper edge, which is swung to and fro and turned.
MotionExperiment swung(int count, double node) {
  MotionExperiment e;
  Scene& scene = e.scene;
  scene.mesh = make_swatch(kSide, kSide, count, count);
  scene.areal_density = kDensity;
  scene.start.resize(3, count * count);
  for (int i = 0; i < count * count; ++i)
    scene.start.col(i) = Vec3(scene.mesh.material(0, i), 0, -scene.mesh.material(1, i));
  std::vector<double> times;
  for (int k = 0; k <= 100; ++k) times.push_back(kEnd * k / 100);
  for (int column = 0; column < count; ++column) {
    Points path(3, 101);
    for (int k = 0; k <= 100; ++k) {
      const double t = times[static_cast<std::size_t>(k)];
      const double swing = 0.05 * (1 - std::cos(8 * t)), turn = 0.3 * std::sin(5 * t) * t;
      const double u = scene.mesh.material(0, column) - kSide / 2;
      path.col(k) = Vec3(kSide / 2 + u * std::cos(turn), swing + u * std::sin(turn), 0);
    }
    scene.fixtures.push_back({"bar", column, Motion(times, path)});
  }
  for (double t = 0; t < kEnd + node / 2; t += node) scene.frame_times.push_back(t);
  return e;
}

SimulationOptions steps(int per_node, double tolerance) {
  SimulationOptions options;
  options.steps_per_frame = per_node;
  options.newton_tolerance = tolerance;
  options.static_options.force_tolerance = 1e-10;
  return options;
}

/// Tracks of 5 x 5 points at 15 frames/s whose stamps are `delay` late, as `fabric` moves.
MotionTracks track(const MotionExperiment& e, const SimulationOptions& simulation,
                   const Fabric& fabric, double delay, double noise = 0) {
  MotionTracks tracks;
  tracks.uv.resize(2, 25);
  for (int p = 0; p < 25; ++p) tracks.uv.col(p) = Vec2(p % 5, p / 5) * (kSide / 4);
  Rng rng(3);
  Scene scene = e.scene;
  scene.frame_times = {0};
  for (int k = 1; k <= 19; ++k) scene.frame_times.push_back(k / 15.0);
  // No delay is part of this simulation: its frames are at the true times.
  const Trajectory motion = simulate(scene, e.air, fabric, simulation);
  EXPECT_FALSE(motion.diverged) << motion.divergence;
  const MaterialLocator locator(scene.mesh);
  for (std::size_t k = 0; k < motion.frames.size(); ++k) {
    Points x = interpolate(scene.mesh, locator, motion.frames[k], tracks.uv);
    for (double& value : x.reshaped()) value += noise * rng.normal();
    tracks.times.push_back(scene.frame_times[k] + delay);
    tracks.weight.push_back(VecX::Ones(25));
    tracks.normal.push_back(grid_normals(x, VecX::Ones(25), 5, 5));
    tracks.position.push_back(std::move(x));
  }
  return tracks;
}

MotionUnknowns bend_drag_and_delay() {
  MotionUnknowns unknowns;
  unknowns.free = {"bend_stiffness", "drag_quadratic"};
  unknowns.delay = true;
  unknowns.delay_lower = 0;
  return unknowns;
}

// Tracks of another mesh and other steps, with noise, and stamps 0.23 s late.
TEST(MotionFit, FindsTheDelayAndTheFabricOfAnotherMesh) {
  const MotionTracks tracks = track(swung(13, 0.02), steps(16, 1e-7), true_fabric(), 0.23, 1e-3);
  MotionProblem problem({{"swing", swung(7, 0.025), steps(2, 1e-6), tracks}}, fabric_of(3e-5, 0.3),
                        bend_drag_and_delay(), {1e-3, 1e-3, 5});
  const MotionFitResult fit = fit_motion(problem, problem.initial());
  // The bar's speed is 0.25 m/s rms: 475 points with 1 mm give the delay to 0.3 ms. On 6 instead of
  // 12 cells and with steps of 12.5 instead of 4 ms the pendulum's phase differs by some ms, and
  // its slight bending by cells that are twice as wide.
  EXPECT_NEAR(fit.delay, 0.23, 4e-3);
  EXPECT_NEAR(fit.fabric.value("drag_quadratic") / 1.2, 1, 0.05);
  EXPECT_NEAR(std::log(fit.fabric.value("bend_stiffness") / 3e-4), 0, std::log(1.6));
  ASSERT_EQ(fit.intervals.size(), 3U);
  for (const ParameterInterval& i : fit.intervals) EXPECT_TRUE(i.determined) << i.name;

  // Frames that were not fitted, by the same delay.
  const std::vector<MotionTracks> later{frames_of(tracks, 10, 20)};
  const auto found = problem.simulate(fit.scaled, &later);
  EXPECT_LT(motion_distance(later[0], found[0].position, 0, 10).rms, 3e-3);
}

TEST(MotionFit, FindsNothingWrongWithTheTruth) {
  const MotionExperiment e = swung(5, 0.02);
  const Fabric f = true_fabric();
  // At nodes, on the same mesh and with the same steps the interpolation is the simulation.
  MotionTracks tracks = track(e, steps(2, 1e-9), f, 0);
  const Trajectory motion = simulate(e.scene, f, steps(2, 1e-9));
  const MaterialLocator locator(e.scene.mesh);
  tracks.times = {0.2 + 0.1, 0.6 + 0.1, 1.0 + 0.1};
  tracks.position.clear();
  for (const std::size_t k : {10, 30, 50})
    tracks.position.push_back(interpolate(e.scene.mesh, locator, motion.frames[k], tracks.uv));
  tracks.normal.resize(3);
  tracks.weight.resize(3);
  MotionUnknowns unknowns = bend_drag_and_delay();
  unknowns.delay_initial = 0.1;
  const MotionProblem problem({{"swing", e, steps(2, 1e-9), tracks}}, f, unknowns);
  EXPECT_LT(problem.cost(problem.initial()), 1e-10);
}

// By fabric, delay, and a number of the scene (gravity), with priors, outliers and unseen points.
TEST(MotionFit, GradientAgreesWithDifferences) {
  MotionTracks tracks = track(swung(5, 0.02), steps(2, 1e-8), true_fabric(), 0.1, 2e-3);
  tracks.position[4].col(7) += Vec3(0.02, 0.05, 0);
  tracks.weight[6][3] = 0;
  tracks.position[6].col(3).setConstant(kNan);
  tracks.weight[8].setConstant(0.5);
  tracks.normal[9].setZero();
  MotionUnknowns unknowns = bend_drag_and_delay();
  unknowns.priors = {{"bend_stiffness", 1e-4, 3}};
  unknowns.delay_initial = 0.12;
  SceneUnknown gravity;
  gravity.info = {"gravity", "m/s^2", 5, 20, 9.81, Scale::linear, "", ""};
  gravity.initial = 10.5;
  gravity.apply = [](double g, MotionExperiment& e) { e.scene.gravity = Vec3(0, 0, -g); };
  gravity.prior = ScaledPrior{0.3, 0.2};
  unknowns.scene = {gravity};
  const MotionProblem problem({{"swing", swung(4, 0.025), steps(2, 1e-11), tracks}},
                              fabric_of(2e-4, 0.8), unknowns, {2e-3, 4e-3, 3});
  const VecX x = problem.initial();
  const auto found = problem.linearize(x);
  ASSERT_TRUE(std::isfinite(found.model.cost));
  EXPECT_NEAR(found.model.cost / problem.cost(x), 1, 1e-6);
  const VecX numeric =
      testing::numeric_gradient([&](const VecX& y) { return problem.cost(y); }, x, 1e-3);
  // Central differences over 1e-3 are what the gravity's column is made of: 1e-6 of a coordinate
  // in which the motion bends over 1.
  EXPECT_TRUE(testing::near(found.model.gradient, numeric, 1e-5));
  VecX sum = found.prior.gradient;
  for (const CostPart& part : found.parts) sum += part.gradient;
  EXPECT_TRUE(testing::near(sum, found.model.gradient, 1e-12));
}

// Twice the density with twice of all stiffness, damping and drag moves alike.
TEST(MotionFit, KnowsTheFabricPerDensityOnly) {
  const MotionTracks tracks = track(swung(5, 0.02), steps(2, 1e-8), true_fabric(), 0);
  MotionExperiment heavy = swung(5, 0.02);
  heavy.scene.areal_density *= 2;
  Fabric twice = fabric_of(2e-4, 0.8);
  const MotionProblem light({{"light", swung(5, 0.02), steps(2, 1e-9), tracks}}, twice,
                            bend_drag_and_delay());
  const double cost = light.cost(light.initial());
  for (Eigen::Index i = 0; i < 8; ++i) twice.values[i] *= 2;  // all but the degradation, s^2/m^2
  const MotionProblem same({{"heavy", heavy, steps(2, 1e-9), tracks}}, twice,
                           bend_drag_and_delay());
  EXPECT_GT(cost, 1e-3);
  EXPECT_NEAR(same.cost(same.initial()) / cost, 1, 1e-5);
}

// Cloth that hangs at rest shows neither delay nor drag nor damping.
TEST(MotionFit, SaysWhatIsNotDetermined) {
  MotionExperiment rest = swung(4, 0.05);
  for (PointFixture& fixture : rest.scene.fixtures)
    fixture.motion = Motion::fixed(fixture.motion.position(0));
  const MotionTracks tracks = track(rest, steps(2, 1e-8), true_fabric(), 0, 1e-3);
  MotionUnknowns unknowns = bend_drag_and_delay();
  unknowns.delay_lower = -0.2;
  unknowns.priors = {{"drag_quadratic", 0.5, 3}, {"bend_stiffness", 1e-4, 3}};
  MotionProblem problem({{"rest", rest, steps(2, 1e-8), tracks}}, true_fabric(), unknowns,
                        {1e-3, 1e-3, 5});
  const MotionFitResult fit = fit_motion(problem, problem.initial());
  ASSERT_EQ(fit.intervals.size(), 3U);
  for (const ParameterInterval& i : fit.intervals) EXPECT_FALSE(i.determined) << i.name;
}

TEST(MotionFit, NormalsOfAGridLeaveOutWhatWasNotSeen) {
  // z = 2 x on a grid of 3 x 3, one corner unseen and one more nowhere.
  Points x(3, 9);
  for (int p = 0; p < 9; ++p) {
    const int column = p % 3, row = p / 3;
    x.col(p) = Vec3(column, row, 2 * column);
  }
  VecX weight = VecX::Ones(9);
  weight[0] = 0;
  x.col(0).setConstant(kNan);
  const Points n = grid_normals(x, weight, 3, 3);
  EXPECT_TRUE(n.col(0).isZero());
  for (int p = 1; p < 9; ++p) EXPECT_NEAR(n.col(p).dot(Vec3(-2, 0, 1).normalized()), 1, 1e-12) << p;
}

TEST(MotionFit, BadInputIsRefused) {
  const MotionExperiment e = swung(4, 0.05);
  const MotionTracks good = track(e, steps(2, 1e-6), true_fabric(), 0);
  const auto message = [&](const MotionTracks& tracks, const MotionUnknowns& unknowns,
                           const MotionNoise& noise = {}) {
    try {
      const MotionProblem problem({{"swing", e, {}, tracks}}, true_fabric(), unknowns, noise);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const MotionUnknowns usual = bend_drag_and_delay();
  EXPECT_EQ(message(good, usual), "");
  MotionTracks bad = good;
  bad.weight[2][1] = kNan;
  EXPECT_THAT(message(bad, usual), HasSubstr("point 1 of frame 2"));
  bad = good;
  bad.uv.col(3) *= 2;
  EXPECT_THAT(message(bad, usual), HasSubstr("tracked point 3"));
  bad = good;
  for (double& t : bad.times) t += 1;
  EXPECT_THAT(message(bad, usual), HasSubstr("the tracks end at"));
  bad = good;
  bad.normal.pop_back();
  EXPECT_THAT(message(bad, usual), HasSubstr("differ in their number of frames"));
  MotionUnknowns twice = usual;
  twice.free.push_back("bend_stiffness");
  EXPECT_THAT(message(good, twice), HasSubstr("searched twice"));
  EXPECT_THAT(message(good, {}), HasSubstr("nothing is searched"));
  EXPECT_THAT(message(good, usual, {0, 1e-3, 3}), HasSubstr("noise along the normal"));
}

}  // namespace
}  // namespace weft::motion_fit_test
