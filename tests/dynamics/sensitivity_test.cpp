#include "weft/dynamics/sensitivity.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <numeric>

#include "dynamics/scenes.h"
#include "weft/base/error.h"

namespace weft::sensitivity_test {
namespace {

using namespace test;  // NOLINT(google-build-using-namespace)

std::vector<int> all_parameters() {
  std::vector<int> all(9);
  std::iota(all.begin(), all.end(), 0);
  return all;
}

/// The judge: central differences of the simulation at two steps, extrapolated. Newton converges
/// to 1e-13 m, so that a relative step of 1e-3 leaves rounding below 1e-8 of what it changes.
struct Differences {
  std::vector<VecX> x, v, reactions;  // by frame, for one parameter
};

Differences differences(const Scene& scene, const Fabric& fabric, int parameter,
                        const SimulationOptions& options, double relative_step) {
  const double value = fabric.values[parameter];
  const auto at = [&](double step) {
    Fabric changed = fabric;
    changed.values[parameter] = value + step;
    Trajectory t = simulate(scene, changed, options);
    EXPECT_FALSE(t.diverged) << t.divergence;
    return t;
  };
  const double h = relative_step * value;
  const Trajectory a = at(h), b = at(-h), c = at(h / 2), d = at(-h / 2);
  Differences out;
  const auto richardson = [&](const Points& p, const Points& q, const Points& r, const Points& s) {
    return VecX((4 * (flat(r) - flat(s)) / h - (flat(p) - flat(q)) / (2 * h)) / 3);
  };
  for (std::size_t k = 0; k < a.frames.size(); ++k) {
    out.x.push_back(richardson(a.frames[k], b.frames[k], c.frames[k], d.frames[k]));
    out.v.push_back(richardson(a.velocities[k], b.velocities[k], c.velocities[k], d.velocities[k]));
    out.reactions.push_back(
        richardson(a.reactions[k], b.reactions[k], c.reactions[k], d.reactions[k]));
  }
  return out;
}

SimulationOptions tight(Integrator integrator, int steps_per_frame = 4) {
  SimulationOptions options;
  options.integrator = integrator;
  options.steps_per_frame = steps_per_frame;
  options.newton_tolerance = 1e-13;
  options.max_newton_iterations = 60;
  options.static_options.force_tolerance = 1e-13;
  return options;
}

void expect_near(const Directions& analytic, std::size_t column, const VecX& numeric,
                 const std::string& what) {
  const VecX ours = analytic.col(static_cast<Eigen::Index>(column));
  ASSERT_EQ(ours.size(), numeric.size());
  const double scale = numeric.cwiseAbs().maxCoeff();
  EXPECT_LE((ours - numeric).cwiseAbs().maxCoeff(), 1e-5 * scale) << what << ", scale " << scale;
}

/// A sagging swatch of 7 x 7 vertices whose corners move: settled, then swung.
Scene moving_scene() {
  Scene scene;
  scene.mesh = make_swatch(0.5, 0.5, 7, 7);
  scene.areal_density = 0.3;
  scene.start = sagging_start(scene.mesh);
  scene.frame_times = uniform_times(0.3, 9);
  const std::vector<double> times = uniform_times(0.4, 16);
  for (const int vertex : {0, 6}) {
    Points path(3, static_cast<Eigen::Index>(times.size()));
    for (std::size_t i = 0; i < times.size(); ++i)
      path.col(static_cast<Eigen::Index>(i)) =
          scene.start.col(vertex) +
          Vec3(0.01, 0.08, 0.02) * (1 - std::cos(2 * M_PI * times[i] / 0.5));
    scene.fixtures.push_back({"corner", vertex, Motion(times, path)});
  }
  return scene;
}

Fabric damped_fabric() {
  return make_fabric({.stretch = 60,
                      .shear = 20,
                      .bend = 2e-4,
                      .stretch_damping = 0.2,
                      .shear_damping = 0.1,
                      .bend_damping = 2e-6,
                      .drag_linear = 0.2,
                      .drag_quadratic = 0.6,
                      .drag_degradation = 0.4});
}

class Sensitivity : public ::testing::TestWithParam<Integrator> {};

void expect_agreement(const Scene& scene, const Fabric& fabric, const SimulationOptions& options) {
  const auto ours = simulate_with_sensitivities(scene, fabric, all_parameters(), options);
  ASSERT_FALSE(ours.trajectory.diverged) << ours.trajectory.divergence;
  EXPECT_EQ(ours.sensitivities.inexact, 0);
  const std::size_t last = scene.frame_times.size() - 1;
  for (std::size_t p = 0; p < 9; ++p) {
    const Differences judge =
        differences(scene, fabric, static_cast<int>(p), options, p < 6 ? 2e-3 : 1e-2);
    for (const std::size_t k : {std::size_t{0}, last / 2, last}) {
      // Drag and damping have no effect on an equilibrium.
      if (k == 0 && p > 2) continue;
      const std::string what = "parameter " + std::to_string(p) + ", frame " + std::to_string(k);
      expect_near(ours.sensitivities.x[k], p, judge.x[k], "x of " + what);
      if (k > 0) expect_near(ours.sensitivities.v[k], p, judge.v[k], "v of " + what);
      expect_near(ours.sensitivities.reactions[k], p, judge.reactions[k], "reactions of " + what);
    }
  }
}

TEST_P(Sensitivity, AgreesWithDifferencesThroughSettlingAndMotion) {
  expect_agreement(moving_scene(), damped_fabric(), tight(GetParam()));
}

TEST_P(Sensitivity, AgreesWithDifferencesFromAGivenStart) {
  SimulationOptions options = tight(GetParam());
  options.settle = SimulationOptions::Settle::none;
  expect_agreement(swinging_scene(0.3, 6), soft_fabric(), options);
}

// BDF2 begins anew there, from accelerations and strain rates that its other steps do without.
TEST_P(Sensitivity, AgreesWithDifferencesWhereStepsGrow) {
  Scene scene = moving_scene();
  scene.frame_times = {0, 0.02, 0.04, 0.12, 0.14, 0.26};
  expect_agreement(scene, damped_fabric(), tight(GetParam(), 2));
}

INSTANTIATE_TEST_SUITE_P(Integrators, Sensitivity,
                         ::testing::Values(Integrator::bdf2, Integrator::newmark,
                                           Integrator::implicit_euler),
                         [](const auto& info) {
                           std::string name(name_of(info.param));
                           std::erase(name, '-');
                           return name;
                         });

TEST(Sensitivities, AreThoseOfTheSameMotion) {
  const Scene scene = moving_scene();
  SimulationOptions options;
  options.newton_tolerance = 1e-7;
  const auto ours = simulate_with_sensitivities(scene, damped_fabric(), {2, 7}, options);
  const Trajectory plain = simulate(scene, damped_fabric(), options);
  ASSERT_EQ(ours.trajectory.frames.size(), plain.frames.size());
  ASSERT_EQ(ours.sensitivities.x.size(), plain.frames.size());
  for (std::size_t k = 0; k < plain.frames.size(); ++k)
    EXPECT_EQ(ours.trajectory.frames[k], plain.frames[k]) << "frame " << k;
  // A subset of the parameters in another order has the same columns; the others are zero.
  const auto all = simulate_with_sensitivities(scene, damped_fabric(), all_parameters(), options);
  const Directions& few = ours.sensitivities.x.back();
  const Directions& many = all.sensitivities.x.back();
  // Each of the 36 steps solves to 1e-7, and stops when all of its columns have.
  EXPECT_LT((few.col(0) - many.col(2)).norm(), 36e-7 * many.col(2).norm());
  EXPECT_LT((few.col(1) - many.col(7)).norm(), 36e-7 * many.col(7).norm());
  EXPECT_EQ(few.rightCols(kDirections - 2).cwiseAbs().maxCoeff(), 0);
}

TEST(Sensitivities, AreTheSameOnAThreadOfTheirOwn) {
  const Scene scene = moving_scene();
  const auto one = simulate_with_sensitivities(scene, damped_fabric(), all_parameters(), {}, 1);
  const auto two = simulate_with_sensitivities(scene, damped_fabric(), all_parameters(), {}, 2);
  ASSERT_EQ(one.sensitivities.x.size(), scene.frame_times.size());
  EXPECT_EQ(two.trajectory.frames, one.trajectory.frames);
  EXPECT_EQ(two.sensitivities.x, one.sensitivities.x);
  EXPECT_EQ(two.sensitivities.v, one.sensitivities.v);
  EXPECT_EQ(two.sensitivities.reactions, one.sensitivities.reactions);
  EXPECT_EQ(two.sensitivities.inexact, one.sensitivities.inexact);
}

TEST(Sensitivities, EndWhereTheMotionDiverges) {
  SimulationOptions options;
  options.max_newton_iterations = 1;
  options.newton_tolerance = 1e-16;
  const Scene scene = moving_scene();
  for (const int threads : {1, 2}) {
    const auto found =
        simulate_with_sensitivities(scene, damped_fabric(), all_parameters(), options, threads);
    ASSERT_TRUE(found.trajectory.diverged);
    ASSERT_EQ(found.trajectory.frames.size(), 1u);
    EXPECT_EQ(found.sensitivities.x.size(), 1u);
    EXPECT_EQ(found.sensitivities.v.size(), 1u);
    EXPECT_EQ(found.sensitivities.reactions.size(), 1u);
  }
}

TEST(Sensitivities, RejectWhatHasNone) {
  const Scene scene = swinging_scene(0.1, 2);
  const Fabric fabric = soft_fabric();
  SimulationOptions options;
  EXPECT_THROW(simulate_with_sensitivities(scene, fabric, {}, options), Error);
  EXPECT_THROW(simulate_with_sensitivities(scene, fabric, {9}, options), Error);
  EXPECT_THROW(simulate_with_sensitivities(scene, fabric, {-1}, options), Error);
  EXPECT_THROW(simulate_with_sensitivities(scene, fabric, {1, 1}, options), Error);
  options.integrator = Integrator::runge_kutta;
  EXPECT_THROW(simulate_with_sensitivities(scene, fabric, {1}, options), Error);
}

}  // namespace
}  // namespace weft::sensitivity_test
