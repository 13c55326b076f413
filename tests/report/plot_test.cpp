#include "weft/report/plot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>

#include "common/temporary_folder.h"
#include "report/xml.h"
#include "weft/base/error.h"

namespace weft::plot_test {
namespace {

using test::XmlElement;
using test::XmlReader;
using ::testing::HasSubstr;

const double kNan = std::numeric_limits<double>::quiet_NaN();

/// A position is printed with two decimals.
constexpr double kPixel = 0.011;

struct Pixel {
  double x, y;
};

/// Points of a path of M and L commands.
std::vector<Pixel> points_of(const std::string& d) {
  std::string spaced = d;
  for (char& c : spaced) {
    if (c == 'M' || c == 'L') c = ' ';
  }
  std::istringstream in(spaced);
  std::vector<Pixel> points;
  for (Pixel p{}; in >> p.x >> p.y;) points.push_back(p);
  return points;
}

/// What a reader of the axis sees: value at a tick label and its place, for the first and last
/// label.
struct Axis {
  double value_0, value_1, pixel_0, pixel_1;
  double pixel(double value) const {
    return pixel_0 + (value - value_0) / (value_1 - value_0) * (pixel_1 - pixel_0);
  }
  double pixel_log(double value) const {
    return pixel_0 + std::log(value / value_0) / std::log(value_1 / value_0) * (pixel_1 - pixel_0);
  }
};

Axis read_axis(const XmlElement& svg, const std::string& letter) {
  const XmlElement& group = *svg.all(letter + "-axis").at(0);
  const auto labels = group.all("tick-label");
  const auto lines = group.all("grid");
  EXPECT_EQ(labels.size(), lines.size());
  const std::string at = letter + "1";
  return {std::stod(labels.front()->text), std::stod(labels.back()->text),
          lines.front()->number(at), lines.back()->number(at)};
}

PlotSeries series_of(std::vector<double> x, std::vector<double> y,
                     PlotSeries::Mark mark = PlotSeries::Mark::line) {
  PlotSeries series;
  series.name = "series";
  series.x = std::move(x);
  series.y = std::move(y);
  series.mark = mark;
  return series;
}

LinePlot simple_plot() {
  LinePlot plot;
  plot.title = "Title";
  plot.x.label = "time";
  plot.x.unit = "s";
  plot.y.label = "length";
  plot.y.unit = "m";
  plot.series.push_back(series_of({0, 1, 2.5, 4}, {10, 40, 25, 30}));
  return plot;
}

TEST(LinePlot, DrawsPointsWhereTheAxesSayTheyAre) {
  LinePlot plot = simple_plot();
  plot.series[0].mark = PlotSeries::Mark::line_and_points;
  const XmlElement svg = XmlReader::read(to_svg(plot));
  const Axis x = read_axis(svg, "x"), y = read_axis(svg, "y");
  const auto marks = svg.all("mark");
  // One more is the key in the legend.
  ASSERT_EQ(marks.size(), 5u);
  const auto line = points_of(svg.all("series").at(0)->all("stroke").at(0)->attributes.at("d"));
  ASSERT_EQ(line.size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(marks[i]->number("cx"), x.pixel(plot.series[0].x[i]), 3 * kPixel);
    EXPECT_NEAR(marks[i]->number("cy"), y.pixel(plot.series[0].y[i]), 3 * kPixel);
    EXPECT_NEAR(line[i].x, marks[i]->number("cx"), kPixel);
    EXPECT_NEAR(line[i].y, marks[i]->number("cy"), kPixel);
  }
  // Up is more.
  EXPECT_LT(y.pixel_1, y.pixel_0);
}

TEST(LinePlot, LogarithmicAxes) {
  LinePlot plot;
  plot.x.logarithmic = plot.y.logarithmic = true;
  plot.series.push_back(series_of({1, 3, 100}, {0.1, 5, 20}, PlotSeries::Mark::points));
  const XmlElement svg = XmlReader::read(to_svg(plot));
  const Axis x = read_axis(svg, "x"), y = read_axis(svg, "y");
  const auto marks = svg.all("series").at(0)->all("mark");
  ASSERT_EQ(marks.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(marks[i]->number("cx"), x.pixel_log(plot.series[0].x[i]), 3 * kPixel);
    EXPECT_NEAR(marks[i]->number("cy"), y.pixel_log(plot.series[0].y[i]), 3 * kPixel);
  }
}

TEST(LinePlot, AxesCarryLabelUnitAndSharedPowerOfTen) {
  LinePlot plot = simple_plot();
  plot.y.unit = "N m";
  for (double& y : plot.series[0].y) y *= 1e-6;
  const XmlElement svg = XmlReader::read(to_svg(plot));
  EXPECT_EQ(svg.all("x-axis").at(0)->all("axis-label").at(0)->text, "time (s)");
  EXPECT_EQ(svg.all("y-axis").at(0)->all("axis-label").at(0)->text, "length (10⁻⁶ N·m)");
  const Axis y = read_axis(svg, "y");
  EXPECT_GE(y.value_0, 10);
  EXPECT_LE(y.value_1, 40);
}

TEST(LinePlot, LinesBreakWhereThereIsNoNumber) {
  LinePlot plot = simple_plot();
  plot.series[0] = series_of({0, 1, 2, 3, 4, 5}, {1, 2, kNan, 2, 3, 4});
  const XmlElement svg = XmlReader::read(to_svg(plot));
  const auto lines = svg.all("series").at(0)->all("stroke");
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(points_of(lines[0]->attributes.at("d")).size(), 2u);
  EXPECT_EQ(points_of(lines[1]->attributes.at("d")).size(), 3u);
}

TEST(LinePlot, InfinityIsMarkedAtTheUpperEdgeAndDoesNotStretchTheAxis) {
  LinePlot plot = simple_plot();
  plot.series[0] = series_of({0, 1, 2}, {1, kInfinity, 3}, PlotSeries::Mark::points);
  const std::string text = to_svg(plot);
  const XmlElement svg = XmlReader::read(text);
  ASSERT_EQ(svg.all("off-scale").size(), 1u);
  const auto at = points_of(svg.all("off-scale")[0]->attributes.at("d").substr(0, 20));
  EXPECT_NEAR(at.at(0).x, read_axis(svg, "x").pixel(1), 3 * kPixel);
  EXPECT_NEAR(at.at(0).y, svg.number("data-top"), 2);
  EXPECT_LE(read_axis(svg, "y").value_1, 3.2);
  EXPECT_EQ(text.find("inf"), std::string::npos);
  EXPECT_EQ(text.find("nan"), std::string::npos);
}

TEST(LinePlot, ZeroHasNoPlaceOnALogarithmicAxis) {
  LinePlot plot = simple_plot();
  plot.y.logarithmic = true;
  plot.series[0] = series_of({0, 1, 2, 3}, {0, 1, 10, 100}, PlotSeries::Mark::points);
  const std::string text = to_svg(plot);
  const XmlElement svg = XmlReader::read(text);
  EXPECT_EQ(svg.all("series").at(0)->all("mark").size(), 3u);
  EXPECT_EQ(text.find("inf"), std::string::npos);
}

TEST(LinePlot, BandLiesBetweenItsBounds) {
  LinePlot plot = simple_plot();
  plot.series[0] = series_of({0, 1, 2}, {2, 3, 4});
  plot.series[0].lower = {1, 2, 3};
  plot.series[0].upper = {3, 5, 6};
  const XmlElement svg = XmlReader::read(to_svg(plot));
  const Axis x = read_axis(svg, "x"), y = read_axis(svg, "y");
  std::string d = svg.all("band").at(0)->attributes.at("d");
  ASSERT_EQ(d.back(), 'Z');
  d.pop_back();
  const auto outline = points_of(d);
  const std::vector<Pixel> expected = {{0, 3}, {1, 5}, {2, 6}, {2, 3}, {1, 2}, {0, 1}};
  ASSERT_EQ(outline.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_NEAR(outline[i].x, x.pixel(expected[i].x), 3 * kPixel);
    EXPECT_NEAR(outline[i].y, y.pixel(expected[i].y), 3 * kPixel);
  }
}

TEST(LinePlot, RegionsCoverTheirPartOfTheAxis) {
  LinePlot plot = simple_plot();
  plot.regions.push_back({1.5, 99, "validation"});
  const XmlElement svg = XmlReader::read(to_svg(plot));
  const XmlElement& region = *svg.all("region").at(0);
  EXPECT_NEAR(region.number("x"), read_axis(svg, "x").pixel(1.5), 3 * kPixel);
  EXPECT_NEAR(region.number("x") + region.number("width"), svg.number("data-right"), 3 * kPixel);
  EXPECT_EQ(svg.all("region-label").at(0)->text, "validation");
}

TEST(LinePlot, LevelsAndNotesStandAtTheirValues) {
  LinePlot plot = simple_plot();
  plot.levels.push_back({20, "twenty"});
  plot.notes.push_back({2.5, 25, "here"});
  const XmlElement svg = XmlReader::read(to_svg(plot));
  const Axis x = read_axis(svg, "x"), y = read_axis(svg, "y");
  EXPECT_NEAR(svg.all("level").at(0)->number("y1"), y.pixel(20), 3 * kPixel);
  EXPECT_NEAR(svg.all("note-mark").at(0)->number("cx"), x.pixel(2.5), 3 * kPixel);
  EXPECT_NEAR(svg.all("note-mark").at(0)->number("cy"), y.pixel(25), 3 * kPixel);
}

TEST(LinePlot, TextIsEscaped) {
  LinePlot plot = simple_plot();
  plot.title = "<b>&\"";
  plot.series[0].name = "'<script>";
  plot.x.label = "a & b";
  const XmlElement svg = XmlReader::read(to_svg(plot, "id\"<"));
  EXPECT_EQ(svg.all("title").at(0)->text, "<b>&\"");
  EXPECT_EQ(svg.all("legend").at(0)->text, "'<script>");
  EXPECT_EQ(svg.all("series").at(0)->attributes.at("data-name"), "'<script>");
}

TEST(LinePlot, CategoriesStandInOrderAndSlantWhereTheyDoNotFit) {
  LinePlot plot = simple_plot();
  plot.x.categories = {"cotton", "denim", "silk"};
  plot.series[0] = series_of({0, 1, 2}, {1, 2, 3}, PlotSeries::Mark::points);
  const XmlElement svg = XmlReader::read(to_svg(plot));
  const auto labels = svg.all("x-axis").at(0)->all("tick-label");
  const auto marks = svg.all("series").at(0)->all("mark");
  ASSERT_EQ(labels.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(labels[i]->text, plot.x.categories[i]);
    EXPECT_NEAR(labels[i]->number("x"), marks[i]->number("cx"), kPixel);
    EXPECT_EQ(labels[i]->attributes.count("transform"), 0u);
  }
  plot.x.categories.assign(3, "a fabric with a name of more than forty letters");
  const XmlElement slanted = XmlReader::read(to_svg(plot));
  EXPECT_EQ(slanted.all("x-axis").at(0)->all("tick-label").at(0)->attributes.count("transform"),
            1u);
  EXPECT_LT(slanted.number("data-bottom"), svg.number("data-bottom"));
}

TEST(LinePlot, LongSeriesStaySmallAndKeepTheirExtremes) {
  LinePlot plot = simple_plot();
  PlotSeries& series = plot.series[0];
  series = series_of({}, {});
  for (int i = 0; i < 200000; ++i) {
    series.x.push_back(i);
    series.y.push_back(i == 123457 ? 9 : std::sin(0.01 * i));
  }
  const std::string text = to_svg(plot);
  EXPECT_LT(text.size(), 80000u);
  const XmlElement svg = XmlReader::read(text);
  const auto line = points_of(svg.all("series").at(0)->all("stroke").at(0)->attributes.at("d"));
  const auto top = std::ranges::min_element(line, {}, &Pixel::y);
  EXPECT_NEAR(top->y, read_axis(svg, "y").pixel(9), 3 * kPixel);
  // The axis reads 10^3: 123457 is 123.457.
  EXPECT_NEAR(top->x, read_axis(svg, "x").pixel(123.457), 3 * kPixel);
  series.mark = PlotSeries::Mark::points;
  EXPECT_LT(to_svg(plot).size(), 1500000u);
}

TEST(LinePlot, DrawsConstantsSinglePointsAndNothing) {
  LinePlot plot = simple_plot();
  for (const auto& series : {series_of({0, 1}, {5, 5}), series_of({3}, {7}), series_of({}, {}),
                             series_of({0, 1}, {kNan, kNan}), series_of({0, 1}, {0, 0})}) {
    plot.series[0] = series;
    for (const bool logarithmic : {false, true}) {
      plot.y.logarithmic = logarithmic;
      const std::string text = to_svg(plot);
      EXPECT_NO_THROW(XmlReader::read(text));
      EXPECT_EQ(text.find("nan"), std::string::npos);
      EXPECT_EQ(text.find("inf"), std::string::npos);
    }
  }
  plot.series.clear();
  EXPECT_NO_THROW(XmlReader::read(to_svg(plot)));
}

TEST(LinePlot, RejectsSeriesOfUnequalLength) {
  LinePlot plot = simple_plot();
  plot.series[0].y.pop_back();
  EXPECT_THROW(to_svg(plot), Error);
  plot = simple_plot();
  plot.series[0].lower = {1, 2, 3, 4};
  EXPECT_THROW(to_svg(plot), Error);
}

TEST(LinePlot, RejectsAnEmptyRange) {
  LinePlot plot = simple_plot();
  plot.y.lower = 2;
  plot.y.upper = 1;
  EXPECT_THROW(to_svg(plot), Error);
  plot.y = {};
  plot.y.logarithmic = true;
  plot.y.lower = 0;
  EXPECT_THROW(to_svg(plot), Error);
}

TEST(LinePlot, MarginSurroundsThePicture) {
  const XmlElement svg = XmlReader::read(to_svg(simple_plot(), "p", 12));
  EXPECT_EQ(svg.attributes.at("viewBox"), "-12 -12 724 364");
  EXPECT_EQ(svg.attributes.at("width"), "724");
}

TEST(BarChart, LengthsAreProportionalToValues) {
  BarChart chart;
  chart.bars = {{"a", 10, "", false}, {"b", 25, "", true}, {"c", 0, "", false}};
  const XmlElement svg = XmlReader::read(to_svg(chart));
  const auto bars = svg.all("bar");
  ASSERT_EQ(bars.size(), 3u);
  EXPECT_NEAR(bars[1]->number("width") / bars[0]->number("width"), 2.5, 1e-3);
  EXPECT_EQ(bars[2]->number("width"), 0);
  EXPECT_NE(bars[0]->attributes.at("fill"), bars[1]->attributes.at("fill"));
}

TEST(BarChart, LogarithmicBarsEndAtTheirValue) {
  BarChart chart;
  chart.value.logarithmic = true;
  chart.bars = {{"a", 2, "", false}, {"b", 20, "", false}, {"c", 300, "", false}};
  const XmlElement svg = XmlReader::read(to_svg(chart));
  const Axis axis = read_axis(svg, "x");
  const auto bars = svg.all("bar");
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(bars[i]->number("x") + bars[i]->number("width"),
                axis.pixel_log(chart.bars[i].value), 3 * kPixel);
  }
}

TEST(BarChart, InfinityIsHatchedAndSaysWhatItIs) {
  BarChart chart;
  chart.value.logarithmic = true;
  chart.bars = {{"a", 2, "", false}, {"b", kInfinity, "not determined", false}};
  const XmlElement svg = XmlReader::read(to_svg(chart, "v"));
  EXPECT_EQ(svg.all("hatched").at(0)->attributes.at("fill"), "url(#v-hatch)");
  EXPECT_EQ(svg.all("bar-note").at(1)->text, "not determined");
  chart.bars = {{"b", kInfinity, "", false}};
  EXPECT_NO_THROW(XmlReader::read(to_svg(chart)));
  chart.bars.clear();
  EXPECT_NO_THROW(XmlReader::read(to_svg(chart)));
}

HeatMap simple_map() {
  HeatMap map;
  map.x_axis.label = "x";
  map.y_axis.label = "y";
  map.x = {1, 2, 3};
  map.y = {10, 20};
  map.values.resize(2, 3);
  map.values << 1, 2, 3, 4, 5, 6;
  map.label = "error";
  return map;
}

TEST(HeatMap, CellsHaveTheColourOfTheirValueAtTheirPlace) {
  const HeatMap map = simple_map();
  const XmlElement svg = XmlReader::read(to_svg(map));
  const auto cells = svg.all("cell");
  ASSERT_EQ(cells.size(), 6u);
  for (std::size_t k = 0; k < 6; ++k) {
    EXPECT_EQ(cells[k]->attributes.at("fill"),
              hex(colour_at(ColourMap::viridis, static_cast<double>(k) / 5)));
    EXPECT_NEAR(cells[k]->number("x"), cells[k % 3]->number("x"), kPixel);
  }
  EXPECT_LT(cells[0]->number("x"), cells[1]->number("x"));
  // The larger y is above.
  EXPECT_LT(cells[3]->number("y"), cells[0]->number("y"));
  EXPECT_NEAR(cells[3]->number("y") + cells[3]->number("height"), cells[0]->number("y"),
              2 * kPixel);
}

TEST(HeatMap, LogarithmicColoursAndAxes) {
  HeatMap map = simple_map();
  map.x = {1, 10, 100};
  map.x_axis.logarithmic = true;
  map.logarithmic = true;
  map.values << 1, 10, 100, 1, 10, 100;
  const XmlElement svg = XmlReader::read(to_svg(map));
  const auto cells = svg.all("cell");
  EXPECT_EQ(cells[1]->attributes.at("fill"), hex(colour_at(ColourMap::viridis, 0.5)));
  EXPECT_NEAR(cells[0]->number("width"), cells[2]->number("width"), 2 * kPixel);
}

TEST(HeatMap, DivergedCellsAreHatched) {
  HeatMap map = simple_map();
  map.values(0, 1) = kInfinity;
  map.values(1, 1) = kNan;
  map.print_values = true;
  const XmlElement svg = XmlReader::read(to_svg(map, "m"));
  EXPECT_EQ(svg.all("cell").at(1)->attributes.at("fill"), "url(#m-hatch)");
  EXPECT_EQ(svg.all("cell").at(4)->attributes.at("fill"), "url(#m-hatch)");
  EXPECT_EQ(svg.all("legend").at(0)->text, "diverged");
  EXPECT_EQ(svg.all("cell-value").at(1)->text, "∞");
}

TEST(HeatMap, OutlinesTheLeastOfEachRowAndMarksPoints) {
  HeatMap map = simple_map();
  map.values << 3, 1, 2, 5, kInfinity, 4;
  map.outline_row_minimum = true;
  map.markers.push_back({2, 20, "estimate"});
  const XmlElement svg = XmlReader::read(to_svg(map));
  const auto cells = svg.all("cell");
  const auto outlines = svg.all("row-minimum");
  ASSERT_EQ(outlines.size(), 4u);  // two strokes each
  const auto inside = [](const XmlElement& a, const XmlElement& b) {
    return a.number("x") > b.number("x") && a.number("x") < b.number("x") + b.number("width") &&
           a.number("y") > b.number("y") && a.number("y") < b.number("y") + b.number("height");
  };
  EXPECT_TRUE(inside(*outlines[0], *cells[1]));
  EXPECT_TRUE(inside(*outlines[2], *cells[5]));
  const XmlElement& cell = *cells[4];
  const XmlElement& marker = *svg.all("marker").at(0);
  EXPECT_NEAR(marker.number("cx"), cell.number("x") + cell.number("width") / 2, 2 * kPixel);
  EXPECT_NEAR(marker.number("cy"), cell.number("y") + cell.number("height") / 2, 2 * kPixel);
}

TEST(HeatMap, TablesOfCategoriesReadFromTheTop) {
  HeatMap map = simple_map();
  map.x = {0, 1, 2};
  map.y = {0, 1};
  map.x_axis.categories = {"a", "b", "c"};
  map.y_axis.categories = {"first", "second"};
  const XmlElement svg = XmlReader::read(to_svg(map));
  EXPECT_LT(svg.all("cell").at(0)->number("y"), svg.all("cell").at(3)->number("y"));
  const auto labels = svg.all("y-axis").at(0)->all("tick-label");
  EXPECT_EQ(labels.at(0)->text, "first");
  EXPECT_LT(labels[0]->number("y"), labels[1]->number("y"));
}

TEST(HeatMap, RejectsShapesThatDoNotAgree) {
  HeatMap map = simple_map();
  map.x.pop_back();
  EXPECT_THROW(to_svg(map), Error);
  map = simple_map();
  map.y = {20, 10};
  EXPECT_THROW(to_svg(map), Error);
  map = simple_map();
  map.values.resize(0, 0);
  map.x.clear();
  map.y.clear();
  EXPECT_THROW(to_svg(map), Error);
}

TEST(ColourMaps, ViridisGrowsLighterAndTwilightCloses) {
  for (std::size_t i = 1; i < 256; ++i) {
    // 8-bit rounding may take back less than one step.
    EXPECT_GT(luminance(colours(ColourMap::viridis)[i]),
              luminance(colours(ColourMap::viridis)[i - 1]) - 0.002);
  }
  const Rgb first = colour_at(ColourMap::twilight, 0), last = colour_at(ColourMap::twilight, 1);
  EXPECT_NEAR(first.red, last.red, 4);
  EXPECT_NEAR(first.green, last.green, 4);
  EXPECT_NEAR(first.blue, last.blue, 4);
  EXPECT_GT(luminance(colour_at(ColourMap::twilight, 0.5)), 0.6);
  EXPECT_EQ(colour_at(ColourMap::viridis, -3), colours(ColourMap::viridis)[0]);
  EXPECT_EQ(colour_at(ColourMap::viridis, 3), colours(ColourMap::viridis)[255]);
  EXPECT_EQ(colour_at(ColourMap::viridis, kNan), colours(ColourMap::viridis)[0]);
}

TEST(ColourMaps, LinesStandOutFromWhite) {
  for (int i = 0; i < 5; ++i) {
    // WCAG asks for a contrast of 3 for graphics; the reddish purple of the set has 2.9.
    EXPECT_GT(1.05 / (luminance(palette(i)) + 0.05), 2.8) << i;
  }
}

class PlotFiles : public ::testing::Test {
 protected:
  std::string read(const std::string& name) const {
    std::ifstream file(folder_ / name);
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
  }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
  }
  std::string error_of(const std::string& name) const {
    try {
      read_series_csv(folder_ / name);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }
  test::TemporaryFolder temporary_;
  std::filesystem::path folder_ = temporary_.path();
};

TEST_F(PlotFiles, CsvHoldsTheDataBehindThePicture) {
  LinePlot plot = simple_plot();
  plot.series[0] = series_of({0, 0.1}, {1.0 / 3, kInfinity});
  plot.series[0].name = "a, b";
  write_plot(folder_ / "plot.svg", plot);
  EXPECT_NO_THROW(XmlReader::read(read("plot.svg")));
  EXPECT_EQ(read("plot.csv"),
            "series,time (s),length (m)\n\"a, b\",0,0.3333333333333333\n\"a, b\",0.1,inf\n");
}

TEST_F(PlotFiles, SeriesReadBackAsWritten) {
  LinePlot plot = simple_plot();
  PlotSeries band = series_of({1, 2}, {0.1, kNan});
  band.name = "with \"quotes\",\nand a line end";
  band.lower = {0, 0.05};
  band.upper = {1, kInfinity};
  plot.series.push_back(band);
  write_plot(folder_ / "plot.svg", plot);
  const auto series = read_series_csv(folder_ / "plot.csv");
  ASSERT_EQ(series.size(), 2u);
  EXPECT_EQ(series[0].x, plot.series[0].x);
  EXPECT_EQ(series[0].y, plot.series[0].y);
  EXPECT_TRUE(series[0].lower.empty());
  EXPECT_EQ(series[1].name, band.name);
  EXPECT_EQ(series[1].upper, band.upper);
  EXPECT_TRUE(std::isnan(series[1].y[1]));
}

TEST_F(PlotFiles, CsvOfBarsAndMaps) {
  BarChart chart;
  chart.value.label = "variability";
  chart.value.unit = "%";
  chart.bars = {{"bend", 2.5, "2.5 %", false}, {"drag", kInfinity, "", false}};
  EXPECT_EQ(to_csv(chart), "label,variability (%),note\nbend,2.5,2.5 %\ndrag,inf,\n");
  HeatMap map = simple_map();
  map.y_axis.categories = {"cotton", "silk"};
  map.y = {0, 1};
  EXPECT_EQ(to_csv(map),
            "x,y,error\n1,cotton,1\n2,cotton,2\n3,cotton,3\n1,silk,4\n2,silk,5\n3,silk,6\n");
}

TEST_F(PlotFiles, BadCsvIsRejectedByFileAndLine) {
  write("a.csv", "series,x,y\na,1,2\na,1,oops\n");
  EXPECT_THAT(error_of("a.csv"), HasSubstr("a.csv:3: \"oops\" is not a number"));
  write("b.csv", "series,x,y\na,1\n");
  EXPECT_THAT(error_of("b.csv"), HasSubstr("b.csv:2: 2 fields"));
  write("c.csv", "x,y\n");
  EXPECT_THAT(error_of("c.csv"), HasSubstr("c.csv:1"));
  EXPECT_THAT(error_of("none.csv"), HasSubstr("cannot be opened"));
}

TEST_F(PlotFiles, UnwritableFilesAreNamed) {
  EXPECT_THROW(write_plot(folder_ / "no" / "plot.svg", simple_plot()), Error);
}

}  // namespace
}  // namespace weft::plot_test
