#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <istream>

#include "weft/base/error.h"
#include "weft/base/number_text.h"
#include "weft/base/text_file.h"
#include "weft/report/plot.h"
#include "weft/report/text.h"

namespace weft {
namespace {

std::string column_name(const PlotAxis& axis, std::string_view otherwise) {
  std::string name = axis.label.empty() ? std::string(otherwise) : axis.label;
  if (!axis.unit.empty()) name += " (" + axis.unit + ")";
  return csv_field(name);
}

std::string coordinate(const PlotAxis& axis, double value) {
  const double index = std::round(value);
  if (index == value && index >= 0 && index < static_cast<double>(axis.categories.size())) {
    return csv_field(axis.categories[static_cast<std::size_t>(index)]);
  }
  return csv_number(value);
}

template <typename Plot>
void write_both(const std::filesystem::path& path, const Plot& plot) {
  write_text(path, to_svg(plot, "plot", 12));
  write_text(std::filesystem::path(path).replace_extension(".csv"), to_csv(plot));
}

/// The fields of the next record, which may span lines; false at the end. `line` counts lines read.
bool read_record(std::istream& in, std::vector<std::string>& fields, int& line) {
  fields.assign(1, "");
  bool quoted = false, any = false;
  ++line;
  for (int c = in.get(); c != std::istream::traits_type::eof(); c = in.get()) {
    any = true;
    const char character = static_cast<char>(c);
    if (quoted) {
      if (character == '"' && in.peek() == '"') {
        fields.back() += static_cast<char>(in.get());
      } else if (character == '"') {
        quoted = false;
      } else {
        if (character == '\n') ++line;
        fields.back() += character;
      }
    } else if (character == '"') {
      quoted = true;
    } else if (character == ',') {
      fields.emplace_back();
    } else if (character == '\n') {
      return true;
    } else if (character != '\r') {
      fields.back() += character;
    }
  }
  return any;
}

double parse_number(const std::string& text, const std::filesystem::path& path, int line) {
  const auto value = number_of<double>(text);
  if (!value) throw Error(fmt::format("{}:{}: \"{}\" is not a number", path.string(), line, text));
  return *value;
}

}  // namespace

std::string to_csv(const LinePlot& plot) {
  bool band = false;
  for (const PlotSeries& series : plot.series) band = band || !series.lower.empty();
  std::string csv = fmt::format("series,{},{}{}\n", column_name(plot.x, "x"),
                                column_name(plot.y, "y"), band ? ",lower,upper" : "");
  for (const PlotSeries& series : plot.series) {
    for (std::size_t i = 0; i < series.x.size(); ++i) {
      csv += fmt::format("{},{},{}", csv_field(series.name), coordinate(plot.x, series.x[i]),
                         csv_number(series.y[i]));
      if (band) {
        csv += series.lower.empty() ? ",,"
                                    : fmt::format(",{},{}", csv_number(series.lower[i]),
                                                  csv_number(series.upper[i]));
      }
      csv += '\n';
    }
  }
  return csv;
}

std::string to_csv(const BarChart& chart) {
  std::string csv = fmt::format("label,{},note\n", column_name(chart.value, "value"));
  for (const BarChart::Bar& bar : chart.bars) {
    csv +=
        fmt::format("{},{},{}\n", csv_field(bar.label), csv_number(bar.value), csv_field(bar.note));
  }
  return csv;
}

std::string to_csv(const HeatMap& map) {
  PlotAxis value;
  value.label = map.label;
  value.unit = map.unit;
  std::string csv = fmt::format("{},{},{}\n", column_name(map.x_axis, "x"),
                                column_name(map.y_axis, "y"), column_name(value, "value"));
  for (Eigen::Index i = 0; i < map.values.rows(); ++i) {
    for (Eigen::Index j = 0; j < map.values.cols(); ++j) {
      csv += fmt::format("{},{},{}\n", coordinate(map.x_axis, map.x[static_cast<std::size_t>(j)]),
                         coordinate(map.y_axis, map.y[static_cast<std::size_t>(i)]),
                         csv_number(map.values(i, j)));
    }
  }
  return csv;
}

void write_plot(const std::filesystem::path& path, const LinePlot& plot) { write_both(path, plot); }
void write_plot(const std::filesystem::path& path, const BarChart& chart) {
  write_both(path, chart);
}
void write_plot(const std::filesystem::path& path, const HeatMap& map) { write_both(path, map); }

std::vector<PlotSeries> read_series_csv(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw Error(path.string() + ": cannot be opened");
  std::vector<PlotSeries> result;
  std::vector<std::string> fields;
  int line = 0;
  if (!read_record(file, fields, line) || fields.size() < 3) {
    throw Error(
        fmt::format("{}:1: a header with the columns series, x, y is needed", path.string()));
  }
  const std::size_t columns = fields.size();
  const bool band = columns == 5 && fields[3] == "lower" && fields[4] == "upper";
  while (read_record(file, fields, line)) {
    if (fields.size() == 1 && fields[0].empty()) continue;
    if (fields.size() != columns) {
      throw Error(fmt::format("{}:{}: {} fields, the header has {}", path.string(), line,
                              fields.size(), columns));
    }
    auto series = std::ranges::find(result, fields[0], &PlotSeries::name);
    if (series == result.end()) {
      result.emplace_back().name = fields[0];
      series = result.end() - 1;
    }
    series->x.push_back(parse_number(fields[1], path, line));
    series->y.push_back(parse_number(fields[2], path, line));
    if (band && !fields[3].empty()) {
      series->lower.push_back(parse_number(fields[3], path, line));
      series->upper.push_back(parse_number(fields[4], path, line));
    }
  }
  return result;
}

}  // namespace weft
