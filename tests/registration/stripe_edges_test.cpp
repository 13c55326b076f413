#include "weft/registration/stripe_edges.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "weft/base/random.h"

namespace weft::stripe_edges_test {
namespace {

constexpr int kRows = 120, kColumns = 40;
constexpr double kPeriod = 17.3;

/// Light of the soft square wave at y: dark `dark`, bright 1, ramps of +-period / (2 pi gain).
double stripe(double y, double dark) {
  const double wave = 4 * std::sin(2 * std::numbers::pi * y / kPeriod) + 0.5;
  return dark + (1 - dark) * std::clamp(wave, 0.0, 1.0);
}

/// Integral over each pixel of shading(y) * stripe(y - slope * x).
template <class Shading>
Image draw(double slope, double dark, Shading&& shading) {
  Image image(kRows, kColumns);
  constexpr int samples = 20;
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      double sum = 0;
      for (int i = 0; i < samples; ++i) {
        for (int j = 0; j < samples; ++j) {
          const double y = row + (i + 0.5) / samples, x = column + (j + 0.5) / samples;
          sum += shading(y) * stripe(y - slope * x, dark);
        }
      }
      image(row, column) = static_cast<float>(sum / (samples * samples));
    }
  }
  return image;
}

Mask everywhere() { return Mask::Ones(kRows, kColumns); }

/// Distance of an edge to the nearest true one of its kind.
double error_of(const StripeEdge& edge, double slope) {
  const double y = edge.y - slope * (edge.column + 0.5);
  const double offset = edge.rising ? 0 : 0.5 * kPeriod;
  return std::remainder(y - offset, kPeriod);
}

TEST(StripeEdges, FindsEveryEdgeToATenthOfAPixel) {
  for (const double slope : {0.0, 0.13, 0.6}) {
    const Image image = draw(slope, 0.08, [](double) { return 0.7; });
    const std::vector<StripeEdge> edges = find_stripe_edges(image, everywhere(), kPeriod);
    // 120 rows hold 13 or 14 half periods a column; the outermost ones lie at the rim.
    EXPECT_GE(edges.size(), 12u * (kColumns - 4));
    for (const StripeEdge& edge : edges) {
      // The ramp is 1.4 px wide, sampled every pixel: its corners are lost between the samples.
      EXPECT_LT(std::abs(error_of(edge, slope)), 0.09) << "y " << edge.y << " slope " << slope;
    }
  }
}

TEST(StripeEdges, NoiseOfTwoPercentCostsLessThanATenthOfAPixel) {
  Image image = draw(0.13, 0.08, [](double) { return 0.7; });
  Rng random(3);
  for (Eigen::Index k = 0; k < image.size(); ++k) {
    image.data()[k] += static_cast<float>(0.02 * random.normal());
  }
  const std::vector<StripeEdge> edges = find_stripe_edges(image, everywhere(), kPeriod);
  double sum = 0;
  for (const StripeEdge& edge : edges) sum += std::pow(error_of(edge, 0.13), 2);
  ASSERT_FALSE(edges.empty());
  // Noise over slope of the light: 0.02 * sqrt(3/8) (three columns) / (0.64 / 2.2 px) = 0.04 px.
  EXPECT_LT(std::sqrt(sum / static_cast<double>(edges.size())), 0.08);
}

TEST(StripeEdges, ShadingIsNotAnEdge) {
  // A crease that halves the light inside a bright stripe, as a fold does.
  const double crease = 4.25 * kPeriod;
  const Image image = draw(0, 0.08, [&](double y) { return y < crease ? 0.8 : 0.4; });
  for (const StripeEdge& edge : find_stripe_edges(image, everywhere(), kPeriod)) {
    EXPECT_GT(std::abs(edge.y - crease), 2);
    EXPECT_LT(std::abs(error_of(edge, 0)), 0.3);
  }
}

TEST(StripeEdges, EdgesAlternateAndCarryTheirContrast) {
  const Image image = draw(0, 0.2, [](double) { return 0.5; });
  const std::vector<StripeEdge> edges = find_stripe_edges(image, everywhere(), kPeriod);
  for (std::size_t k = 1; k < edges.size(); ++k) {
    if (edges[k].column != edges[k - 1].column) continue;
    EXPECT_NE(edges[k].rising, edges[k - 1].rising);
    EXPECT_NEAR(edges[k].contrast, 0.5 * 0.8, 0.02);
    EXPECT_NEAR(edges[k].modulation, 0.8 / 1.2, 0.05);
  }
}

TEST(StripeEdges, RimAndBlankCloth) {
  const Image image = draw(0, 0.08, [](double) { return 0.7; });
  Mask inner = Mask::Zero(kRows, kColumns);
  inner.block(30, 10, 50, 20).setOnes();
  for (const StripeEdge& edge : find_stripe_edges(image, inner, kPeriod)) {
    EXPECT_GE(edge.column, 12);
    EXPECT_LT(edge.column, 28);
    EXPECT_GE(edge.y, 31);
    EXPECT_LE(edge.y, 79);
  }
  EXPECT_THAT(find_stripe_edges(image, Mask::Zero(kRows, kColumns), kPeriod), ::testing::IsEmpty());
  EXPECT_THAT(find_stripe_edges(Image::Constant(kRows, kColumns, 0.5f), everywhere(), kPeriod),
              ::testing::IsEmpty());
}

}  // namespace
}  // namespace weft::stripe_edges_test
