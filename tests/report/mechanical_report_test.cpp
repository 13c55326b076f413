#include "weft/report/mechanical_report.h"

#include <gmock/gmock.h>

#include <cmath>
#include <string>

#include "weft/report/report_html.h"

namespace weft::mechanical_report_test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

ReportMechanical stretch() {
  ReportMechanical capture;
  capture.name = "stretch";
  capture.width = 0.2;
  capture.height = 0.1;
  capture.force_count = 6;
  capture.frames = {{0, true, 0.0, {}}, {1, true, 0.1, {}}, {2, true, 0.2, {}}};
  ReportClip still{"still", {0, 0, 0}, {0, -1, -2}, {0, -1.1, -2.1}, {}, {}};
  ReportClip pulled{"pulled", {0, 0.01, 0.02}, {0, 1, 2}, {0, 1.1, 2.1}, {0, 1, 2}, {0, 1.2, 2.2}};
  capture.clips = {still, pulled};
  return capture;
}

TEST(ForcePlot, RunsAlongTheWayOfTheClipThatMoves) {
  const LinePlot plot = force_plot(stretch());
  EXPECT_EQ(plot.x.label, "way of pulled");
  ASSERT_EQ(plot.series.size(), 4u);
  EXPECT_EQ(plot.series[2].name, "pulled, computed");
  EXPECT_EQ(plot.series[2].x, (std::vector<double>{0, 10, 20}));  // mm
  EXPECT_EQ(plot.series[2].upper, (std::vector<double>{0, 1.2, 2.2}));
  EXPECT_EQ(plot.series[3].y, (std::vector<double>{0, 1, 2}));
}

TEST(ForcePlot, RunsAlongTheFramesWhereNothingMoves) {
  ReportMechanical capture = stretch();
  capture.clips[1].moved = {0, 0, 0};
  const LinePlot plot = force_plot(capture);
  EXPECT_EQ(plot.x.label, "frame");
  EXPECT_EQ(plot.series[0].x, (std::vector<double>{0, 1, 2}));
}

ReportMechanical pulled() {
  ReportMechanical capture = stretch();
  capture.force_count = 0;
  capture.clips = {{"held", {0, 0, 0}, {}, {}, {}, {}}, {"bar", {0, 0.01, 0.03}, {}, {}, {}, {}}};
  capture.loaded = {{"bar",
                     {1, 2, 4},
                     {0, 0.01, 0.03},
                     {0.001, 0.012, 0.031},
                     {0, 0.01, 0.03},
                     {0.002, 0.02, 0.04}}};
  capture.pose = ReportPose{0.0015, 0.0025};
  return capture;
}

TEST(LoadedPlot, RunsAlongTheKnownForce) {
  ReportMechanical capture = pulled();
  LinePlot plot = loaded_plot(capture);
  EXPECT_EQ(plot.x.label, "known force");
  ASSERT_EQ(plot.series.size(), 2u);
  EXPECT_EQ(plot.series[0].name, "bar, computed");
  EXPECT_EQ(plot.series[0].x, (std::vector<double>{1, 2, 4}));
  EXPECT_EQ(plot.series[0].y, (std::vector<double>{1, 12, 31}));  // mm
  EXPECT_EQ(plot.series[0].upper, (std::vector<double>{2, 20, 40}));
  EXPECT_EQ(plot.series[1].y, (std::vector<double>{0, 10, 30}));
  capture.loaded[0].force = {2, 2, 2};  // a weight that stays
  plot = loaded_plot(capture);
  EXPECT_EQ(plot.x.label, "frame");
  EXPECT_EQ(plot.series[0].x, (std::vector<double>{0, 1, 2}));
}

/// The number of an attribute of the picture's root.
double attribute(const std::string& svg, const std::string& name) {
  const auto begin = svg.find(name + "=\"") + name.size() + 2;
  return std::stod(svg.substr(begin, svg.find('"', begin) - begin));
}

