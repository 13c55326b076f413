#include <algorithm>
#include <array>
#include <cstdio>
#include <fstream>
#include <sstream>

#include "dynamics/scenes.h"
#include "study.h"
#include "weft/report/figures.h"

namespace weft::validation {
namespace {

using namespace weft::test;

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
    std::ranges::replace(line, ',', ' ');
    std::istringstream fields(line);
    std::array<double, 7> row{};
    for (double& value : row) {
      if (!(fields >> value)) throw Error(fmt::format("{}: seven numbers a line", path.string()));
    }
    rows.push_back(row);
  }
  if (rows.size() < 2) throw Error(fmt::format("{}: at least two frames", path.string()));
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

constexpr double kSide = 0.5;  // m
constexpr int kBase = 25;      // vertices a side

/// The surface of the swatch of n x n vertices at the vertices of another mesh of it.
Points transfer(const Points& x, int n, const TriangleMesh& to) {
  const TriangleMesh from = make_swatch(kSide, kSide, n, n);
  return interpolate(from, MaterialLocator(from), x, to.material);
}

/// `settled`: a settled shape on the base mesh to settle from; empty: a smooth guess.
Trajectory waving(const Corners& corners, int n, const Fabric& fabric, int steps_per_frame,
                  const Points& settled) {
  Scene scene;
  scene.mesh = make_swatch(kSide, kSide, n, n);
  scene.areal_density = 0.3;
  scene.start =
      settled.size() == 0 ? sagging_start(scene.mesh) : transfer(settled, kBase, scene.mesh);
  scene.fixtures = {{"left", 0, Motion(corners.times, corners.left)},
                    {"right", n - 1, Motion(corners.times, corners.right)}};
  scene.frame_times = corners.times;
  SimulationOptions options;
  options.steps_per_frame = steps_per_frame;
  return simulate(scene, fabric, options);
}

/// Mean distance at the vertices of the base mesh, m, frame by frame as far as both go.
PlotSeries parting(const Corners& corners, const Trajectory& base, const Trajectory& other, int n) {
  const TriangleMesh mesh = make_swatch(kSide, kSide, kBase, kBase);
  PlotSeries series;
  for (std::size_t k = 0; k < std::min(base.frames.size(), other.frames.size()); ++k) {
    const Points apart = base.frames[k] - transfer(other.frames[k], n, mesh);
    series.x.push_back(corners.times[k]);
    series.y.push_back(apart.colwise().norm().mean());
  }
  return series;
}

struct Pair {
  const char* name;
  int n, steps_per_frame;
};
constexpr Pair kPairs[] = {
    {"25 and 37", 37, 4}, {"25 and 13", 13, 4}, {"25, 4 and 8 steps", kBase, 8}};

std::vector<Fabric> fabrics() {
  Fabric cotton = make_fabric({.stretch = 340,
                               .shear = 170,
                               .bend = 1e-5,
                               .stretch_damping = 0.1,
                               .shear_damping = 0.1,
                               .bend_damping = 1e-7,
                               .drag_linear = 0.2,
                               .drag_quadratic = 0.3,
                               .drag_degradation = 0.1});
  cotton.name = "cotton-like";
  return {cotton, find_fabric("satin-waving"), find_fabric("linen-waving")};
}

double mean_between(const PlotSeries& series, std::size_t first, std::size_t last) {
  double sum = 0;
  for (std::size_t k = first; k < last; ++k) sum += series.y[k];
  return sum / static_cast<double>(last - first);
}

}  // namespace

void study_parting(const std::filesystem::path& out, const std::filesystem::path& corners_csv,
                   Findings& findings) {
  const Corners corners = read_corners(corners_csv);
  std::vector<PlotSeries> meshes, steps;
  std::puts("two simulations of one fabric: mean distance in mm by frame");
  int colour = 1;
  for (const Fabric& fabric : fabrics()) {
    const Trajectory base = waving(corners, kBase, fabric, 4, {});
    for (const Pair& pair : kPairs) {
      // From the shape that the base mesh settled to, so that both are on one branch.
      const Trajectory other =
          waving(corners, pair.n, fabric, pair.steps_per_frame, base.frames.front());
      if (base.diverged || other.diverged) {
        fmt::print("  diverged: {} {}\n", base.divergence, other.divergence);
      }
      PlotSeries series = parting(corners, base, other, pair.n);
      std::string line = fmt::format("  {:13} {:18}", fabric.name, pair.name);
      for (std::size_t k = 0; k < series.y.size(); ++k) {
        if (k % 10 == 0 || k + 1 == corners.times.size()) {
          line += fmt::format(" {}:{:.2f}", k, 1e3 * series.y[k]);
        }
      }
      std::puts(line.c_str());
      const std::size_t count = series.y.size(), half = count / 2;
      findings.push_back({fmt::format("parting of {}, {}", fabric.name, pair.name),
                          fmt::format("{:.2f} mm in the first half, {:.2f} in the second",
                                      1e3 * mean_between(series, 0, half),
                                      1e3 * mean_between(series, half, count)),
                          "", true});
      const bool same_mesh = pair.n == kBase;
      series.name =
          same_mesh ? fabric.name : fmt::format("{}, {}² and {}²", fabric.name, kBase, pair.n);
      series.colour = colour;
      series.dashed = pair.n < kBase;
      (same_mesh ? steps : meshes).push_back(std::move(series));
    }
    ++colour;
  }
  LinePlot plot = distance_plot(meshes);
  plot.title = "Distance between simulations of one fabric on two meshes";
  write_plot(out / "parting.svg", plot);
  // Both start from the same shape: nothing to show on a logarithmic axis at first.
  plot = distance_plot(steps);
  plot.title = "Distance between simulations with 4 and with 8 steps a frame, 25² vertices";
  plot.y.logarithmic = true;
  plot.y.from_zero = false;
  plot.y.lower = 1e-4;
  write_plot(out / "steps.svg", plot);
}

}  // namespace weft::validation
