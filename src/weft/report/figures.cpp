#include "weft/report/figures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "weft/report/text.h"

namespace weft {
namespace {

constexpr double kGap = std::numeric_limits<double>::quiet_NaN();

/// Stretches of validation frames on an axis where a frame lies at `place`; edges half way between
/// frames.
template <class Number>
std::vector<PlotRegion> validation_regions(const ReportCapture& capture,
                                           Number ReportFrame::*place) {
  std::vector<PlotRegion> regions;
  const auto& frames = capture.frames;
  const auto at = [&](std::size_t i) { return static_cast<double>(frames[i].*place); };
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (!frames[i].validation) continue;
    std::size_t last = i;
    while (last + 1 < frames.size() && frames[last + 1].validation) ++last;
    const double lower = i > 0 ? (at(i - 1) + at(i)) / 2 : at(i);
    const double upper = last + 1 < frames.size() ? (at(last) + at(last + 1)) / 2 : at(last);
    regions.push_back({lower, upper, "validation"});
    i = last;
  }
  return regions;
}

PlotAxis frame_axis() {
  PlotAxis axis;
  axis.label = "frame";
  axis.integers = true;
  return axis;
}

PlotAxis time_axis() {
  PlotAxis axis;
  axis.label = "time";
  axis.unit = "s";
  return axis;
}

PlotSeries& add_series(LinePlot& plot, std::string name,
                       PlotSeries::Mark mark = PlotSeries::Mark::line, int colour = -1) {
  PlotSeries& series = plot.series.emplace_back();
  series.name = std::move(name);
  series.mark = mark;
  series.colour = colour;
  return series;
}

void add_point(PlotSeries& series, double x, double y) {
  series.x.push_back(x);
  series.y.push_back(y);
}

/// A fixed parameter's name in words: "bend_stiffness" as "bend stiffness".
/// Logarithmic where the finite values span more than a factor of 20 above zero.
bool spans_decades(const std::vector<ReportHistoryPoint>& history) {
  double lower = kInfinity, upper = 0;
  for (const ReportHistoryPoint& point : history) {
    if (!std::isfinite(point.error)) continue;
    lower = std::min(lower, point.error);
    upper = std::max(upper, point.error);
  }
  return lower > 0 && upper > 20 * lower;
}

}  // namespace

LinePlot error_plot(const ReportCapture& capture) {
  LinePlot plot;
  plot.title = "Error per frame";
  plot.x = frame_axis();
  plot.y.label = "error";
  plot.y.from_zero = true;
  plot.regions = validation_regions(capture, &ReportFrame::index);
  plot.height = 280;
  PlotSeries& error = add_series(plot, "");
  for (const ReportFrame& frame : capture.frames) add_point(error, frame.index, frame.error);
  return plot;
}

LinePlot error_parts_plot(const ReportCapture& capture) {
  LinePlot plot = error_plot(capture);
  plot.title = "Error per frame and its parts";
  plot.series.clear();
  PlotSeries& error = add_series(plot, "error", PlotSeries::Mark::line, 0);
  for (const ReportFrame& frame : capture.frames) add_point(error, frame.index, frame.error);
  PlotSeries& fold = add_series(plot, "fold", PlotSeries::Mark::line, 1);
  for (const ReportFrame& frame : capture.frames) add_point(fold, frame.index, frame.fold);
  PlotSeries& silhouette = add_series(plot, "silhouette, weighted", PlotSeries::Mark::line, 2);
  for (const ReportFrame& frame : capture.frames) {
    add_point(silhouette, frame.index,
              std::isfinite(frame.error) ? frame.error - frame.fold : frame.error);
  }
  silhouette.dashed = true;
  return plot;
}

LinePlot distance_plot(const ReportCapture& capture) {
  LinePlot plot;
  plot.title = "Distance to the true surface";
  plot.x = time_axis();
  plot.y.label = "distance";
  plot.y.unit = "mm";
  plot.y.from_zero = true;
  plot.regions = validation_regions(capture, &ReportFrame::time);
  plot.height = 280;
  PlotSeries mean, max;
  for (const ReportFrame& frame : capture.frames) {
    if (!frame.distance) continue;
    add_point(mean, frame.time, kMillimetres * frame.distance->mean);
    add_point(max, frame.time, kMillimetres * frame.distance->max);
  }
  mean.name = "mean";
  mean.colour = 1;
  max.name = "largest";
  max.colour = 2;
  max.dashed = true;
  plot.series = {std::move(mean), std::move(max)};
  return plot;
}

