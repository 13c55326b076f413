#include "weft/report/figures.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "report/sample_report.h"

namespace weft::figures_test {
namespace {

using test::infinity;
using test::sample_report;
using ::testing::ElementsAre;

PlotSeries power_law(double factor, double order) {
  PlotSeries series;
  series.name = "method";
  for (const double h : {0.1, 0.05, 0.025, 0.0125}) {
    series.x.push_back(h);
    series.y.push_back(factor * std::pow(h, order));
  }
  return series;
}

TEST(Figures, ErrorsPerFrameWithValidationShaded) {
  const ReportCapture capture = sample_report().captures[0];
  const LinePlot plot = error_plot(capture);
  EXPECT_THAT(plot.series[0].x, ElementsAre(0, 1, 2, 3));
  EXPECT_THAT(plot.series[0].y, ElementsAre(20, 30.1, 40.2, 50.3));
  ASSERT_EQ(plot.regions.size(), 1u);
  EXPECT_DOUBLE_EQ(plot.regions[0].lower, 1.5);
  EXPECT_DOUBLE_EQ(plot.regions[0].upper, 3);
  const LinePlot parts = error_parts_plot(capture);
  ASSERT_EQ(parts.series.size(), 3u);
  EXPECT_NEAR(parts.series[2].y[3], 10.3, 1e-12);  // 0.1 * 103 pixels
}

TEST(Figures, DistancesInMillimetres) {
  const LinePlot plot = distance_plot(sample_report().captures[0]);
  EXPECT_EQ(plot.y.unit, "mm");
  EXPECT_DOUBLE_EQ(plot.series[0].y[3], 4);
  EXPECT_DOUBLE_EQ(plot.series[1].y[3], 20);
  EXPECT_DOUBLE_EQ(plot.series[0].x[3], 0.1);
}

TEST(Figures, SearchShowsPhasesApartAndTheBestOfEach) {
  const LinePlot plot = search_plot(sample_report().history);
  ASSERT_EQ(plot.series.size(), 3u);
  EXPECT_EQ(plot.series[0].name, "coarse");
  EXPECT_THAT(plot.series[0].y, ElementsAre(5, infinity, 3));
  EXPECT_EQ(plot.series[1].name, "anneal");
  EXPECT_THAT(plot.series[1].x, ElementsAre(4, 5, 6, 7));
  const PlotSeries& best = plot.series[2];
  EXPECT_EQ(best.y.front(), 5);
  EXPECT_EQ(best.y.back(), 7);
  // One gap, between the phases.
  EXPECT_EQ(std::ranges::count_if(best.y, [](double y) { return std::isnan(y); }), 1);
}

TEST(Figures, TemperatureIsLeftOutWhereThereIsNone) {
  const LinePlot plot = temperature_plot(sample_report().history);
  EXPECT_TRUE(std::isnan(plot.series[0].y[2]));
  EXPECT_EQ(plot.series[0].y[3], 1);
}

TEST(Figures, PerturbationCurveIsTheQuadraticAndItsLevelOnePercentAboveTheLeast) {
  const LinePlot plot = perturbation_plot(sample_report().perturbations[0]);
  EXPECT_THAT(plot.series[0].x, ElementsAre(-10, 0, 10));  // %
  const PlotSeries& curve = plot.series[1];
  for (std::size_t i = 0; i < curve.x.size(); ++i) {
    const double r = curve.x[i] / 100;
    EXPECT_NEAR(curve.y[i], 1 + 4 * r * r, 1e-12);
  }
  ASSERT_EQ(plot.levels.size(), 1u);
  EXPECT_NEAR(plot.levels[0].value, 1.01, 1e-12);
}

TEST(Figures, VariabilityOfFreeParametersOnly) {
  const BarChart chart = variability_chart(sample_report().parameters);
  ASSERT_EQ(chart.bars.size(), 3u);
  EXPECT_EQ(chart.bars[0].label, "bend stiffness");
  EXPECT_EQ(chart.bars[0].value, 2.5);
  EXPECT_EQ(chart.bars[1].value, infinity);
  EXPECT_EQ(chart.bars[1].note, "not determined by the data");
  EXPECT_TRUE(chart.bars[2].highlighted);
}

TEST(Figures, MatrixAsLinesAndAsTable) {
  const ReportMatrix matrix = *sample_report().matrix;
  const LinePlot lines = matrix_plot(matrix);
  ASSERT_EQ(lines.series.size(), 2u);
  EXPECT_EQ(lines.series[1].name, "other");
  EXPECT_THAT(lines.series[1].y, ElementsAre(5, 4, infinity));
  const HeatMap table = matrix_map(matrix);
  EXPECT_EQ(table.values, matrix.error);
  EXPECT_TRUE(table.outline_row_minimum);
  EXPECT_NO_THROW(to_svg(table));
}

TEST(Figures, SurfaceMarksTheEstimateWhereItIsKnown) {
  ReportSurface surface = sample_report().surfaces[0];
  EXPECT_TRUE(surface_map(surface).markers.empty());
  surface.y_estimate = 0.5;
  EXPECT_EQ(surface_map(surface).markers.size(), 1u);
  EXPECT_NO_THROW(to_svg(surface_map(surface)));
}

TEST(Figures, SurfaceLineIsTheFirstRowWithTheEstimateOnIt) {
  ReportSurface surface;
  surface.x_parameter = "stretch_stiffness";
  surface.x_unit = "N/m";
  surface.x_logarithmic = true;
  surface.x = {50, 100, 200};
  surface.error = MatX(1, 3);
  surface.error << 3, 1, 2;
  surface.x_estimate = 110;
  LinePlot line = surface_line(surface);
  EXPECT_TRUE(line.x.logarithmic);
  ASSERT_EQ(line.series.size(), 1u);
  EXPECT_THAT(line.series[0].y, ElementsAre(3, 1, 2));
  ASSERT_EQ(line.notes.size(), 1u);
  EXPECT_EQ(line.notes[0].y, 1);
  EXPECT_NO_THROW(to_svg(line));
  surface.x_estimate = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(surface_line(surface).notes.empty());
}

TEST(Figures, OrderIsTheSlopeOfThePowerLaw) {
  EXPECT_NEAR(fitted_order(power_law(3, 2)), 2, 1e-12);
  PlotSeries series = power_law(3, 1);
  series.y[2] = 0;
  series.y[3] = infinity;
  EXPECT_NEAR(fitted_order(series), 1, 1e-12);
  series.y[1] = 0;
  EXPECT_TRUE(std::isnan(fitted_order(series)));
}

TEST(Figures, ConvergenceGuidesGoThroughTheFinestPointOfTheNearestSeries) {
  const LinePlot plot =
      convergence_plot("Order", {}, {}, {power_law(3, 1), power_law(7, 2.02)}, {2});
  ASSERT_EQ(plot.series.size(), 3u);
  const PlotSeries& guide = plot.series[0];
  EXPECT_DOUBLE_EQ(guide.y[0], 7 * std::pow(0.0125, 2.02));
  EXPECT_NEAR(fitted_order(guide), 2, 1e-12);
  EXPECT_EQ(plot.series[2].name, "method, order 2.02");
  EXPECT_NO_THROW(to_svg(plot));
}

}  // namespace
}  // namespace weft::figures_test
