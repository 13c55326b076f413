#pragma once
#include <algorithm>
#include <cmath>

namespace weft {

/// The sRGB transfer curve (IEC 61966-2-1): linear light to code value, both 0 to 1.
inline double srgb_encode(double linear) {
  linear = std::clamp(linear, 0.0, 1.0);
  return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

inline double srgb_decode(double code) {
  return code <= 0.04045 ? code / 12.92 : std::pow((code + 0.055) / 1.055, 2.4);
}

/// Linear light as an 8-bit code value, rounded to the nearest.
inline unsigned char srgb_byte(double linear) {
  return static_cast<unsigned char>(std::lround(255 * srgb_encode(linear)));
}

}  // namespace weft
