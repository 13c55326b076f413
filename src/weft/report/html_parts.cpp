#include "weft/report/html_parts.h"

#include <cmath>

namespace weft::detail {

std::string percent(double value) {
  return format_value(value, std::abs(value) < 10 ? 2 : 3) + " %";
}

std::string millimetres(double metres) { return format_value(1000 * metres, 3) + " mm"; }

std::string data_uri(const EncodedPicture& picture) {
  return "data:" + picture.mime + ";base64," + base64(picture.bytes);
}

std::string cell(std::string_view name, std::string_view markup, std::string_view classes) {
  return fmt::format("<td{} data-name=\"{}\">{}</td>",
                     classes.empty() ? "" : fmt::format(" class=\"{}\"", classes), escaped(name),
                     markup);
}

std::string gradient(ColourMap map) {
  constexpr int kStops = 24;
  std::string stops;
  for (int i = 0; i <= kStops; ++i) {
    if (i > 0) stops += ',';
    stops += hex(colour_at(map, static_cast<double>(i) / kStops));
  }
  return fmt::format("linear-gradient(90deg,{})", stops);
}

std::string PlotPlacer::figure(const std::string& id, std::string svg, const std::string& csv,
                               std::string_view caption, std::string_view along) {
  // Inside HTML the name space is understood, and the page stays free of addresses.
  constexpr std::string_view kNameSpace = " xmlns=\"http://www.w3.org/2000/svg\"";
  if (const auto at = svg.find(kNameSpace); at != std::string::npos)
    svg.erase(at, kNameSpace.size());
  const std::vector<std::uint8_t> bytes(csv.begin(), csv.end());
  return fmt::format(
      "<figure class=\"plot\"{}><div class=\"scroll\">{}</div><figcaption>{} "
      "<a class=\"data\" download=\"{}.csv\" href=\"data:text/csv;charset=utf-8;base64,{}\">"
      "Data (CSV)</a></figcaption></figure>\n",
      along.empty() ? "" : fmt::format(" data-along=\"{}\"", along), svg, escaped(caption), id,
      base64(bytes));
}

}  // namespace weft::detail
