#include "weft/report/mechanical_html.h"

#include <fmt/ranges.h>

#include <algorithm>
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

std::string pose_cell(const ReportMechanical& c) {
  if (!c.pose) return "–";
  return millimetres(c.pose->position) + ", " + format_short(1e3 * c.pose->rotation, 3) + " mrad";
}

/// One row a test, as in Table 2 of Miguel et al. 2012.
std::string table_of_tests(const MechanicalReport& report) {
  const bool poses = std::ranges::any_of(
      report.captures, [](const ReportMechanical& c) { return c.pose.has_value(); });
  std::string html =
      "<table><thead><tr><th>Test</th><th class=\"n\">Force, rms</th><th class=\"n\">of the "
      "largest</th><th class=\"n\">largest measured</th><th class=\"n\">Distance, mean</th>"
      "<th class=\"n\">largest</th>";
  if (poses) html += "<th class=\"n\">Pose of loaded clips, rms</th>";
  html += "<th class=\"n\">Frames without equilibrium</th></tr></thead><tbody>\n";
  for (const ReportMechanical& c : report.captures) {
    html += "<tr>" + cell("Test", fmt::format("<b>{}</b>", escaped(c.name)), "lead");
    html += cell("Force, rms", force_cell(c), "n");
    html += cell("of the largest", c.force_count == 0 ? "–" : percent(100 * c.force_relative), "n");
    html += cell("largest measured",
                 c.force_count == 0 ? "–" : format_short(c.force_largest, 3) + " N", "n");
    html += cell("Distance, mean", distance_cell(c, &ReportDistance::mean), "n");
    html += cell("largest", distance_cell(c, &ReportDistance::max), "n");
    if (poses) html += cell("Pose of loaded clips, rms", pose_cell(c), "n");
    html += cell("Frames without equilibrium", std::to_string(frames_without_equilibrium(c)), "n");
    html += "</tr>\n";
  }
  return html + "</tbody></table>\n";
}

/// Head of a table: the first column holds names, the others numbers; `detail` beside the names.
std::string table_head(std::string_view name, const std::vector<std::string_view>& numbers,
                       std::string_view detail = "") {
  std::string html = fmt::format("<table><thead><tr><th>{}</th>", name);
  if (!detail.empty()) html += fmt::format("<th>{}</th>", detail);
  for (const std::string_view number : numbers)
    html += fmt::format("<th class=\"n\">{}</th>", number);
  return html + "</tr></thead><tbody>\n";
}

std::string name_cell(std::string_view column, std::string_view name,
                      std::string_view detail = "") {
  return cell(
      column,
      fmt::format(
          "<b>{}</b>{}", escaped(name),
          detail.empty() ? "" : fmt::format("<div class=\"minor\">{}</div>", escaped(detail))),
      "lead");
}

std::string interval(double lower, double upper) {
  if (!std::isfinite(upper)) return "unbounded";
  return format_value(lower) + " to " + format_value(upper);
}

std::string table_of_clamps(const MechanicalReport& report) {
  std::string rows;
  for (const ReportMechanical& c : report.captures) {
    for (const ReportClampForce& clamp : c.clamps) {
      rows += "<tr>" + name_cell("Test", c.name) + cell("Clamp", escaped(clamp.name));
      rows += cell("Measured", clamp.measured ? format_value(*clamp.measured) + " N" : "–", "n");
      rows += cell("Noise", clamp.measured ? format_short(clamp.noise, 3) + " N" : "–", "n");
      rows += cell("Computed", format_value(clamp.computed) + " N", "n");
      rows += cell("Difference",
                   clamp.measured ? format_value(clamp.computed - *clamp.measured, 2) + " N" : "–",
                   "n");
      rows += "</tr>\n";
    }
  }
  if (rows.empty()) return "";
  return "<h3>Forces of the clamps</h3>\n<p class=\"minor\">Magnitudes. The noise is the standard "
         "deviation that the capture states.</p>\n" +
         table_head("Test", {"Measured", "Noise", "Computed", "Difference"}, "Clamp") + rows +
         "</tbody></table>\n";
}

