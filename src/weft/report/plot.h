#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "weft/base/types.h"
#include "weft/report/colour_map.h"

namespace weft {

/// Lengths are shown in mm: what those in m are multiplied by.
inline constexpr double kMillimetres = 1000;

/// Plots as SVG (vector, selectable text, light background, colours that colour-blind readers tell
/// apart) with the data behind each as CSV. Made to be read at 700 px width. Every element carries
/// a class, so that a page may restyle a plot that it holds inline.
///
/// Values that are not finite are never drawn as if they were numbers: a line breaks there;
/// +infinity (a diverged simulation) is marked by a triangle on the upper edge; a cell of a heat
/// map is hatched.

struct PlotAxis {
  std::string label;
  std::string unit;          ///< printed in brackets after the label; "N m" is set as N·m
  bool logarithmic = false;  ///< values <= 0 count as not finite
  bool integers = false;     ///< marks at whole numbers only
  bool from_zero = false;    ///< the range includes zero (linear axes)
  std::optional<double> lower, upper;  ///< of the range; by default the data's
  /// If not empty, the axis has these at 0, 1, 2 ... instead of numbers (x axis).
  std::vector<std::string> categories;
};

struct PlotSeries {
  enum class Mark { line, points, line_and_points };
  std::string name;  ///< for the legend; empty: not in it
  std::vector<double> x, y;
  Mark mark = Mark::line;
  bool dashed = false;
  int colour = -1;  ///< index into the palette (0 to 7; 0 is black); -1: the next after black
  /// A band from lower to upper around the series, one a point, or both empty.
  std::vector<double> lower, upper;
};

/// A stretch of the x axis with another ground and a word at its top ("validation").
struct PlotRegion {
  double lower = 0, upper = 0;
  std::string label;
};

/// A horizontal line at `value` with a word above it.
struct PlotLevel {
  double value = 0;
  std::string label;
  double label_at = 1;  ///< where along the line, 0 (left end) to 1 (right end)
};

/// A point with a word beside it.
struct PlotNote {
  double x = 0, y = 0;
  std::string text;
};

struct LinePlot {
  std::string title;
  PlotAxis x, y;
  std::vector<PlotSeries> series;
  std::vector<PlotRegion> regions;
  std::vector<PlotLevel> levels;
  std::vector<PlotNote> notes;
  int width = 700, height = 340;  ///< px
};

/// Horizontal bars, first on top, with the value at the end of each.
struct BarChart {
  struct Bar {
    std::string label;
    double value = 0;  ///< infinity: hatched over the whole width
    std::string note;  ///< printed instead of the value where not empty
    bool highlighted = false;
  };
  std::string title;
  PlotAxis
      value;  ///< linear axes start at zero; logarithmic ones at the power of ten below the least
  std::vector<Bar> bars;
  int width = 700;  ///< px; the height follows from the number of bars
};

/// Cells of colour. Row i of `values` belongs to y[i], column j to x[j].
struct HeatMap {
  struct Marker {
    double x = 0, y = 0;
    std::string label;  ///< for the legend
  };
  std::string title;
  PlotAxis x_axis, y_axis;   ///< either may have categories, with x or y then 0, 1, 2 ...
  std::vector<double> x, y;  ///< centres of the cells, increasing
  MatX values;
  std::string label;  ///< of the colour bar
  std::string unit;
  bool logarithmic = false;            ///< colours follow log(value)
  std::optional<double> lower, upper;  ///< of the colours; by default the values'
  std::string gap = "diverged";        ///< what a hatched cell means, for the legend
  bool print_values = false;
  int digits = 3;  ///< significant ones, of printed values
  bool outline_row_minimum = false;
  std::vector<Marker> markers;
  int width = 700;   ///< px
  int height = 460;  ///< px
};

/// The picture. `id` begins the ids inside, so that several can stand in one page; `margin` px are
/// added on all sides. Throws Error for series whose x, y and band differ in length, and heat maps
/// whose shapes do not agree.
std::string to_svg(const LinePlot& plot, std::string_view id = "plot", double margin = 0);
std::string to_svg(const BarChart& chart, std::string_view id = "plot", double margin = 0);
std::string to_svg(const HeatMap& map, std::string_view id = "plot", double margin = 0);

/// The data, one line a point, numbers that read back to the same value (inf, -inf, nan for the
/// rest): `series,X,Y[,lower,upper]`, `label,VALUE,note` and `X,Y,VALUE`, where X, Y and VALUE are
/// labels of axes with their units. Categories are written as text.
std::string to_csv(const LinePlot& plot);
std::string to_csv(const BarChart& chart);
std::string to_csv(const HeatMap& map);

/// Writes `path` (.svg) and the data next to it (.csv). Throws Error if a file cannot be written.
void write_plot(const std::filesystem::path& path, const LinePlot& plot);
void write_plot(const std::filesystem::path& path, const BarChart& chart);
void write_plot(const std::filesystem::path& path, const HeatMap& map);

/// Reads what to_csv(LinePlot) writes, or any CSV with a header and the columns series, x, y by
/// position: the series in the order of their first appearance. Throws Error with file and line.
std::vector<PlotSeries> read_series_csv(const std::filesystem::path& path);

/// The colour of a series.
Rgb palette(int index);

}  // namespace weft
