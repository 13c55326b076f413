#include "weft/report/plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include "weft/base/error.h"
#include "weft/report/svg.h"
#include "weft/report/text.h"
#include "weft/report/ticks.h"

namespace weft {
namespace {

constexpr double kTitleSize = 15;
constexpr double kLabelSize = 13;
constexpr double kTickSize = 12;
constexpr double kLegendRow = 20;
/// Above these a mark has no tooltip of its own, and marks that fall on the same pixel are merged.
constexpr std::size_t kTooltipMarks = 400;
constexpr std::size_t kTooltipCells = 1600;

const char* const kInk = "fill=\"#22262b\"";
const char* const kSoftInk = "fill=\"#59616b\"";

bool drawable(const PlotAxis& axis, double value) {
  return std::isfinite(value) && (!axis.logarithmic || value > 0);
}

std::string axis_title(const PlotAxis& axis, int exponent) {
  std::string unit = format_unit(axis.unit);
  if (exponent != 0) unit = power_of_ten(exponent) + (unit.empty() ? "" : " ") + unit;
  if (unit.empty()) return axis.label;
  return axis.label.empty() ? unit : fmt::format("{} ({})", axis.label, unit);
}

/// An axis with its range settled, and where it lies on the picture.
struct Scale {
  double lower = 0, upper = 1;
  bool logarithmic = false;
  double from = 0, to = 1;  ///< px of lower and upper
  Ticks ticks;

