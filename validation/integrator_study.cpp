#include <Eigen/Geometry>
#include <cmath>
#include <cstdio>

#include "dynamics/scenes.h"
#include "study.h"
#include "weft/report/figures.h"

namespace weft::validation {
namespace {

using namespace weft::test;

constexpr Integrator kImplicit[] = {Integrator::implicit_euler, Integrator::bdf2,
                                    Integrator::newmark};

std::string label_of(Integrator integrator) {
  switch (integrator) {
    case Integrator::implicit_euler:
      return "implicit Euler";
    case Integrator::bdf2:
      return "BDF2";
    case Integrator::newmark:
      return "Newmark";
    case Integrator::runge_kutta:
      return "Runge-Kutta";
  }
  return "";
}

/// Each integrator has its colour in all pictures.
int colour_of(Integrator integrator) {
  switch (integrator) {
    case Integrator::implicit_euler:
      return 2;
    case Integrator::bdf2:
      return 1;
    case Integrator::newmark:
      return 3;
    case Integrator::runge_kutta:
      return 0;
  }
  return 0;
}

PlotSeries series_of(Integrator integrator) {
  PlotSeries series;
  series.name = label_of(integrator);
  series.colour = colour_of(integrator);
  return series;
}

/// The slope where the steps are smallest; the coarse end is not yet in the range of the order.
double order_at_fine_end(const PlotSeries& series) {
  constexpr std::size_t kPoints = 4;
  PlotSeries tail;
  const std::size_t first = series.x.size() > kPoints ? series.x.size() - kPoints : 0;
  tail.x.assign(series.x.begin() + static_cast<std::ptrdiff_t>(first), series.x.end());
  tail.y.assign(series.y.begin() + static_cast<std::ptrdiff_t>(first), series.y.end());
  return fitted_order(tail);
}

void expect_order(Findings& findings, const PlotSeries& series, double expected) {
  const double order = order_at_fine_end(series);
  findings.push_back({fmt::format("order of {}, four smallest steps", series.name),
                      fmt::format("{:.2f}", order), fmt::format("{} to within 0.1", expected),
                      std::abs(order - expected) <= 0.1});
}

}  // namespace

void study_order(const std::filesystem::path& out, Findings& findings) {
  constexpr double kEnd = 0.3;  // s
  const Scene scene = swinging_scene(kEnd, 1);
  const Fabric fabric = soft_fabric();
  SimulationOptions options;
  options.settle = SimulationOptions::Settle::none;
  options.integrator = Integrator::runge_kutta;
  options.relative_tolerance = 0;
  options.absolute_tolerance = 1e-12;
  const Points truth = simulate(scene, fabric, options).frames.back();
  std::vector<PlotSeries> all;
  std::puts("error in m after 0.3 s by number of steps");
  for (const Integrator integrator : kImplicit) {
    options.integrator = integrator;
    options.newton_tolerance = 1e-11;
    PlotSeries series = series_of(integrator);
    std::string line = fmt::format("  {:15}", series.name);
    for (int steps = 25; steps <= 3200; steps *= 2) {
      options.steps_per_frame = steps;
      const double error = largest_distance(simulate(scene, fabric, options).frames.back(), truth);
      series.x.push_back(kEnd / steps);
      series.y.push_back(error);
      line += fmt::format(" {}:{:.2e}", steps, error);
    }
    std::puts(line.c_str());
    expect_order(findings, series, integrator == Integrator::implicit_euler ? 1 : 2);
    all.push_back(std::move(series));
  }
  options.integrator = Integrator::runge_kutta;
  PlotSeries series = series_of(options.integrator);
  std::string line = fmt::format("  {:15}", series.name);
  for (const double tolerance : {1e-5, 1e-6, 1e-7, 1e-8, 1e-9}) {
    options.absolute_tolerance = tolerance;
    const Trajectory t = simulate(scene, fabric, options);
    series.x.push_back(kEnd / static_cast<double>(t.steps));
    series.y.push_back(largest_distance(t.frames.back(), truth));
    line += fmt::format(" {}:{:.2e}", t.steps, series.y.back());
  }
  std::puts(line.c_str());
  const double order = order_at_fine_end(series);
  findings.push_back(
      {"order of Runge-Kutta, mean step", fmt::format("{:.2f}", order), "at least 4", order >= 4});
  all.push_back(std::move(series));
  PlotAxis size, error;
  size.label = "time step";
  size.unit = "s";
  error.label = "largest distance to the reference after 0.3 s";
  error.unit = "m";
  LinePlot plot = convergence_plot("Error by time step; orders of the smallest steps", size, error,
                                   all, {1, 2});
  plot.series[0].name = "slopes 1 and 2";
  plot.series[1].name.clear();
  for (std::size_t i = 0; i < all.size(); ++i) {
    plot.series[i + 2].name =
        fmt::format("{}, order {:.2f}", all[i].name, order_at_fine_end(all[i]));
  }
  write_plot(out / "order.svg", plot);
}

namespace {

/// A settled swatch, turned about the line of its fixtures and let go, without damping and without
/// air: its energy should stay.
struct Pendulum {
  Scene scene;
  Fabric fabric = make_fabric({.stretch = 300, .shear = 100, .bend = 1e-4});
  double rest_energy = 0;  // J
  double height = 0;       // J, energy above rest at the start

