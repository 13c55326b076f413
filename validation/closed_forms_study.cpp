#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "dynamics/elastica.h"
#include "dynamics/scenes.h"
#include "estimate/closed_forms.h"
#include "textile_studies.h"
#include "weft/base/error.h"
#include "weft/estimate/homogeneous_strip.h"
#include "weft/report/plot.h"

namespace weft::validation {
namespace {

constexpr double kMembrane = 3000, kBend = 2e-5, kSpring = 500;
constexpr int kCells[] = {5, 10, 20, 40};

/// Elastica of the springs' own law, with the clamp half a cell inside the clip.
double springs_alone(double load, int cells) {
  const double h = 0.1 / cells, weight = load * kBend / 1e-3;
  try {
    const ElasticaProfile own =
        heavy_elastica(test::bend_law_of_springs(kSpring, h, 60), weight, 0.1 + h / 2);
    return -own.at(1, own.at.cols() - 1) / 0.1;
  } catch (const Error&) {
    return std::nan("");  // so limp that it hangs straight down
  }
}

/// Force per width of a free strip along a thread of diagonals `diagonal` N/m: k (s - 1) + k_d (d -
/// 1) s / d, d = sqrt((s^2 + l^2) / 2), with the width l at which k (l - 1) + k_d (d - 1) l / d =
/// 0.
double coupled_strip(double stretch, double diagonal) {
  const auto along = [&](double of, double width) {
    const double d = std::sqrt((stretch * stretch + width * width) / 2);
    return kMembrane * (of - 1) + diagonal * std::max(0.0, d - 1) * of / d;
  };
  const double width = test::bisect([&](double l) { return along(l, l); }, 2 - stretch, 1);
  return along(stretch, width);
}

}  // namespace

void study_closed_forms(const StudyFolders& folders) {
  fmt::print("strip between clips, error of the force at stretches of 1.01 and 1.1\n");
  for (const auto& [fabric, strip] : test::elastic_cases(kMembrane, kBend)) {
    fmt::print("  {:<23}", fabric.model);
    for (const int cells : {5, 20})
      for (const double stretch : {1.01, 1.1})
        fmt::print(" {:+.4f} %",
                   100 * (test::strip_on_mesh(fabric, stretch, cells) / strip(stretch) - 1));
    fmt::print("\n");
  }
  fmt::print(
      "strip strained alike everywhere, diagonals of 0.2 and 2 times the membrane's stiffness, "
      "against its equation, at 1.01 and 1.1\n");
  for (const auto& [original, strip] : test::elastic_cases(kMembrane, kBend)) {
    Fabric fabric = original;
    if (!fabric.model.starts_with("baraff-witkin-")) continue;
    fmt::print("  {:<23}", fabric.model);
    for (const double share : {0.2, 2.0})
      for (const double stretch : {1.01, 1.1}) {
        fabric.values[fabric.value_index("diagonal_stiffness")] = share * kMembrane;
        const StripState found = HomogeneousStrip(fabric).pull(VecX::Constant(1, stretch))[0];
        fmt::print(" {:.3f} N/m {:+.1e}", found.force,
                   found.force / coupled_strip(stretch, share * kMembrane) - 1);
      }
    fmt::print("\n");
  }
  fmt::print(
      "cantilever, error of the tip deflection by cells along it (5, 10, 20, 40), at loads "
      "of 2 and 20; springs against the elastica of their own law on each mesh, and the "
      "deflection itself\n");
  LinePlot plot;
  plot.title = "Heavy cantilever: tip against the elastica";
  plot.x.label = "cells along the strip";
  plot.x.logarithmic = true;
  plot.y.label = "error";
  plot.y.unit = std::string("%");
  for (const auto& [original, strip] : test::elastic_cases(kMembrane, kBend)) {
    Fabric fabric = original;
    const bool springs = fabric.model == "springs";
    if (springs) fabric.set("weft_bend", kSpring);
    for (const double load : {2.0, 20.0}) {
      fmt::print("  {:<23} load {:>2.0f}:", fabric.model, load);
      PlotSeries series;
      series.name = fmt::format("{}, load {:.0f}", fabric.model, load);
      series.mark = PlotSeries::Mark::line_and_points;
      std::string deflections;
      for (const int cells : kCells) {
        const double found = test::cantilever_on_mesh(fabric, kBend, load, cells);
        const double expected =
            springs ? springs_alone(load, cells) : test::elastica_tip_deflection(load);
        fmt::print(" {:+.2f} %", 100 * (found / expected - 1));
        deflections += fmt::format(" {:.3f}", found);
        series.x.push_back(cells);
        series.y.push_back(100 * (found / expected - 1));
      }
      fmt::print("{}\n", springs ? "  deflection" + deflections : "");
      std::fflush(stdout);
      if (!springs) plot.series.push_back(series);
    }
  }
  write_plot(folders.out / "closed_forms.svg", plot);
}

}  // namespace weft::validation
