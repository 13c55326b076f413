#include "weft/dynamics/simulate.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "dynamics/scenes.h"
#include "weft/base/error.h"

namespace weft::simulate_test {
namespace {

using namespace test;

constexpr Integrator kAll[] = {Integrator::bdf2, Integrator::newmark, Integrator::implicit_euler,
                               Integrator::runge_kutta};
constexpr Integrator kSecondOrder[] = {Integrator::bdf2, Integrator::newmark};

SimulationOptions unsettled(Integrator integrator, int steps_per_frame = 4) {
  SimulationOptions options;
  options.integrator = integrator;
  options.steps_per_frame = steps_per_frame;
  options.settle = SimulationOptions::Settle::none;
  return options;
}

TEST(Integrator, NamesGoBothWays) {
  for (const Integrator integrator : kAll) {
    EXPECT_EQ(integrator_from_name(name_of(integrator)), integrator);
  }
  EXPECT_EQ(name_of(Integrator::implicit_euler), "implicit-euler");
  EXPECT_THROW(integrator_from_name("euler"), Error);
}

/// A swatch that nothing holds.
Scene loose_scene(const std::function<Vec3(double, double)>& position, double end, int frames) {
  Scene scene;
  scene.mesh = make_swatch(0.2, 0.2, 4, 4);
  scene.areal_density = 0.2;
  scene.gravity = Vec3(0, 0, -kGravity);
  scene.start = place(scene.mesh, position);
  scene.frame_times = uniform_times(end, frames);
  return scene;
}

TEST(Simulate, FallsFreelyWithoutAir) {
  // x = g t^2 / 2. Integrators of second order or more are exact for a parabola; implicit Euler is
  // ahead of it by g t h / 2 (the sum of its velocities).
  const Scene scene = loose_scene([](double u, double v) { return Vec3(u, v, 0); }, 0.5, 5);
  for (const Integrator integrator : kAll) {
    const Trajectory t = simulate(scene, make_fabric({}), unsettled(integrator));
    ASSERT_FALSE(t.diverged) << t.divergence;
    ASSERT_EQ(t.frames.size(), 6u);
    const double h = 0.1 / 4;
    const double ahead = integrator == Integrator::implicit_euler ? kGravity * 0.5 * h / 2 : 0;
    Points expected = scene.start;
    expected.row(2).array() -= kGravity * 0.25 / 2 + ahead;
    EXPECT_LT(largest_distance(t.frames.back(), expected), 1e-6) << name_of(integrator);
    EXPECT_NEAR(t.velocities.back()(2, 3), -kGravity * 0.5, 1e-5) << name_of(integrator);
  }
}

TEST(Simulate, ReachesTheTerminalVelocityAcrossTheCloth) {
  // Weight per area = k_N v^2 / (1 + k_f v^2), solved here by bisection.
  const FabricValues values{.drag_quadratic = 1.7, .drag_degradation = 0.2};
  const Scene scene = loose_scene([](double u, double v) { return Vec3(u, v, 0); }, 3.0, 30);
  const double speed = bisect(
      [&](double v) {
        return values.drag_quadratic * v * v / (1 + values.drag_degradation * v * v) -
               scene.areal_density * kGravity;
      },
      0, 3);
  for (const Integrator integrator : kAll) {
    const Trajectory t = simulate(scene, make_fabric(values), unsettled(integrator));
    ASSERT_FALSE(t.diverged) << t.divergence;
    // Vertices of unequal lumped area fall at one mean speed only as long as the cloth stays flat.
    EXPECT_NEAR(-t.velocities.back().row(2).mean(), speed, 2e-3 * speed) << name_of(integrator);
  }
}

TEST(Simulate, FallsAlongTheClothAsStokesLawSays) {
  // A vertical sheet: v(t) = g tau (1 - exp(-t / tau)) with tau = areal density / k_T.
  const FabricValues values{.drag_linear = 0.8};
  const Scene scene = loose_scene([](double u, double v) { return Vec3(u, 0, -v); }, 1.0, 10);
  const double tau = scene.areal_density / values.drag_linear;
  const double expected = kGravity * tau * (1 - std::exp(-1.0 / tau));
  const VecX masses = vertex_areas(scene.mesh);
  for (const Integrator integrator :
       {Integrator::bdf2, Integrator::newmark, Integrator::runge_kutta}) {
    const Trajectory t = simulate(scene, make_fabric(values), unsettled(integrator, 10));
    ASSERT_FALSE(t.diverged) << t.divergence;
    const double mean = -t.velocities.back().row(2).dot(masses) / masses.sum();
    EXPECT_NEAR(mean, expected, 1e-4 * expected) << name_of(integrator);
  }
}

Points last_frame(const Scene& scene, const Fabric& fabric, const SimulationOptions& options) {
  const Trajectory t = simulate(scene, fabric, options);
  EXPECT_FALSE(t.diverged) << t.divergence;
  return t.frames.back();
}

Points reference(const Scene& scene, const Fabric& fabric) {
  SimulationOptions options = unsettled(Integrator::runge_kutta);
  options.relative_tolerance = 0;
  options.absolute_tolerance = 1e-11;
  return last_frame(scene, fabric, options);
}

class OrderOfAccuracy : public ::testing::TestWithParam<std::pair<Integrator, int>> {};

TEST_P(OrderOfAccuracy, IsWhatTheMethodPromises) {
  // The reference has its damping from velocities, not from differences of strains: both forms of
  // the damping force are checked against each other as well.
  const auto [integrator, order] = GetParam();
  const Scene scene = swinging_scene(0.3, 3);
  const Points truth = reference(scene, soft_fabric());
  SimulationOptions options = unsettled(integrator);
  options.newton_tolerance = 1e-10;
  std::vector<double> errors;
  for (const int steps : {50, 100, 200}) {
    options.steps_per_frame = steps;
    errors.push_back(largest_distance(last_frame(scene, soft_fabric(), options), truth));
  }
  EXPECT_NEAR(std::log2(errors[0] / errors[1]), order, 0.25);
  EXPECT_NEAR(std::log2(errors[1] / errors[2]), order, 0.12);
}

INSTANTIATE_TEST_SUITE_P(Implicit, OrderOfAccuracy,
                         ::testing::Values(std::pair{Integrator::implicit_euler, 1},
                                           std::pair{Integrator::bdf2, 2},
                                           std::pair{Integrator::newmark, 2}),
                         [](const auto& info) {
                           std::string name(name_of(info.param.first));
                           std::erase(name, '-');
                           return name;
                         });

TEST(RungeKutta, ErrorFallsAtLeastWithTheFourthPowerOfTheStep) {
  const Scene scene = swinging_scene(0.3, 1);
  const Points truth = reference(scene, soft_fabric());
  std::vector<double> errors;
  std::vector<double> steps;
  for (const double tolerance : {1e-5, 1e-7, 1e-9}) {
    SimulationOptions options = unsettled(Integrator::runge_kutta);
    options.relative_tolerance = 0;
    options.absolute_tolerance = tolerance;
    const Trajectory t = simulate(scene, soft_fabric(), options);
    errors.push_back(largest_distance(t.frames.back(), truth));
    steps.push_back(static_cast<double>(t.steps));
  }
  for (int i = 0; i < 2; ++i) {
    EXPECT_GE(std::log(errors[i] / errors[i + 1]) / std::log(steps[i + 1] / steps[i]), 4);
  }
}

TEST(Simulate, SecondOrderFromAStartUnderWay) {
  // With frames of unequal length BDF2 changes its step; the order must not suffer.
  Scene scene = swinging_scene(0.3, 3);
  const Points truth = reference(scene, soft_fabric());
  scene.frame_times = {0, 0.06, 0.17, 0.19, 0.3};
  SimulationOptions options = unsettled(Integrator::bdf2);
  options.newton_tolerance = 1e-10;
  std::vector<double> errors;
  for (const int steps : {50, 100}) {
    options.steps_per_frame = steps;
    errors.push_back(largest_distance(last_frame(scene, soft_fabric(), options), truth));
  }
  EXPECT_NEAR(std::log2(errors[0] / errors[1]), 2, 0.25);
}

/// Fixtures that start and stop smoothly: 0.1 m sideways and back within a second.
std::vector<PointFixture> moving_fixtures(const Points& x, std::initializer_list<int> vertices) {
  std::vector<PointFixture> fixtures;
  for (const int vertex : vertices) {
    std::vector<double> times;
    Points path(3, 21);
    for (int i = 0; i <= 20; ++i) {
      times.push_back(i / 20.0);
      path.col(i) = x.col(vertex) + Vec3(0, 0.05 * (1 - std::cos(2 * M_PI * times.back())), 0);
    }
    fixtures.push_back({"moving", vertex, Motion(times, path)});
  }
  return fixtures;
}

TEST(Simulate, BalancesItsEnergy) {
  // d(energy)/dt = power of the fixtures - damping - drag, integrated by the trapezoidal rule over
  // short frames.
  Scene scene = swinging_scene(0.4, 400);
  scene.fixtures = moving_fixtures(scene.start, {0, 3});
  const Fabric fabric = soft_fabric();
  const ClothModel model(scene.mesh, fabric, scene.areal_density, scene.gravity);
  for (const Integrator integrator :
       {Integrator::bdf2, Integrator::newmark, Integrator::runge_kutta}) {
    const Trajectory t = simulate(scene, fabric, unsettled(integrator, 2));
    ASSERT_FALSE(t.diverged) << t.divergence;
    double work = 0, lost = 0, power_before = 0, loss_before = 0;
    for (std::size_t k = 0; k < t.frames.size(); ++k) {
      double power = 0;
      for (std::size_t f = 0; f < scene.fixtures.size(); ++f) {
        power += t.reactions[k]
                     .col(static_cast<Eigen::Index>(f))
                     .dot(t.velocities[k].col(scene.fixtures[f].vertex));
      }
      const double loss = model.damping_power(t.frames[k], t.velocities[k]) +
                          model.drag_power(t.frames[k], t.velocities[k]);
      if (k > 0) {
        work += 0.5 * (power + power_before) * 0.001;
        lost += 0.5 * (loss + loss_before) * 0.001;
      }
      power_before = power;
      loss_before = loss;
    }
    const double change = total_energy(model, t.frames.back(), t.velocities.back()) -
                          total_energy(model, t.frames.front(), t.velocities.front());
    EXPECT_GT(lost, 1e-3);
    EXPECT_GT(std::abs(work), 1e-3);
    EXPECT_NEAR(change, work - lost, 0.01 * lost) << name_of(integrator);
  }
}

TEST(Simulate, ImplicitEulerLosesMotionThatSecondOrderKeeps) {
  // A settled swatch swings about the line of its fixtures from 0.1 rad, without damping and drag:
  // its energy is constant. At 120 steps a second implicit Euler takes a good part of it within 2
  // s.
  Scene scene = swinging_scene(2.0, 60);
  const Fabric fabric = make_fabric({.stretch = 100, .shear = 30, .bend = 1e-4});
  const ClothModel model(scene.mesh, fabric, scene.areal_density, scene.gravity);
  const StaticResult rest = solve_static(model, scene.start, scene.fixtures, 0);
  ASSERT_TRUE(rest.converged);
  const double bottom = total_energy(model, rest.x, Points::Zero(3, rest.x.cols()));
  const Vec3 hook = scene.start.col(0);
  const Mat3 turn = Eigen::AngleAxisd(0.1, Vec3::UnitX()).toRotationMatrix();
  scene.start = (turn * (rest.x.colwise() - hook)).colwise() + hook;
  auto lost = [&](Integrator integrator) {
    const Trajectory t = simulate(scene, fabric, unsettled(integrator, 4));
    EXPECT_FALSE(t.diverged) << t.divergence;
    const double start = total_energy(model, t.frames.front(), t.velocities.front()) - bottom;
    return 1 - (total_energy(model, t.frames.back(), t.velocities.back()) - bottom) / start;
  };
  const double euler = lost(Integrator::implicit_euler);
  EXPECT_GT(euler, 0.4);
  EXPECT_LT(std::abs(lost(Integrator::newmark)), 0.002);
  EXPECT_LT(std::abs(lost(Integrator::bdf2)), 0.02);
  EXPECT_LT(std::abs(lost(Integrator::runge_kutta)), 1e-3);
}

TEST(Simulate, HungStripSwingsAsAChain) {
  // Small oscillation of a hanging chain: omega = (z / 2) sqrt(g / L), z = 2.40483 the first zero
  // of J0, mode J0(z sqrt(1 - s / L)), s from the support. It starts from its equilibrium, moved to
  // the side by the mode: let go unstretched it would bounce up and down as well.
  const double length = 0.5;
  const double zero = 2.404825557695773;
  Scene scene;
  scene.mesh = make_swatch(0.02, length, 2, 26);
  scene.areal_density = 0.1;
  scene.start = place(scene.mesh, [](double u, double v) { return Vec3(u, 0, -v); });
  scene.fixtures = {hold(0, scene.start), hold(1, scene.start)};
  scene.frame_times = uniform_times(3.0, 300);
  // Damps ringing along the strip, which the trapezoidal rule keeps and cannot resolve; not the
  // swing.
  const Fabric fabric = make_fabric(
      {.stretch = 2000, .shear = 2000, .bend = 1e-8, .stretch_damping = 1, .shear_damping = 1});
  {
    const ClothModel model(scene.mesh, fabric, scene.areal_density, scene.gravity);
    scene.start = solve_static(model, scene.start, scene.fixtures, 0).x;
  }
  for (int i = 0; i < scene.mesh.vertex_count(); ++i) {
    const double s = scene.mesh.material(1, i);
    const double mode = std::cyl_bessel_j(0, zero * std::sqrt(1 - s / length));
    scene.start(1, i) = 0.01 * length * mode;
  }
  const double expected = 2 * M_PI / (zero / 2 * std::sqrt(kGravity / length));
  for (const Integrator integrator : kSecondOrder) {
    std::vector<double> crossings;
    double time_before = 0, y_before = 0;
    const auto observe = [&](double time, const Points& x, const Points&) {
      const double y = 0.5 * (x(1, 50) + x(1, 51));
      if (y_before < 0 && y >= 0) {
        crossings.push_back(time_before + (time - time_before) * y_before / (y_before - y));
      }
      time_before = time;
      y_before = y;
    };
    SimulationOptions options = unsettled(integrator, 4);
    options.newton_tolerance = 1e-7;  // of a swing by millimetres
    const Trajectory t = simulate(scene, fabric, options, observe);
    ASSERT_FALSE(t.diverged) << t.divergence;
    ASSERT_GE(crossings.size(), 2u);
    const double period =
        (crossings.back() - crossings.front()) / static_cast<double>(crossings.size() - 1);
    // Lumping over 25 segments, the stretch of the strip, its bending and the step each change the
    // period by less than 0.3 %.
    EXPECT_NEAR(period, expected, 0.005 * expected) << name_of(integrator);
  }
}

TEST(Simulate, StaysAtRestOnceSettledAndHangsByItsWeight) {
  Scene scene;
  scene.mesh = make_swatch(0.5, 0.5, 9, 9);
  scene.areal_density = 0.3;
  scene.start = sagging_start(scene.mesh);
  scene.fixtures = {hold(0, scene.start), hold(8, scene.start)};
  scene.frame_times = uniform_times(0.2, 6);
  const Fabric fabric = make_fabric({.stretch = 300, .shear = 100, .bend = 1e-4});
  for (const Integrator integrator :
       {Integrator::bdf2, Integrator::newmark, Integrator::implicit_euler}) {
    SimulationOptions options;
    options.integrator = integrator;
    const Trajectory t = simulate(scene, fabric, options);
    ASSERT_FALSE(t.diverged) << t.divergence;
    EXPECT_LT(largest_distance(t.frames.back(), t.frames.front()), 1e-5) << name_of(integrator);
    for (const Points& reaction : t.reactions) {
      const Vec3 sum = reaction.rowwise().sum();
      EXPECT_LT((sum - Vec3(0, 0, 0.3 * 0.25 * kGravity)).norm(), 2e-5) << name_of(integrator);
    }
  }
}

TEST(Simulate, ReactionsCarryTheInertiaOfAMovedCloth) {
  // All vertices held and moved as one: the reactions are the inertia and the weight of each.
  Scene scene = loose_scene([](double u, double v) { return Vec3(u, 0, -v); }, 1.0, 20);
  scene.fixtures =
      moving_fixtures(scene.start, {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15});
  const Fabric fabric = make_fabric({});
  const ClothModel model(scene.mesh, fabric, scene.areal_density, scene.gravity);
  for (const Integrator integrator : kAll) {
    const Trajectory t = simulate(scene, fabric, unsettled(integrator));
    ASSERT_FALSE(t.diverged) << t.divergence;
    for (std::size_t k = 0; k < t.frames.size(); ++k) {
      for (int i = 0; i < 16; ++i) {
        const Motion& motion = scene.fixtures[static_cast<std::size_t>(i)].motion;
        const Vec3 expected =
            model.masses()(i) * (motion.acceleration(scene.frame_times[k]) - scene.gravity);
        EXPECT_LT((t.reactions[k].col(i) - expected).norm(), 1e-9) << name_of(integrator);
      }
    }
  }
}

TEST(Simulate, IsDeterministic) {
  Scene scene = swinging_scene(0.2, 6);
  scene.fixtures = moving_fixtures(scene.start, {0, 3});
  for (const Integrator integrator : kAll) {
    SimulationOptions options;
    options.integrator = integrator;
    const Trajectory a = simulate(scene, soft_fabric(), options);
    const Trajectory b = simulate(scene, soft_fabric(), options);
    ASSERT_EQ(a.frames.size(), b.frames.size());
    for (std::size_t k = 0; k < a.frames.size(); ++k) {
      EXPECT_EQ(a.frames[k], b.frames[k]);
      EXPECT_EQ(a.reactions[k], b.reactions[k]);
    }
  }
}

TEST(Simulate, ObserverSeesEachStepInOrder) {
  const Scene scene = swinging_scene(0.1, 3);
  double last = 0;
  long calls = 0;
  const Trajectory t = simulate(scene, soft_fabric(), unsettled(Integrator::bdf2, 4),
                                [&](double time, const Points& x, const Points& v) {
                                  EXPECT_GT(time, last);
                                  EXPECT_EQ(x.cols(), 16);
                                  EXPECT_EQ(v.cols(), 16);
                                  last = time;
                                  ++calls;
                                });
  EXPECT_EQ(calls, t.steps);
  EXPECT_EQ(calls, 12);
  EXPECT_DOUBLE_EQ(last, 0.1);
}

TEST(Simulate, ShowsEachFrameAsItIsReached) {
  const Scene scene = swinging_scene(0.1, 3);
  std::vector<Points> shown;
  const Trajectory t = simulate_frames(scene, soft_fabric(), unsettled(Integrator::bdf2),
                                       [&](std::size_t frame, const Points& x) {
                                         EXPECT_EQ(frame, shown.size());
                                         shown.push_back(x);
                                       });
  ASSERT_FALSE(t.diverged) << t.divergence;
  EXPECT_EQ(shown, t.frames);
  EXPECT_EQ(shown.size(), 4u);
}

TEST(Simulate, ReportsDivergenceInsteadOfThrowing) {
  Scene scene = swinging_scene(0.5, 5);
  {  // explicit integration of a stiff, strongly damped fabric: the budget is used up
    SimulationOptions options = unsettled(Integrator::runge_kutta);
    options.max_force_evaluations = 300;
    const Trajectory t = simulate(
        scene, make_fabric({.stretch = 3000, .shear = 500, .bend = 1e-3, .stretch_damping = 5}),
        options);
    EXPECT_TRUE(t.diverged);
    EXPECT_NE(t.divergence.find("force evaluations"), std::string::npos) << t.divergence;
    EXPECT_GE(t.frames.size(), 1u);
    EXPECT_LT(t.frames.size(), 6u);
  }
  {  // Newton is not given the iterations that it needs, at any step
    SimulationOptions options = unsettled(Integrator::bdf2);
    options.max_newton_iterations = 1;
    options.newton_tolerance = 1e-16;
    const Trajectory t = simulate(scene, soft_fabric(), options);
    EXPECT_TRUE(t.diverged);
    EXPECT_EQ(t.frames.size(), 1u);
    EXPECT_FALSE(t.divergence.empty());
  }
  {  // a cloth that nothing holds has no equilibrium
    SimulationOptions options;
    options.static_options.max_iterations = 50;
    scene.fixtures.clear();
    const Trajectory t = simulate(scene, soft_fabric(), options);
    EXPECT_TRUE(t.diverged);
    EXPECT_TRUE(t.frames.empty());
  }
  {  // parameters that overflow
    scene.fixtures = {hold(0, scene.start)};
    const Trajectory t = simulate(scene, make_fabric({.stretch = 1e308, .shear = 1e308}),
                                  unsettled(Integrator::bdf2));
    EXPECT_TRUE(t.diverged);
  }
}

TEST(Simulate, RejectsAnImpossibleScene) {
  const Scene good = swinging_scene(0.1, 2);
  const Fabric fabric = soft_fabric();
  auto expect_error = [&](const std::function<void(Scene&, SimulationOptions&)>& spoil) {
    Scene scene = good;
    SimulationOptions options = unsettled(Integrator::bdf2);
    spoil(scene, options);
    EXPECT_THROW(simulate(scene, fabric, options), Error);
  };
  expect_error([](Scene& s, auto&) { s.start.conservativeResize(3, 5); });
  expect_error([](Scene& s, auto&) { s.start(0, 0) = std::nan(""); });
  expect_error([](Scene& s, auto&) { s.frame_times.clear(); });
  expect_error([](Scene& s, auto&) { s.frame_times = {0, 0}; });
  expect_error([](Scene& s, auto&) { s.fixtures[0].vertex = 16; });
  expect_error([](Scene& s, auto&) { s.fixtures[0].vertex = -1; });
  expect_error([](Scene& s, auto&) { s.fixtures[1].vertex = s.fixtures[0].vertex; });
  expect_error([](Scene&, SimulationOptions& o) { o.steps_per_frame = 0; });
  expect_error([](Scene&, SimulationOptions& o) { o.newton_tolerance = -1; });
  expect_error([](Scene&, SimulationOptions& o) { o.absolute_tolerance = 0; });
}

}  // namespace
}  // namespace weft::simulate_test
