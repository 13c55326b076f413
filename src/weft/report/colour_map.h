#pragma once
#include <array>
#include <cstdint>
#include <string>

namespace weft {

struct Rgb {
  std::uint8_t red = 0, green = 0, blue = 0;
  friend bool operator==(const Rgb&, const Rgb&) = default;
};

/// Maps whose steps look equally large: `viridis` for amounts, `inferno` for amounts on a black
/// ground, `twilight` for angles: its two ends are the same colour, and its middle is the lightest.
enum class ColourMap { viridis, inferno, twilight };

/// The 256 colours of a map, as tabulated by OpenCV.
const std::array<Rgb, 256>& colours(ColourMap map);
/// The colour at t, clamped to [0, 1]; NaN gives the colour at 0.
Rgb colour_at(ColourMap map, double t);

/// "#1f2a44".
std::string hex(Rgb colour);
/// Relative luminance, 0 to 1 (WCAG 2.1), to choose between dark and light text.
double luminance(Rgb colour);

}  // namespace weft
