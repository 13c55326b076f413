/// Draws the distance to the true surface against time for several captures, with the border
/// between fit and validation frames:
///
///     weft_validate_distance OUT.svg CAPTURE=EVALUATION.json ...
///
/// CAPTURE is the capture's folder, EVALUATION.json what `weft evaluate CAPTURE --json` printed.
/// Also prints the means.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "program.h"
#include "weft/base/error.h"
#include "weft/capture/capture.h"
#include "weft/report/figures.h"

namespace {

using namespace weft;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

struct Distances {
  PlotSeries series;  // s, m
  double border = 0;  // s, half way from the last fit frame to the next
};

double number_or_gap(const nlohmann::json& object, const char* key) {
  const auto at = object.find(key);
  return at != object.end() && at->is_number() ? at->get<double>() : kNone;
}

std::string in_millimetres(const nlohmann::json& part) {
  if (!part.is_object()) return "none";
  const double mean = number_or_gap(part, "distance_mean");
  const double max = number_or_gap(part, "distance_max");
  return std::isfinite(max) ? fmt::format("{:6.2f} mm (largest {:.1f})", 1e3 * mean, 1e3 * max)
                            : fmt::format("{:6.2f} mm", 1e3 * mean);
}

Distances read_distances(const std::string& argument) {
  const std::size_t equals = argument.rfind('=');
  if (equals == std::string::npos) throw Error(argument + ": CAPTURE=EVALUATION.json is expected");
  const Capture capture = read_capture(argument.substr(0, equals));
  const std::string file = argument.substr(equals + 1);
  std::ifstream in(file);
  if (!in) throw Error(file + ": cannot be read");
  Distances distances;
  distances.series.name = capture.name;
  try {
    const nlohmann::json evaluation = nlohmann::json::parse(in);
    distances.border = (evaluation.at("fit").at("last").get<int>() + 0.5) / capture.frame_rate;
    for (const nlohmann::json& frame : evaluation.at("frames")) {
      distances.series.x.push_back(frame.at("frame").get<int>() / capture.frame_rate);
      distances.series.y.push_back(number_or_gap(frame, "distance_mean"));
    }
    if (distances.series.x.size() < 10) {  // too short to be seen as a line
      distances.series.mark = PlotSeries::Mark::line_and_points;
    }
    fmt::print("{:<20} fit {}, validation {}\n", capture.name, in_millimetres(evaluation.at("fit")),
               in_millimetres(evaluation.at("validation")));
  } catch (const nlohmann::json::exception& error) {
    throw Error(fmt::format("{}: {}", file, error.what()));
  }
  return distances;
}

/// The ground changes at each border between fit and validation frames.
std::vector<PlotRegion> regions(const std::set<double>& borders, double end) {
  if (borders.size() == 1) return {{*borders.begin(), end, "validation frames"}};
  return {{*borders.begin(), *borders.rbegin(), "validation in some"},
          {*borders.rbegin(), end, "validation frames"}};
}

double largest(const LinePlot& plot) {
  double value = 1e-3;
  for (const PlotSeries& series : plot.series) {
    for (const double y : series.y) value = y > value ? y : value;
  }
  return value;
}

int run(int argc, char** argv) {
  if (argc < 3) throw Error("usage: weft_validate_distance OUT.svg CAPTURE=EVALUATION.json ...");
  std::vector<PlotSeries> all;
  std::set<double> borders;
  double end = 0;
  for (int i = 2; i < argc; ++i) {
    Distances one = read_distances(argv[i]);
    one.series.dashed = all.size() >= 7;  // where the colours begin again
    // Captures without later frames have no border.
    if (!one.series.x.empty() && one.border < one.series.x.back()) borders.insert(one.border);
    if (!one.series.x.empty()) end = std::max(end, one.series.x.back());
    all.push_back(std::move(one.series));
  }
  LinePlot plot = distance_plot(all);
  plot.title = "Distance to the true surface";
  plot.height = 400;
  if (!borders.empty()) {
    plot.regions = regions(borders, end);
    plot.y.upper = 1.15 * largest(plot);  // room for the word on top
  }
  write_plot(argv[1], plot);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return weft::validation::run_program("weft_validate_distance", [&] { return run(argc, argv); });
}