LinePlot distance_plot(const std::vector<PlotSeries>& series) {
  LinePlot plot;
  plot.title = "Distance between surfaces";
  plot.x = time_axis();
  plot.y.label = "mean distance";
  plot.y.unit = "mm";
  plot.y.from_zero = true;
  plot.series = series;
  for (PlotSeries& one : plot.series) {
    for (auto* values : {&one.y, &one.lower, &one.upper}) {
      for (double& value : *values) value *= kMillimetres;
    }
  }
  return plot;
}

LinePlot search_plot(const std::vector<ReportHistoryPoint>& history) {
  LinePlot plot;
  plot.title = "Progress of the search";
  plot.x.label = "evaluation";
  plot.x.integers = true;
  plot.y.label = "error";
  plot.y.logarithmic = spans_decades(history);
  plot.y.from_zero = !plot.y.logarithmic;
  plot.height = 320;
  if (!history.empty()) {
    plot.x.lower = 0;
    plot.x.upper = static_cast<double>(history.back().evaluation) + 1;
  }
  int colour = 1;
  for (std::size_t i = 0; i < history.size(); ++i) {
    const std::string& phase = history[i].phase;
    auto found = std::ranges::find(plot.series, phase, &PlotSeries::name);
    if (found == plot.series.end()) {
      add_series(plot, phase, PlotSeries::Mark::points, colour++ % 8);
      found = plot.series.end() - 1;
    }
    add_point(*found, static_cast<double>(history[i].evaluation), history[i].error);
  }
  PlotSeries& best = add_series(plot, "best so far", PlotSeries::Mark::line, 0);
  for (std::size_t i = 0; i < history.size(); ++i) {
    const auto at = static_cast<double>(history[i].evaluation);
    // A step, and a gap between phases: their errors may be sums over different frames.
    if (i > 0 && history[i].phase != history[i - 1].phase) {
      add_point(best, at, kGap);
    } else if (i > 0 && std::isfinite(history[i - 1].best)) {
      add_point(best, at, history[i - 1].best);
    }
    add_point(best, at, std::isfinite(history[i].best) ? history[i].best : kGap);
  }
  return plot;
}

LinePlot temperature_plot(const std::vector<ReportHistoryPoint>& history) {
  LinePlot plot;
  plot.title = "Temperature";
  plot.x.label = "evaluation";
  plot.x.integers = true;
  plot.y.label = "temperature, in units of the error";
  plot.y.logarithmic = true;
  plot.height = 220;
  PlotSeries& series = add_series(plot, "", PlotSeries::Mark::line, 2);
  for (const ReportHistoryPoint& point : history) {
    add_point(series, static_cast<double>(point.evaluation),
              point.temperature > 0 ? point.temperature : kGap);
  }
  if (!history.empty()) {
    plot.x.lower = 0;
    plot.x.upper = static_cast<double>(history.back().evaluation) + 1;
  }
  return plot;
}

LinePlot perturbation_plot(const ReportPerturbation& perturbation) {
  LinePlot plot;
  plot.title = in_words(perturbation.parameter);
  plot.x.label = "change of the parameter";
  plot.x.unit = "%";
  plot.y.label = "error";
  plot.width = 360;
  plot.height = 250;
  const auto [c0, c1, c2] = perturbation.quadratic;
  PlotSeries& measured = add_series(plot, "evaluated", PlotSeries::Mark::points, 1);
  double lower = kInfinity, upper = -kInfinity;
  for (std::size_t i = 0; i < perturbation.relative.size(); ++i) {
    add_point(measured, 100 * perturbation.relative[i], perturbation.error[i]);
    lower = std::min(lower, perturbation.relative[i]);
    upper = std::max(upper, perturbation.relative[i]);
  }
  PlotSeries& quadratic = add_series(plot, "quadratic", PlotSeries::Mark::line, 2);
  constexpr int kSamples = 60;
  for (int i = 0; lower < upper && i <= kSamples; ++i) {
    const double r = lower + (upper - lower) * i / kSamples;
    add_point(quadratic, 100 * r, c0 + c1 * r + c2 * r * r);
  }
  if (c2 > 0) {
    // The least of the quadratic within what was sampled; the variability is where it has risen by
    // 1 %.
    const double at = std::clamp(-c1 / (2 * c2), lower, upper);
    plot.levels.push_back({1.01 * (c0 + c1 * at + c2 * at * at), "+1 %", 0.5});
  }
  return plot;
}