TEST(OverhangPlot, ShowsStripAndPlaneInOneScale) {
  ReportOverhang overhang;
  overhang.angle = 0.75;
  overhang.measured = {0.05, 0.06};
  overhang.x = {0, 0.03, 0.042};
  overhang.z = {0, -0.01, -0.035};
  const LinePlot plot = overhang_plot(overhang);
  EXPECT_EQ(plot.title, "The strip at the mean of what was read, 55 mm");
  ASSERT_EQ(plot.series.size(), 2u);
  EXPECT_NEAR(plot.series[0].x[2], 42, 1e-12);
  EXPECT_NEAR(plot.series[0].y[2], -35, 1e-12);
  // From the edge on, and beyond the tip.
  const std::vector<double>&x = plot.series[1].x, &y = plot.series[1].y;
  EXPECT_EQ(x[0], 0);
  EXPECT_EQ(y[0], 0);
  EXPECT_GT(x[1], 42);
  EXPECT_NEAR(std::atan2(-y[1], x[1]), 0.75, 1e-12);
  for (const int width : {700, 570}) {
    const LinePlot sized = overhang_plot(overhang, width);
    const std::string svg = to_svg(sized);
    const double across = attribute(svg, "data-right") - attribute(svg, "data-left"),
                 down = attribute(svg, "data-bottom") - attribute(svg, "data-top");
    EXPECT_NEAR(across / (*sized.x.upper - *sized.x.lower),
                down / (*sized.y.upper - *sized.y.lower),
                0.03 * down / (*sized.y.upper - *sized.y.lower));
  }
}

TEST(MechanicalPage, ShowsOverhangs) {
  MechanicalReport report;
  report.captures = {stretch()};
  ReportOverhang overhang{0.75, 1e-3, {0.05, 0.06}, 0.054, 0.052, 0.056, {0, 0.04}, {0, -0.03}};
  report.captures[0].overhang = overhang;
  const std::string page = report_to_html(Report(), {}, report);
  for (const char* text :
       {"<h3>Overhangs</h3>", "2 readings of an overhang", "52.0 mm to 56.0 mm", "computed strip"})
    EXPECT_THAT(page, HasSubstr(text));
  report.captures[0].overhang->computed = std::nan("");
  EXPECT_THAT(report_to_html(Report(), {}, report), HasSubstr(">none<"));
  report.captures[0].overhang.reset();
  EXPECT_THAT(report_to_html(Report(), {}, report), Not(HasSubstr("Overhangs")));
}

TEST(StrainPlot, IsAStaircaseInPercent) {
  const ReportHistogram histogram{"weft stretch", "", 0.0, 0.02, {0.25, 0.75}};
  const LinePlot plot = strain_plot(histogram);
  EXPECT_EQ(plot.series[0].x, (std::vector<double>{0, 1, 1, 2}));
  EXPECT_EQ(plot.series[0].y, (std::vector<double>{25, 25, 75, 75}));
}

ReportResponse loop() {
  return {"shear",
          "",
          "N/m",
          {0, 0.2, 0.1, 0, 0.1, 0.2},
          {0, 5, 2, -1, 3, 5},
          {0, 4, 1, -2, 2, 4},
          {0, 6, 3, 0, 4, 6},
          {1, 3}};
}

TEST(ResponsePlot, IsOneLineWithoutFriction) {
  const ReportResponse response{"shear", "", "N/m", {0, 0.1, 0.2}, {0, 1, 2}, {}, {}, {}};
  const LinePlot plot = response_plot(response);
  ASSERT_EQ(plot.series.size(), 1u);
  EXPECT_EQ(plot.series[0].name, "");
  EXPECT_EQ(plot.series[0].x, (std::vector<double>{0, 10, 20}));  // %
  EXPECT_EQ(plot.series[0].y, response.stress);
  EXPECT_FALSE(plot.series[0].dashed);
}

TEST(ResponsePlot, HasABranchBetweenTheTurnsOfACycle) {
  const LinePlot plot = response_plot(loop());
  ASSERT_EQ(plot.series.size(), 3u);
  EXPECT_EQ(plot.series[0].name, "from rest");
  EXPECT_EQ(plot.series[0].y, (std::vector<double>{0, 5}));
  EXPECT_EQ(plot.series[1].name, "unloading");
  EXPECT_EQ(plot.series[1].x, (std::vector<double>{20, 10, 0}));
  EXPECT_EQ(plot.series[1].y, (std::vector<double>{5, 2, -1}));
  EXPECT_EQ(plot.series[1].upper, (std::vector<double>{6, 3, 0}));
  EXPECT_EQ(plot.series[2].name, "loading");
  EXPECT_EQ(plot.series[2].y, (std::vector<double>{-1, 3, 5}));
  EXPECT_NO_THROW(to_svg(plot));
}

