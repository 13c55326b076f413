#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <numbers>
#include <sstream>

#include "textile_studies.h"
#include "weft/base/error.h"
#include "weft/base/quantile.h"
#include "weft/estimate/homogeneous_strip.h"
#include "weft/estimate/mechanical_trial.h"
#include "weft/report/plot.h"

namespace weft::validation {
namespace {

constexpr int kFitted = 3;           // repeats; the others are predicted
constexpr int kSteps = 80;           // points of a repeat that a fit sees
constexpr double kForceNoise = 0.1;  // N
constexpr double kLateralNoise = 0.01;

std::vector<double> list(const VecX& values) { return {values.begin(), values.end()}; }

struct Repeat {
  VecX gap, width, force;  ///< mm, mm between the side pins, N; every sample of the film, smoothed
};
struct Sample {
  std::string name;
  double fabric_width = 0;  ///< m
  std::vector<Repeat> repeats;
};

/// Running median: single readings of the display are wrong.
VecX median(const VecX& values, Eigen::Index reach) {
  VecX out(values.size());
  std::vector<double> window;
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const Eigen::Index a = std::max<Eigen::Index>(0, i - reach);
    const Eigen::Index b = std::min<Eigen::Index>(values.size() - 1, i + reach);
    window.assign(values.begin() + a, values.begin() + b + 1);
    out[i] = quantile(window, 0.5);
  }
  return out;
}

Sample read_sample(const std::filesystem::path& path, double fabric_width) {
  const MatX rows = read_rows(path);
  Sample sample;
  sample.name = path.stem().string();
  sample.fabric_width = fabric_width;
  const Eigen::Index last = rows.cols() - 1;
  for (Eigen::Index begin = 0; begin < rows.rows();) {
    Eigen::Index end = begin;
    while (end < rows.rows() && rows(end, 0) == rows(begin, 0)) ++end;
    const MatX own = rows.middleRows(begin, end - begin);
    const auto apart = [&](Eigen::Index a, Eigen::Index b) -> VecX {
      return (own.middleCols(a, 2) - own.middleCols(b, 2)).rowwise().norm();
    };
    // Pins: right, left, ..., bottom clamp, top clamp; x and y each.
    sample.repeats.push_back(
        {median(apart(last - 3, last - 1), 7), median(apart(3, 5), 7), median(own.col(2), 7)});
    begin = end;
  }
  return sample;
}

std::map<std::string, double> fabric_widths(const std::filesystem::path& index) {
  std::map<std::string, double> widths;
  std::ifstream in(index);
  for (std::string line; std::getline(in, line);) {
    std::vector<std::string> cells;
    std::istringstream parts(line);
    for (std::string cell; std::getline(parts, cell, ',');) cells.push_back(cell);
    if (cells.size() > 6 && cells[0] != "sample") widths[cells[0]] = std::stod(cells[6]) * 1e-3;
  }
  return widths;
}

/// In the order of the film, as many points as a fit sees, evenly by force and gap together.
StripTest strip_test(const Sample& sample, const Repeat& repeat) {
  const Eigen::Index n = repeat.gap.size();
  VecX way = VecX::Zero(n);
  const double gap_range = repeat.gap.maxCoeff() - repeat.gap.minCoeff();
  const double force_range = repeat.force.maxCoeff();
  for (Eigen::Index i = 1; i < n; ++i)
    way[i] = way[i - 1] + std::hypot((repeat.gap[i] - repeat.gap[i - 1]) / gap_range,
                                     (repeat.force[i] - repeat.force[i - 1]) / force_range);
  StripTest test;
  test.stretch.resize(kSteps);
  test.force.resize(kSteps);
  test.lateral.resize(kSteps);
  Eigen::Index at = 0;
  for (int k = 0; k < kSteps; ++k) {
    const double target = way[n - 1] * k / (kSteps - 1);
    while (at + 1 < n && way[at] < target) ++at;
    test.stretch[k] = repeat.gap[at] / repeat.gap[0];
    test.force[k] = repeat.force[at] / sample.fabric_width;
    test.lateral[k] = repeat.width[at] / repeat.width[0];
  }
  test.force_noise = kForceNoise / sample.fabric_width;
  test.lateral_noise = kLateralNoise;
  return test;
}

/// A stretch curve of five control values, and a coupling to the other thread.
Fabric knit_start(const std::vector<StripTest>& tests) {
  double most = 0, force = 0;
  for (const StripTest& test : tests) {
    most = std::max(most, test.stretch.maxCoeff());
    force = std::max(force, test.force.maxCoeff());
  }
  const double green = 0.5 * (most * most - 1), mean = force / (most * green);
  Fabric fabric = Fabric::with_defaults("knit", "stvk-diagonal");
  VecX knots(5), values(5);
  knots << 0, 0.4 * green, 0.7 * green, 0.85 * green, green;
  values << 0.3 * mean, 0.3 * mean, 0.5 * mean, 0.7 * mean, mean;
  fabric.set_curve("weft_stretch", {knots, values.cwiseMax(0.2)});
  fabric.set("warp_stretch", mean);
  fabric.include("stretch_coupling");
  fabric.set("stretch_coupling", 0.1 * mean);
  return fabric;
}

std::vector<std::string> free_values(const Fabric& fabric) {
  std::vector<std::string> names = value_names(fabric, "weft_stretch");
  names.insert(names.end(), {"warp_stretch", "stretch_coupling"});
  if (fabric.value_count("weft_stretch_friction") > 0)
    names.insert(names.end(), {"weft_stretch_friction", "weft_stretch_friction_scale"});
  return names;
}

Fabric with_friction(Fabric fabric, double amplitude) {
  fabric.include("weft_stretch_friction");
  fabric.include("weft_stretch_friction_scale");
  fabric.set("weft_stretch_friction", amplitude);
  fabric.set("weft_stretch_friction_scale", 0.02);
  return fabric;
}

struct Errors {
  double force = 0;    ///< rms over the largest, of all tests
  double lateral = 0;  ///< rms of the width's ratio
};
Errors errors_of(const Fabric& fabric, const std::vector<StripTest>& tests) {
  double force = 0, lateral = 0, count = 0, largest = 0;
  for (const StripTest& test : tests) {
    const auto states = HomogeneousStrip(fabric, test.grain_angle).pull(test.stretch);
    for (Eigen::Index i = 0; i < test.stretch.size(); ++i) {
      const StripState& state = states[static_cast<std::size_t>(i)];
      force += std::pow(state.force - test.force[i], 2);
      lateral += std::pow(state.lateral - test.lateral[i], 2);
      ++count;
    }
    largest = std::max(largest, test.force.maxCoeff());
  }
  return {std::sqrt(force / count) / largest, std::sqrt(lateral / count)};
}

/// At the same stretch, of one repeat; beyond its ends nothing.
double interpolated(const StripTest& test, const VecX& values, double stretch) {
  double sum = 0, weight = 0;
  const double scale = 0.01 * (test.stretch.maxCoeff() - 1);
  if (stretch > test.stretch.maxCoeff() + scale) return std::nan("");
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const double w = std::exp(-0.5 * std::pow((test.stretch[i] - stretch) / scale, 2));
    sum += w * values[i];
    weight += w;
  }
  return weight > 1e-12 ? sum / weight : std::nan("");
}

