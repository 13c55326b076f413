#include <cmath>
#include <cstdio>
#include <map>
#include <string>

#include "dynamics/elastica.h"
#include "dynamics/scenes.h"
#include "study.h"
#include "weft/report/plot.h"

namespace weft::validation {
namespace {

using namespace weft::test;

constexpr double kLoads[] = {0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0};

PlotAxis load_axis() {
  PlotAxis axis;
  axis.label = "load ρ g L³ / B";
  axis.logarithmic = true;
  axis.lower = 0.4;
  axis.upper = 62;
  return axis;
}

/// Deflections by load, the elastica first.
LinePlot deflection_plot() {
  LinePlot plot;
  plot.title = "Tip of a heavy cantilever";
  plot.x = load_axis();
  plot.y.label = "deflection / length";
  plot.y.from_zero = true;
  PlotSeries& exact = plot.series.emplace_back();
  exact.name = "elastica";
  exact.colour = 0;
  for (int i = 0; i <= 60; ++i) {
    exact.x.push_back(0.5 * std::pow(100.0, i / 60.0));
    exact.y.push_back(elastica_tip_deflection(exact.x.back()));
  }
  return plot;
}

LinePlot error_plot() {
  LinePlot plot;
  plot.title = "Tip of a heavy cantilever: difference from the elastica";
  plot.x = load_axis();
  plot.y.label = "relative difference";
  plot.y.unit = std::string("%");  // GCC 12 warns of a literal here (-Wrestrict)
  for (const double percent : {1.0, -1.0}) {
    PlotLevel& level = plot.levels.emplace_back();
    level.value = percent;
    level.label = fmt::format("{}1 %", percent > 0 ? "+" : "\u2212");
    level.label_at = 0;
  }
  return plot;
}

}  // namespace

void study_cantilever(const std::filesystem::path& out, Findings& findings) {
  LinePlot deflections = deflection_plot(), errors = error_plot();
  std::puts("heavy cantilever: relative error of the tip deflection");
  for (const std::string model :
       {"baraff-witkin", "baraff-witkin-diagonals", "baraff-witkin-hinges"}) {
    const bool drawn = model == "baraff-witkin";  // the others lie on it
    double largest = 0;
    std::string by_cells;
    std::map<int, double> largest_of;
    for (const GridPattern pattern : {GridPattern::alternating, GridPattern::uniform}) {
      const bool uniform = pattern == GridPattern::uniform;
      int colour = 1;
      for (const int cells : {10, 20, 40}) {
        const std::string name =
            fmt::format("{} cells, {}", cells, uniform ? "uniform" : "alternating");
        PlotSeries measured;  // they lie on each other: one name in the legend for all
        if (deflections.series.size() == 1) measured.name = "meshes of 10, 20 and 40 cells";
        measured.mark = PlotSeries::Mark::points;
        measured.colour = 1;
        PlotSeries error;
        error.name = name;
        error.mark = PlotSeries::Mark::line_and_points;
        error.colour = uniform ? colour + 3 : colour;
        error.dashed = uniform;
        ++colour;
        std::string line = fmt::format("  {:24}{:23}", model, name);
        for (const double load : kLoads) {
          const Cantilever cantilever(cells, pattern, load, model);
          const double deflection = cantilever.deflection() / cantilever.free_length;
          const double relative = deflection / elastica_tip_deflection(load) - 1;
          measured.x.push_back(load);
          measured.y.push_back(deflection);
          error.x.push_back(load);
          error.y.push_back(100 * relative);
          // Written so that no equilibrium (NaN) counts.
          double& most = largest_of[cells];
          if (!(std::abs(relative) <= most)) most = std::abs(relative);
          line += fmt::format("  {:+.3f} %", 100 * relative);
        }
        std::puts(line.c_str());
        if (!drawn) continue;
        deflections.series.push_back(std::move(measured));
        errors.series.push_back(std::move(error));
      }
    }
    for (const auto& [cells, most] : largest_of) {
      if (!(most <= largest)) largest = most;
      by_cells += fmt::format("{}{:.2f}", by_cells.empty() ? "" : ", ", 100 * most);
    }
    findings.push_back({model + ": cantilever, load 0.5 to 50, 10, 20, 40 cells, 2 triangulations",
                        fmt::format("at most {} % off", by_cells), "at most 1 %", largest <= 0.01});
  }
  write_plot(out / "cantilever.svg", deflections);
  write_plot(out / "cantilever_error.svg", errors);
}

}  // namespace weft::validation
