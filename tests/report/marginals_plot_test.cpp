#include "weft/report/marginals_plot.h"

#include <gtest/gtest.h>

#include <cmath>

#include "report/xml.h"
#include "weft/base/error.h"

namespace weft::marginals_plot_test {
namespace {

std::size_t count(const std::string& text, const std::string& word) {
  std::size_t found = 0;
  for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1))
    ++found;
  return found;
}

MarginalsPlot sample() {
  MarginalsPlot plot;
  plot.title = "Posterior <of> a & b";
  MarginalsPlot::Parameter a{
      "bend_stiffness", "N m", {}, ReportParameter::Scale::logarithmic, 1e-5};
  MarginalsPlot::Parameter b{
      "drag_linear", "N s/m^3", {}, ReportParameter::Scale::shifted_logarithmic};
  for (int i = 0; i < 1000; ++i) {
    a.values.push_back(1e-5 * std::exp(0.5 * std::sin(i)));
    b.values.push_back(0.001 * i);
  }
  plot.parameters = {a, b};
  return plot;
}

TEST(MarginalsPlot, HasAHistogramOfEachAndEveryPairOnce) {
  MarginalsPlot plot = sample();
  const std::string svg = to_svg(plot);
  EXPECT_NO_THROW(test::XmlReader::read(svg));
  EXPECT_EQ(count(svg, "class=\"panel histogram\""), 2u);
  EXPECT_EQ(count(svg, "class=\"panel pair\""), 1u);
  EXPECT_NE(svg.find("bend stiffness"), std::string::npos);
  EXPECT_NE(svg.find("N·m"), std::string::npos);
  // One line in the histogram of a; b has no estimate, so the pair has none.
  EXPECT_EQ(count(svg, "class=\"estimate\""), 1u);
  plot.parameters[1].estimate = 0.4;
  EXPECT_EQ(count(to_svg(plot), "class=\"estimate\""), 4u);
}

TEST(MarginalsPlot, AConstantIsDrawnAndNothingIsRefused) {
  MarginalsPlot plot = sample();
  for (double& value : plot.parameters[0].values) value = 2e-5;
  EXPECT_NO_THROW(test::XmlReader::read(to_svg(plot)));
  plot.parameters[0].values.pop_back();
  EXPECT_THROW(to_svg(plot), Error);
  EXPECT_THROW(to_svg(MarginalsPlot{}), Error);
}

}  // namespace
}  // namespace weft::marginals_plot_test