/// What no model of stretch alone can do better: the mean of the fitted repeats.
Errors floor_of(const std::vector<StripTest>& fitted, const std::vector<StripTest>& held_back) {
  std::vector<double> force, lateral;
  double largest = 0;
  for (const StripTest& test : held_back) {
    largest = std::max(largest, test.force.maxCoeff());
    for (Eigen::Index i = 0; i < test.stretch.size(); ++i) {
      double f = 0, l = 0;
      for (const StripTest& other : fitted) {
        f += interpolated(other, other.force, test.stretch[i]) / static_cast<double>(fitted.size());
        l += interpolated(other, other.lateral, test.stretch[i]) /
             static_cast<double>(fitted.size());
      }
      force.push_back(f - test.force[i]);
      lateral.push_back(l - test.lateral[i]);
    }
  }
  const auto all = [](const std::vector<double>& v) {
    return rms(VecX::Map(v.data(), static_cast<Eigen::Index>(v.size())));
  };
  return {all(force) / largest, all(lateral)};
}

/// Largest way back of the clamps, mm: the unloading that the film shows.
double largest_return(const Sample& sample) {
  double most = 0;
  for (const Repeat& repeat : sample.repeats) {
    double reached = 0;
    for (const double gap : repeat.gap) {
      reached = std::max(reached, gap);
      most = std::max(most, reached - gap);
    }
  }
  return most;
}

