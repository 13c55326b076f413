#include "weft/report/report_html.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <regex>
#include <set>

#include "report/sample_report.h"
#include "report/xml.h"
#include "weft/report/figures.h"
#include "weft/report/text.h"

namespace weft::report_html_test {
namespace {

using test::sample_pictures;
using test::sample_report;
using test::XmlReader;
using ::testing::HasSubstr;

std::vector<std::string> matches(const std::string& text, const std::string& pattern,
                                 int group = 1) {
  const std::regex regex(pattern);
  std::vector<std::string> found;
  for (auto it = std::sregex_iterator(text.begin(), text.end(), regex);
       it != std::sregex_iterator(); ++it) {
    found.push_back((*it)[static_cast<std::size_t>(group)]);
  }
  return found;
}

/// Texts between `start` and `end`, both included.
std::vector<std::string> pieces(const std::string& text, const std::string& start,
                                const std::string& end) {
  std::vector<std::string> found;
  for (std::size_t at = text.find(start); at != std::string::npos; at = text.find(start, at + 1)) {
    found.push_back(text.substr(at, text.find(end, at) + end.size() - at));
  }
  return found;
}

/// Instead of a matcher, which would print the page.
bool contains(const std::string& page, const std::string& text) {
  return page.find(text) != std::string::npos;
}

std::string sample_html() {
  return report_to_html(sample_report(), {sample_pictures("sample", 3)});
}

TEST(ReportHtml, RefersToNothingOutside) {
  const std::string html = sample_html();
  EXPECT_FALSE(contains(html, "http:"));
  EXPECT_FALSE(contains(html, "https:"));
  EXPECT_FALSE(contains(html, "@import"));
  EXPECT_FALSE(contains(html, "<link"));
  for (const std::string& address : matches(html, "(?:src|href)=\"([^\"]{0,12})")) {
    EXPECT_TRUE(address.starts_with("data:") || address.starts_with("#")) << address;
  }
  for (const std::string& address : matches(html, "url\\(([^)]*)\\)")) {
    EXPECT_TRUE(address.starts_with("#")) << address;
  }
}

TEST(ReportHtml, HasEverySectionAndALinkToIt) {
  const std::string html = sample_html();
  for (const char* id : {"measured", "found", "match", "sure", "search", "matrix", "made"}) {
    EXPECT_TRUE(contains(html, "<section id=\"" + std::string(id) + "\">"));
    EXPECT_TRUE(contains(html, "<a href=\"#" + std::string(id) + "\">"));
  }
  EXPECT_TRUE(contains(html, "<h1>Fit of sample</h1>"));
  EXPECT_TRUE(contains(html, "weft fit sample --out out"));
  EXPECT_TRUE(contains(html, "18446744073709551615"));
  EXPECT_TRUE(contains(html, "40, of which 3 diverged"));
}

TEST(ReportHtml, WarningsComeBeforeTheNumbers) {
  const std::string html = sample_html();
  const std::size_t warning = html.find("The data do not determine bend_damping");
  ASSERT_NE(warning, std::string::npos);
  EXPECT_LT(warning, html.find("<section id=\"found\">"));
  EXPECT_LT(warning, html.find("class=\"tiles\""));
  EXPECT_TRUE(contains(html, "A remark."));
}

TEST(ReportHtml, ParametersWithVariabilityAndStatus) {
  const std::string html = sample_html();
  EXPECT_TRUE(contains(html, "3.20×10⁻⁵"));
  EXPECT_TRUE(contains(html, "± 2.5 %"));
  EXPECT_TRUE(contains(html, "▲ not determined"));
  EXPECT_TRUE(contains(html, "▲ at upper end"));
  EXPECT_TRUE(contains(html, ">held<"));
  EXPECT_TRUE(contains(html, "N·m"));
  // log(3.2e-5 / 1e-7) / log(1e-2 / 1e-7) = 0.5010.
  EXPECT_TRUE(contains(html, "class=\"estimate\" style=\"left:50.10%\""));
}

TEST(ReportHtml, SearchesSideBySide) {
  Report report = sample_report();
  const std::string html = report_to_html(report, {});
  EXPECT_TRUE(contains(html, "<th class=\"n\">18446744073709551615, kept</th>"));
  EXPECT_TRUE(contains(html, "<th class=\"n\">7</th>"));
  const auto table = pieces(html.substr(html.find("<h3>Searches</h3>")), "<tr>", "</tr>");
  ASSERT_EQ(table.size(), 5u);  // seeds, error, and the three that are searched
  EXPECT_TRUE(contains(table[1], "∞"));
  EXPECT_TRUE(contains(table[2], "▲ 1.00×10⁻⁷"));
  EXPECT_FALSE(contains(table[3], "▲")) << "an unbounded interval holds all";
  report.searches.clear();
  EXPECT_FALSE(contains(report_to_html(report, {}), "Searches"));
}

TEST(ReportHtml, SectionsWithoutContentAreLeftOut) {
  const std::string html = report_to_html({});
  for (const char* id : {"measured", "found", "match", "sure", "search", "matrix"}) {
    EXPECT_FALSE(contains(html, "<section id=\"" + std::string(id) + "\">"));
    EXPECT_FALSE(contains(html, "<a href=\"#" + std::string(id) + "\">"));
  }
  EXPECT_TRUE(contains(html, "<section id=\"made\">"));
  EXPECT_FALSE(contains(report_to_html(sample_report()), "class=\"viewer\""));
}

TEST(ReportHtml, DistanceIsSaidOfTheFramesItIsOf) {
  Report report = sample_report();
  EXPECT_TRUE(contains(report_to_html(report), "over 2 fit frames"));
  for (ReportFrame& frame : report.captures[0].frames)
    if (!frame.validation) frame.distance.reset();
  const std::string html = report_to_html(report);
  EXPECT_FALSE(contains(html, "fit frames</div>"));
  EXPECT_TRUE(contains(html, "validation frames</div>"));
}

TEST(ReportHtml, TextIsEscapedEverywhere) {
  const std::string evil = "<b>&\"'</script><script>alert(1)</script>";
  Report report = sample_report();
  report.title = report.fabric = report.command = report.method = report.created = evil;
  report.program_version = report.error_meaning = evil;
  report.remarks = {evil};
  report.settings = {{evil, evil}};
  report.parameters[0].name = report.parameters[0].unit = report.parameters[0].meaning = evil;
  report.captures[0].name = report.captures[0].description = report.captures[0].start = evil;
  report.history[0].phase = evil;
  report.perturbations[0].parameter = evil;
  report.surfaces[0].capture = report.surfaces[0].x_parameter = report.surfaces[0].y_unit = evil;
  report.matrix->captures[0] = report.matrix->fabrics[0] = evil;
  const std::string html = report_to_html(report, {sample_pictures(evil, 2)});
  EXPECT_FALSE(contains(html, "<b>&\""));
  EXPECT_FALSE(contains(html, "<script>alert"));
  EXPECT_TRUE(contains(html, "&lt;b&gt;&amp;&quot;"));
  // One script of the page and one element with the data of the viewer.
  EXPECT_EQ(pieces(html, "<script", ">").size(), 2u);
}

TEST(ReportHtml, PlotsAreWellFormedWithIdsOfTheirOwn) {
  const std::string html = sample_html();
  const auto plots = pieces(html, "<svg", "</svg>");
  // Error, distance, correlation, variability, surface, one perturbation, search, temperature,
  // matrix twice.
  EXPECT_EQ(plots.size(), 10u);
  for (const std::string& plot : plots) EXPECT_NO_THROW(XmlReader::read(plot));
  const auto ids = matches(html, " id=\"([^\"]*)\"");
  EXPECT_EQ(std::set<std::string>(ids.begin(), ids.end()).size(), ids.size());
}

TEST(ReportHtml, CertaintyHasItsConditionAndCorrelations) {
  Report report = sample_report();
  report.certainty->condition = test::infinity;
  const std::string html = report_to_html(report);
  EXPECT_TRUE(contains(html, "Condition number of the problem: ∞ (above 10¹²"));
  EXPECT_TRUE(contains(html,
                       "leaving out blocks of frames and parts of the picture in turn (8 or more, "
                       "5 frames a block)"));
  const auto plots = pieces(html, "<svg", "</svg>");
  const auto correlation = std::ranges::find_if(
      plots, [](const std::string& plot) { return contains(plot, "Correlation of the"); });
  ASSERT_NE(correlation, plots.end());
  EXPECT_TRUE(contains(*correlation, "-0.5") || contains(*correlation, "−0.5"));
  EXPECT_TRUE(contains(*correlation, "not determined, or held"));
  // The shade of a row is its interval: 0.9 to 1.2 times 3.2e-5 in log10 over 1e-7 to 1e-2.
  EXPECT_TRUE(contains(html, "class=\"interval\" style=\"left:49.19%;width:2.50%\""));
}

TEST(ReportHtml, AnIntervalWithOneEndIsShadedToTheEndOfTheRange) {
  Report report = sample_report();
  ReportParameter& bend = report.parameters[0];  // range 1e-7 to 1e-2
  bend.determined = false;
  bend.interval_lower = 1e-3;
  bend.interval_upper = test::infinity;
  const std::string html = report_to_html(report);
  EXPECT_TRUE(contains(html, "class=\"interval\" style=\"left:80.00%;width:20.00%\""));
  EXPECT_TRUE(contains(html, "▲ bounded below only"));
  EXPECT_TRUE(contains(html, "at least 0.001"));
}

TEST(ReportHtml, DataBehindAPlotIsTheCsvOfThePlot) {
  const std::string html = sample_html();
  const std::string csv = to_csv(temperature_plot(sample_report().history));
  EXPECT_TRUE(contains(html, base64(std::vector<std::uint8_t>(csv.begin(), csv.end()))));
}

TEST(ReportHtml, ViewerHoldsEveryPictureOfEveryFrame) {
  const CapturePictures pictures = sample_pictures("sample", 3);
  const std::string html =
      report_to_html(sample_report(), {sample_pictures("another", 1), pictures});
  const auto scripts = pieces(html, "<script type=\"application/json\">", "</script>");
  ASSERT_EQ(scripts.size(), 1u);
  const std::size_t start = scripts[0].find('>') + 1;
  const auto data = nlohmann::json::parse(
      scripts[0].substr(start, scripts[0].size() - start - std::string("</script>").size()));
  EXPECT_EQ(data["frames"], (std::vector<int>{0, 1, 2}));
  EXPECT_EQ(data["rate"], 30);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(data["measured"][k],
              "data:image/png;base64," + base64(pictures.frames[k].measured.bytes));
    EXPECT_EQ(data["difference"][k],
              "data:image/png;base64," + base64(pictures.frames[k].difference.bytes));
    EXPECT_NEAR(data["times"][k].get<double>(), static_cast<double>(k) / 30, 1e-12);
  }
  EXPECT_THAT(data["readouts"][2].get<std::string>(), HasSubstr("validation"));
  EXPECT_THAT(data["readouts"][1].get<std::string>(), HasSubstr("<b>2.00 mm</b>"));
  EXPECT_TRUE(contains(html, "max=\"2\""));
  for (const char* kind : {"measured", "simulated", "silhouettes", "measured_angles",
                           "simulated_angles", "difference"}) {
    EXPECT_TRUE(contains(html, "class=\"panel " + std::string(kind) + "\""));
  }
}

}  // namespace
}  // namespace weft::report_html_test