  double fraction(double value) const {
    return logarithmic ? std::log(value / lower) / std::log(upper / lower)
                       : (value - lower) / (upper - lower);
  }
  double pixel(double value) const { return from + (to - from) * fraction(value); }
  bool contains(double value) const { return value >= lower && value <= upper; }
};

/// The range that holds `values`, widened by `padding` of its length on both sides.
Scale make_scale(const PlotAxis& axis, const std::vector<double>& values, double padding) {
  Scale scale;
  scale.logarithmic = axis.logarithmic;
  if (!axis.categories.empty()) {
    scale.lower = -0.5;
    scale.upper = static_cast<double>(axis.categories.size()) - 0.5;
    return scale;
  }
  double lower = kInfinity, upper = -lower;
  for (const double value : values) {
    if (!drawable(axis, value)) continue;
    lower = std::min(lower, value);
    upper = std::max(upper, value);
  }
  if (lower > upper) lower = upper = 1;
  if (axis.from_zero && !axis.logarithmic) {
    lower = std::min(lower, 0.0);
    upper = std::max(upper, 0.0);
  }
  if (axis.logarithmic) {
    if (upper <= lower * (1 + 1e-12)) lower /= 2, upper *= 2;
    const double factor = std::pow(upper / lower, padding);
    lower /= factor;
    upper *= factor;
  } else {
    if (upper - lower <= 1e-12 * std::max(std::abs(lower), std::abs(upper))) {
      const double half = upper == 0 ? 0.5 : 0.5 * std::abs(upper);
      lower -= half;
      upper += half;
    }
    const double margin = padding * (upper - lower);
    // A range that ends at zero says so; nothing lies beyond.
    const bool at_zero = axis.from_zero && lower == 0;
    const bool below_zero = axis.from_zero && upper == 0;
    if (!at_zero) lower -= margin;
    if (!below_zero) upper += margin;
  }
  scale.lower = axis.lower.value_or(lower);
  scale.upper = axis.upper.value_or(upper);
  if (!(scale.lower < scale.upper) || (axis.logarithmic && scale.lower <= 0)) {
    throw Error(fmt::format("plot: axis \"{}\": range {} to {} is empty or not positive",
                            axis.label, scale.lower, scale.upper));
  }
  return scale;
}

void set_ticks(Scale& scale, const PlotAxis& axis, double length, double spacing) {
  if (!axis.categories.empty()) {
    for (std::size_t i = 0; i < axis.categories.size(); ++i) {
      scale.ticks.positions.push_back(static_cast<double>(i));
      scale.ticks.labels.push_back(axis.categories[i]);
    }
    return;
  }
  const int most = std::max(3, static_cast<int>(length / spacing));
  scale.ticks = axis.logarithmic ? log_ticks(scale.lower, scale.upper, most)
                                 : linear_ticks(scale.lower, scale.upper, most,
                                                axis.integers ? TickStep::whole : TickStep::any);
}

double widest(const std::vector<std::string>& labels) {
  double width = 0;
  for (const std::string& label : labels) width = std::max(width, text_width(label, kTickSize));
  return width;
}

struct Frame {
  double left = 0, top = 0, right = 0, bottom = 0;
};

void draw_title(Svg& svg, const std::string& title) {
  if (title.empty()) return;
  svg.text(
      0, kTitleSize + 1,
      fmt::format("class=\"title\" font-size=\"{}\" font-weight=\"600\" {}", px(kTitleSize), kInk),
      title);
}
double title_height(const std::string& title) { return title.empty() ? 4 : kTitleSize + 12; }

/// Categories that do not fit beside each other are set slanting, and need this much more height.
double slant_height(const PlotAxis& axis, double length) {
  if (axis.categories.empty()) return 0;
  const double width = widest(axis.categories);
  const bool fits = width + 8 <= length / static_cast<double>(axis.categories.size());
  return fits ? 0 : 0.5 * width;
}

enum class Grid { none, lines };

void draw_x_axis(Svg& svg, const Frame& frame, const Scale& scale, const PlotAxis& axis, Grid grid,
                 double slant = 0) {
  svg.open("class=\"axis x-axis\"");
  const double baseline = frame.bottom + 4 + kTickSize + 2;
  for (std::size_t i = 0; i < scale.ticks.positions.size(); ++i) {
    const double x = scale.pixel(scale.ticks.positions[i]);
    if (grid == Grid::lines)
      svg.line(x, frame.top, x, frame.bottom, "class=\"grid\" stroke=\"#e6e8eb\"");
    svg.line(x, frame.bottom, x, frame.bottom + 4, "class=\"tick\" stroke=\"#8a929c\"");
    const std::string how = slant > 0
                                ? fmt::format("text-anchor=\"end\" transform=\"rotate(-30 {} {})\"",
                                              px(x), px(baseline))
                                : std::string("text-anchor=\"middle\"");
    svg.text(x, baseline, fmt::format("class=\"tick-label\" {} {}", how, kSoftInk),
             scale.ticks.labels[i]);
  }
  for (const double minor : scale.ticks.minor) {
    const double x = scale.pixel(minor);
    svg.line(x, frame.bottom, x, frame.bottom + 2.5, "class=\"tick\" stroke=\"#b7bdc5\"");
  }
  svg.text((frame.left + frame.right) / 2, baseline + slant + 4 + kLabelSize,
           fmt::format("class=\"axis-label\" text-anchor=\"middle\" font-size=\"{}\" {}",
                       px(kLabelSize), kInk),
           axis_title(axis, scale.ticks.exponent));
  svg.close();
}

void draw_y_axis(Svg& svg, const Frame& frame, const Scale& scale, const PlotAxis& axis,
                 Grid grid) {
  svg.open("class=\"axis y-axis\"");
  for (std::size_t i = 0; i < scale.ticks.positions.size(); ++i) {
    const double y = scale.pixel(scale.ticks.positions[i]);
    if (grid == Grid::lines)
      svg.line(frame.left, y, frame.right, y, "class=\"grid\" stroke=\"#e6e8eb\"");
    svg.text(frame.left - 6, y + 0.36 * kTickSize,
             fmt::format("class=\"tick-label\" text-anchor=\"end\" {}", kSoftInk),
             scale.ticks.labels[i]);
  }
  for (const double minor : scale.ticks.minor) {
    const double y = scale.pixel(minor);
    svg.line(frame.left - 2.5, y, frame.left, y, "class=\"tick\" stroke=\"#b7bdc5\"");
  }
  const std::string title = axis_title(axis, scale.ticks.exponent);
  svg.text(0, frame.top - 9,
           fmt::format("class=\"axis-label\" font-size=\"{}\" {}", px(kLabelSize), kInk), title);
  svg.close();
}

void draw_base_line(Svg& svg, const Frame& frame) {
  svg.line(frame.left, frame.bottom, frame.right, frame.bottom,
           "class=\"base\" stroke=\"#8a929c\"");
}

// ---- Legend: entries flow in rows above the plot, where they never cover data.

struct LegendEntry {
  std::string label;
  double x = 0, y = 0;  ///< upper left corner
};

std::vector<LegendEntry> lay_out_legend(const std::vector<std::string>& labels, double width,
                                        double top, double& height) {
  std::vector<LegendEntry> entries;
  double x = 0, y = top;
  for (const std::string& label : labels) {
    const double length = 30 + text_width(label, kTickSize) + 18;
    if (x > 0 && x + length > width) x = 0, y += kLegendRow;
    entries.push_back({label, x, y});
    x += length;
  }
  height = entries.empty() ? 0 : y + kLegendRow - top + 4;
  return entries;
}

// ---- Marks

int colour_index(const PlotSeries& series, std::size_t position) {
  return series.colour >= 0 ? series.colour % 8 : 1 + static_cast<int>(position % 7);
}

std::string stroke(int colour, double width) {
  return fmt::format("class=\"s{} stroke\" stroke=\"{}\" stroke-width=\"{}\" fill=\"none\"", colour,
                     hex(palette(colour)), px(width));
}
std::string fill(int colour, std::string_view name) {
  return fmt::format("class=\"{} s{} fill\" fill=\"{}\"", name, colour, hex(palette(colour)));
}

/// Shapes differ with the colour, so that series can be told apart without it.
void draw_mark(Svg& svg, double x, double y, int colour, double r, std::string_view tooltip) {
  const std::string attributes = fill(colour, "mark");
  switch (colour % 4) {
    case 2:
      svg.rect(x - 0.9 * r, y - 0.9 * r, 1.8 * r, 1.8 * r, attributes, tooltip);
      break;
    case 3:
      svg.path(fmt::format("M{} {}l{} {}h{}z", px(x), px(y - 1.2 * r), px(1.15 * r), px(2 * r),
                           px(-2.3 * r)),
               attributes, tooltip);
      break;
    case 0:
      if (colour != 0) {
        svg.path(fmt::format("M{} {}l{} {}l{} {}l{} {}z", px(x), px(y - 1.3 * r), px(1.3 * r),
                             px(1.3 * r), px(-1.3 * r), px(1.3 * r), px(-1.3 * r), px(-1.3 * r)),
                 attributes, tooltip);
        break;
      }
      [[fallthrough]];
    default:
      svg.circle(x, y, r, attributes, tooltip);
  }
}

struct Pixel {
  double x, y;
};

/// The pieces of a series between gaps, in pixels. Where many points share a column of pixels only
/// the first, lowest, highest and last of them are kept.
std::vector<std::vector<Pixel>> line_pieces(const PlotSeries& series, const LinePlot& plot,
                                            const Scale& x, const Scale& y) {
  std::vector<std::vector<Pixel>> pieces(1);
  for (std::size_t i = 0; i < series.x.size(); ++i) {
    if (drawable(plot.x, series.x[i]) && drawable(plot.y, series.y[i])) {
      pieces.back().push_back({x.pixel(series.x[i]), y.pixel(series.y[i])});
    } else if (!pieces.back().empty()) {
      pieces.emplace_back();
    }
  }
  if (series.x.size() <= 4 * static_cast<std::size_t>(plot.width)) return pieces;
  for (auto& piece : pieces) {
    std::vector<Pixel> kept;
    for (std::size_t i = 0; i < piece.size();) {
      std::size_t end = i, low = i, high = i;
      for (; end < piece.size() && std::floor(piece[end].x) == std::floor(piece[i].x); ++end) {
        if (piece[end].y < piece[low].y) low = end;
        if (piece[end].y > piece[high].y) high = end;
      }
      std::set<std::size_t> indices{i, low, high, end - 1};
      for (const std::size_t k : indices) kept.push_back(piece[k]);
      i = end;
    }
    piece = std::move(kept);
  }
  return pieces;
}

std::string path_through(const std::vector<Pixel>& points) {
  std::string d;
  for (const Pixel& p : points)
    d += fmt::format("{}{} {}", d.empty() ? 'M' : 'L', px(p.x), px(p.y));
  return d;
}

void draw_band(Svg& svg, const PlotSeries& series, const LinePlot& plot, const Scale& x,
               const Scale& y, int colour) {
  std::vector<Pixel> above, below;
  const auto flush = [&] {
    if (above.size() > 1) {
      std::vector<Pixel> outline = above;
      outline.insert(outline.end(), below.rbegin(), below.rend());
      svg.path(path_through(outline) + "Z", fill(colour, "band") + " fill-opacity=\"0.18\"");
    }
    above.clear();
    below.clear();
  };
  for (std::size_t i = 0; i < series.lower.size(); ++i) {
    if (!drawable(plot.x, series.x[i]) || !drawable(plot.y, series.lower[i]) ||
        !drawable(plot.y, series.upper[i])) {
      flush();
      continue;
    }
    const double at = x.pixel(series.x[i]);
    above.push_back({at, y.pixel(series.upper[i])});
    below.push_back({at, y.pixel(series.lower[i])});
  }
  flush();
}

std::string value_with_unit(const PlotAxis& axis, double value) {
  const std::string unit = format_unit(axis.unit);
  return format_value(value, 4) + (unit.empty() ? "" : " " + unit);
}

std::string coordinate_text(const PlotAxis& axis, double value) {
  if (!axis.categories.empty()) {
    const auto index = static_cast<std::size_t>(std::max(0.0, std::round(value)));
    return index < axis.categories.size() ? axis.categories[index] : "";
  }
  return (axis.label.empty() ? "" : axis.label + " ") + value_with_unit(axis, value);
}

void draw_points(Svg& svg, const PlotSeries& series, const LinePlot& plot, const Frame& frame,
                 const Scale& x, const Scale& y, int colour) {
  const bool many = series.x.size() > kTooltipMarks;
  const double radius = series.x.size() > 60 ? 2.1 : 3.2;
  std::set<std::pair<long, long>> taken;
  std::string dots;
  for (std::size_t i = 0; i < series.x.size(); ++i) {
    if (!drawable(plot.x, series.x[i]) || !x.contains(series.x[i])) continue;
    const double at_x = x.pixel(series.x[i]);
    if (!drawable(plot.y, series.y[i])) {
      if (series.y[i] != kInfinity) continue;
      if (many && !taken.insert({std::lround(at_x), -1}).second) continue;
      svg.path(fmt::format("M{} {}l4 6h-8z", px(at_x), px(frame.top + 1)),
               fill(colour, "off-scale"), many ? "" : coordinate_text(plot.x, series.x[i]) + ": ∞");
      continue;
    }
    if (!y.contains(series.y[i])) continue;
    const double at_y = y.pixel(series.y[i]);
    if (many) {
      if (taken.insert({std::lround(at_x), std::lround(at_y)}).second) {
        dots += fmt::format("M{} {}h0", px(at_x), px(at_y));
      }
      continue;
    }
    draw_mark(
        svg, at_x, at_y, colour, radius,
        fmt::format("{}{}: {}", series.name.empty() ? "" : series.name + ", ",
                    coordinate_text(plot.x, series.x[i]), value_with_unit(plot.y, series.y[i])));
  }
  if (!dots.empty()) {
    svg.path(dots, fmt::format("class=\"dots s{} stroke\" stroke=\"{}\" stroke-width=\"2.8\" "
                               "stroke-linecap=\"round\" stroke-opacity=\"0.75\" fill=\"none\"",
                               colour, hex(palette(colour))));
  }
}

void draw_series(Svg& svg, const PlotSeries& series, const LinePlot& plot, const Frame& frame,
                 const Scale& x, const Scale& y, int colour) {
  svg.open(fmt::format("class=\"series\" data-name=\"{}\"", escape_xml(series.name)));
  if (!series.lower.empty()) draw_band(svg, series, plot, x, y, colour);
  if (series.mark != PlotSeries::Mark::points) {
    for (const auto& piece : line_pieces(series, plot, x, y)) {
      if (piece.empty()) continue;
      // A single point between gaps would be an invisible line.
      const std::string d = path_through(piece) + (piece.size() == 1 ? "h0" : "");
      svg.path(d, stroke(colour, 1.8) + " stroke-linejoin=\"round\" stroke-linecap=\"round\"" +
                      (series.dashed ? " stroke-dasharray=\"6 4\"" : ""));
    }
  }
  if (series.mark != PlotSeries::Mark::line) draw_points(svg, series, plot, frame, x, y, colour);
  svg.close();
}

void draw_legend_key(Svg& svg, const LegendEntry& entry, const PlotSeries& series, int colour) {
  const double middle = entry.y + kLegendRow / 2;
  if (series.mark != PlotSeries::Mark::points) {
    svg.line(entry.x, middle, entry.x + 24, middle,
             stroke(colour, 2.2) + (series.dashed ? " stroke-dasharray=\"6 4\"" : ""));
  }
  if (series.mark != PlotSeries::Mark::line) draw_mark(svg, entry.x + 12, middle, colour, 3.6, {});
}

void draw_legend_label(Svg& svg, const LegendEntry& entry) {
  svg.text(entry.x + 30, entry.y + kLegendRow / 2 + 0.36 * kTickSize,
           fmt::format("class=\"legend\" {}", kInk), entry.label);
}

void check_series(const LinePlot& plot) {
  for (const PlotSeries& series : plot.series) {
    const std::size_t n = series.x.size();
    const bool band = series.lower.empty() && series.upper.empty();
    if (series.y.size() != n || (!band && (series.lower.size() != n || series.upper.size() != n))) {
      throw Error(fmt::format("plot \"{}\": series \"{}\": {} x, {} y, band {} and {}", plot.title,
                              series.name, n, series.y.size(), series.lower.size(),
                              series.upper.size()));
    }
  }
}

/// From where to where in px; nothing where it is not in the frame.
std::optional<std::pair<double, double>> extent(const PlotRegion& region, const Frame& frame,
                                                const Scale& x) {
  const double left = std::max(frame.left, x.pixel(std::max(region.lower, x.lower)));
  const double right = std::min(frame.right, x.pixel(std::min(region.upper, x.upper)));
  if (right <= left) return std::nullopt;
  return std::pair(left, right);
}

void draw_regions(Svg& svg, const LinePlot& plot, const Frame& frame, const Scale& x) {
  for (const PlotRegion& region : plot.regions)
    if (const auto at = extent(region, frame, x))
      svg.rect(at->first, frame.top, at->second - at->first, frame.bottom - frame.top,
               "class=\"region\" fill=\"#f1f3f6\"");
}

/// Over the lines of the grid.
void draw_region_labels(Svg& svg, const LinePlot& plot, const Frame& frame, const Scale& x) {
  for (const PlotRegion& region : plot.regions)
    if (const auto at = extent(region, frame, x))
      svg.text((at->first + at->second) / 2, frame.top + kTickSize + 3,
               fmt::format("class=\"region-label\" text-anchor=\"middle\" {} stroke=\"#f1f3f6\" "
                           "stroke-width=\"4\" paint-order=\"stroke\"",
                           kSoftInk),
               region.label);
}

void draw_levels(Svg& svg, const LinePlot& plot, const Frame& frame, const Scale& y) {
  for (const PlotLevel& level : plot.levels) {
    if (!drawable(plot.y, level.value) || !y.contains(level.value)) continue;
    const double at = y.pixel(level.value);
    svg.line(frame.left, at, frame.right, at,
             "class=\"level\" stroke=\"#59616b\" stroke-dasharray=\"2 3\"");
    const double width = text_width(level.label, kTickSize);
    const double room = frame.right - frame.left - width - 8;
    svg.text(frame.left + 4 + room * level.label_at, std::max(at - 4, frame.top + kTickSize),
             fmt::format("class=\"note\" {} stroke=\"#ffffff\" stroke-width=\"3\" "
                         "paint-order=\"stroke\"",
                         kSoftInk),
             level.label);
  }
}

void draw_notes(Svg& svg, const LinePlot& plot, const Frame& frame, const Scale& x,
                const Scale& y) {
  for (const PlotNote& note : plot.notes) {
    if (!drawable(plot.x, note.x) || !drawable(plot.y, note.y)) continue;
    const double at_x = x.pixel(note.x), at_y = y.pixel(note.y);
    const bool to_left = at_x + 8 + text_width(note.text, kTickSize) > frame.right;
    svg.circle(at_x, at_y, 4.5,
               "class=\"note-mark\" fill=\"none\" stroke=\"#22262b\" stroke-width=\"1.6\"");
    svg.text(
        at_x + (to_left ? -8 : 8), std::max(at_y - 8, frame.top + kTickSize),
        fmt::format("class=\"note\" text-anchor=\"{}\" {} stroke=\"#ffffff\" stroke-width=\"3\" "
                    "paint-order=\"stroke\"",
                    to_left ? "end" : "start", kInk),
        note.text);
  }
}

/// What a script needs to place a cursor: the frame in px and the range of x.
std::string root_attributes(const Frame& frame, const Scale& x) {
  return fmt::format(
      "data-left=\"{}\" data-right=\"{}\" data-top=\"{}\" data-bottom=\"{}\" data-x-lower=\"{}\" "
      "data-x-upper=\"{}\"",
      px(frame.left), px(frame.right), px(frame.top), px(frame.bottom), x.lower, x.upper);
}

std::string clip(std::string_view id, const Frame& frame) {
  return fmt::format(
      "<clipPath id=\"{}-clip\"><rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/></clipPath>\n",
      escape_xml(id), px(frame.left), px(frame.top), px(frame.right - frame.left),
      px(frame.bottom - frame.top));
}

/// Hatching for what has no number.
std::string hatch(std::string_view id) {
  return fmt::format(
      "<pattern id=\"{}-hatch\" width=\"6\" height=\"6\" patternUnits=\"userSpaceOnUse\" "
      "patternTransform=\"rotate(45)\"><rect class=\"hatch-ground\" width=\"6\" height=\"6\" "
      "fill=\"#eceef1\"/><line class=\"hatch-line\" x1=\"0\" y1=\"0\" x2=\"0\" y2=\"6\" "
      "stroke=\"#9aa1aa\" stroke-width=\"2.4\"/></pattern>\n",
      escape_xml(id));
}

std::vector<double> x_values(const LinePlot& plot) {
  std::vector<double> values;
  for (const PlotSeries& s : plot.series) values.insert(values.end(), s.x.begin(), s.x.end());
  for (const PlotNote& note : plot.notes) values.push_back(note.x);
  return values;
}

std::vector<double> y_values(const LinePlot& plot) {
  std::vector<double> values;
  for (const PlotSeries& s : plot.series) {
    for (const auto* part : {&s.y, &s.lower, &s.upper}) {
      values.insert(values.end(), part->begin(), part->end());
    }
  }
  for (const PlotNote& note : plot.notes) values.push_back(note.y);
  for (const PlotLevel& level : plot.levels) values.push_back(level.value);
  return values;
}

}  // namespace

Rgb palette(int index) {
  // Okabe and Ito 2008 without yellow, which light grounds swallow, in order of contrast; grey
  // last.
  static constexpr Rgb kColours[] = {{34, 38, 43},   {0, 114, 178},   {213, 94, 0},
                                     {0, 158, 115},  {204, 121, 167}, {230, 159, 0},
                                     {86, 180, 233}, {120, 126, 134}};
  return kColours[static_cast<std::size_t>(std::max(0, index) % 8)];
}

std::string to_svg(const LinePlot& plot, std::string_view id, double margin) {
  check_series(plot);
  const bool marks = std::ranges::any_of(
      plot.series, [](const PlotSeries& s) { return s.mark != PlotSeries::Mark::line; });
  Scale x = make_scale(plot.x, x_values(plot), marks ? 0.02 : 0);
  Scale y = make_scale(plot.y, y_values(plot), 0.06);

  std::vector<std::string> labels;
  std::vector<std::size_t> named;
  for (std::size_t i = 0; i < plot.series.size(); ++i) {
    if (plot.series[i].name.empty()) continue;
    labels.push_back(plot.series[i].name);
    named.push_back(i);
  }
  double legend_height = 0;
  const double legend_top = title_height(plot.title);
  const auto legend = lay_out_legend(labels, plot.width, legend_top, legend_height);

  Frame frame;
  frame.top = legend_top + legend_height + kLabelSize + 12;
  const double slant = slant_height(plot.x, plot.width - 80);
  frame.bottom = std::max(frame.top + 60, plot.height - slant - kTickSize - kLabelSize - 16.0);
  set_ticks(y, plot.y, frame.bottom - frame.top, plot.y.logarithmic ? 30 : 36);
  frame.left = std::max(24.0, widest(y.ticks.labels) + 8);
  frame.right = plot.width - 14;
  set_ticks(x, plot.x, frame.right - frame.left, 60);
  x.from = frame.left, x.to = frame.right;
  y.from = frame.bottom, y.to = frame.top;

  Svg svg;
  svg.raw("<defs>" + clip(id, frame) + "</defs>\n");
  draw_title(svg, plot.title);
  draw_regions(svg, plot, frame, x);
  draw_x_axis(svg, frame, x, plot.x, plot.x.categories.empty() ? Grid::lines : Grid::none, slant);
  draw_y_axis(svg, frame, y, plot.y, Grid::lines);
  draw_region_labels(svg, plot, frame, x);
  draw_levels(svg, plot, frame, y);
  svg.open(fmt::format("clip-path=\"url(#{}-clip)\"", escape_xml(id)));
  for (std::size_t i = 0; i < plot.series.size(); ++i) {
    draw_series(svg, plot.series[i], plot, frame, x, y, colour_index(plot.series[i], i));
  }
  svg.close();
  draw_base_line(svg, frame);
  draw_notes(svg, plot, frame, x, y);
  for (std::size_t k = 0; k < legend.size(); ++k) {
    const PlotSeries& series = plot.series[named[k]];
    draw_legend_key(svg, legend[k], series, colour_index(series, named[k]));
    draw_legend_label(svg, legend[k]);
  }
  return svg.document(plot.width, plot.height, margin, plot.title, root_attributes(frame, x));
}

std::string to_svg(const BarChart& chart, std::string_view id, double margin) {
  constexpr double kRow = 28;
  std::vector<double> values;
  std::vector<std::string> labels;
  double note_width = 0;
  const auto note = [&](const BarChart::Bar& bar) {
    return bar.note.empty() ? value_with_unit(chart.value, bar.value) : bar.note;
  };
  for (const BarChart::Bar& bar : chart.bars) {
    values.push_back(bar.value);
    labels.push_back(bar.label);
    if (std::isfinite(bar.value))
      note_width = std::max(note_width, text_width(note(bar), kTickSize));
  }
  PlotAxis axis = chart.value;
  axis.from_zero = true;
  Scale scale = make_scale(axis, values, 0);
  if (axis.logarithmic && !axis.lower) {
    scale.lower = std::pow(10.0, std::floor(std::log10(scale.lower) - 0.05));
  }

  Frame frame;
  frame.top = title_height(chart.title) + 6;
  frame.bottom = frame.top + kRow * static_cast<double>(chart.bars.size()) + 4;
  frame.left = widest(labels) + 12;
  frame.right = std::max(frame.left + 80, chart.width - note_width - 14);
  scale.from = frame.left, scale.to = frame.right;
  set_ticks(scale, axis, frame.right - frame.left, 60);

  Svg svg;
  svg.raw("<defs>" + hatch(id) + "</defs>\n");
  draw_title(svg, chart.title);
  draw_x_axis(svg, frame, scale, axis, Grid::lines);
  for (std::size_t i = 0; i < chart.bars.size(); ++i) {
    const BarChart::Bar& bar = chart.bars[i];
    const double top = frame.top + kRow * static_cast<double>(i) + 5;
    const double baseline = top + kRow / 2 - 5 + 0.36 * kTickSize;
    svg.text(frame.left - 8, baseline,
             fmt::format("class=\"bar-label\" text-anchor=\"end\" {}", kInk), bar.label);
    const bool finite = std::isfinite(bar.value);
    const double end = !finite ? frame.right
                       : axis.logarithmic && bar.value <= 0
                           ? frame.left
                           : std::clamp(scale.pixel(bar.value), frame.left, frame.right);
    if (finite) {
      svg.rect(frame.left, top, end - frame.left, kRow - 10, fill(bar.highlighted ? 2 : 1, "bar"),
               fmt::format("{}: {}", bar.label, value_with_unit(chart.value, bar.value)));
      svg.text(end + 6, baseline, fmt::format("class=\"bar-note\" {}", kInk), note(bar));
    } else {
      svg.rect(frame.left, top, end - frame.left, kRow - 10,
               fmt::format("class=\"bar hatched\" fill=\"url(#{}-hatch)\"", escape_xml(id)),
               bar.label);
      svg.text(frame.left + 8, baseline,
               fmt::format("class=\"bar-note note\" {} stroke=\"#ffffff\" stroke-width=\"4\" "
                           "paint-order=\"stroke\"",
                           kInk),
               note(bar));
    }
  }
  svg.line(frame.left, frame.top, frame.left, frame.bottom, "class=\"base\" stroke=\"#8a929c\"");
  const double height = frame.bottom + kTickSize + kLabelSize + 16;
  return svg.document(chart.width, height, margin, chart.title, root_attributes(frame, scale));
}

// ---- Heat maps

namespace {

void check_map(const HeatMap& map) {
  const bool shape = map.values.rows() == static_cast<Eigen::Index>(map.y.size()) &&
                     map.values.cols() == static_cast<Eigen::Index>(map.x.size());
  const bool increasing = std::ranges::is_sorted(map.x, std::less_equal<>()) &&
                          std::ranges::is_sorted(map.y, std::less_equal<>());
  if (!shape || !increasing || map.values.size() == 0) {
    throw Error(fmt::format(
        "heat map \"{}\": {} x {} values for {} rows and {} columns, whose centres must increase",
        map.title, map.values.rows(), map.values.cols(), map.y.size(), map.x.size()));
  }
}

/// Edges between cells: half way between centres, on the axis' own scale.
std::vector<double> cell_edges(const std::vector<double>& centres, bool logarithmic) {
  const auto forward = [&](double v) { return logarithmic ? std::log(v) : v; };
  const auto back = [&](double v) { return logarithmic ? std::exp(v) : v; };
  const std::size_t n = centres.size();
  std::vector<double> edges(n + 1);
  for (std::size_t i = 1; i < n; ++i) {
    edges[i] = back((forward(centres[i - 1]) + forward(centres[i])) / 2);
  }
  if (n == 1) return {back(forward(centres[0]) - 0.5), back(forward(centres[0]) + 0.5)};
  edges[0] = back(2 * forward(centres[0]) - forward(edges[1]));
  edges[n] = back(2 * forward(centres[n - 1]) - forward(edges[n - 1]));
  return edges;
}

Scale cell_scale(const PlotAxis& axis, const std::vector<double>& edges) {
  PlotAxis exact = axis;
  exact.categories.clear();
  exact.lower = edges.front();
  exact.upper = edges.back();
  return make_scale(exact, edges, 0);
}

void draw_colour_bar(Svg& svg, const HeatMap& map, const Frame& frame, const Scale& colours_scale) {
  const double left = frame.right + 18, width = 14;
  const int steps = 64;
  const double height = (frame.bottom - frame.top) / steps;
  svg.open("class=\"colour-bar\" shape-rendering=\"crispEdges\"");
  for (int i = 0; i < steps; ++i) {
    svg.rect(left, frame.bottom - (i + 1) * height, width, height + 0.6,
             fmt::format("fill=\"{}\"", hex(colour_at(ColourMap::viridis, (i + 0.5) / steps))));
  }
  svg.close();
  for (std::size_t i = 0; i < colours_scale.ticks.positions.size(); ++i) {
    const double y = colours_scale.pixel(colours_scale.ticks.positions[i]);
    svg.line(left + width, y, left + width + 4, y, "class=\"tick\" stroke=\"#8a929c\"");
    svg.text(left + width + 7, y + 0.36 * kTickSize,
             fmt::format("class=\"tick-label\" {}", kSoftInk), colours_scale.ticks.labels[i]);
  }
  PlotAxis axis;
  axis.label = map.label;
  axis.unit = map.unit;
  svg.text(map.width, frame.top - 9,
           fmt::format("class=\"axis-label\" text-anchor=\"end\" font-size=\"{}\" {}",
                       px(kLabelSize), kInk),
           axis_title(axis, colours_scale.ticks.exponent));
}

Eigen::Index smallest_finite(const HeatMap& map, Eigen::Index row) {
  Eigen::Index best = -1;
  for (Eigen::Index j = 0; j < map.values.cols(); ++j) {
    const double value = map.values(row, j);
    if (std::isfinite(value) && (best < 0 || value < map.values(row, best))) best = j;
  }
  return best;
}

/// Where a heat map's cells, axes and colours lie.
struct MapLayout {
  std::vector<double> x_edges, y_edges;
  PlotAxis colour_axis;
  Scale x, y, colour;
  Frame frame;
  double slant = 0;  ///< height of slanting labels below

