/// Refinement studies of the time integrators and of the mesh. Prints a summary and writes the data
/// of each study as CSV:
///   cantilever.csv  tip deflection of a heavy cantilever against the elastica, by load and mesh
///   order.csv       error of each integrator by number of steps
///   energy.csv      energy of a swinging swatch over time, by integrator
///   mesh.csv        static shape of a sagging swatch by mesh
///   parting.csv     distance over time between simulations of one fabric on two meshes
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <string>

#include "dynamics/elastica.h"
#include "dynamics/scenes.h"
#include "weft/base/error.h"

namespace {

using namespace weft;
using namespace weft::test;

/// A CSV file with a header line.
class Csv {
 public:
  Csv(const std::filesystem::path& path, std::string_view header) : out_(path) {
    if (!out_) throw Error(fmt::format("{}: cannot be written", path.string()));
    out_ << header << '\n';
  }
  template <class... T>
  void row(fmt::format_string<T...> format, T&&... values) {
    out_ << fmt::format(format, std::forward<T>(values)...) << '\n';
  }

 private:
  std::ofstream out_;
};

void study_cantilever(const std::filesystem::path& out) {
  Csv csv(out / "cantilever.csv", "pattern,cells,load,deflection,elastica,relative_error");
  std::puts("heavy cantilever: relative error of the tip deflection");
  for (const GridPattern pattern : {GridPattern::alternating, GridPattern::uniform}) {
    const char* name = pattern == GridPattern::uniform ? "uniform" : "alternating";
    for (const int cells : {10, 20, 40, 80}) {
      std::string line = fmt::format("  {:12} {:3} cells", name, cells);
      for (const double load : {0.5, 2.0, 5.0, 20.0, 50.0}) {
        const Cantilever cantilever(cells, pattern, load);
        const double deflection = cantilever.deflection() / cantilever.free_length;
        const double expected = elastica_tip_deflection(load);
        const double error = deflection / expected - 1;
        csv.row("{},{},{},{:.8g},{:.8g},{:.3e}", name, cells, load, deflection, expected, error);
        line += fmt::format("  {:+.3f} %", 100 * error);
      }
      std::puts(line.c_str());
    }
  }
}

constexpr Integrator kImplicit[] = {Integrator::implicit_euler, Integrator::bdf2,
                                    Integrator::newmark};

void study_order(const std::filesystem::path& out) {
  Csv csv(out / "order.csv", "integrator,steps,error_m");
  const Scene scene = swinging_scene(0.3, 1);
  const Fabric fabric = soft_fabric();
  SimulationOptions options;
  options.settle = SimulationOptions::Settle::none;
  options.integrator = Integrator::runge_kutta;
  options.relative_tolerance = 0;
  options.absolute_tolerance = 1e-12;
  const Points truth = simulate(scene, fabric, options).frames.back();
  std::puts("error after 0.3 s by number of steps");
  for (const Integrator integrator : kImplicit) {
    options.integrator = integrator;
    options.newton_tolerance = 1e-11;
    std::string line = fmt::format("  {:15}", name_of(integrator));
    for (int steps = 25; steps <= 3200; steps *= 2) {
      options.steps_per_frame = steps;
      const double error = largest_distance(simulate(scene, fabric, options).frames.back(), truth);
      csv.row("{},{},{:.6e}", name_of(integrator), steps, error);
      line += fmt::format(" {:.2e}", error);
    }
    std::puts(line.c_str());
  }
  options.integrator = Integrator::runge_kutta;
  std::string line = fmt::format("  {:15}", name_of(options.integrator));
  for (const double tolerance : {1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10}) {
    options.absolute_tolerance = tolerance;
    const Trajectory t = simulate(scene, fabric, options);
    const double error = largest_distance(t.frames.back(), truth);
    csv.row("{},{},{:.6e}", name_of(options.integrator), t.steps, error);
    line += fmt::format(" {}:{:.2e}", t.steps, error);
  }
  std::puts(line.c_str());
}

void study_energy(const std::filesystem::path& out) {
  Csv csv(out / "energy.csv", "integrator,time_s,energy_above_rest_J,fraction");
  // A settled swatch, turned about the line of its fixtures and let go, without damping and without
  // air: the energy should stay.
  Scene scene;
  scene.mesh = make_swatch(0.5, 0.5, 13, 13);
  scene.areal_density = 0.3;
  scene.start = sagging_start(scene.mesh);
  scene.fixtures = {hold(0, scene.start), hold(12, scene.start)};
  scene.frame_times = uniform_times(3.0, 90);
  const Fabric fabric = make_fabric({.stretch = 300, .shear = 100, .bend = 1e-4});
  const ClothModel model(scene.mesh, fabric, scene.areal_density, scene.gravity);
  const StaticResult rest = solve_static(model, scene.start, scene.fixtures, 0);
  const double bottom = total_energy(model, rest.x, Points::Zero(3, rest.x.cols()));
  const Vec3 hook = scene.start.col(0);
  const Mat3 turn = Eigen::AngleAxisd(0.15, Vec3::UnitX()).toRotationMatrix();
  scene.start = (turn * (rest.x.colwise() - hook)).colwise() + hook;
  const double height = total_energy(model, scene.start, Points::Zero(3, rest.x.cols())) - bottom;
  std::puts("energy above rest after 3 s, of what was there at the start (4 steps a frame)");
  for (const Integrator integrator : {Integrator::implicit_euler, Integrator::bdf2,
                                      Integrator::newmark, Integrator::runge_kutta}) {
    SimulationOptions options;
    options.integrator = integrator;
    options.settle = SimulationOptions::Settle::none;
    csv.row("{},0,{:.6e},1", name_of(integrator), height);
    const auto observe = [&](double time, const Points& x, const Points& v) {
      if (integrator == Integrator::runge_kutta) return;
      const double energy = total_energy(model, x, v) - bottom;
      csv.row("{},{:.6f},{:.6e},{:.6f}", name_of(integrator), time, energy, energy / height);
    };
    const Trajectory t = simulate(scene, fabric, options, observe);
    if (integrator == Integrator::runge_kutta) {  // its steps are too many: frames only
      for (std::size_t k = 1; k < t.frames.size(); ++k) {
        const double energy = total_energy(model, t.frames[k], t.velocities[k]) - bottom;
        csv.row("{},{:.6f},{:.6e},{:.6f}", name_of(integrator), scene.frame_times[k], energy,
                energy / height);
      }
    }
    const double left = total_energy(model, t.frames.back(), t.velocities.back()) - bottom;
    fmt::print("  {:15} {:.4f}{}\n", name_of(integrator), left / height,
               t.diverged ? " diverged: " + t.divergence : "");
  }
}

Points at_common_points(const Points& x, int n) {
  const int stride = (n - 1) / 12;
  Points common(3, 169);
  for (int i = 0; i < 169; ++i) common.col(i) = x.col((i / 13) * stride * n + (i % 13) * stride);
  return common;
}

/// The surface `x` of the swatch of n x n vertices at the vertices of another mesh of it.
Points transfer(const Points& x, int n, const TriangleMesh& to) {
  const TriangleMesh from = make_swatch(0.5, 0.5, n, n);
  return interpolate(from, MaterialLocator(from), x, to.material);
}

void study_mesh(const std::filesystem::path& out) {
  Csv csv(out / "mesh.csv", "start,bend_stiffness,vertices,against,mean_m,max_m,iterations");
  constexpr int kSizes[] = {13, 25, 49, 97};
  constexpr int kFinest = 97;
  const auto relax = [](int n, double bend, const Points& start) {
    const TriangleMesh mesh = make_swatch(0.5, 0.5, n, n);
    const std::vector<PointFixture> fixtures{{"left", 0, Motion::fixed({-0.1875, 0, 1})},
                                             {"right", n - 1, Motion::fixed({0.1875, 0, 1})}};
    const ClothModel model(mesh, make_fabric({.stretch = 300, .shear = 100, .bend = bend}), 0.3,
                           Vec3(0, 0, -kGravity));
    return solve_static(model, start, fixtures, 0);
  };
  std::puts("static shape by mesh: mean and largest distance to 97 x 97, mm (iterations)");
  for (const double bend : {1e-3, 3e-4, 1e-4, 1e-5, 1e-6}) {
    const StaticResult finest =
        relax(kFinest, bend, sagging_start(make_swatch(0.5, 0.5, kFinest, kFinest)));
    if (!finest.converged) fmt::print("  bend {:.0e}: 97 x 97 did not converge\n", bend);
    // From one smooth start limp cloth may end on another of its many equilibria on each mesh; from
    // the finest one's equilibrium the same branch is compared.
    for (const bool common : {true, false}) {
      std::string line = fmt::format("  bend {:.0e} N m, from {}:", bend,
                                     common ? "a common start" : "that of 97 x 97");
      for (const int n : kSizes) {
        if (n == kFinest) continue;
        const TriangleMesh mesh = make_swatch(0.5, 0.5, n, n);
        const StaticResult result =
            relax(n, bend, common ? sagging_start(mesh) : transfer(finest.x, kFinest, mesh));
        const Points apart = at_common_points(result.x, n) - at_common_points(finest.x, kFinest);
        const VecX distance = apart.colwise().norm();
        csv.row("{},{},{},{},{:.6e},{:.6e},{}", common ? "common" : "finest", bend, n, kFinest,
                distance.mean(), distance.maxCoeff(), result.iterations);
        line += fmt::format("  {}^2 {:.3f} {:.3f} ({}{})", n, 1e3 * distance.mean(),
                            1e3 * distance.maxCoeff(), result.iterations,
                            result.converged ? "" : ", not converged");
      }
      std::puts(line.c_str());
    }
  }
}

/// time, left x y z, right x y z, after a header line.
struct Corners {
  std::vector<double> times;
  Points left, right;
};

Corners read_corners(const std::filesystem::path& path) {
  std::ifstream in(path);
  if (!in) throw Error(fmt::format("{}: cannot be read", path.string()));
  std::string line;
  std::getline(in, line);
  std::vector<std::array<double, 7>> rows;
  while (std::getline(in, line)) {
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream fields(line);
    std::array<double, 7> row;
    for (double& value : row) {
      if (!(fields >> value)) throw Error(fmt::format("{}: seven numbers a line", path.string()));
    }
    rows.push_back(row);
  }
  Corners corners;
  corners.left.resize(3, static_cast<Eigen::Index>(rows.size()));
  corners.right.resizeLike(corners.left);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const auto column = static_cast<Eigen::Index>(k);
    corners.times.push_back(rows[k][0]);
    corners.left.col(column) = Vec3(rows[k][1], rows[k][2], rows[k][3]);
    corners.right.col(column) = Vec3(rows[k][4], rows[k][5], rows[k][6]);
  }
  return corners;
}