// A square that faces the viewer half way: its colours are those of the map between the values at
// its two sides, and what it does not cover stays white.
TEST(ShapePicture, ColoursBetweenTheValuesOfTheVertices) {
  const TriangleMesh mesh = make_swatch(1, 1, 2, 2);
  Points x(3, 4);
  x << 0, 1, 0, 1, 0, 0, 1, 1, 0, 0, 0, 0;
  VecX values(4);
  values << 0, 0, 2, 2;
  ShapeView view;
  view.lower = Vec3(-1, -1, -1);
  view.upper = Vec3(2, 2, 2);
  const Picture picture = shape_picture(mesh, x, values, 2, view);
  EXPECT_EQ(picture.width, view.width);
  EXPECT_EQ(picture.rgb.size(),
            3 * static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.height));
  EXPECT_EQ(picture.rgb.front(), 255);
  int blue = 0, yellow = 0;  // viridis begins in dark violet and ends in yellow
  for (std::size_t i = 0; i < picture.rgb.size(); i += 3) {
    const int r = picture.rgb[i], b = picture.rgb[i + 2];
    if (r == 255) continue;
    if (b > r + 20) ++blue;
    if (r > b + 60) ++yellow;
  }
  EXPECT_GT(blue, 1000);
  EXPECT_GT(yellow, 500);
}

TEST(ReportHtml, MechanicalCapturesHaveTheirSections) {
  Report report;
  report.title = "Fit";
  report.error_initial = 2;
  report.error = 1;
  MechanicalReport mechanical;
  EXPECT_THAT(report_to_html(report, {}, mechanical), Not(HasSubstr("id=\"match\"")));
  mechanical.captures = {stretch()};
  mechanical.captures[0].name = "<stretch>";
  const std::string page = report_to_html(report, {}, mechanical);
  EXPECT_THAT(page, HasSubstr("id=\"measured\""));
  EXPECT_THAT(page, HasSubstr("id=\"match\""));
  EXPECT_THAT(page, HasSubstr("&lt;stretch&gt;"));
  EXPECT_THAT(page, Not(HasSubstr("<stretch>")));
}

/// The text of the row of a table that begins with `name`; empty where there is none.
std::string row_of(const std::string& page, const std::string& name) {
  const auto at = page.find("<b>" + name + "</b>");
  if (at == std::string::npos) return "";
  const std::string row = page.substr(at, page.find("</tr>", at) - at);
  std::string text;
  bool inside = false;
  for (const char c : row) {
    if (c == '<') text += inside ? "" : " ";
    inside = c == '<' || (inside && c != '>');
    if (!inside && c != '>') text += c;
  }
  return text;
}

TEST(ReportHtml, LoadedClipsHaveTheirPoses) {
  MechanicalReport tests;
  tests.captures = {pulled()};
  const std::string html = report_to_html(Report(), {}, tests);
  EXPECT_THAT(html, HasSubstr("Pose of loaded clips, rms"));
  EXPECT_THAT(html, HasSubstr("2.5 mrad"));
  EXPECT_THAT(html, HasSubstr("Way of the clips under known forces"));
  tests.captures = {stretch()};
  EXPECT_THAT(report_to_html(Report(), {}, tests), Not(HasSubstr("Pose of loaded clips")));
}

