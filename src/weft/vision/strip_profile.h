#pragma once
#include <filesystem>
#include <optional>

#include "weft/base/types.h"

namespace weft {

/// A picture in shades of grey as its file has it, 0 to 1 (no transfer curve undone: for lines and
/// edges, not for light). Throws Error if it cannot be read.
Image read_grey_image(const std::filesystem::path& path);

struct StripProfileOptions {
  /// px, where the strip leaves the clamp; empty: the brightest point of the left or right border,
  /// of the two the brighter one.
  std::optional<Vec2> clamp = {};
  double blur = 3;    ///< px, standard deviation; above the width of loose fibres; 0 to 50
  double step = 4;    ///< px between points of the profile, 1 to 50
  double reach = 16;  ///< px to both sides in which the line is looked for, 4 to 200
  double contrast =
      0.35;  ///< the strip ends where the line is below this of its median, 0.05 to 0.95
};

/// The bright line that a strip's edge makes in a picture from the side before a dark ground: its
/// points from the clamp to the free end, px, 2 x points (x right, y down).
///
/// The ground is the median of the picture. From the clamp on, in steps along the line: across the
/// way, the brightest point and the light-weighted mean of what is at least half as bright around
/// it. Blurring first makes a loose fibre darker than the strip. Throws Error for options out of
/// range and where no line of at least 20 points begins at the clamp.
MaterialPoints find_strip_profile(const Image& grey, const StripProfileOptions& options = {});

}  // namespace weft
