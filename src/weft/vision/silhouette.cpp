#include "weft/vision/silhouette.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "weft/base/dense.h"
#include "weft/base/error.h"

// Method.
// 1. Background: a quadratic surface through the light of a frame-wide border, by iteratively
// trimmed
//    least squares (the cloth may cover part of the border); its spread is 1.4826 times the median
//    absolute residual.
// 2. Difference: |light - background|, closed by a disc somewhat wider than a dark stripe, so that
// dark
//    stripes at the level of the background join the bright ones around them.
// 3. Cloth: the closed difference above a few spreads; the largest component, those at least a
//    twentieth of it, and what they enclose. Steps 1 to 3 run again with the background fitted to
//    all pixels away from the first result.
// 4. Edge: a pixel of the rim belongs to the cloth where the difference is at least half of its
//    largest value nearby, which is where half of the pixel is covered; repeated from the outside
//    in.

namespace weft {
namespace {

/// One code of an 8-bit sRGB picture near black.
constexpr double kLeastSpread = 1.0 / 255 / 12.92;
constexpr double kSpreads = 6;
/// Differences below this fraction of the bright stripes' are not cloth (compression rings).
constexpr double kLeastContrast = 0.01;

struct Background {
  cv::Mat light;  ///< CV_32F
  double spread = 0;
};

double median_of(std::vector<double>& values) {
  const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// 1, x, y, x^2, x y, y^2 with x and y from -1 to 1 over the frame.
Eigen::Matrix<double, 6, 1> quadratic(double x, double y) { return {1, x, y, x * x, x * y, y * y}; }

/// Fits the pixels where `use` is not 0 (every eighth one), dropping the worst half at first and
/// those beyond 4 spreads later.
Background fit_background(const cv::Mat& light, const cv::Mat& use) {
  struct Sample {
    Eigen::Matrix<double, 6, 1> terms;
    double value;
  };
  std::vector<Sample> samples;
  const auto position = [](int i, int count) { return 2 * (i + 0.5) / count - 1; };
  for (int y = 0; y < light.rows; y += 2)
    for (int x = y / 2 % 4; x < light.cols; x += 4)
      if (use.at<std::uint8_t>(y, x) != 0)
        samples.push_back({quadratic(position(x, light.cols), position(y, light.rows)),
                           double(light.at<float>(y, x))});

  Eigen::Matrix<double, 6, 1> coefficients = Eigen::Matrix<double, 6, 1>::Zero();
  std::vector<double> residuals;
  for (const Sample& sample : samples) residuals.push_back(sample.value);
  coefficients(0) = residuals.empty() ? 0 : median_of(residuals);
  double spread = kLeastSpread;
  for (int round = 0; round < 6 && samples.size() >= 64; ++round) {
    residuals.clear();
    for (const Sample& sample : samples)
      residuals.push_back(std::abs(sample.value - coefficients.dot(sample.terms)));
    const double median = median_of(residuals);
    spread = std::max(1.4826 * median, kLeastSpread);
    const double limit = round == 0 ? std::max(median, kLeastSpread) : 4 * spread;
    Eigen::Matrix<double, 6, 6> normal = 1e-9 * Eigen::Matrix<double, 6, 6>::Identity();
    Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
    for (const Sample& sample : samples) {
      if (std::abs(sample.value - coefficients.dot(sample.terms)) > limit) continue;
      normal += sample.terms * sample.terms.transpose();
      right += sample.value * sample.terms;
    }
    coefficients = solve_symmetric(normal, right);
  }

  Background background{cv::Mat(light.size(), CV_32F), spread};
  for (int y = 0; y < light.rows; ++y)
    for (int x = 0; x < light.cols; ++x)
      background.light.at<float>(y, x) =
          float(coefficients.dot(quadratic(position(x, light.cols), position(y, light.rows))));
  return background;
}

cv::Mat disc(double radius) {
  const int size = 2 * std::max(1, int(std::lround(radius))) + 1;
  return cv::getStructuringElement(cv::MORPH_ELLIPSE, {size, size});
}

double masked_quantile(const cv::Mat& plane, const cv::Mat& use, double fraction) {
  std::vector<float> values;
  for (int y = 0; y < plane.rows; ++y)
    for (int x = 0; x < plane.cols; ++x)
      if (use.empty() || use.at<std::uint8_t>(y, x) != 0) values.push_back(plane.at<float>(y, x));
  if (values.empty()) return 0;
  const auto at = values.begin() + std::ptrdiff_t(fraction * double(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return double(*at);
}

/// The largest component and those at least a twentieth of it; nothing if none has `least` pixels.
cv::Mat large_components(const cv::Mat& mask, double least) {
  cv::Mat labels, statistics, centroids;
  const int count = cv::connectedComponentsWithStats(mask, labels, statistics, centroids, 4);
  int largest = 0;
  for (int i = 1; i < count; ++i)
    largest = std::max(largest, statistics.at<int>(i, cv::CC_STAT_AREA));
  const double limit = std::max(least, largest / 20.0);
  cv::Mat kept(mask.size(), CV_8U, cv::Scalar(0));
  for (int y = 0; y < mask.rows; ++y)
    for (int x = 0; x < mask.cols; ++x) {
      const int label = labels.at<int>(y, x);
      if (label > 0 && statistics.at<int>(label, cv::CC_STAT_AREA) >= limit)
        kept.at<std::uint8_t>(y, x) = 255;
    }
  return kept;
}

void fill_holes(cv::Mat& mask) {
  cv::Mat outside;
  cv::copyMakeBorder(mask, outside, 1, 1, 1, 1, cv::BORDER_CONSTANT, cv::Scalar(0));
  cv::floodFill(outside, {0, 0}, cv::Scalar(128));
  for (int y = 0; y < mask.rows; ++y)
    for (int x = 0; x < mask.cols; ++x)
      mask.at<std::uint8_t>(y, x) = outside.at<std::uint8_t>(y + 1, x + 1) == 128 ? 0 : 255;
}

struct Difference {
  cv::Mat raw;     ///< |light - background|
  cv::Mat closed;  ///< the same with the stripes joined
  double spread = 0;
};

Difference difference_to(const Background& background, const cv::Mat& light, double period) {
  Difference difference;
  cv::absdiff(light, background.light, difference.raw);
  cv::morphologyEx(difference.raw, difference.closed, cv::MORPH_CLOSE, disc(0.4 * period), {-1, -1},
                   1, cv::BORDER_REPLICATE);
  difference.spread = background.spread;
  return difference;
}

cv::Mat find_cloth(const Difference& difference, double period) {
  const double bright = masked_quantile(difference.closed, {}, 0.995);
  const double limit = std::max(kSpreads * difference.spread, kLeastContrast * bright);
  cv::Mat mask = difference.closed > limit;
  cv::morphologyEx(mask, mask, cv::MORPH_OPEN, disc(0.15 * period), {-1, -1}, 1,
                   cv::BORDER_REPLICATE);
  mask = large_components(mask, 4 * period * period);
  fill_holes(mask);
  return mask;
}

/// Peels rim pixels whose difference is below half of the least of the cloth's within 3 px; the
/// cloth's own are those at least 2 px inside.
void refine_edge(cv::Mat& mask, const cv::Mat& raw) {
  constexpr int kReach = 3;
  cv::Mat core, inner, least;
  for (int round = 0; round < 2 * kReach; ++round) {
    cv::erode(mask, core, disc(2), {-1, -1}, 1, cv::BORDER_CONSTANT, cv::Scalar(255));
    inner = cv::Mat(raw.size(), CV_32F, cv::Scalar(1e9));
    raw.copyTo(inner, core);
    cv::erode(inner, least, disc(kReach), {-1, -1}, 1, cv::BORDER_CONSTANT, cv::Scalar(1e9));
    cv::erode(mask, core, disc(1), {-1, -1}, 1, cv::BORDER_CONSTANT, cv::Scalar(255));
    const cv::Mat weak = (raw < 0.5 * least) & (least < 1e8);
    const cv::Mat drop = weak & mask & ~core;
    if (cv::countNonZero(drop) == 0) break;
    mask.setTo(0, drop);
  }
}

}  // namespace

SilhouetteResult find_silhouette(const Image& intensity, const SilhouetteOptions& options) {
  const double period = options.stripe_period;
  if (!(period >= 2 && period <= 200))
    throw Error("silhouette: stripe_period is " + std::to_string(period) +
                " px, must be from 2 to 200");
  if (intensity.size() == 0) throw Error("silhouette: the image is empty");
  const cv::Mat frame(int(intensity.rows()), int(intensity.cols()), CV_32F,
                      const_cast<float*>(intensity.data()));
  cv::Mat light;
  cv::GaussianBlur(frame, light, {3, 3}, 0.6, 0.6, cv::BORDER_REPLICATE);

  const int border = std::max(4, std::min(frame.rows, frame.cols) / 20);
  cv::Mat use(frame.size(), CV_8U, cv::Scalar(255));
  if (frame.cols > 2 * border && frame.rows > 2 * border)
    use(cv::Rect(border, border, frame.cols - 2 * border, frame.rows - 2 * border)).setTo(0);
  Background background = fit_background(light, use);
  Difference difference = difference_to(background, light, period);
  cv::Mat mask = find_cloth(difference, period);

  cv::dilate(mask, use, disc(0.75 * period), {-1, -1}, 1, cv::BORDER_CONSTANT, cv::Scalar(0));
  use = ~use;
  if (cv::countNonZero(use) > int(use.total() / 20)) {
    background = fit_background(light, use);
    difference = difference_to(background, light, period);
    mask = find_cloth(difference, period);
  }
  refine_edge(mask, difference.raw);
  mask = large_components(mask, 4 * period * period);
  fill_holes(mask);

  SilhouetteResult result;
  result.silhouette.resize(intensity.rows(), intensity.cols());
  for (int y = 0; y < mask.rows; ++y)
    for (int x = 0; x < mask.cols; ++x)
      result.silhouette(y, x) = mask.at<std::uint8_t>(y, x) != 0 ? 1 : 0;
  if (cv::countNonZero(mask) > 0)
    result.confidence = masked_quantile(difference.closed, mask, 0.5) / background.spread;
  return result;
}

}  // namespace weft