TEST(ReportHtml, WhatWasFoundOfTestsHasItsTables) {
  Report report;
  report.error_initial = 2;
  report.error = 1;
  report.parameters.emplace_back().name = "shear";
  report.history = {{1, "least squares", 2, 2, 0}, {2, "least squares", 1, 1, 0}};
  MechanicalReport mechanical;
  mechanical.captures = {stretch()};
  const std::string without = report_to_html(report, {}, mechanical);
  for (const char* text : {"Friction of the cords", "As moduli", "Forces of the clamps",
                           "raw scans", "<h3>Stages", "The fabric's curves"})
    EXPECT_EQ(without.find(text), std::string::npos) << text;

  ReportMechanical& capture = mechanical.captures[0];
  capture.name = "pull";
  capture.cord_friction = ReportCordFriction{0.25, 0.2, 0.31, true};
  mechanical.moduli = {{"E_u", "N/m", "Young's modulus.", 123, 111, 134},
                       {"b", "N m", "Rigidity.", 2e-5, {}, {}}};
  mechanical.stages = {{"shear", 1, {"pull", "tear"}, 2, 40, 3.5, 3.6, 17, true},
                       {"weft bend", 2, {"hang"}, 3, 3.5, 3.4, 4.1, 9, false}};
  mechanical.responses = {loop()};
  std::string page = report_to_html(report, {}, mechanical);
  EXPECT_THAT(row_of(page.substr(page.find("Friction of the cords")), "pull"),
              ::testing::AllOf(HasSubstr("0.250 N"), HasSubstr("0.200 to 0.310 N")));
  EXPECT_THAT(row_of(page, "E_u"), ::testing::AllOf(HasSubstr("123"), HasSubstr("111 to 134")));
  EXPECT_THAT(row_of(page, "b"), ::testing::AllOf(HasSubstr("–"), HasSubstr("N·m")));
  const std::string stages = page.substr(page.find("<h3>Stages"));
  EXPECT_THAT(row_of(stages, "shear"),
              ::testing::AllOf(HasSubstr("pull, tear"), HasSubstr("40.0"), HasSubstr("3.50"),
                               HasSubstr("3.60"), Not(HasSubstr("not kept"))));
  EXPECT_THAT(row_of(stages, "weft bend"), HasSubstr("not kept"));
  EXPECT_NE(page.find("Internal friction makes loops"), std::string::npos);

  capture.cord_friction->determined = false;
  page = report_to_html(report, {}, mechanical);
  EXPECT_THAT(row_of(page.substr(page.find("Friction of the cords")), "pull"),
              ::testing::AllOf(HasSubstr("not determined"), Not(HasSubstr("0.310"))));
}

TEST(ReportHtml, ScansHaveTheirClampsAndRegistrations) {
  Report report;
  MechanicalReport mechanical;
  mechanical.captures = {stretch()};
  ReportMechanical& capture = mechanical.captures[0];
  capture.name = "frame";
  capture.clamps = {{"left", 1.5, 0.02, 1.25}, {"right", {}, 0.01, 0.75}};
  capture.registration = ReportRegistration{5000, 4000, 1e-4, 7e-4, 0.01, 200, 5};
  const std::string page = report_to_html(report, {}, mechanical);
  const std::string clamps = page.substr(page.find("Forces of the clamps"));
  EXPECT_THAT(row_of(clamps, "frame"),
              ::testing::AllOf(HasSubstr("left"), HasSubstr("1.50 N"), HasSubstr("0.02 N"),
                               HasSubstr("1.25 N"), HasSubstr("−0.25 N")));
  EXPECT_THAT(clamps.substr(0, clamps.find("</table>")), HasSubstr("0.750 N"));
  EXPECT_THAT(row_of(page.substr(page.find("raw scans")), "frame"),
              ::testing::AllOf(HasSubstr("4000 of 5000"), HasSubstr("0.100 mm"),
                               HasSubstr("0.700 mm"), HasSubstr("5 of 200 (2.5 %)")));
}

// One rigidity in three rows is one number that was searched.
TEST(ReportHtml, TiedParametersCountOnce) {
  Report report;
  report.error_initial = 2;
  report.error = 1;
  ReportParameter bend;
  bend.name = "bend_uu";
  bend.value = 2;
  bend.upper = 4;
  bend.interval_lower = 1;
  bend.interval_upper = 3;
  ReportParameter tied = bend;
  tied.name = "bend_vv";
  tied.tied_to = "bend_uu";
  report.parameters = {bend, tied};
  std::string page = report_to_html(report);
  EXPECT_THAT(page, HasSubstr("1 of 1"));
  EXPECT_THAT(row_of(page, "bend vv"), HasSubstr("tied to bend uu"));
  for (ReportParameter& p : report.parameters) {
    p.determined = false;
    p.at_bound = ReportParameter::Bound::upper;
  }
  for (const std::string& warning : report_warnings(report))
    EXPECT_EQ(warning.find("bend_vv"), std::string::npos) << warning;
  EXPECT_EQ(report_warnings(report).size(), 2u);
}

}  // namespace
}  // namespace weft::mechanical_report_test