BarChart variability_chart(const std::vector<ReportParameter>& parameters) {
  BarChart chart;
  chart.title = "Variability";
  chart.value.label = "change of the parameter that raises the error by 1 %";
  chart.value.unit = "%";
  chart.value.logarithmic = true;
  for (const ReportParameter& p : parameters) {
    if (!p.free || !p.variability_percent) continue;
    BarChart::Bar bar;
    bar.label = in_words(p.name);
    bar.value = p.determined ? *p.variability_percent : kInfinity;
    bar.highlighted = p.at_bound != ReportParameter::Bound::none;
    if (!std::isfinite(bar.value)) {
      bar.note = "not determined by the data";
    } else if (bar.highlighted) {
      bar.note = format_value(bar.value, 2) + " %, at a bound";
    } else {
      bar.note = format_value(bar.value, 2) + " %";
    }
    chart.bars.push_back(std::move(bar));
  }
  return chart;
}

namespace {

PlotAxis parameter_axis(const std::string& name, const std::string& unit, bool logarithmic) {
  PlotAxis axis;
  axis.label = in_words(name);
  axis.unit = unit;
  axis.logarithmic = logarithmic;
  return axis;
}

}  // namespace

HeatMap surface_map(const ReportSurface& surface) {
  HeatMap map;
  map.title =
      "Error over " + in_words(surface.x_parameter) + " and " + in_words(surface.y_parameter);
  map.x_axis = parameter_axis(surface.x_parameter, surface.x_unit, surface.x_logarithmic);
  map.y_axis = parameter_axis(surface.y_parameter, surface.y_unit, surface.y_logarithmic);
  map.x = surface.x;
  map.y = surface.y;
  map.values = surface.error;
  map.label = "error";
  map.logarithmic = (surface.error.array() > 0).all();
  if (std::isfinite(surface.x_estimate) && std::isfinite(surface.y_estimate)) {
    map.markers.push_back({surface.x_estimate, surface.y_estimate, "estimate"});
  }
  return map;
}

LinePlot surface_line(const ReportSurface& surface) {
  LinePlot plot;
  plot.title = "Error along " + in_words(surface.x_parameter);
  plot.x = parameter_axis(surface.x_parameter, surface.x_unit, surface.x_logarithmic);
  plot.y.label = "error";
  PlotSeries& series = add_series(plot, "", PlotSeries::Mark::line_and_points);
  std::size_t nearest = 0;
  const auto away = [&](std::size_t i) { return std::abs(surface.x[i] - surface.x_estimate); };
  for (std::size_t i = 0; i < surface.x.size(); ++i) {
    add_point(series, surface.x[i], surface.error(0, static_cast<Eigen::Index>(i)));
    if (away(i) < away(nearest)) nearest = i;
  }
  if (std::isfinite(surface.x_estimate) && std::isfinite(series.y.at(nearest)))
    plot.notes.push_back({surface.x_estimate, series.y[nearest], "estimate"});
  return plot;
}

LinePlot matrix_plot(const ReportMatrix& matrix) {
  LinePlot plot;
  plot.title = "Error of each fabric's parameters on each capture";
  plot.x.label = "parameters of";
  plot.x.categories = matrix.fabrics;
  plot.y.label = "error";
  plot.y.from_zero = true;
  for (Eigen::Index i = 0; i < matrix.error.rows(); ++i) {
    PlotSeries& series = add_series(plot, matrix.captures[static_cast<std::size_t>(i)],
                                    PlotSeries::Mark::line_and_points);
    for (Eigen::Index j = 0; j < matrix.error.cols(); ++j) {
      add_point(series, static_cast<double>(j), matrix.error(i, j));
    }
  }
  return plot;
}

HeatMap matrix_map(const ReportMatrix& matrix) {
  HeatMap map;
  map.title = "Error of each fabric's parameters on each capture";
  map.x_axis.label = "parameters of";
  map.x_axis.categories = matrix.fabrics;
  map.y_axis.label = "capture";
  map.y_axis.categories = matrix.captures;
  for (std::size_t j = 0; j < matrix.fabrics.size(); ++j) map.x.push_back(static_cast<double>(j));
  for (std::size_t i = 0; i < matrix.captures.size(); ++i) map.y.push_back(static_cast<double>(i));
  map.values = matrix.error;
  map.label = "error";
  map.logarithmic = (matrix.error.array() > 0).all();
  map.print_values = true;
  map.outline_row_minimum = true;
  map.height = 110 + 52 * static_cast<int>(matrix.captures.size());
  return map;
}

