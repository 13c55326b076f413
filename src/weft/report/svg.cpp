#include "weft/report/svg.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "weft/report/text.h"

namespace weft {

std::string px(double value) {
  std::string text = fmt::format("{:.2f}", value);
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text == "-0" ? "0" : text;
}

double text_width(std::string_view text, double size) {
  const auto continuation = [](char c) { return (static_cast<unsigned char>(c) & 0xC0) == 0x80; };
  const auto bytes = static_cast<double>(text.size());
  return 0.6 * size * (bytes - static_cast<double>(std::ranges::count_if(text, continuation)));
}

void Svg::element(std::string_view start, std::string_view attributes, std::string_view name,
                  std::string_view tooltip) {
  body_ += fmt::format("<{} {}", start, attributes);
  if (tooltip.empty()) {
    body_ += "/>\n";
  } else {
    body_ += fmt::format("><title>{}</title></{}>\n", escape_xml(tooltip), name);
  }
}

void Svg::line(double x1, double y1, double x2, double y2, std::string_view attributes) {
  element(
      fmt::format("line x1=\"{}\" y1=\"{}\" x2=\"{}\" y2=\"{}\"", px(x1), px(y1), px(x2), px(y2)),
      attributes, "line", {});
}

void Svg::rect(double x, double y, double width, double height, std::string_view attributes,
               std::string_view tooltip) {
  element(fmt::format("rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"", px(x), px(y),
                      px(std::max(0.0, width)), px(std::max(0.0, height))),
          attributes, "rect", tooltip);
}

void Svg::circle(double x, double y, double radius, std::string_view attributes,
                 std::string_view tooltip) {
  element(fmt::format("circle cx=\"{}\" cy=\"{}\" r=\"{}\"", px(x), px(y), px(radius)), attributes,
          "circle", tooltip);
}

void Svg::path(std::string_view d, std::string_view attributes, std::string_view tooltip) {
  element(fmt::format("path d=\"{}\"", d), attributes, "path", tooltip);
}

void Svg::text(double x, double y, std::string_view attributes, std::string_view content) {
  body_ += fmt::format("<text x=\"{}\" y=\"{}\" {}>{}</text>\n", px(x), px(y), attributes,
                       escape_xml(content));
}

void Svg::open(std::string_view attributes) { body_ += fmt::format("<g {}>\n", attributes); }
void Svg::close() { body_ += "</g>\n"; }
void Svg::raw(std::string_view markup) { body_ += markup; }

std::string Svg::document(double width, double height, double margin, std::string_view title,
                          std::string_view attributes) const {
  return fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"weft-plot\" width=\"{0}\" height=\"{1}\" "
      "viewBox=\"{2} {2} {0} {1}\" role=\"img\" aria-label=\"{3}\" "
      "font-family=\"system-ui, 'Segoe UI', Helvetica, Arial, 'DejaVu Sans', sans-serif\" "
      "font-size=\"12\" {4}>\n"
      "<rect class=\"ground\" x=\"{2}\" y=\"{2}\" width=\"{0}\" height=\"{1}\" "
      "fill=\"#ffffff\"/>\n{5}</svg>\n",
      px(width + 2 * margin), px(height + 2 * margin), px(-margin), escape_xml(title), attributes,
      body_);
}

}  // namespace weft
