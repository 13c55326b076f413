#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <string>

#include "dynamics/scenes.h"
#include "weft/dynamics/sensitivity.h"

namespace weft {
namespace {

using namespace test;  // NOLINT(google-build-using-namespace)

/// A sagging swatch of 6 x 6 vertices with a hem whose right corner swings: diagonals go slack and
/// taut.
Scene waving_scene() {
  Scene scene;
  scene.mesh = make_swatch(0.5, 0.5, 6, 6);
  scene.areal_density = 0.3;
  scene.hem_width = 0.03;
  scene.start = sagging_start(scene.mesh);
  scene.frame_times = uniform_times(0.2, 4);
  const std::vector<double> times = uniform_times(0.3, 12);
  for (const int vertex : {0, 5}) {
    Points path(3, static_cast<Eigen::Index>(times.size()));
    for (std::size_t i = 0; i < times.size(); ++i)
      path.col(static_cast<Eigen::Index>(i)) =
          scene.start.col(vertex) +
          (vertex ? 1 : 0) * Vec3(0.01, 0.08, 0.02) * (1 - std::cos(2 * M_PI * times[i] / 0.5));
    scene.fixtures.push_back({"corner", vertex, Motion(times, path)});
  }
  return scene;
}

Fabric diagonal_fabric(const char* model) {
  Fabric fabric = Fabric::with_defaults("test", model);
  fabric.include("twist_stiffness");
  fabric.include("drag_normal_linear");
  fabric.values << 60, 2, 2e-4, 0.2, 0.05, 2e-6, 0.2, 0.6, 0.4, 80, 0.15, 1e-4, 0.3;
  return fabric;
}

/// Differences at a relative step of 2e-5: the motion is a smooth function of the parameters only
/// while the same diagonals are taut at the end of each step, so that the step must be small; with
/// Newton's changes below 1e-13 m it leaves 1e-13 / 2e-5 = 5e-9 m, of sensitivities per relative
/// change of a parameter that are above 1e-3 m here.
class DiagonalSensitivity : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Models, DiagonalSensitivity,
                         ::testing::Values("baraff-witkin-diagonals", "baraff-witkin-hinges"),
                         [](const auto& of) {
                           return std::string(of.param).substr(
                               std::string("baraff-witkin-").size());
                         });

TEST_P(DiagonalSensitivity, AgreesWithDifferencesThroughSettlingAndMotion) {
  const Scene scene = waving_scene();
  const Fabric fabric = diagonal_fabric(GetParam());
  SimulationOptions options;
  options.newton_tolerance = 1e-13;
  options.max_newton_iterations = 60;
  options.static_options.force_tolerance = 1e-13;
  std::vector<int> all(static_cast<std::size_t>(fabric.values.size()));
  std::iota(all.begin(), all.end(), 0);
  const auto ours = simulate_with_sensitivities(scene, fabric, all, options);
  ASSERT_FALSE(ours.trajectory.diverged) << ours.trajectory.divergence;
  EXPECT_EQ(ours.sensitivities.inexact, 0);
  for (const int p : {0, 2, 9, 10, 11, 12}) {
    const double step = 2e-5 * fabric.values[p];
    Fabric above = fabric, below = fabric;
    above.values[p] += step;
    below.values[p] -= step;
    const Trajectory a = simulate(scene, above, options), b = simulate(scene, below, options);
    for (const std::size_t k : {std::size_t{0}, std::size_t{2}, std::size_t{4}}) {
      if (k == 0 && (p == 10 || p == 12))
        continue;  // damping and drag have no effect on an equilibrium
      const VecX numeric = flat(Points(a.frames[k] - b.frames[k])) / (2 * step);
      const VecX analytic = ours.sensitivities.x[k].col(p);
      const double scale = numeric.cwiseAbs().maxCoeff();
      EXPECT_GT(scale, 0);
      EXPECT_LE((analytic - numeric).cwiseAbs().maxCoeff(), 1e-4 * scale)
          << "parameter " << p << ", frame " << k << ", scale " << scale;
    }
  }
}

}  // namespace
}  // namespace weft