struct Found {
  Fabric fabric;
  std::vector<StripTest> fitted, held_back;
};

Found study(const Sample& sample, LinePlot& plot) {
  std::vector<StripTest> fitted, held_back;
  for (std::size_t i = 0; i < sample.repeats.size(); ++i)
    (i < kFitted ? fitted : held_back).push_back(strip_test(sample, sample.repeats[i]));
  const Fabric start = knit_start(fitted);
  const StripFit plain = fit_strips(fitted, start, free_values(start));
  const double amplitude = std::max(0.01, 0.02 * fitted[0].force.maxCoeff());
  const Fabric rough = with_friction(plain.fabric, amplitude);
  const StripFit rubbed = fit_strips(fitted, rough, free_values(rough));
  const Errors own = errors_of(plain.fabric, fitted), next = errors_of(plain.fabric, held_back);
  const Errors rubbed_own = errors_of(rubbed.fabric, fitted);
  const Errors rubbed_next = errors_of(rubbed.fabric, held_back);
  const Errors least = floor_of(fitted, held_back);
  double narrowest = 1;
  for (const StripTest& test : held_back) narrowest = std::min(narrowest, test.lateral.minCoeff());
  fmt::print(
      "{:<28} {:>5.2f} {:>7.2f} {:>7.2f} {:>7.2f} {:>8.2f} {:>8.2f} {:>7.2f} {:>7.4f} "
      "{:>7.4f} {:>6.3f} {:>6.2f}\n",
      sample.name, fitted[0].stretch.maxCoeff(), 100 * own.force, 100 * next.force,
      100 * least.force, 100 * rubbed_own.force, 100 * rubbed_next.force,
      rubbed_own.force / own.force, next.lateral, least.lateral, 1 - narrowest,
      largest_return(sample));
  std::fflush(stdout);

  PlotSeries measured;
  measured.name = sample.name;
  measured.mark = PlotSeries::Mark::points;
  measured.colour = static_cast<int>(plot.series.size() / 2) % 7 + 1;
  measured.x = list(held_back[0].stretch);
  measured.y = list(held_back[0].force * sample.fabric_width);
  plot.series.push_back(measured);
  PlotSeries line;
  line.colour = measured.colour;
  line.x = measured.x;
  for (const StripState& state : HomogeneousStrip(plain.fabric).pull(held_back[0].stretch))
    line.y.push_back(state.force * sample.fabric_width);
  plot.series.push_back(line);
  return {plain.fabric, fitted, held_back};
}

/// The same specimen on a mesh between its clamps, which keep it from getting narrow there.
void between_clamps(const Sample& sample, const Found& found) {
  const double gap = sample.repeats[0].gap[0] * 1e-3, depth = 5e-3;
  const double most = found.held_back[0].stretch.maxCoeff();
  MechanicalCapture capture;
  capture.width = gap + 2 * depth;
  capture.height = sample.fabric_width;
  capture.areal_density = 0.2;
  capture.gravity.setZero();
  VecX stretches(2);
  stretches << 1 + 0.3 * (most - 1), 1 + 0.7 * (most - 1);
  capture.frame_count = 2;
  for (const double u : {0.0, gap + depth}) {
    MechanicalFixture jaw;
    for (const double stretch : stretches) {
      Clip clip;
      clip.region = {{u, 0}, {u + depth, capture.height}};
      clip.position =
          Vec3(u + depth / 2 + (u > 0 ? (stretch - 1) * gap : 0), capture.height / 2, 0);
      jaw.frames.push_back(clip);
    }
    capture.fixtures.push_back(jaw);
  }
  MechanicalOptions options;
  options.cells = 8;
  const auto trial = prepare_mechanical(capture, options);
  const auto frames = simulate_mechanical({trial}, found.fabric);
  const auto states = HomogeneousStrip(found.fabric).pull(stretches);
  const auto held = HomogeneousStrip(found.fabric, 0, StripSides::held).pull(stretches);
  fmt::print("  {} ({:.2f} times as wide as long):", sample.name, capture.height / gap);
  for (std::size_t i = 0; i < 2; ++i) {
    const double force = frames[0][i].forces(0, 1) / capture.height;
    fmt::print(
        "  at a stretch of {:.2f} homogeneous {:+.1f} %, with held sides {:+.1f} % of the mesh",
        stretches[static_cast<Eigen::Index>(i)], 100 * (states[i].force / force - 1),
        100 * (held[i].force / force - 1));
    if (!frames[0][i].converged) fmt::print(" (no equilibrium)");
  }
  fmt::print("\n");
}