HeatMap correlation_map(const ReportCertainty& certainty) {
  HeatMap map;
  map.title = "Correlation of the parameters";
  for (const std::string& name : certainty.parameters) {
    map.x.push_back(static_cast<double>(map.x.size()));
    map.x_axis.categories.push_back(in_words(name));
  }
  map.y = map.x;
  map.y_axis.categories = map.x_axis.categories;
  // Two digits: more say nothing, and cells are small.
  map.values = certainty.correlation.unaryExpr([](double r) { return std::round(100 * r) / 100; });
  map.label = "correlation";
  map.lower = -1;
  map.upper = 1;
  map.gap = "a parameter that is not determined, or held at its bound";
  map.print_values = true;
  map.digits = 2;
  map.height = 150 + 34 * static_cast<int>(map.y.size());
  return map;
}

LinePlot energy_plot(const std::vector<PlotSeries>& series) {
  LinePlot plot;
  plot.title = "Energy over time";
  plot.x = time_axis();
  plot.y.label = "energy";
  plot.y.unit = "J";
  plot.series = series;
  // Integrators that agree lie on each other: dashes let the one below be seen.
  for (std::size_t i = 1; i < plot.series.size(); i += 2) plot.series[i].dashed = true;
  return plot;
}

double fitted_order(const PlotSeries& series) {
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (std::size_t i = 0; i < series.x.size(); ++i) {
    if (!(series.x[i] > 0 && series.y[i] > 0) || !std::isfinite(series.x[i] * series.y[i]))
      continue;
    const double x = std::log(series.x[i]), y = std::log(series.y[i]);
    n += 1;
    sx += x;
    sy += y;
    sxx += x * x;
    sxy += x * y;
  }
  const double denominator = n * sxx - sx * sx;
  return n >= 2 && denominator > 0 ? (n * sxy - sx * sy) / denominator : kGap;
}

namespace {

/// A dashed line of slope `order` through the finest point of the series whose own slope is
/// nearest.
PlotSeries guide_line(const std::vector<PlotSeries>& series, double order) {
  PlotSeries guide;
  const PlotSeries* nearest = nullptr;
  for (const PlotSeries& one : series) {
    const double distance = std::abs(fitted_order(one) - order);
    if (!std::isfinite(distance)) continue;
    if (nearest == nullptr || distance < std::abs(fitted_order(*nearest) - order)) nearest = &one;
  }
  if (nearest == nullptr) return guide;
  guide.name = "slope " + format_short(order);
  guide.colour = 7;
  guide.dashed = true;
  double lower = kInfinity, upper = 0, anchor = kGap;
  for (std::size_t i = 0; i < nearest->x.size(); ++i) {
    if (!(nearest->x[i] > 0 && nearest->y[i] > 0)) continue;
    if (nearest->x[i] < lower) anchor = nearest->y[i];
    lower = std::min(lower, nearest->x[i]);
    upper = std::max(upper, nearest->x[i]);
  }
  add_point(guide, lower, anchor);
  add_point(guide, upper, anchor * std::pow(upper / lower, order));
  return guide;
}

}  // namespace

LinePlot convergence_plot(const std::string& title, const PlotAxis& size, const PlotAxis& error,
                          std::vector<PlotSeries> series, const std::vector<double>& guides) {
  LinePlot plot;
  plot.title = title;
  plot.x = size;
  plot.y = error;
  plot.x.logarithmic = plot.y.logarithmic = true;
  plot.height = 420;
  for (const double order : guides) {
    PlotSeries guide = guide_line(series, order);
    if (!guide.x.empty()) plot.series.push_back(std::move(guide));
  }
  int colour = 1;
  for (PlotSeries& one : series) {
    one.mark = PlotSeries::Mark::line_and_points;
    if (one.colour < 0) one.colour = colour++;
    const double order = fitted_order(one);
    if (std::isfinite(order)) one.name += fmt::format(", order {:.2f}", order);
    plot.series.push_back(std::move(one));
  }
  return plot;
}

}  // namespace weft