/// `settled`: a settled shape on 25 x 25 to start from; empty: a smooth guess.
Trajectory waving(const Corners& corners, int n, const Fabric& fabric, int steps_per_frame,
                  const Points& settled) {
  Scene scene;
  scene.mesh = make_swatch(0.5, 0.5, n, n);
  scene.areal_density = 0.3;
  scene.start = settled.size() == 0 ? sagging_start(scene.mesh) : transfer(settled, 25, scene.mesh);
  scene.fixtures = {{"left", 0, Motion(corners.times, corners.left)},
                    {"right", n - 1, Motion(corners.times, corners.right)}};
  scene.frame_times = corners.times;
  SimulationOptions options;
  options.steps_per_frame = steps_per_frame;
  return simulate(scene, fabric, options);
}

void study_parting(const std::filesystem::path& out, const Corners& corners) {
  Csv csv(out / "parting.csv", "fabric,pair,time_s,mean_m,max_m");
  std::puts("two simulations of one fabric: mean distance in mm by frame");
  const std::pair<const char*, Fabric> fabrics[] = {
      {"cotton-like", make_fabric({.stretch = 340,
                                   .shear = 170,
                                   .bend = 1e-5,
                                   .stretch_damping = 0.1,
                                   .shear_damping = 0.1,
                                   .bend_damping = 1e-7,
                                   .drag_linear = 0.2,
                                   .drag_quadratic = 0.3,
                                   .drag_degradation = 0.1})},
      {"linen-waving", find_fabric("linen-waving")},
      {"satin-waving", find_fabric("satin-waving")}};
  for (const auto& [name, fabric] : fabrics) {
    const Trajectory coarse = waving(corners, 25, fabric, 4, {});
    const std::tuple<const char*, int, int> others[] = {
        {"25 against 37", 37, 4}, {"25: 4 against 8 steps", 25, 8}, {"25 against 13", 13, 4}};
    for (const auto& [pair, n, steps] : others) {
      // From the shape that 25 x 25 settled to, so that both are on one branch.
      const Trajectory other = waving(corners, n, fabric, steps, coarse.frames.front());
      if (coarse.diverged || other.diverged) {
        fmt::print("  diverged: {} {}\n", coarse.divergence, other.divergence);
      }
      std::string line = fmt::format("  {:13} {:22}", name, pair);
      for (std::size_t k = 0; k < std::min(coarse.frames.size(), other.frames.size()); ++k) {
        const Points apart =
            at_common_points(coarse.frames[k], 25) - at_common_points(other.frames[k], n);
        const VecX distance = apart.colwise().norm();
        csv.row("{},{},{:.6f},{:.6e},{:.6e}", name, pair, corners.times[k], distance.mean(),
                distance.maxCoeff());
        if (k % 10 == 0 || k + 1 == coarse.frames.size()) {
          line += fmt::format(" {}:{:.2f}", k, 1e3 * distance.mean());
        }
      }
      std::puts(line.c_str());
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2 || argc > 3) {
    std::fputs("usage: weft_validate_dynamics OUT_FOLDER [CORNERS_CSV]\n", stderr);
    return 2;
  }
  try {
    const std::filesystem::path out = argv[1];
    std::filesystem::create_directories(out);
    study_cantilever(out);
    study_order(out);
    study_energy(out);
    study_mesh(out);
    if (argc == 3) study_parting(out, read_corners(argv[2]));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