  explicit Pendulum(double end) {
    scene.mesh = make_swatch(0.5, 0.5, 13, 13);
    scene.areal_density = 0.3;
    scene.start = sagging_start(scene.mesh);
    scene.fixtures = {hold(0, scene.start), hold(12, scene.start)};
    scene.frame_times = uniform_times(end, static_cast<int>(std::lround(30 * end)));
    const ClothModel model = make_model();
    const StaticResult rest = solve_static(model, scene.start, scene.fixtures, 0);
    const Points still = Points::Zero(3, rest.x.cols());
    rest_energy = total_energy(model, rest.x, still);
    const Vec3 hook = scene.start.col(0);
    const Mat3 turn = Eigen::AngleAxisd(0.15, Vec3::UnitX()).toRotationMatrix();
    scene.start = (turn * (rest.x.colwise() - hook)).colwise() + hook;
    height = total_energy(model, scene.start, still) - rest_energy;
  }
  ClothModel make_model() const { return {scene.mesh, fabric, scene.areal_density, scene.gravity}; }
};

/// Energy above rest after each step, J; of Runge-Kutta, whose steps are too many, each frame.
PlotSeries energy_over_time(const Pendulum& pendulum, Integrator integrator) {
  const ClothModel model = pendulum.make_model();
  PlotSeries series = series_of(integrator);
  const auto add = [&](double time, const Points& x, const Points& v) {
    series.x.push_back(time);
    series.y.push_back(total_energy(model, x, v) - pendulum.rest_energy);
  };
  const bool by_step = integrator != Integrator::runge_kutta;
  SimulationOptions options;
  options.integrator = integrator;
  options.settle = SimulationOptions::Settle::none;
  if (by_step) add(0, pendulum.scene.start, Points::Zero(3, pendulum.scene.start.cols()));
  const Trajectory t = simulate(pendulum.scene, pendulum.fabric, options,
                                by_step ? StepObserver(add) : StepObserver());
  for (std::size_t k = 0; !by_step && k < t.frames.size(); ++k) {
    add(pendulum.scene.frame_times[k], t.frames[k], t.velocities[k]);
  }
  if (t.diverged) fmt::print("  {} diverged: {}\n", series.name, t.divergence);
  return series;
}

}  // namespace

void study_energy(const std::filesystem::path& out, Findings& findings) {
  constexpr double kEnd = 3.0;  // s
  const Pendulum pendulum(kEnd);
  std::vector<PlotSeries> all;
  std::puts("energy above rest of an undamped swinging swatch, of what was there at the start");
  for (const Integrator integrator : {Integrator::newmark, Integrator::bdf2,
                                      Integrator::implicit_euler, Integrator::runge_kutta}) {
    PlotSeries series = energy_over_time(pendulum, integrator);
    std::string line = fmt::format("  {:15}", series.name);
    for (std::size_t i = 0; i < series.x.size(); ++i) {
      const double halves = 2 * series.x[i];
      if (std::abs(halves - std::round(halves)) < 1e-6) {
        line += fmt::format(" {:.1f} s: {:.3f}", series.x[i], series.y[i] / pendulum.height);
      }
    }
    std::puts(line.c_str());
    const double kept = series.y.back() / pendulum.height;
    const bool first_order = integrator == Integrator::implicit_euler;
    findings.push_back({fmt::format("energy that {} keeps for {} s", series.name, kEnd),
                        fmt::format("{:.1f} %", 100 * kept),
                        first_order ? "at most 60 %: it takes motion away" : "at least 95 %",
                        first_order ? kept <= 0.6 : kept >= 0.95});
    series.name += fmt::format(": {:.1f} % left", 100 * kept);
    all.push_back(std::move(series));
  }
  LinePlot plot = energy_plot(all);
  plot.title = "Energy of an undamped swinging swatch, 120 steps a second";
  plot.y.label = "energy above rest";
  plot.y.unit = "mJ";
  plot.y.from_zero = true;
  for (PlotSeries& series : plot.series) {
    for (double& energy : series.y) energy *= 1000;
  }
  // The reference lies on the others: dashes let them be seen.
  for (PlotSeries& series : plot.series) series.dashed = series.colour == 0;
  write_plot(out / "energy.svg", plot);
}

}  // namespace weft::validation