/// One sheet for both directions of a knit: a curve along each thread, one coupling.
void joint_fit(const std::string& name, const Found& x, const Found& y) {
  std::vector<StripTest> tests = x.fitted;
  for (StripTest test : y.fitted) {
    test.grain_angle = std::numbers::pi / 2;
    tests.push_back(test);
  }
  Fabric start = x.fabric;
  start.set_curve("warp_stretch", y.fabric.curve("weft_stretch"));
  const double least = std::min(start.curve("weft_stretch").values().minCoeff(),
                                start.curve("warp_stretch").values().minCoeff());
  start.set("stretch_coupling", std::max(1e-3, 0.5 * least));
  std::vector<std::string> free = value_names(start, "weft_stretch");
  for (const std::string& value : value_names(start, "warp_stretch")) free.push_back(value);
  free.emplace_back("stretch_coupling");
  const StripFit fit = fit_strips(tests, start, free);
  const std::vector<StripTest> along(tests.begin(), tests.begin() + kFitted),
      across(tests.begin() + kFitted, tests.end());
  const Errors own_x = errors_of(x.fabric, x.fitted), own_y = errors_of(y.fabric, y.fitted);
  const Errors joint_x = errors_of(fit.fabric, along), joint_y = errors_of(fit.fabric, across);
  fmt::print("  {:<26} {:>7.2f} {:>7.2f} {:>7.2f} {:>7.2f}   {:>7.4f} {:>7.4f} {:>7.4f} {:>7.4f}\n",
             name, 100 * own_x.force, 100 * joint_x.force, 100 * own_y.force, 100 * joint_y.force,
             own_x.lateral, joint_x.lateral, own_y.lateral, joint_y.lateral);
}

}  // namespace

void study_knits(const StudyFolders& folders) {
  const auto widths = fabric_widths(folders.data / "knits" / "index.csv");
  LinePlot plot;
  plot.title = "Knits: a repeat that was not fitted";
  plot.x.label = "stretch";
  plot.y.label = "force";
  plot.y.unit = std::string("N");
  plot.height = 460;
  fmt::print(
      "five control values and a coupling, fitted to {} repeats; force rms in % of the "
      "largest, width rms as a ratio\n",
      kFitted);
  fmt::print("{:<28} {:>5} {:>7} {:>7} {:>7} {:>8} {:>8} {:>7} {:>7} {:>7} {:>6} {:>6}\n", "sample",
             "most", "fitted", "others", "floor", "friction", "others", "ratio", "width", "floor",
             "of", "return");
  std::map<std::string, Found> found;
  std::vector<Sample> samples;
  for (const auto& [name, width] : widths) {
    const auto path = folders.out / "knits" / (name + ".csv");
    if (!std::filesystem::exists(path)) continue;
    samples.push_back(read_sample(path, width));
    if (samples.back().repeats.size() <= kFitted) continue;
    found.emplace(name, study(samples.back(), plot));
  }
  if (found.empty()) throw Error(fmt::format("no tables in {}", (folders.out / "knits").string()));
  write_plot(folders.out / "knits.svg", plot);
  fmt::print("return: how far the clamps ever go back, mm\n");
  fmt::print("the homogeneous strip against a mesh between clamps\n");
  for (const Sample& sample : samples)
    if (found.contains(sample.name)) between_clamps(sample, found.at(sample.name));
  fmt::print(
      "one sheet for both directions against one for each: force rms, % of the largest (x: "
      "own, joint; y: own, joint), and of the width\n");
  for (const auto& [name, x] : found) {
    if (!name.ends_with("_x")) continue;
    const std::string knit = name.substr(0, name.size() - 2);
    if (found.contains(knit + "_y")) joint_fit(knit, x, found.at(knit + "_y"));
  }
}

}  // namespace weft::validation