std::string table_of_overhangs(const MechanicalReport& report) {
  std::string rows;
  for (const ReportMechanical& c : report.captures) {
    if (!c.overhang) continue;
    const ReportOverhang& o = *c.overhang;
    const bool known = std::isfinite(o.computed);
    rows += "<tr>" + name_cell("Test", c.name);
    rows += cell("Readings", std::to_string(o.measured.size()), "n");
    rows += cell("Measured, mean", millimetres(o.mean()), "n");
    rows += cell("Deviation of one", millimetres(o.deviation), "n");
    rows += cell("Computed", known ? millimetres(o.computed) : "none", "n");
    rows += cell("90 % interval",
                 o.lower && o.upper ? millimetres(*o.lower) + " to " + millimetres(*o.upper) : "–",
                 "n");
    rows += cell("Difference",
                 known ? fmt::format("{:.2f} mm", 1e3 * (o.computed - o.mean())) : "–", "n");
    rows += "</tr>\n";
  }
  if (rows.empty()) return "";
  return "<h3>Overhangs</h3>\n<p class=\"minor\">At which the line from the edge to the middle of "
         "the tip is at the angle of the inclined plane. The interval is what the uncertainty of "
         "the parameters gives.</p>\n" +
         table_head("Test", {"Readings", "Measured, mean", "Deviation of one", "Computed",
                             "90 % interval", "Difference"}) +
         rows + "</tbody></table>\n";
}

std::string table_of_registrations(const MechanicalReport& report) {
  std::string rows;
  for (const ReportMechanical& c : report.captures) {
    if (!c.registration) continue;
    const ReportRegistration& r = *c.registration;
    rows += "<tr>" + name_cell("Raw scan", c.name);
    rows += cell("Points used", fmt::format("{} of {}", r.inliers, r.points), "n");
    rows += cell("Distance, median", millimetres(r.residual_median), "n");
    rows += cell("95 % are within", millimetres(r.residual_95), "n");
    rows += cell("Strain, rms", percent(100 * r.strain_rms), "n");
    rows += cell("Vertices without support",
                 fmt::format("{} of {} ({})", r.unsupported, r.vertices,
                             percent(100.0 * r.unsupported / std::max(r.vertices, 1))),
                 "n");
    rows += "</tr>\n";
  }
  if (rows.empty()) return "";
  return "<h3>How the grids lie on the raw scans</h3>\n<p class=\"minor\">Distance of the points "
         "that were used to the grid. Vertices without support have hardly any points of the scan "
         "about them; their places count little.</p>\n" +
         table_head("Raw scan", {"Points used", "Distance, median", "95 % are within",
                                 "Strain, rms", "Vertices without support"}) +
         rows + "</tbody></table>\n";
}

std::string table_of_moduli(const MechanicalReport& report) {
  if (report.moduli.empty()) return "";
  std::string html =
      "<h3>As moduli</h3>\n<table><thead><tr><th>Modulus</th><th class=\"n\">Value</th>"
      "<th class=\"n\">90 % interval</th><th>Unit</th></tr></thead><tbody>\n";
  for (const ReportModulus& m : report.moduli) {
    html += "<tr class=\"parameter\">" + name_cell("Modulus", m.name, m.meaning);
    html += cell("Value", "<span class=\"value\">" + format_value(m.value) + "</span>", "n");
    html += cell("90 % interval", m.lower && m.upper ? interval(*m.lower, *m.upper) : "–", "n");
    html += cell("Unit", escaped(format_unit(m.unit)));
    html += "</tr>\n";
  }
  return html + "</tbody></table>\n";
}

std::string table_of_cords(const MechanicalReport& report) {
  std::string rows;
  for (const ReportMechanical& c : report.captures) {
    if (!c.cord_friction) continue;
    const ReportCordFriction& f = *c.cord_friction;
    rows += "<tr>" + name_cell("Test", c.name);
    rows += cell("Friction", format_value(f.value) + " N", "n");
    rows += cell("90 % interval", f.determined ? interval(f.lower, f.upper) + " N" : "–", "n");
    rows += cell("", f.determined ? "<span class=\"status fine\">determined</span>"
                                  : "<span class=\"status warn\">▲ not determined</span>");
    rows += "</tr>\n";
  }
  if (rows.empty()) return "";
  return "<h3>Friction of the cords</h3>\n<p class=\"minor\">That pull the clips: found with the "
         "fabric, and part of the computed forces.</p>\n"
         "<table><thead><tr><th>Test</th><th class=\"n\">Friction</th><th class=\"n\">90 % "
         "interval</th><th></th></tr></thead><tbody>\n" +
         rows + "</tbody></table>\n";
}

