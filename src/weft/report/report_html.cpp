#include "weft/report/report_html.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>

#include "weft/base/error.h"
#include "weft/report/colour_map.h"
#include "weft/report/figures.h"
#include "weft/report/html_parts.h"
#include "weft/report/mechanical_html.h"
#include "weft/report/report_assets.h"
#include "weft/report/text.h"

namespace weft::detail {
namespace {

std::string with_unit(double value, const std::string& unit, int digits = 3) {
  const std::string printed = format_unit(unit);
  return format_value(value, digits) + (printed.empty() ? "" : " " + printed);
}

std::string short_with_unit(double value, const std::string& unit) {
  return format_short(value) + " " + format_unit(unit);
}

/// "2026-11-21T08:00:00+00:00" as people write it.
std::string date_text(std::string created) {
  if (created.size() > 10 && created[10] == 'T') created[10] = ' ';
  return created;
}

// ---- Head of the page

std::string tile(std::string_view name, std::string_view number, std::string_view detail) {
  return fmt::format(
      "<div class=\"tile\"><div class=\"name\">{}</div><div class=\"number\">{}</div>"
      "<div class=\"detail\">{}</div></div>\n",
      escaped(name), escaped(number), escaped(detail));
}

std::string error_tile(const Report& report) {
  std::string detail = "at the start " + format_value(report.error_initial);
  if (std::isfinite(report.error) && std::isfinite(report.error_initial) &&
      report.error_initial > 0) {
    detail += fmt::format(", {} of it left", percent(100 * report.error / report.error_initial));
  }
  return tile("Error", format_value(report.error), detail);
}

std::string parameters_tile(const Report& report) {
  std::size_t free = 0, sound = 0, examined = 0;
  for (const ReportParameter& p : report.parameters) {
    if (!is_searched(p)) continue;
    ++free;
    if (p.variability_percent || p.interval_upper || !p.determined) ++examined;
    if (p.determined && p.at_bound == ReportParameter::Bound::none) ++sound;
  }
  if (examined == 0)
    return tile("Parameters", fmt::format("{} fitted", free), "certainty not computed");
  return tile("Parameters", fmt::format("{} of {}", sound, free),
              "determined, and inside their range");
}

/// Over the fit frames, or the validation frames where those have no truth.
std::string distance_tile(const Report& report) {
  for (const auto kind : {ReportFrame::Kind::fit, ReportFrame::Kind::validation}) {
    double sum = 0;
    std::size_t frames = 0;
    for (const ReportCapture& capture : report.captures) {
      const auto means = report_means(capture, kind);
      if (!means || !means->distance) continue;
      sum += means->distance->mean * static_cast<double>(means->frames);
      frames += means->frames;
    }
    if (frames == 0) continue;
    return tile("Mean distance to the truth", millimetres(sum / static_cast<double>(frames)),
                fmt::format("over {} {} frames", frames,
                            kind == ReportFrame::Kind::fit ? "fit" : "validation"));
  }
  return "";
}

std::string head(const Report& report) {
  std::string subtitle;
  for (const std::string& part : {report.fabric, report.model, date_text(report.created)}) {
    if (!part.empty()) subtitle += (subtitle.empty() ? "" : " · ") + escaped(part);
  }
  std::string html = fmt::format(
      "<header class=\"page\">\n<div class=\"brand\">weft {}</div>\n<h1>{}</h1>\n"
      "<p class=\"subtitle\">{}</p>\n",
      escaped(report.program_version), escaped(report.title), subtitle);
  const auto warnings = report_warnings(report);
  if (warnings.empty()) {
    const bool examined = std::all_of(
        report.parameters.begin(), report.parameters.end(), [](const ReportParameter& p) {
          return !p.free || p.variability_percent.has_value() || p.interval_upper.has_value();
        });
    html += fmt::format("<p class=\"quiet\" id=\"warnings\">No warnings: the error fell{}</p>\n",
                        examined ? ", every fitted parameter is determined and inside its range."
                                 : ". Whether the data determine each parameter was not examined.");
  } else {
    html +=
        "<section class=\"warnings\" id=\"warnings\"><h2>Before you use these numbers</h2><ul>\n";
    for (const std::string& warning : warnings) html += "<li>" + escaped(warning) + "</li>\n";
    html += "</ul></section>\n";
  }
  html += "<div class=\"tiles\">\n" + error_tile(report) + parameters_tile(report) +
          distance_tile(report) +
          tile("Search", fmt::format("{} evaluations", report.evaluations),
               "in " + format_duration(report.wall_s)) +
          "</div>\n";
  return html;
}

// ---- What was measured

std::size_t count_frames(const ReportCapture& capture, ReportFrame::Kind kind) {
  return static_cast<std::size_t>(std::ranges::count(capture.frames, kind, &ReportFrame::kind));
}

std::string measured_section(const Report& report) {
  if (report.captures.empty()) return "";
  std::string html =
      "<section id=\"measured\"><h2>What was measured</h2>\n<table><thead><tr><th>Capture</th>"
      "<th>Swatch</th><th>Areal density</th><th>Video</th><th>Fit frames</th><th>Validation "
      "frames</th>"
      "<th>Simulated as</th><th>Motion starts from</th></tr></thead><tbody>\n";
  for (const ReportCapture& c : report.captures) {
    const std::size_t validation = count_frames(c, ReportFrame::Kind::validation);
    html += "<tr>";
    html += cell("Capture",
                 fmt::format("<b>{}</b><div class=\"minor\">{}</div>", escaped(c.name),
                             escaped(c.description)),
                 "lead");
    html += cell("Swatch",
                 fmt::format("{} × {}", format_short(c.width), short_with_unit(c.height, "m")));
    html += cell("Areal density", short_with_unit(c.areal_density, "kg/m^2"));
    if (c.hem_width > 0) html += cell("Hem", short_with_unit(c.hem_width, "m"));
    html +=
        cell("Video", fmt::format("{} frames, {}/s", c.frame_count, format_short(c.frame_rate)));
    html += cell("Fit frames", fmt::format("{} to {}", c.fit_first, c.fit_last));
    html += cell("Validation frames", validation == 0 ? "none" : std::to_string(validation));
    html += cell("Simulated as", fmt::format("{} × {} vertices", c.columns, c.rows));
    html += cell("Motion starts from", escaped(c.start));
    html += "</tr>\n";
  }
  return html + "</tbody></table></section>\n";
}

// ---- What was found

/// Position in the range, 0 to 1; an open end of an interval lies at that of the range.
double fraction(const ReportParameter& p, double value) {
  const auto coordinate = [&](double v) {
    switch (p.scale) {
      case ReportParameter::Scale::logarithmic:
        return std::log(std::max(v, 1e-300));
      case ReportParameter::Scale::shifted_logarithmic:
        return std::log1p(std::max(v, 0.0) / 0.1);
      case ReportParameter::Scale::linear:
        break;
    }
    return v;
  };
  const double lower = coordinate(p.lower), upper = coordinate(p.upper);
  const double t = (coordinate(value) - lower) / (upper - lower);
  return std::isnan(t) ? 0.0 : std::clamp(t, 0.0, 1.0);
}

std::string range_bar(const ReportParameter& p) {
  std::string bar;
  const IntervalEnds ends = interval_ends(p);
  const bool shown = p.determined || is_of_prior(p) || ends != IntervalEnds::both;
  if (p.free && shown && ends != IntervalEnds::none) {
    const double left = fraction(p, *p.interval_lower), right = fraction(p, *p.interval_upper);
    bar += fmt::format("<span class=\"interval\" style=\"left:{:.2f}%;width:{:.2f}%\"></span>",
                       100 * left, 100 * (right - left));
  } else if (p.free && p.determined && p.variability_percent &&
             std::isfinite(*p.variability_percent)) {
    const double change = *p.variability_percent / 100 * std::abs(p.value);
    const double left = fraction(p, p.value - change), right = fraction(p, p.value + change);
    bar += fmt::format("<span class=\"interval\" style=\"left:{:.2f}%;width:{:.2f}%\"></span>",
                       100 * left, 100 * (right - left));
  }
  if (p.free) {
    bar += fmt::format("<span class=\"start\" style=\"left:{:.2f}%\" title=\"start: {}\"></span>",
                       100 * fraction(p, p.initial), escaped(with_unit(p.initial, p.unit)));
  }
  bar += fmt::format("<span class=\"estimate\" style=\"left:{:.2f}%\" title=\"{}\"></span>",
                     100 * fraction(p, p.value), escaped(with_unit(p.value, p.unit, 5)));
  return fmt::format(
      "<div class=\"track\">{}</div><div class=\"ends\"><span>{}</span><span>{}</span></div>", bar,
      format_short(p.lower), format_short(p.upper));
}

std::string status_of_undetermined(const ReportParameter& p) {
  if (is_of_prior(p)) return "of its prior";
  switch (interval_ends(p)) {
    case IntervalEnds::lower:
      return "bounded below only";
    case IntervalEnds::upper:
      return "bounded above only";
    default:
      return "not determined";
  }
}

std::string status(const ReportParameter& p) {
  if (!p.free) return "<span class=\"status held\">held</span>";
  std::string text;
  if (!p.determined) text = status_of_undetermined(p);
  if (p.at_bound != ReportParameter::Bound::none) {
    text += (text.empty() ? "" : ", ");
    text += p.at_bound == ReportParameter::Bound::upper ? "at upper end" : "at lower end";
  }
  if (!text.empty()) return fmt::format("<span class=\"status warn\">▲ {}</span>", text);
  if (!p.tied_to.empty())
    return fmt::format("<span class=\"status held\">tied to {}</span>",
                       escaped(in_words(p.tied_to)));
  if (!p.variability_percent && !p.interval_upper)
    return "<span class=\"status held\">not examined</span>";
  return "<span class=\"status fine\">determined</span>";
}

std::string variability_text(const ReportParameter& p) {
  if (!p.free || !p.variability_percent) return "–";
  if (!p.determined || !std::isfinite(*p.variability_percent)) return "unbounded";
  return "± " + format_value(*p.variability_percent, 2) + " %";
}

std::string interval_text(const ReportParameter& p) {
  if (!p.free || !p.interval_lower || !p.interval_upper) return "–";
  return interval_in_words(p, [](double value) { return format_value(value, 3); });
}

bool holds_mesh(const Report& report) {
  return std::ranges::any_of(report.settings, [](const auto& setting) {
    const auto* text = std::get_if<std::string>(&setting.second);
    return setting.first == intervals_setting && text && *text == noise_and_mesh;
  });
}

std::string found_section(const Report& report, const MechanicalReport& mechanical) {
  if (report.parameters.empty()) return "";
  const bool with_intervals = std::ranges::any_of(
      report.parameters, [](const ReportParameter& p) { return p.interval_upper.has_value(); });
  const bool with_variability = std::ranges::any_of(
      report.parameters,
      [](const ReportParameter& p) { return p.variability_percent.has_value(); });
  std::string html =
      "<section id=\"found\"><h2>What was found</h2>\n<table><thead><tr><th>Parameter</th>"
      "<th class=\"n\">Value</th>";
  if (with_intervals) html += "<th class=\"n\">90 % interval</th>";
  if (with_variability || !with_intervals) html += "<th class=\"n\">Variability</th>";
  html += "<th>Unit</th><th>Range searched</th><th></th></tr></thead><tbody>\n";
  for (const ReportParameter& p : report.parameters) {
    const bool weak = !p.free || !p.determined;
    html += fmt::format("<tr class=\"parameter{}\">", weak ? " weak" : "");
    html += cell("Parameter",
                 fmt::format("<b>{}</b><div class=\"minor\">{}</div>", escaped(in_words(p.name)),
                             escaped(p.meaning)),
                 "lead");
    html += cell("Value", "<span class=\"value\">" + format_value(p.value) + "</span>", "n");
    if (with_intervals) html += cell("90 % interval", interval_text(p), "n");
    if (with_variability || !with_intervals) html += cell("Variability", variability_text(p), "n");
    html += cell("Unit", escaped(format_unit(p.unit)));
    html += cell("Range searched", range_bar(p), "range");
    html += cell("", status(p));
    html += "</tr>\n";
  }
  html += "</tbody></table>\n<p class=\"minor\" style=\"margin-top:10px\">";
  if (with_variability)
    html +=
        "Variability is the change of the parameter that raises the error by 1 %: the smaller, the "
        "better the data determine it. ";
  html += "In the bars, the dot is the estimate, the tick where the search started, the shade ";
  html += with_intervals ? "the interval." : "the variability.";
  for (const ReportParameter& p : report.parameters) {
    if (!p.free || !p.prior_median || !p.prior_factor) continue;
    html += fmt::format(" Prior of {}: {} within a factor of {} (68 %).", escaped(in_words(p.name)),
                        escaped(with_unit(*p.prior_median, p.unit)), format_short(*p.prior_factor));
  }
  if (with_intervals) {
    html += fmt::format(
        " The 90 % interval comes from leaving out {} in turn, to first order: what is "
        "wrong in all {} alike is not in it.",
        report.captures.empty() ? "frames" : "blocks of frames, and parts of the picture,",
        report.captures.empty() ? "frames" : "frames and places");
    if (holds_mesh(report))
      html +=
          " What the width of the cells does is in it: to either side twice what the estimate "
          "would "
          "move by on cells of half the width.";
  }
  return html + "</p>\n" + found_tables(mechanical) + "</section>\n";
}

// ---- How well it matches

/// A bar of colours at equal steps of t from 0 to 1.
template <typename ColourOf>
std::string gradient(ColourOf&& colour_of) {
  constexpr int kStops = 24;
  std::string stops;
  for (int i = 0; i <= kStops; ++i) {
    if (i > 0) stops += ',';
    stops += hex(colour_of(static_cast<double>(i) / kStops));
  }
  return fmt::format("linear-gradient(90deg,{})", stops);
}
std::string angle_gradient() {
  return gradient([](double t) { return angle_colour((t - 0.5) * std::numbers::pi); });
}
std::string difference_gradient() {
  return gradient([](double t) { return difference_colour(t * full_difference); });
}

std::string swatch(const char* colour, std::string_view label) {
  return fmt::format(
      "<span class=\"key\"><span class=\"swatch\" style=\"background:{}\"></span>{}</span>", colour,
      label);
}

std::string panel(std::string_view kind, std::string_view title, std::string_view key,
                  const EncodedPicture& size) {
  return fmt::format(
      "<figure class=\"panel {0}\" style=\"grid-area:{0}\"><img alt=\"{1}\" width=\"{2}\" "
      "height=\"{3}\" decoding=\"sync\"><figcaption><span>{1}</span>{4}</figcaption></figure>\n",
      kind, title, size.width, size.height, key);
}

const ReportFrame* find_frame(const ReportCapture& capture, int index) {
  const auto found = std::ranges::find(capture.frames, index, &ReportFrame::index);
  return found == capture.frames.end() ? nullptr : &*found;
}

double time_of(const ReportCapture& capture, int index) {
  if (const ReportFrame* frame = find_frame(capture, index)) return frame->time;
  return capture.frame_rate > 0 ? index / capture.frame_rate : 0;
}

/// The line under the pictures; markup.
std::string readout(const ReportCapture& capture, int index) {
  std::string text = fmt::format("<span>frame <b>{}</b></span><span><b>{:.3f}</b> s</span>", index,
                                 time_of(capture, index));
  const ReportFrame* frame = find_frame(capture, index);
  if (frame == nullptr) return text;
  text += fmt::format(
      "<span>{}</span><span>error <b>{}</b></span><span>fold {} rad²</span>"
      "<span>silhouette {} px</span>",
      frame->validation ? "validation" : "fit", format_value(frame->error),
      format_value(frame->fold), format_value(frame->silhouette));
  if (frame->distance) {
    text += fmt::format("<span>distance mean <b>{}</b>, largest {}</span>",
                        millimetres(frame->distance->mean), millimetres(frame->distance->max));
  }
  return text;
}

/// JSON that may stand inside a script element.
std::string script_json(const nlohmann::json& json) {
  std::string text = json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  for (std::size_t at = text.find('<'); at != std::string::npos; at = text.find('<', at + 6)) {
    text.replace(at, 1, "\\u003c");
  }
  return text;
}

std::string viewer_data(const ReportCapture& capture, const CapturePictures& pictures) {
  nlohmann::json json;
  json["rate"] = capture.frame_rate > 0 ? capture.frame_rate : 30.0;
  const auto collect = [&](const char* key, EncodedPicture FramePictures::*member) {
    for (const FramePictures& frame : pictures.frames) json[key].push_back(data_uri(frame.*member));
  };
  collect("measured", &FramePictures::measured);
  collect("simulated", &FramePictures::simulated);
  collect("silhouettes", &FramePictures::silhouettes);
  collect("measured_angles", &FramePictures::measured_angles);
  collect("simulated_angles", &FramePictures::simulated_angles);
  collect("difference", &FramePictures::difference);
  for (const FramePictures& frame : pictures.frames) {
    json["frames"].push_back(frame.frame);
    json["times"].push_back(time_of(capture, frame.frame));
    json["readouts"].push_back(readout(capture, frame.frame));
  }
  return script_json(json);
}

std::string viewer(const ReportCapture& capture, const CapturePictures& pictures) {
  const FramePictures& first = pictures.frames.front();
  const std::string angle_key = fmt::format(
      "<span class=\"key\">−90° <span class=\"scale\" style=\"background:{}\"></span> 90°</span>",
      angle_gradient());
  const std::string difference_key = fmt::format(
      "<span class=\"key\">0° <span class=\"scale\" style=\"background:{}\"></span> 20°</span>",
      difference_gradient());
  std::string html = "<div class=\"viewer\" tabindex=\"0\" aria-label=\"Frames side by side\">\n";
  html += "<script type=\"application/json\">" + viewer_data(capture, pictures) + "</script>\n";
  html += "<div class=\"panels\">\n";
  html += panel("measured", "Measured", "", first.measured);
  html += panel("simulated", "Simulated", "", first.simulated);
  html += panel("silhouettes", "Silhouettes",
                swatch("#e69f00", "only measured") + swatch("#56b4e9", "only simulated"),
                first.silhouettes);
  html += panel("measured_angles", "Stripe angle, measured", angle_key, first.measured_angles);
  html += panel("simulated_angles", "Stripe angle, simulated", angle_key, first.simulated_angles);
  html += panel("difference", "Difference at folds", difference_key, first.difference);
  html += fmt::format(
      "</div>\n<div class=\"controls\"><button type=\"button\" class=\"play\">▶ Play</button>"
      "<input type=\"range\" min=\"0\" max=\"{}\" value=\"0\" step=\"1\" aria-label=\"Frame\">"
      "<select aria-label=\"Speed\"><option value=\"1\">1×</option><option "
      "value=\"0.5\">½×</option>"
      "<option value=\"0.25\" selected>¼×</option><option "
      "value=\"0.1\">⅒×</option></select></div>\n"
      "<div class=\"readout\">{}</div>\n"
      "<p class=\"hint\">Arrow keys step through the frames; click a plot below to go to its "
      "frame.</p>\n"
      "<noscript><p class=\"hint\">The pictures need scripts to be allowed.</p></noscript></div>\n",
      pictures.frames.size() - 1, readout(capture, first.frame));
  return html;
}

std::string means_row(const char* kind, const std::optional<ReportMeans>& means, bool distances) {
  if (!means) return "";
  std::string html = "<tr>" + cell("", fmt::format("<b>{}</b>", kind), "lead");
  html += cell("Frames", std::to_string(means->frames), "n");
  html += cell("Error", format_value(means->error), "n");
  html += cell("Fold (rad²)", format_value(means->fold), "n");
  html += cell("Silhouette (px)", format_value(means->silhouette), "n");
  if (distances) {
    const auto& d = means->distance;
    html += cell("Distance, mean", d ? millimetres(d->mean) : "–", "n");
    html += cell("rms", d ? millimetres(d->rms) : "–", "n");
    html += cell("largest", d ? millimetres(d->max) : "–", "n");
  }
  return html + "</tr>\n";
}

std::string means_table(const ReportCapture& capture) {
  const auto fit = report_means(capture, ReportFrame::Kind::fit);
  const auto validation = report_means(capture, ReportFrame::Kind::validation);
  const bool distances = (fit && fit->distance) || (validation && validation->distance);
  return fmt::format(
      "<table><thead><tr><th></th><th class=\"n\">Frames</th><th class=\"n\">Error</th>"
      "<th class=\"n\">Fold (rad²)</th><th class=\"n\">Silhouette "
      "(px)</th>{}</tr></thead><tbody>\n{}{}"
      "</tbody></table>\n",
      distances ? "<th class=\"n\">Distance, mean</th><th class=\"n\">rms</th>"
                  "<th class=\"n\">largest</th>"
                : "",
      means_row("Fit frames", fit, distances),
      means_row("Validation frames", validation, distances));
}

std::string match_of(const ReportCapture& capture, const CapturePictures* pictures,
                     PlotPlacer& place) {
  std::string html = fmt::format("<div class=\"capture\"><h3>{}</h3>\n", escaped(capture.name));
  if (!capture.frames.empty()) html += means_table(capture);
  if (pictures != nullptr && !pictures->frames.empty()) html += viewer(capture, *pictures);
  if (!capture.frames.empty()) {
    html += "<div class=\"figures\">\n";
    LinePlot error = error_parts_plot(capture);
    error.width = kPlotWidth;
    html +=
        place(error,
              "Error of each frame (equation 8 of Bhat et al. 2003): squared angle differences at "
              "folds, plus weighted silhouette pixels that differ.",
              "frame");
    LinePlot distance = distance_plot(capture);
    if (!distance.series.front().x.empty()) {
      distance.width = kPlotWidth;
      html +=
          place(distance,
                "Distance between simulated and true surface at the same point of the fabric. The "
                "fit never saw the true surface.",
                "time");
    }
    html += "</div>\n";
  }
  return html + "</div>\n";
}

std::string match_section(const Report& report, const std::vector<CapturePictures>& pictures,
                          PlotPlacer& place) {
  if (report.captures.empty()) return "";
  std::string html = "<section id=\"match\"><h2>How well it matches</h2>\n";
  for (const ReportCapture& capture : report.captures) {
    const auto found = std::ranges::find(pictures, capture.name, &CapturePictures::capture);
    html += match_of(capture, found == pictures.end() ? nullptr : &*found, place);
  }
  return html + "</section>\n";
}

// ---- How sure

std::string condition_text(const ReportCertainty& certainty) {
  return fmt::format(
      "<p class=\"minor\" id=\"condition\">Condition number of the problem: {}{}. Intervals of "
      "{:.0f} % from leaving out {} in turn ({}{}).</p>\n",
      format_value(certainty.condition, 2),
      certainty.condition > largest_condition
          ? " (above 10¹²: some combination of parameters is not determined)"
          : "",
      100 * certainty.confidence, certainty.left_out, certainty.clusters,
      certainty.frames_per_cluster > 1
          ? fmt::format(" or more, {} frames a block", certainty.frames_per_cluster)
          : "");
}

/// A column for each search, the one that was kept marked.
std::string searches_table(const Report& report) {
  if (report.searches.empty()) return "";
  std::string html =
      "<h3>Searches</h3>\n<p class=\"minor\">Whole searches with other draws. A value with ▲ lies "
      "outside of the 90 % interval, which tells of what is near the estimate alone.</p>\n"
      "<div class=\"plot\"><div class=\"scroll\"><table><thead><tr><th>Seed</th>";
  for (const ReportSearch& search : report.searches)
    html += fmt::format("<th class=\"n\">{}{}</th>", search.seed, search.kept ? ", kept" : "");
  html += "<th>Unit</th></tr></thead><tbody>\n";
  const auto row = [&](const std::string& name, const std::string& unit, const auto& text) {
    html += "<tr>" + cell("", "<b>" + escaped(in_words(name)) + "</b>", "lead");
    for (const ReportSearch& search : report.searches)
      html += cell(std::to_string(search.seed), text(search), "n");
    html += cell("Unit", escaped(format_unit(unit))) + "</tr>\n";
  };
  row("error", "", [](const ReportSearch& s) { return format_value(s.error); });
  for (std::size_t i = 0; i < report.parameters.size(); ++i) {
    const ReportParameter& p = report.parameters[i];
    if (!is_searched(p)) continue;
    row(p.name, p.unit, [&](const ReportSearch& s) {
      return (in_interval(p, s.values[i]) ? "" : "▲ ") + format_value(s.values[i], 3);
    });
  }
  return html + "</tbody></table></div></div>\n";
}

std::string sure_section(const Report& report, const MechanicalReport& mechanical,
                         PlotPlacer& place) {
  BarChart chart = variability_chart(report.parameters);
  if (chart.bars.empty() && report.perturbations.empty() && report.surfaces.empty() &&
      !report.certainty && report.searches.empty() && mechanical.responses.empty())
    return "";
  std::string html = "<section id=\"sure\"><h2>How sure</h2>\n";
  if (report.certainty) html += condition_text(*report.certainty);
  html += searches_table(report);
  html += "<div class=\"figures\">\n";
  if (report.certainty && report.certainty->parameters.size() > 1) {
    HeatMap map = correlation_map(*report.certainty);
    map.width = kPlotWidth;
    html += place(map,
                  "Near 1 or −1, two parameters change together without a change of the error: "
                  "their combination is better known than each of them.");
  }
  if (!chart.bars.empty()) {
    chart.width = kPlotWidth;
    html +=
        place(chart,
              "A short bar means that a small change of the parameter is noticed in the error. A "
              "hatched one that the data say nothing about it.");
  }
  for (const ReportSurface& surface : report.surfaces) {
    HeatMap map = surface_map(surface);
    map.width = kPlotWidth;
    map.height = 420;
    html += place(map, fmt::format("The other parameters as estimated{}.",
                                   surface.capture.empty() ? "" : ", capture " + surface.capture));
  }
  html += "</div>\n" + response_figures(mechanical, place);
  if (!report.perturbations.empty()) {
    html +=
        "<h3>Perturbation of each parameter</h3>\n<p class=\"minor\">One parameter changed at a "
        "time "
        "about the estimate; the quadratic gives the variability.</p>\n";
    html += small_figures(report.perturbations, perturbation_plot, place);
  }
  return html + "</section>\n";
}

// ---- Progress, matrix

std::string search_section(const Report& report, const MechanicalReport& mechanical,
                           PlotPlacer& place) {
  if (report.history.empty()) return "";
  std::string html =
      "<section id=\"search\"><h2>Progress of the search</h2>\n<div class=\"figures\">\n";
  LinePlot errors = search_plot(report.history);
  errors.width = kPlotWidth;
  errors.title = "Error";
  html +=
      place(errors,
            "One point an evaluation; triangles at the upper edge are simulations that diverged. "
            "Phases may compare different numbers of frames, so their errors are not comparable.");
  const bool cooled = std::ranges::any_of(
      report.history, [](const ReportHistoryPoint& point) { return point.temperature > 0; });
  if (cooled) {
    LinePlot temperature = temperature_plot(report.history);
    temperature.width = kPlotWidth;
    html +=
        place(temperature,
              "At a high temperature the search accepts worse points often, at a low one hardly.");
  }
  return html + "</div>\n" + stage_table(mechanical) + "</section>\n";
}

std::string matrix_section(const Report& report, PlotPlacer& place) {
  if (!report.matrix || report.matrix->error.size() == 0) return "";
  LinePlot lines = matrix_plot(*report.matrix);
  HeatMap table = matrix_map(*report.matrix);
  lines.width = table.width = kPlotWidth;
  lines.title = table.title = "";
  return "<section id=\"matrix\"><h2>Fabrics against captures</h2>\n<div class=\"figures\">\n" +
         place(table,
               "Error of each fabric's parameters on each capture; the least of each row is "
               "outlined.") +
         place(lines, "The same, a line a capture. Each should be lowest at its own fabric.") +
         "</div></section>\n";
}

// ---- How it was made

std::string value_text(const ReportValue& value) {
  if (const bool* flag = std::get_if<bool>(&value)) return *flag ? "yes" : "no";
  if (const double* number = std::get_if<double>(&value)) return format_short(*number, 6);
  if (const auto* integer = std::get_if<std::int64_t>(&value)) return std::to_string(*integer);
  return std::get<std::string>(value);
}

std::string made_section(const Report& report) {
  std::string html = "<section id=\"made\"><h2>How it was made</h2>\n";
  if (!report.command.empty()) html += "<pre>" + escaped(report.command) + "</pre>\n";
  const auto fact = [&](const char* name, const std::string& text) {
    return text.empty() ? "" : fmt::format("<dt>{}</dt><dd>{}</dd>\n", name, escaped(text));
  };
  html += "<dl class=\"facts\">\n";
  html += fact("Program", "weft " + report.program_version);
  html += fact("Made", date_text(report.created));
  html += fact("Method", report.method);
  html += fact("Error", report.error_meaning);
  html += fact("Seed", std::to_string(report.seed));
  html += fact("Evaluations",
               fmt::format("{}, of which {} diverged", report.evaluations, report.diverged));
  html +=
      fact("Time", format_duration(report.wall_s) +
                       (report.threads > 0 ? fmt::format(" on {} threads", report.threads) : ""));
  html += fact("Ended", report.stopped ? "stopped early" : "by itself");
  html += "</dl>\n";
  if (!report.settings.empty()) {
    html += "<h3>Settings</h3>\n<div class=\"columns\"><dl class=\"facts\">\n";
    for (const auto& [name, value] : report.settings) {
      html += fmt::format("<div><dt>{}</dt><dd>{}</dd></div>\n", escaped(name),
                          escaped(value_text(value)));
    }
    html += "</dl></div>\n";
  }
  return html + "</section>\n";
}

/// Links to the sections that are there.
std::string navigation(const std::string& body) {
  static constexpr std::pair<const char*, const char*> kSections[] = {
      {"measured", "What was measured"},
      {"found", "What was found"},
      {"match", "How well it matches"},
      {"tests-match", "Mechanical tests"},
      {"sure", "How sure"},
      {"search", "Search"},
      {"matrix", "Fabrics against captures"},
      {"made", "How it was made"}};
  std::string html = "<nav aria-label=\"Sections\">";
  for (const auto& [id, name] : kSections) {
    if (body.find(fmt::format("<section id=\"{}\">", id)) == std::string::npos) continue;
    html += fmt::format("<a href=\"#{}\">{}</a>", id, name);
  }
  return html + "</nav>\n";
}

std::string page(const Report& report, const std::vector<CapturePictures>& pictures,
                 const MechanicalReport& mechanical) {
  PlotPlacer place;
  const bool videos = !report.captures.empty();
  std::string body =
      measured_section(report) +
      mechanical_measured_section(mechanical, videos ? "tests-measured" : "measured");
  body += found_section(report, mechanical);
  body += match_section(report, pictures, place) +
          mechanical_match_section(mechanical, videos ? "tests-match" : "match", place);
  body += sure_section(report, mechanical, place);
  body += search_section(report, mechanical, place);
  body += matrix_section(report, place);
  body += made_section(report);
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<meta name=\"generator\" content=\"weft "
      "{}\">\n<title>{}</title>\n<style>{}</style>\n</head>\n"
      "<body>\n{}{}</header>\n<main>\n{}</main>\n<footer class=\"page\">Everything on this page is "
      "inside this file. The same numbers are in result.json.</footer>\n<script>{}</script>\n"
      "</body>\n</html>\n",
      escaped(report.program_version), escaped(report.title), report_css, head(report),
      navigation(body), body, report_js);
}

}  // namespace
}  // namespace weft::detail

namespace weft {

std::string report_to_html(const Report& report, const std::vector<CapturePictures>& pictures,
                           const MechanicalReport& mechanical) {
  return detail::page(report, pictures, mechanical);
}

void write_report_html(const std::filesystem::path& path, const Report& report,
                       const std::vector<CapturePictures>& pictures,
                       const MechanicalReport& mechanical) {
  std::ofstream file(path, std::ios::binary);
  file << report_to_html(report, pictures, mechanical);
  file.close();
  if (!file) throw Error(path.string() + ": cannot be written");
}

}  // namespace weft
