#pragma once
#include <cmath>
#include <numbers>

#include "weft/base/random.h"
#include "weft/base/types.h"

namespace weft::testing {

struct Grating {
  double angle = 0;  ///< rad, along the stripes
  double period = 17;
  double contrast = 1;  ///< (brightest - darkest) / full scale
  bool square = false;
  double noise = 0;  ///< standard deviation, of full scale
  double phase = 0.7;
};

/// +-1 patterns at one point.
inline double sine_wave(double cycles) { return std::sin(2 * std::numbers::pi * cycles); }
inline double square_wave(double cycles) { return sine_wave(cycles) > 0 ? 1 : -1; }

/// Around grey 0.5; squares are averaged over 8 x 8 points a pixel.
inline Image make_grating(int width, int height, const Grating& grating, std::uint64_t seed = 1) {
  const double nx = -std::sin(grating.angle), ny = std::cos(grating.angle);
  const int points = grating.square ? 8 : 1;
  Rng random(seed);
  Image image(height, width);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      double sum = 0;
      for (int i = 0; i < points; ++i)
        for (int j = 0; j < points; ++j) {
          const double px = x + (j + 0.5) / points, py = y + (i + 0.5) / points;
          const double cycles = (px * nx + py * ny) / grating.period + grating.phase;
          sum += grating.square ? square_wave(cycles) : sine_wave(cycles);
        }
      const double pattern = 0.5 * grating.contrast * sum / (points * points);
      image(y, x) =
          float(0.5 + pattern + (grating.noise > 0 ? grating.noise * random.normal() : 0));
    }
  return image;
}

/// Circles around (cx, cy) in continuous image coordinates.
inline Image make_rings(int width, int height, double cx, double cy, double period) {
  Image image(height, width);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      image(y, x) = float(0.5 + 0.4 * sine_wave(std::hypot(x + 0.5 - cx, y + 0.5 - cy) / period));
  return image;
}

}  // namespace weft::testing
