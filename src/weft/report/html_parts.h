#pragma once
/// Pieces that the sections of a report's page share.
#include <fmt/format.h>

#include <string>
#include <string_view>
#include <vector>

#include "weft/report/pictures.h"
#include "weft/report/plot.h"
#include "weft/report/text.h"

namespace weft::detail {

inline constexpr int kPlotWidth = 570;       // px
inline constexpr int kSmallPlotWidth = 360;  // px

inline std::string escaped(std::string_view text) { return escape_xml(text); }
/// "0.52 %", "12.3 %".
std::string percent(double value);
std::string millimetres(double metres);
std::string data_uri(const EncodedPicture& picture);
/// A cell that names its column, which narrow screens show.
std::string cell(std::string_view name, std::string_view markup, std::string_view classes = {});
/// A bar of a map's colours from left to right, as a CSS gradient.
std::string gradient(ColourMap map);

/// Numbers the plots of one page, so that ids and file names differ.
struct PlotPlacer {
  int count = 0;

  /// `along`: "frame" or "time" where a viewer's cursor runs along the x axis.
  template <typename Plot>
  std::string operator()(const Plot& plot, std::string_view caption, std::string_view along = {}) {
    const std::string id = fmt::format("plot-{}", ++count);
    return figure(id, to_svg(plot, id), to_csv(plot), caption, along);
  }

 private:
  static std::string figure(const std::string& id, std::string svg, const std::string& csv,
                            std::string_view caption, std::string_view along);
};

/// Small plots side by side, one of each of `items`.
template <typename Item>
std::string small_figures(const std::vector<Item>& items, LinePlot (*plot_of)(const Item&),
                          PlotPlacer& place) {
  std::string html = "<div class=\"figures small\">\n";
  for (const Item& item : items) {
    LinePlot plot = plot_of(item);
    plot.width = kSmallPlotWidth;
    html += place(plot, "");
  }
  return html + "</div>\n";
}

}  // namespace weft::detail
