#include "weft/report/marginals_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "weft/base/error.h"
#include "weft/report/plot.h"
#include "weft/report/svg.h"
#include "weft/report/text.h"

namespace weft {
namespace {

constexpr double kPanelGap = 8, kTitle = 30, kLabels = 62, kFontSize = 11, kPlotMargin = 16;
constexpr int kBars = 24, kCells = 18;
constexpr double kLeftOut = 0.005;  // of the samples, at either end

/// In which an axis is linear.
double coordinate(ReportParameter::Scale scale, double value) {
  switch (scale) {
    case ReportParameter::Scale::logarithmic:
      return std::log(std::max(value, 1e-300));
    case ReportParameter::Scale::shifted_logarithmic:
      return std::log1p(value / 0.1);
    case ReportParameter::Scale::linear:
      break;
  }
  return value;
}

double value_at(ReportParameter::Scale scale, double coordinate) {
  switch (scale) {
    case ReportParameter::Scale::logarithmic:
      return std::exp(coordinate);
    case ReportParameter::Scale::shifted_logarithmic:
      return 0.1 * std::expm1(coordinate);
    case ReportParameter::Scale::linear:
      break;
  }
  return coordinate;
}

struct Axis {
  std::vector<double> samples;  ///< coordinates
  double lower = 0, upper = 1, estimate = 0;
  std::string name, unit, lower_label, upper_label;
  double fraction(double at) const { return (at - lower) / (upper - lower); }
  /// -1: outside.
  int bin(std::size_t sample, int bins) const {
    const double t = fraction(samples[sample]);
    return t >= 0 && t <= 1 ? std::min(static_cast<int>(t * bins), bins - 1) : -1;
  }
};

Axis make_axis(const MarginalsPlot::Parameter& p) {
  Axis axis;
  for (const double value : p.values) axis.samples.push_back(coordinate(p.scale, value));
  std::vector<double> sorted = axis.samples;
  std::ranges::sort(sorted);
  const auto last = double(sorted.size() - 1);
  axis.lower = sorted[static_cast<std::size_t>(kLeftOut * last)];
  axis.upper = sorted[static_cast<std::size_t>(std::ceil((1 - kLeftOut) * last))];
  if (!(axis.upper > axis.lower)) {
    axis.lower -= 0.5;
    axis.upper += 0.5;
  }
  axis.estimate = coordinate(p.scale, p.estimate);
  axis.name = in_words(p.name);
  axis.unit = format_unit(p.unit);
  axis.lower_label = format_value(value_at(p.scale, axis.lower), 2);
  axis.upper_label = format_value(value_at(p.scale, axis.upper), 2);
  return axis;
}

struct Panel {
  double left, top, side;
};

void draw_frame(Svg& svg, const Panel& at) {
  svg.rect(at.left, at.top, at.side, at.side,
           "class=\"frame\" fill=\"none\" stroke=\"#8a929c\" stroke-width=\"0.8\"");
}

void draw_histogram(Svg& svg, const Axis& axis, const Panel& at, const std::string& ink) {
  std::vector<int> counts(kBars, 0);
  for (std::size_t i = 0; i < axis.samples.size(); ++i)
    if (const int bin = axis.bin(i, kBars); bin >= 0) ++counts[static_cast<std::size_t>(bin)];
  const int most = std::max(1, *std::ranges::max_element(counts));
  const double width = at.side / kBars;
  for (int i = 0; i < kBars; ++i) {
    const double height = 0.94 * at.side * counts[static_cast<std::size_t>(i)] / most;
    if (height > 0)
      svg.rect(at.left + i * width, at.top + at.side - height, width, height,
               fmt::format("class=\"bar\" fill=\"{}\" fill-opacity=\"0.75\"", ink));
  }
}

void draw_pair(Svg& svg, const Axis& x, const Axis& y, const Panel& at, const std::string& ink) {
  std::vector<int> counts(static_cast<std::size_t>(kCells * kCells), 0);
  for (std::size_t i = 0; i < x.samples.size(); ++i) {
    const int column = x.bin(i, kCells), row = y.bin(i, kCells);
    if (column >= 0 && row >= 0) ++counts[static_cast<std::size_t>(row * kCells + column)];
  }
  const double most = std::max(1, *std::ranges::max_element(counts));
  const double side = at.side / kCells;
  for (int row = 0; row < kCells; ++row) {
    for (int column = 0; column < kCells; ++column) {
      const int count = counts[static_cast<std::size_t>(row * kCells + column)];
      if (count == 0) continue;
      svg.rect(at.left + column * side, at.top + at.side - (row + 1) * side, side, side,
               fmt::format("class=\"cell\" fill=\"{}\" fill-opacity=\"{:.3f}\"", ink,
                           std::max(0.02, count / most)));
    }
  }
}

bool inside(double t) { return t >= 0 && t <= 1; }

void draw_estimate(Svg& svg, const Axis& x, const Axis* y, const Panel& at) {
  const std::string line = "class=\"estimate\" stroke=\"#c1272d\" stroke-width=\"1.6\"";
  const double tx = x.fraction(x.estimate);
  if (!inside(tx)) return;
  const double px_at = at.left + tx * at.side;
  if (!y) {
    svg.line(px_at, at.top, px_at, at.top + at.side, line);
    return;
  }
  const double ty = y->fraction(y->estimate);
  if (!inside(ty)) return;
  const double py_at = at.top + (1 - ty) * at.side;
  svg.line(px_at - 4, py_at, px_at + 4, py_at, line);
  svg.line(px_at, py_at - 4, px_at, py_at + 4, line);
}

std::string text_style(const char* anchor, double size) {
  return fmt::format("class=\"tick-label\" text-anchor=\"{}\" font-size=\"{}\" fill=\"#4a525c\"",
                     anchor, px(size));
}

/// Under the lowest panel of a column.
void draw_labels(Svg& svg, const Axis& axis, const Panel& at) {
  const double y = at.top + at.side;
  svg.text(at.left, y + 13, text_style("start", 9), axis.lower_label);
  svg.text(at.left + at.side, y + 25, text_style("end", 9), axis.upper_label);
  svg.text(at.left + at.side / 2, y + 40, text_style("middle", kFontSize - 1), axis.name);
  svg.text(at.left + at.side / 2, y + 53, text_style("middle", 9), axis.unit);
}

}  // namespace

std::string to_svg(const MarginalsPlot& plot, double margin) {
  if (plot.parameters.empty() || plot.parameters.front().values.empty())
    throw Error(fmt::format("marginals \"{}\": no parameter or no samples", plot.title));
  std::vector<Axis> axes;
  for (const MarginalsPlot::Parameter& p : plot.parameters) {
    if (p.values.size() != plot.parameters.front().values.size())
      throw Error(fmt::format("marginals \"{}\": numbers of samples differ", plot.title));
    axes.push_back(make_axis(p));
  }
  double names = 0;
  for (const Axis& axis : axes) names = std::max(names, text_width(axis.name, kFontSize));
  const double side = plot.panel, left = names + 10;
  const std::string ink = hex(palette(1));
  Svg svg;
  svg.text(0, 16, "class=\"title\" font-size=\"15\" font-weight=\"600\" fill=\"#16191d\"",
           plot.title);
  for (std::size_t row = 0; row < axes.size(); ++row) {
    const double top = kTitle + double(row) * (side + kPanelGap);
    svg.text(left - 8, top + side / 2 + 4, text_style("end", kFontSize), axes[row].name);
    for (std::size_t column = 0; column <= row; ++column) {
      const Panel at{left + double(column) * (side + kPanelGap), top, side};
      svg.open(fmt::format("class=\"panel {}\"", row == column ? "histogram" : "pair"));
      if (row == column)
        draw_histogram(svg, axes[row], at, ink);
      else
        draw_pair(svg, axes[column], axes[row], at, ink);
      draw_frame(svg, at);
      draw_estimate(svg, axes[column], row == column ? nullptr : &axes[row], at);
      svg.close();
      if (row + 1 == axes.size()) draw_labels(svg, axes[column], at);
    }
  }
  const auto count = double(axes.size());
  const double width = left + count * (side + kPanelGap) + 20;
  const double height = kTitle + count * (side + kPanelGap) + kLabels;
  return svg.document(std::max(width, text_width(plot.title, 15)), height, margin, plot.title,
                      fmt::format("data-parameters=\"{}\"", axes.size()));
}

void write_plot(const std::filesystem::path& path, const MarginalsPlot& plot) {
  std::ofstream file(path, std::ios::binary);
  file << to_svg(plot, kPlotMargin);
  file.close();
  if (!file) throw Error(path.string() + ": cannot be written");
}

}  // namespace weft
