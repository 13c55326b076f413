#include "weft/report/mechanical_html.h"

#include <cmath>
#include <numbers>

namespace weft::detail {
namespace {

std::string heading(std::string_view id, std::string_view title) {
  return fmt::format("<section id=\"{0}\"><h2>{1}{2}</h2>\n", id, title,
                     id.starts_with("tests") ? " by the mechanical tests" : "");
}

std::string force_cell(const ReportMechanical& c) {
  return c.force_count == 0 ? "not measured" : format_short(c.force_rms, 3) + " N";
}

std::string distance_cell(const ReportMechanical& c, double ReportDistance::*member) {
  return c.distance ? millimetres((*c.distance).*member) : "–";
}

int frames_without_equilibrium(const ReportMechanical& capture) {
  int count = 0;
  for (const ReportMechanicalFrame& frame : capture.frames) count += frame.converged ? 0 : 1;
  return count;
}

/// One row a test, as in Table 2 of Miguel et al. 2012.
std::string table_of_tests(const MechanicalReport& report) {
  std::string html =
      "<table><thead><tr><th>Test</th><th class=\"n\">Force, rms</th><th class=\"n\">of the "
      "largest</th><th class=\"n\">largest measured</th><th class=\"n\">Distance, mean</th>"
      "<th class=\"n\">largest</th><th class=\"n\">Frames without equilibrium</th></tr></thead>"
      "<tbody>\n";
  for (const ReportMechanical& c : report.captures) {
    html += "<tr>" + cell("Test", fmt::format("<b>{}</b>", escaped(c.name)), "lead");
    html += cell("Force, rms", force_cell(c), "n");
    html += cell("of the largest", c.force_count == 0 ? "–" : percent(100 * c.force_relative), "n");
    html += cell("largest measured",
                 c.force_count == 0 ? "–" : format_short(c.force_largest, 3) + " N", "n");
    html += cell("Distance, mean", distance_cell(c, &ReportDistance::mean), "n");
    html += cell("largest", distance_cell(c, &ReportDistance::max), "n");
    html += cell("Frames without equilibrium", std::to_string(frames_without_equilibrium(c)), "n");
    html += "</tr>\n";
  }
  return html + "</tbody></table>\n";
}

std::string picture(const EncodedPicture& image, std::string_view alt) {
  return fmt::format("<img alt=\"{}\" width=\"{}\" height=\"{}\" src=\"{}\">", escaped(alt),
                     image.width, image.height, data_uri(image));
}

std::string shapes(const ReportMechanical& c) {
  if (c.shapes.empty()) return "";
  std::string html = "<div class=\"shapes\">\n";
  for (const ReportShape& shape : c.shapes) {
    html += fmt::format(
        "<figure><div class=\"pair\">{}{}</div><figcaption>{}easured, and computed with "
        "its distance to the measured shape</figcaption></figure>\n",
        picture(shape.measured, fmt::format("{}, frame {}, measured", c.name, shape.frame)),
        picture(shape.computed, fmt::format("{}, frame {}, computed", c.name, shape.frame)),
        c.frames.size() > 1 ? fmt::format("Frame {}: m", shape.frame) : "M");
  }
  return html + fmt::format(
                    "</div>\n<p class=\"minor\"><span class=\"key\">0 <span class=\"scale\" "
                    "style=\"background:{}\"></span> {} and more</span></p>\n",
                    gradient(ColourMap::viridis), millimetres(c.full_distance));
}

std::string match_of(const ReportMechanical& c, PlotPlacer& place) {
  std::string html = fmt::format("<div class=\"capture\"><h3>{}</h3>\n", escaped(c.name));
  html += shapes(c);
  html += "<div class=\"figures\">\n";
  LinePlot force = force_plot(c);
  force.width = kPlotWidth;
  if (!force.series.empty())
    html += place(force,
                  "Component along the direction of the largest measured force of each clip. The "
                  "band is the 90 % interval that the parameters' uncertainty gives.");
  LinePlot distance = shape_distance_plot(c);
  distance.width = kPlotWidth;
  if (distance.series.front().x.size() > 1)
    html += place(distance, "At the same point of the fabric, outside the clips.", "frame");
  html += "</div>\n";
  if (!c.strains.empty()) {
    html +=
        "<h4>Strains that occur</h4>\n<p class=\"minor\">By area, over all frames; the outermost "
        "0.5 % on either side are left out. A parameter whose strain does not occur is not "
        "determined by this test.</p>\n";
    html += small_figures(c.strains, strain_plot, place);
  }
  return html + "</div>\n";
}

}  // namespace

std::string mechanical_measured_section(const MechanicalReport& report, std::string_view id) {
  if (report.captures.empty()) return "";
  std::string html =
      heading(id, "What was measured") +
      "<table><thead><tr><th>Test</th>"
      "<th>Swatch</th><th>Weft at</th><th>Areal density</th><th>Frames</th><th>Force components"
      "</th><th>Points of the shape</th></tr></thead><tbody>\n";
  for (const ReportMechanical& c : report.captures) {
    html += "<tr>" + cell("Test",
                          fmt::format("<b>{}</b><div class=\"minor\">{}</div>", escaped(c.name),
                                      escaped(c.description)),
                          "lead");
    html += cell("Swatch", fmt::format("{} × {} m", format_short(c.width), format_short(c.height)));
    html += cell("Weft at", format_short(c.grain_angle * 180 / std::numbers::pi) + "°");
    html += cell("Areal density", format_short(c.areal_density) + " kg/m²");
    html += cell("Frames", std::to_string(c.frames.size()));
    html += cell("Force components", std::to_string(c.force_count));
    html +=
        cell("Points of the shape", c.point_count == 0 ? "none" : std::to_string(c.point_count));
    html += "</tr>\n";
  }
  return html + "</tbody></table></section>\n";
}

std::string mechanical_match_section(const MechanicalReport& report, std::string_view id,
                                     PlotPlacer& place) {
  if (report.captures.empty()) return "";
  std::string html = heading(id, "How well it matches");
  html += table_of_tests(report);
  for (const ReportMechanical& capture : report.captures) html += match_of(capture, place);
  return html + "</section>\n";
}

std::string response_figures(const MechanicalReport& report, PlotPlacer& place) {
  if (report.responses.empty()) return "";
  return "<h3>The fabric's curves</h3>\n<p class=\"minor\">Of a homogeneous sheet, the other "
         "strains held at zero, over the strains that occur. Bands: 90 % intervals.</p>\n" +
         small_figures(report.responses, response_plot, place);
}

}  // namespace weft::detail
