#include <fmt/format.h>

#include <array>
#include <cmath>

#include "estimate/closed_forms.h"
#include "textile_studies.h"
#include "weft/base/random.h"
#include "weft/capture/standard_test.h"
#include "weft/estimate/computed_overhang.h"
#include "weft/estimate/mechanical_fit.h"

namespace weft::validation {
namespace {

constexpr double kMembrane = 3000, kBend = 2e-5, kDensity = 0.2;  // N/m, N m, kg/m^2
constexpr double kWeight = 9.81 * kDensity;
constexpr int kCells[] = {4, 8, 16};
constexpr std::array<double, 3> kAngles{0, 90, 45};
const std::vector<std::string> kBends{"bend_uu", "bend_vv", "bend_twist"};

std::shared_ptr<const MechanicalTrial> overhang_trial(const VecX& lengths, double angle,
                                                      double width,
                                                      const MechanicalOptions& options) {
  MechanicalCapture capture = overhang_capture(
      {0, width, kDensity, angle}, {lengths, kCantileverAngle, overhang_deviation(lengths)});
  capture.name = "overhang";
  return prepare_mechanical(capture, options);
}

MechanicalOptions with_cells(int cells, GridPattern pattern = GridPattern::alternating) {
  MechanicalOptions options;
  options.cells = cells;
  options.pattern = pattern;
  return options;
}

std::string bend_row(const Fabric& fabric) {
  if (fabric.model == "stvk") return "bend_uu";
  return fabric.model.starts_with("baraff-witkin") ? "bend_stiffness" : "weft_bend";
}

MechanicalFitResult fit(const std::vector<std::shared_ptr<const MechanicalTrial>>& trials,
                        const Fabric& start, const std::vector<std::string>& free) {
  MechanicalFitOptions options;
  options.first_cells = FirstCells::as_given;
  return fit_mechanical(MechanicalProblem(trials, start, free), start, options);
}

/// The bend that is fitted to one overhang, from 4 times the truth.
double fitted_bend(Fabric fabric, double overhang, double width, int cells) {
  const std::string row = bend_row(fabric);
  fabric.set(row, 4 * kBend);
  const auto trial = overhang_trial(VecX::Constant(1, overhang), 0, width, with_cells(cells));
  return fit({trial}, fabric, {row}).fabric.value(row);
}

void by_mesh() {
  fmt::print(
      "bend fitted to the overhang of the elastica, {:.2f} mm, a strip of 20 mm on 4, 8 and 16 "
      "cells "
      "across, off by\n",
      1e3 * overhang_of_rigidity(kWeight, kBend));
  for (const auto& [fabric, strip] : test::elastic_cases(kMembrane, kBend)) {
    if (fabric.model == "springs" || fabric.model == "piecewise-linear") continue;
    fmt::print("  {:<23}", fabric.model);
    for (const int cells : kCells) {
      const double found = fitted_bend(fabric, overhang_of_rigidity(kWeight, kBend), 0.02, cells);
      fmt::print(" {:+.2f} %", 100 * (found / kBend - 1));
    }
    fmt::print("\n");
    std::fflush(stdout);
  }
}

void by_width() {
  fmt::print(
      "computed overhang with bend_uv = 0.4 bend_uu, off from the elastica of a plate, D11, and of "
      "a "
      "strip, D11 - D12^2 / D22, by width over overhang\n");
  Fabric fabric = test::elastic_cases(kMembrane, kBend)[3].fabric;
  fabric.set("bend_uv", 0.4 * kBend);
  const double plate = overhang_of_rigidity(kWeight, kBend),
               strip = overhang_of_rigidity(kWeight, 0.84 * kBend);
  for (const double width : {0.1, 0.3, 0.6, 1.0, 3.0}) {
    const auto trial =
        overhang_trial(VecX::Constant(1, plate), 0, width * plate, with_cells(width < 1 ? 6 : 12));
    const double found = simulate_mechanical({trial}, fabric)[0][0].overhang;
    fmt::print("  {:.1f}: {:+.2f} %, {:+.2f} %\n", width, 100 * (found / plate - 1),
               100 * (found / strip - 1));
    std::fflush(stdout);
  }
}

Fabric orthotropic() {
  Fabric fabric = test::elastic_cases(kMembrane, kBend)[3].fabric;
  fabric.set("bend_uu", 4e-5);
  fabric.set("bend_vv", 1e-5);
  fabric.set("bend_twist", 8e-6);
  return fabric;
}

/// Truth on 24 cells with all diagonals alike, fits on 8 with alternating ones.
void recovery() {
  constexpr int kReadings = 8, kDraws = 20;
  constexpr double kNoise = 1.5e-3, kWidth = 0.025;  // m
  const Fabric truth = orthotropic();
  std::array<double, 3> exact{};
  for (std::size_t i = 0; i < kAngles.size(); ++i) {
    const auto trial = overhang_trial(VecX::Constant(1, 0.05), kAngles[i] * kDegree, kWidth,
                                      with_cells(24, GridPattern::uniform));
    exact[i] = simulate_mechanical({trial}, truth)[0][0].overhang;
  }
  fmt::print(
      "bends from overhangs at 0, 90 and 45 degrees ({:.2f}, {:.2f}, {:.2f} mm), {} readings each "
      "with {:g} mm of noise, {} draws, from 2e-5 N m each: mean and scatter of the factor to the "
      "truth, "
      "share of 90 % intervals that hold it\n",
      1e3 * exact[0], 1e3 * exact[1], 1e3 * exact[2], kReadings, 1e3 * kNoise, kDraws);
  MatX logs(kDraws, 3);
  std::array<int, 3> held{};
  for (int draw = 0; draw < kDraws; ++draw) {
    Rng rng(static_cast<std::uint64_t>(draw + 1), 0);
    std::vector<std::shared_ptr<const MechanicalTrial>> trials;
    for (std::size_t i = 0; i < kAngles.size(); ++i) {
      VecX lengths(kReadings);
      for (double& length : lengths) length = exact[i] + kNoise * rng.normal();
      trials.push_back(overhang_trial(lengths, kAngles[i] * kDegree, kWidth, with_cells(8)));
    }
    Fabric start = truth;
    for (const std::string& name : kBends) start.set(name, 2e-5);
    const MechanicalFitResult found = fit(trials, start, kBends);
    for (std::size_t k = 0; k < kBends.size(); ++k) {
      const double value = truth.value(kBends[k]);
      logs(draw, static_cast<Eigen::Index>(k)) = std::log(found.fabric.value(kBends[k]) / value);
      const ParameterInterval& p = found.intervals[k];
      if (p.lower <= value && value <= p.upper) ++held[k];
    }
  }
  for (std::size_t k = 0; k < kBends.size(); ++k) {
    const VecX log = logs.col(static_cast<Eigen::Index>(k));
    const double mean = log.mean();
    const double scatter = std::sqrt((log.array() - mean).square().sum() / (kDraws - 1));
    fmt::print("  {:<10} {:.3f}, {:.3f}; {} of {}\n", kBends[k], std::exp(mean), std::exp(scatter),
               held[k], kDraws);
  }
}

}  // namespace

void study_overhang(const StudyFolders&) {
  by_mesh();
  by_width();
  recovery();
}

}  // namespace weft::validation
