#include "weft/report/colour_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace weft {
namespace {

std::array<Rgb, 256> table(int opencv_map) {
  cv::Mat ramp(1, 256, CV_8U);
  for (int i = 0; i < 256; ++i) ramp.at<std::uint8_t>(0, i) = static_cast<std::uint8_t>(i);
  cv::Mat bgr;
  cv::applyColorMap(ramp, bgr, opencv_map);
  std::array<Rgb, 256> result;
  for (int i = 0; i < 256; ++i) {
    const cv::Vec3b& c = bgr.at<cv::Vec3b>(0, i);
    result[static_cast<std::size_t>(i)] = {c[2], c[1], c[0]};
  }
  return result;
}

}  // namespace

const std::array<Rgb, 256>& colours(ColourMap map) {
  static const std::array<Rgb, 256> viridis = table(cv::COLORMAP_VIRIDIS);
  static const std::array<Rgb, 256> inferno = table(cv::COLORMAP_INFERNO);
  static const std::array<Rgb, 256> twilight = table(cv::COLORMAP_TWILIGHT_SHIFTED);
  switch (map) {
    case ColourMap::viridis:
      return viridis;
    case ColourMap::inferno:
      return inferno;
    case ColourMap::twilight:
      break;
  }
  return twilight;
}

Rgb colour_at(ColourMap map, double t) {
  const double clamped = t > 0 ? std::min(t, 1.0) : 0.0;
  return colours(map)[static_cast<std::size_t>(std::lround(255 * clamped))];
}

std::string hex(Rgb colour) {
  return fmt::format("#{:02x}{:02x}{:02x}", colour.red, colour.green, colour.blue);
}

double luminance(Rgb colour) {
  const auto linear = [](std::uint8_t value) {
    const double s = value / 255.0;
    return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
  };
  return 0.2126 * linear(colour.red) + 0.7152 * linear(colour.green) + 0.0722 * linear(colour.blue);
}

}  // namespace weft
