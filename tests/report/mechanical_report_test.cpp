#include "weft/report/mechanical_report.h"

#include <gmock/gmock.h>

#include "weft/report/report_html.h"

namespace weft {
namespace {

using testing::HasSubstr;
using testing::Not;

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

TEST(StrainPlot, IsAStaircaseInPercent) {
  const ReportHistogram histogram{"weft stretch", "", 0.0, 0.02, {0.25, 0.75}};
  const LinePlot plot = strain_plot(histogram);
  EXPECT_EQ(plot.series[0].x, (std::vector<double>{0, 1, 1, 2}));
  EXPECT_EQ(plot.series[0].y, (std::vector<double>{25, 25, 75, 75}));
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

}  // namespace
}  // namespace weft
