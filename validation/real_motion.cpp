/// Fabrics fitted to the earlier part of a real motion, judged by the later part.
///
///   weft_validate_real_motion arm OUT FOLDER NAME...
///   weft_validate_real_motion video OUT REGISTERED SIDE RATE [KEY...]
///
/// FOLDER: NAME_mesh.csv, NAME_tcp.csv and campose.csv (real_motion.h). REGISTERED: a PC2 of grids
/// of SIDE m that weft register or weft_validate_registration wrote; RATE: frames/s.
#include "real_motion.h"

#include <fmt/core.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <limits>

#include "program.h"
#include "weft/base/error.h"

namespace weft::validation {

std::vector<std::vector<double>> read_numbers(const std::filesystem::path& path) {
  std::ifstream in(path);
  if (!in) throw Error(path.string() + ": cannot be read");
  std::vector<std::vector<double>> rows;
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line[0] == '#' || line[0] == '%') continue;
    std::vector<double> row;
    const char* at = line.c_str();
    for (char* end = nullptr;; at = end + 1) {
      row.push_back(std::strtod(at, &end));
      if (end == at)
        throw Error(fmt::format("{}: line {} is not numbers", path.string(), rows.size() + 1));
      if (*end != ',') break;
    }
    if (!rows.empty() && row.size() != rows.front().size())
      throw Error(fmt::format("{}: rows differ in length", path.string()));
    rows.push_back(std::move(row));
  }
  if (rows.empty()) throw Error(path.string() + ": no rows");
  return rows;
}

namespace {

/// Mean distance along the tracked normals, m.
double off_surface(const MotionTracks& tracks, const std::vector<Points>& x, std::size_t first,
                   std::size_t last) {
  double sum = 0;
  int count = 0;
  for (std::size_t k = first; k < last; ++k) {
    for (Eigen::Index p = 0; p < x[k].cols(); ++p) {
      const Vec3 n = tracks.normal[k].col(p);
      if (!(tracks.weight[k][p] > 0) || n.isZero()) continue;
      sum += std::abs(n.dot(x[k].col(p) - tracks.position[k].col(p)));
      ++count;
    }
  }
  return sum / count;
}

}  // namespace

void print_distances(const MotionTracks& tracks, std::size_t split,
                     const std::vector<Prediction>& predictions) {
  fmt::print("  {:<50}{:>36}{:>36}\n", "mm: mean, rms, median; off surface", "frames fitted",
             "frames predicted");
  const std::size_t end = tracks.times.size();
  for (const Prediction& p : predictions) {
    fmt::print("  {:<50}", p.name);
    for (const auto& [first, last] : {std::pair{std::size_t{0}, split}, std::pair{split, end}}) {
      const MotionDistance d = motion_distance(tracks, p.position, first, last);
      fmt::print("    {:7.2f} {:7.2f} {:7.2f}; {:6.2f}", 1e3 * d.mean, 1e3 * d.rms, 1e3 * d.median,
                 1e3 * off_surface(tracks, p.position, first, last));
    }
    fmt::print("\n");
  }
}

void write_distances(const std::filesystem::path& path, const std::string& title,
                     const MotionTracks& tracks, std::size_t split,
                     const std::vector<Prediction>& predictions) {
  LinePlot plot;
  plot.title = title;
  plot.x.label = "time";
  plot.x.unit = 's';
  plot.y.label = "mean distance";
  plot.y.unit = "mm";
  plot.y.from_zero = true;
  for (const Prediction& p : predictions) {
    PlotSeries series;
    series.name = p.name;
    for (std::size_t k = 0; k < tracks.times.size(); ++k) {
      series.x.push_back(tracks.times[k] - tracks.times.front());
      series.y.push_back(1e3 * motion_distance(tracks, k, p.position[k]).mean);
    }
    plot.series.push_back(std::move(series));
  }
  const auto& x = plot.series.front().x;
  plot.regions = {{0.5 * (x[split - 1] + x[split]), x.back(), "predicted"}};
  write_plot(path, plot);
}

SceneUnknown added_mass(double most) {
  SceneUnknown unknown;
  unknown.info = {"added_mass",
                  "1",
                  0,
                  most,
                  0,
                  Scale::linear,
                  "Inertia of the air that moves with the cloth over that of the cloth.",
                  ""};
  unknown.initial = 0.2;
  unknown.apply = [](double a, MotionExperiment& e) { e.scene.gravity /= 1 + a; };
  unknown.step = 0.01;
  return unknown;
}

MotionFitOptions fit_options() {
  MotionFitOptions options;
  options.least_squares.cost_tolerance = 3e-4;
  return options;
}

void print_intervals(const MotionFitResult& fit) {
  for (const ParameterInterval& i : fit.intervals)
    fmt::print("  {:<20} {:>10.4g} {:<10} {}\n", i.name, i.value, i.unit,
               i.determined               ? fmt::format("90 %: {:.4g} to {:.4g}", i.lower, i.upper)
               : i.at_lower || i.at_upper ? "at a bound"
                                          : "not determined");
  fmt::print(
      "  cost {:.4g} -> {:.4g}, {} iterations, {:.1f} s; condition {:.1g}, inexact derivatives "
      "{}\n",
      fit.cost_start, fit.cost, fit.iterations, fit.wall_s, fit.condition, fit.inexact);
}

namespace {

int run(int argc, char** argv) {
  const std::string kind = argc > 1 ? argv[1] : "";
  if (kind == "arm" && argc >= 5) {
    study_arm(argv[2], argv[3], std::vector<std::string>(argv + 4, argv + argc));
  } else if (kind == "video" && argc >= 6) {
    study_video(argv[2], argv[3], validation::number("SIDE", argv[4], 0.0),
                validation::number("RATE", argv[5], 0.0),
                std::vector<std::string>(argv + 6, argv + argc));
  } else {
    throw Error(
        "usage: weft_validate_real_motion arm OUT FOLDER NAME... | video OUT REGISTERED SIDE RATE "
        "[KEY...]");
  }
  return 0;
}

}  // namespace
}  // namespace weft::validation

int main(int argc, char** argv) {
  return weft::validation::run_program("weft_validate_real_motion",
                                       [&] { return weft::validation::run(argc, argv); });
}
