#include "weft/dynamics/air.h"

#include <gmock/gmock.h>

#include <cmath>

#include "common/gradient_check.h"
#include "dynamics/scenes.h"
#include "weft/base/error.h"

namespace weft::air_test {
namespace {

using ::testing::HasSubstr;

constexpr double kDensity = 0.2;  // kg/m^2

test::FabricValues dragged() {
  test::FabricValues f;
  f.stretch_damping = f.shear_damping = 0.1;
  f.bend_damping = 1e-7;
  f.drag_linear = 0.2;
  f.drag_quadratic = 0.6;
  f.drag_degradation = 0.3;
  return f;
}

/// The same velocity everywhere.
Points everywhere(const TriangleMesh& mesh, const Vec3& velocity) {
  return velocity.replicate(1, mesh.vertex_count());
}

/// A swatch that hangs flat from its upper corners.
Scene hanging(int count) {
  Scene scene;
  scene.mesh = make_swatch(0.3, 0.3, count, count);
  scene.areal_density = kDensity;
  scene.start =
      test::place(scene.mesh, [](double u, double v) { return Vec3(u, 0.02 * u * v, -v); });
  scene.fixtures = {test::hold(0, scene.start), test::hold(count - 1, scene.start)};
  scene.frame_times = test::uniform_times(0.5, 50);
  return scene;
}

TEST(Air, IsLinearBetweenSamplesAndConstantOutside) {
  const TriangleMesh mesh = make_swatch(1, 1, 2, 2);
  const AirMotion air{{1, 3}, {everywhere(mesh, Vec3(0, 1, 0)), everywhere(mesh, Vec3(2, 5, 0))}};
  Points v;
  air.at(0, v);
  EXPECT_EQ(v.col(3), Vec3(0, 1, 0));
  air.at(1.5, v);
  EXPECT_EQ(v.col(0), Vec3(0.5, 2, 0));
  air.at(4, v);
  EXPECT_EQ(v.col(1), Vec3(2, 5, 0));
  AirMotion().at(1, v);
  EXPECT_EQ(v.cols(), 0);
}

// A free flat sheet floats in an upward stream of its own terminal velocity: k_N w^2 = rho g.
TEST(Air, CarriesASheetAtItsTerminalVelocity) {
  test::FabricValues f = dragged();
  f.drag_degradation = 0;
  Scene scene;
  scene.mesh = make_swatch(0.3, 0.3, 5, 5);
  scene.areal_density = kDensity;
  scene.start = test::place(scene.mesh, [](double u, double v) { return Vec3(u, v, 1); });
  scene.frame_times = {0, 0.5, 1};
  const double speed = std::sqrt(kDensity * test::kGravity / f.drag_quadratic);
  const AirMotion air{{0}, {everywhere(scene.mesh, Vec3(0, 0, speed))}};
  SimulationOptions options;
  options.settle = SimulationOptions::Settle::none;
  options.newton_tolerance = 1e-9;
  options.steps_per_frame = 25;
  const Trajectory motion = simulate(scene, air, test::make_fabric(f), options);
  ASSERT_FALSE(motion.diverged) << motion.divergence;
  // 50 steps solved to 1e-9 m each; in still air it falls by 1.8 m.
  EXPECT_LT(test::largest_distance(motion.frames.back(), scene.start), 1e-6);
  EXPECT_GT(test::largest_distance(simulate(scene, test::make_fabric(f), options).frames.back(),
                                   scene.start),
            1);
}

// Air that gains speed evenly is at rest in a frame that falls behind: there the fixtures move by
// -a t^2 / 2 and gravity is g - a.
TEST(Air, GainingSpeedIsStillAirInAnAcceleratedFrame) {
  const Vec3 a(0.5, 4, 0.3);  // m/s^2
  const Fabric fabric = test::make_fabric(dragged());
  SimulationOptions options;
  options.settle = SimulationOptions::Settle::none;
  options.newton_tolerance = 1e-10;
  options.steps_per_frame = 1;
  const Scene scene = hanging(5);
  const AirMotion air{{0, 1}, {everywhere(scene.mesh, Vec3::Zero()), everywhere(scene.mesh, a)}};
  const Trajectory blown = simulate(scene, air, fabric, options);
  ASSERT_FALSE(blown.diverged) << blown.divergence;

  Scene moving = scene;
  moving.gravity -= a;
  std::vector<double> times = test::uniform_times(0.6, 3000);
  for (PointFixture& fixture : moving.fixtures) {
    Points path(3, static_cast<Eigen::Index>(times.size()));
    for (Eigen::Index k = 0; k < path.cols(); ++k) {
      const double t = times[static_cast<std::size_t>(k)];
      path.col(k) = scene.start.col(fixture.vertex) - 0.5 * t * t * a;
    }
    fixture.motion = Motion(times, path);
  }
  const Trajectory carried = simulate(moving, fabric, options);
  ASSERT_FALSE(carried.diverged) << carried.divergence;
  const double end = scene.frame_times.back();
  const Points expected = carried.frames.back().colwise() + Vec3(0.5 * end * end * a);
  // BDF2 differentiates t^2 exactly. The natural spline starts without acceleration: its velocity
  // is off by a h / 4 at first, h = 0.2 ms, for a step of 10 ms of drag at the corners alone.
  EXPECT_LT(test::largest_distance(blown.frames.back(), expected), 1e-6);
  EXPECT_GT(test::largest_distance(blown.frames.back(), scene.start), 0.02);
}

TEST(Air, DerivativesAgreeWithDifferences) {
  const Scene scene = hanging(4);
  Points gust = everywhere(scene.mesh, Vec3(0.3, 3, 0));
  for (Eigen::Index i = 0; i < gust.cols(); ++i) gust(1, i) *= 1 - 2 * scene.mesh.material(0, i);
  const AirMotion air{{0, 0.4}, {0 * gust, gust}};
  SimulationOptions options;
  options.newton_tolerance = 1e-11;
  options.static_options.force_tolerance = 1e-12;
  const Fabric fabric = test::make_fabric(dragged());
  const std::vector<int> parameters{2, 5, 6, 7, 8};
  const auto found = simulate_with_sensitivities(scene, air, fabric, parameters, options);
  ASSERT_FALSE(found.trajectory.diverged);
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const double value = fabric.values[parameters[i]];
    const VecX numeric = testing::derivative(
        [&](const VecX& factor) {
          Fabric moved = fabric;
          moved.values[parameters[i]] = factor[0] * value;
          return VecX(flat(simulate(scene, air, moved, options).frames.back()));
        },
        VecX::Ones(1), VecX::Ones(1), 0.02);
    const VecX analytic = value * found.sensitivities.x.back().col(static_cast<Eigen::Index>(i));
    // Both are of steps solved to 1e-11 m, over a step of 0.02.
    EXPECT_TRUE(testing::near(analytic, numeric, 1e-4)) << parameters[i];
  }
}

TEST(Air, BadInputIsRefused) {
  const Scene scene = hanging(3);
  const Fabric fabric = test::make_fabric(dragged());
  const Points still = everywhere(scene.mesh, Vec3::Zero());
  const auto message = [&](const AirMotion& air, SimulationOptions options = {}) {
    try {
      simulate(scene, air, fabric, options);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(message({{0, 0}, {still, still}}), HasSubstr("sample 1 is at 0 s"));
  EXPECT_THAT(message({{0, 1}, {still}}), HasSubstr("2 times but 1"));
  EXPECT_THAT(message({{0}, {Points::Zero(3, 2)}}), HasSubstr("not 9 finite velocities"));
  SimulationOptions explicit_steps;
  explicit_steps.integrator = Integrator::runge_kutta;
  EXPECT_THAT(message({{0}, {still}}, explicit_steps), HasSubstr("runge-kutta"));
}

}  // namespace
}  // namespace weft::air_test
