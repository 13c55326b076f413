#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <string>
#include <tuple>
#include <vector>

#include "dynamics/scenes.h"
#include "weft/dynamics/sensitivity.h"

namespace weft::motion_models_sensitivity_test {
namespace {

using namespace test;  // NOLINT(google-build-using-namespace)

/// A sagging swatch of 6 x 6 vertices with a hem whose right corner swings: diagonals go slack and
/// taut. A frame a step, so that every state that the equations are solved at is seen.
Scene waving_scene() {
  Scene scene;
  scene.mesh = make_swatch(0.5, 0.5, 6, 6);
  scene.areal_density = 0.3;
  scene.hem_width = 0.03;
  scene.start = sagging_start(scene.mesh);
  scene.frame_times = uniform_times(0.2, 16);
  const std::vector<double> times = uniform_times(0.3, 12);
  for (const int vertex : {0, 5}) {
    Points path(3, static_cast<Eigen::Index>(times.size()));
    for (std::size_t i = 0; i < times.size(); ++i)
      path.col(static_cast<Eigen::Index>(i)) =
          scene.start.col(vertex) +
          (vertex ? 1 : 0) * Vec3(0.01, 0.07, 0.02) * (1 - std::cos(2 * M_PI * times[i] / 0.5));
    scene.fixtures.push_back({"corner", vertex, Motion(times, path)});
  }
  return scene;
}

/// With all optional terms.
Fabric fabric_of(const std::string& model) {
  Fabric fabric = Fabric::with_defaults("test", model);
  fabric.include("twist_stiffness");
  fabric.include("drag_normal_linear");
  if (model == "baraff-witkin")
    fabric.values << 60, 20, 2e-4, 0.2, 0.1, 2e-6, 0.2, 0.6, 0.4, 1e-4, 0.3;
  else
    fabric.values << 60, 2, 2e-4, 0.2, 0.05, 2e-6, 0.2, 0.6, 0.4, 80, 0.15, 1e-4, 0.3;
  return fabric;
}

/// Which diagonals are taut in which frame; empty for a model without.
std::vector<bool> taut_diagonals(const Scene& scene, const Fabric& fabric,
                                 const Trajectory& motion) {
  std::vector<bool> taut;
  if (fabric.model == "baraff-witkin") return taut;
  const ClothModel model(scene.mesh, fabric, scene.areal_density, scene.gravity, scene.hem_width);
  const int diagonal = fabric.value_index("diagonal_stiffness");
  const std::vector<int>& of = model.components().stiffness;
  for (const Points& x : motion.frames) {
    VecX c;
    model.strains(x, c);
    for (std::size_t i = 0; i < of.size(); ++i)
      if (of[i] == diagonal) taut.push_back(c[static_cast<Eigen::Index>(i)] > 0);
  }
  return taut;
}

/// Central differences at a relative step of 5e-5. The motion is a smooth function of the
/// parameters only while the same diagonals are taut at the end of each step: where one goes slack
/// its damping ends at once, and the step may jump to another solution. So the step must be small,
/// and the motion one in which no diagonal is that near to its length at rest, which is asserted.
/// With Newton's changes below 1e-13 m it leaves 1e-13 / 5e-5 = 2e-9 m, of sensitivities per
/// relative change of a parameter that are above 1e-5 m here.
class MotionModelSensitivity
    : public ::testing::TestWithParam<std::tuple<const char*, Integrator>> {};

INSTANTIATE_TEST_SUITE_P(Models, MotionModelSensitivity,
                         ::testing::Combine(::testing::Values("baraff-witkin",
                                                              "baraff-witkin-diagonals",
                                                              "baraff-witkin-hinges"),
                                            ::testing::Values(Integrator::bdf2, Integrator::newmark,
                                                              Integrator::implicit_euler)),
                         [](const auto& of) {
                           std::string name = std::string(std::get<0>(of.param)) + "_" +
                                              std::string(name_of(std::get<1>(of.param)));
                           std::erase(name, '-');
                           return name;
                         });

TEST_P(MotionModelSensitivity, AgreesWithDifferencesThroughSettlingAndMotion) {
  const Scene scene = waving_scene();
  const Fabric fabric = fabric_of(std::get<0>(GetParam()));
  SimulationOptions options;
  options.integrator = std::get<1>(GetParam());
  options.steps_per_frame = 1;
  options.newton_tolerance = 1e-13;
  options.max_newton_iterations = 60;
  options.static_options.force_tolerance = 1e-13;
  std::vector<int> all(static_cast<std::size_t>(fabric.values.size()));
  std::iota(all.begin(), all.end(), 0);
  const auto ours = simulate_with_sensitivities(scene, fabric, all, options);
  ASSERT_FALSE(ours.trajectory.diverged) << ours.trajectory.divergence;
  EXPECT_EQ(ours.sensitivities.inexact, 0);
  const std::vector<bool> taut = taut_diagonals(scene, fabric, ours.trajectory);
  const std::size_t steps = scene.frame_times.size(), diagonals = taut.size() / steps;
  std::size_t changed = 0;
  for (std::size_t i = diagonals; i < taut.size(); ++i) changed += taut[i] != taut[i - diagonals];
  if (diagonals > 0) {
    EXPECT_GT(changed, 10U) << "few diagonals go slack or taut";
  }
  for (const int p : all) {
    const double step = 5e-5 * fabric.values[p];
    const auto simulated = [&](double by) {
      Fabric other = fabric;
      other.values[p] += by;
      Trajectory t = simulate(scene, other, options);
      EXPECT_EQ(taut_diagonals(scene, fabric, t), taut) << "parameter " << p;
      return t;
    };
    const Trajectory a = simulated(step), b = simulated(-step);
    const std::string name(fabric.info(p).name);
    for (const std::size_t k : {std::size_t{0}, steps / 2, steps - 1}) {
      if (k == 0 && (name.ends_with("_damping") || name.starts_with("drag_")))
        continue;  // no effect on an equilibrium
      const auto expect_near = [&](const Points& above, const Points& below,
                                   const Directions& directions, const char* what) {
        const VecX numeric = flat(Points(above - below)) / (2 * step);
        const double scale = numeric.cwiseAbs().maxCoeff();
        EXPECT_GT(scale * fabric.values[p], 1e-6);
        EXPECT_LE((directions.col(p) - numeric).cwiseAbs().maxCoeff(), 1e-5 * scale)
            << what << " by " << name << ", frame " << k << ", scale " << scale;
      };
      expect_near(a.frames[k], b.frames[k], ours.sensitivities.x[k], "x");
      if (k > 0) expect_near(a.velocities[k], b.velocities[k], ours.sensitivities.v[k], "v");
    }
  }
}

}  // namespace
}  // namespace weft::motion_models_sensitivity_test