std::string comma_separated(const std::vector<std::string>& names) {
  return fmt::format("{}", fmt::join(names, ", "));
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
  if (!c.loaded.empty()) {
    LinePlot loaded = loaded_plot(c);
    loaded.width = kPlotWidth;
    html += place(loaded,
                  "Along the largest force, from where the clip was measured at the first frame. "
                  "The band is the 90 % interval that the parameters' uncertainty gives.");
  }
  LinePlot distance = shape_distance_plot(c);
  distance.width = kPlotWidth;
  if (c.overhang && !c.overhang->x.empty()) {
    html +=
        place(overhang_plot(*c.overhang, kPlotWidth),
              "The middle of the computed strip, clamped at the edge. Where its tip is above the "
              "plane, the computed strip overhangs further than was read.");
  }
  if (distance.series.front().x.size() > 1)
    html += place(distance, "At the same point of the fabric, outside the clips.", "frame");
  html += "</div>\n";
  if (!c.strains.empty()) {
    html +=
        "<h4>Strains that occur</h4>\n<p class=\"minor\">By area, over all frames; the outermost "
        "0.5 % on either side are left out. A parameter whose strain does not occur is not "
        "determined by this test. The diagonals bend half as much as the threads where only these "
        "do, which says nothing of the diagonal bend.</p>\n";
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
    html += cell("Points of the shape",
                 c.overhang ? fmt::format("{} readings of an overhang", c.overhang->measured.size())
                 : c.point_count == 0 ? "none"
                                      : std::to_string(c.point_count));
    html += "</tr>\n";
  }
  return html + "</tbody></table>\n" + table_of_registrations(report) + "</section>\n";
}

std::string mechanical_match_section(const MechanicalReport& report, std::string_view id,
                                     PlotPlacer& place) {
  if (report.captures.empty()) return "";
  std::string html = heading(id, "How well it matches");
  html += table_of_tests(report) + table_of_overhangs(report) + table_of_clamps(report);
  for (const ReportMechanical& capture : report.captures) html += match_of(capture, place);
  return html + "</section>\n";
}

std::string found_tables(const MechanicalReport& report) {
  return table_of_moduli(report) + table_of_cords(report);
}

std::string stage_table(const MechanicalReport& report) {
  if (report.stages.empty()) return "";
  const bool halved = std::ranges::any_of(report.stages, [](const ReportStage& stage) {
    return std::isfinite(stage.error_on_halved_cells);
  });
  std::string html =
      "<h3>Stages</h3>\n<p class=\"minor\">The fits one after the other, each of what it is named "
      "after, to the tests that isolate it. Errors are of these tests "
      "alone.</p>\n<table><thead><tr>"
      "<th>Stage</th><th>Tests</th><th class=\"n\">Pass</th><th class=\"n\">Control points</th>"
      "<th class=\"n\">Error before</th><th class=\"n\">after</th>";
  if (halved) html += "<th class=\"n\">on halved cells</th>";
  html += "<th class=\"n\">Evaluations</th><th></th></tr></thead><tbody>\n";
  for (const ReportStage& stage : report.stages) {
    html += "<tr>" + name_cell("Stage", stage.name);
    html += cell("Tests", escaped(comma_separated(stage.captures)));
    html += cell("Pass", std::to_string(stage.pass), "n");
    html += cell("Control points", std::to_string(stage.points), "n");
    html += cell("Error before", format_value(stage.error_initial), "n");
    html += cell("after", format_value(stage.error), "n");
    if (halved)
      html += cell("on halved cells",
                   std::isfinite(stage.error_on_halved_cells)
                       ? format_value(stage.error_on_halved_cells)
                       : "–",
                   "n");
    html += cell("Evaluations", std::to_string(stage.evaluations), "n");
    html += cell("", stage.kept ? "" : "<span class=\"status held\">not kept</span>");
    html += "</tr>\n";
  }
  return html + "</tbody></table>\n";
}

std::string response_figures(const MechanicalReport& report, PlotPlacer& place) {
  if (report.responses.empty() && report.response_remark.empty()) return "";
  const bool loops = std::ranges::any_of(
      report.responses, [](const ReportResponse& response) { return !response.turns.empty(); });
  std::string html =
      "<h3>The fabric's curves</h3>\n<p class=\"minor\">Of a homogeneous sheet, the other strains "
      "held at zero (the diagonal bend, of a strip on the bias, bends weft and warp half as much), "
      "over the strains that occur. Bands: 90 % intervals.";
  if (loops)
    html += " Internal friction makes loops: from rest to the largest strain, to the least, back.";
  if (!report.response_remark.empty()) html += " " + escaped(report.response_remark);
  return html + "</p>\n" + small_figures(report.responses, response_plot, place);
}

}  // namespace weft::detail