  double left(Eigen::Index column) const { return x.pixel(x_edges[std::size_t(column)]); }
  double right(Eigen::Index column) const { return x.pixel(x_edges[std::size_t(column) + 1]); }
  double top(Eigen::Index row) const { return std::min(edge(row), edge(row + 1)); }
  double height(Eigen::Index row) const { return std::abs(edge(row + 1) - edge(row)); }

 private:
  double edge(Eigen::Index row) const { return y.pixel(y_edges[std::size_t(row)]); }
};

MapLayout lay_out(const HeatMap& map, double top) {
  MapLayout out;
  out.x_edges = cell_edges(map.x, map.x_axis.logarithmic);
  out.y_edges = cell_edges(map.y, map.y_axis.logarithmic);
  out.x = cell_scale(map.x_axis, out.x_edges);
  out.y = cell_scale(map.y_axis, out.y_edges);
  out.colour_axis.logarithmic = map.logarithmic;
  out.colour_axis.lower = map.lower;
  out.colour_axis.upper = map.upper;
  out.colour =
      make_scale(out.colour_axis, {map.values.data(), map.values.data() + map.values.size()}, 0);
  out.slant = slant_height(map.x_axis, map.width - 160);
  Frame& frame = out.frame;
  frame.top = top;
  frame.bottom = std::max(top + 60, map.height - out.slant - kTickSize - kLabelSize - 16.0);
  set_ticks(out.y, map.y_axis, frame.bottom - frame.top, 36);
  set_ticks(out.colour, out.colour_axis, frame.bottom - frame.top, 60);
  frame.left = std::max(24.0, widest(out.y.ticks.labels) + 8);
  frame.right =
      std::max(frame.left + 60, map.width - 18 - 14 - 7 - widest(out.colour.ticks.labels) - 4);
  set_ticks(out.x, map.x_axis, frame.right - frame.left, 60);
  out.x.from = frame.left, out.x.to = frame.right;
  out.y.from = frame.bottom, out.y.to = frame.top;
  // A table of categories reads from the top.
  if (!map.y_axis.categories.empty()) std::swap(out.y.from, out.y.to);
  out.colour.from = frame.bottom, out.colour.to = frame.top;
  return out;
}

void draw_cells(Svg& svg, const HeatMap& map, const MapLayout& layout, std::string_view id) {
  svg.open("class=\"cells\" shape-rendering=\"crispEdges\"");
  const bool tooltips = static_cast<std::size_t>(map.values.size()) <= kTooltipCells;
  for (Eigen::Index i = 0; i < map.values.rows(); ++i) {
    for (Eigen::Index j = 0; j < map.values.cols(); ++j) {
      const double value = map.values(i, j);
      const std::string ink =
          drawable(layout.colour_axis, value)
              ? hex(colour_at(ColourMap::viridis, layout.colour.fraction(value)))
              : fmt::format("url(#{}-hatch)", escape_xml(id));
      svg.rect(layout.left(j), layout.top(i), layout.right(j) - layout.left(j), layout.height(i),
               fmt::format("class=\"cell\" fill=\"{}\"", ink),
               tooltips
                   ? fmt::format("{}, {}: {}", coordinate_text(map.x_axis, map.x[std::size_t(j)]),
                                 coordinate_text(map.y_axis, map.y[std::size_t(i)]),
                                 format_value(value, 4))
                   : "");
    }
  }
  svg.close();
}

void outline_row_minimum(Svg& svg, const HeatMap& map, const MapLayout& layout, Eigen::Index row) {
  const Eigen::Index best = smallest_finite(map, row);
  if (best < 0) return;
  // Two strokes: one of them stands out on any ground.
  for (const auto& [ink, width] : {std::pair{"#16191d", 5.0}, std::pair{"#ffffff", 2.4}}) {
    svg.rect(layout.left(best) + 3, layout.top(row) + 3, layout.right(best) - layout.left(best) - 6,
             layout.height(row) - 6,
             fmt::format("class=\"row-minimum\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\"",
                         ink, px(width)));
  }
}

/// Text colour that the ground of a cell with this value calls for.
const char* ink_on_cell(const MapLayout& layout, double value) {
  const bool hatched = !drawable(layout.colour_axis, value);
  const bool dark_ground =
      !hatched && luminance(colour_at(ColourMap::viridis, layout.colour.fraction(value))) < 0.3;
  return dark_ground ? "#ffffff" : "#16191d";
}

void draw_row_values(Svg& svg, const HeatMap& map, const MapLayout& layout, Eigen::Index row) {
  for (Eigen::Index j = 0; j < map.values.cols(); ++j) {
    const double value = map.values(row, j);
    if (std::isnan(value)) continue;
    svg.text((layout.left(j) + layout.right(j)) / 2,
             layout.top(row) + layout.height(row) / 2 + 0.36 * kTickSize,
             fmt::format("class=\"cell-value\" text-anchor=\"middle\" fill=\"{}\"",
                         ink_on_cell(layout, value)),
             format_value(value, map.digits));
  }
}

/// A ring or a cross, in turn.
void draw_map_marker(Svg& svg, double x, double y, std::size_t index) {
  for (const auto& [ink, width] : {std::pair{"#16191d", 5.0}, std::pair{"#ffffff", 2.2}}) {
    const std::string attributes = fmt::format(
        "class=\"marker\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\"", ink, px(width));
    if (index % 2 == 0) {
      svg.circle(x, y, 6.5, attributes);
    } else {
      svg.path(fmt::format("M{} {}l10 10m0 -10l-10 10", px(x - 5), px(y - 5)), attributes);
    }
  }
}

void draw_markers(Svg& svg, const HeatMap& map, const MapLayout& layout) {
  for (std::size_t i = 0; i < map.markers.size(); ++i) {
    const HeatMap::Marker& marker = map.markers[i];
    if (!drawable(map.x_axis, marker.x) || !drawable(map.y_axis, marker.y)) continue;
    if (layout.x.contains(marker.x) && layout.y.contains(marker.y))
      draw_map_marker(svg, layout.x.pixel(marker.x), layout.y.pixel(marker.y), i);
  }
}

}  // namespace

std::string to_svg(const HeatMap& map, std::string_view id, double margin) {
  check_map(map);
  std::vector<std::string> labels;
  for (const HeatMap::Marker& marker : map.markers) labels.push_back(marker.label);
  if (!map.values.array().isFinite().all()) labels.push_back(map.gap);
  double legend_height = 0;
  const double legend_top = title_height(map.title);
  const auto legend = lay_out_legend(labels, map.width, legend_top, legend_height);
  const MapLayout layout = lay_out(map, legend_top + legend_height + kLabelSize + 12);

  Svg svg;
  svg.raw("<defs>" + hatch(id) + clip(id, layout.frame) + "</defs>\n");
  draw_title(svg, map.title);
  draw_cells(svg, map, layout, id);
  for (Eigen::Index i = 0; i < map.values.rows(); ++i) {
    if (map.outline_row_minimum) outline_row_minimum(svg, map, layout, i);
    if (map.print_values) draw_row_values(svg, map, layout, i);
  }
  draw_x_axis(svg, layout.frame, layout.x, map.x_axis, Grid::none, layout.slant);
  draw_y_axis(svg, layout.frame, layout.y, map.y_axis, Grid::none);
  draw_colour_bar(svg, map, layout.frame, layout.colour);
  draw_markers(svg, map, layout);
  for (std::size_t i = 0; i < legend.size(); ++i) {
    const double middle = legend[i].y + kLegendRow / 2;
    if (i < map.markers.size()) {
      draw_map_marker(svg, legend[i].x + 14, middle, i);
    } else {
      svg.rect(legend[i].x + 4, middle - 7, 20, 14,
               fmt::format("fill=\"url(#{}-hatch)\"", escape_xml(id)));
    }
    draw_legend_label(svg, legend[i]);
  }
  return svg.document(map.width, map.height, margin, map.title,
                      root_attributes(layout.frame, layout.x));
}

}  // namespace weft
