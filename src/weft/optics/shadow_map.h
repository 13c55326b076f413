#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "weft/optics/float_lanes.h"
#include "weft/optics/raster.h"

namespace weft {

/// Depth of the surface as the projector sees it, for the question whether a point is lit. Depths
/// are kept inverted (1/m), which is affine over the image of a triangle.
class ShadowMap {
 public:
  struct alignas(16) Vertex {
    float x, y;           ///< projector px
    float inverse_depth;  ///< 1/m; 0: not in front of the projector
    float unused = 0;     ///< four floats are read
  };
  /// Gradient of the inverse depth over a triangle, per texel, along x and y.
  using Slope = ImagePoint;

  /// `texels_per_pixel` > 0; `bias` in m.
  ShadowMap(double texels_per_pixel, double bias);

  /// Draws the triangles; slopes[t] is what lit() asks for points of triangle t.
  void draw(const std::vector<Vertex>& vertices, const std::vector<std::array<int, 3>>& triangles,
            std::vector<Slope>& slopes);

  /// Fraction, 0 to 1, of the bilinear neighbourhood of (x, y) that the projector sees. The depth
  /// of the surface is continued along its slope (as draw() returns it) to the four texels, so that
  /// a slanted surface does not shadow itself. 1 outside the map.
  FloatLanes lit(FloatLanes x, FloatLanes y, FloatLanes inverse_depth, FloatLanes slope_x,
                 FloatLanes slope_y) const {
    const FloatLanes none = {};
    FloatLanes u = (x - origin_x_) * scale_ - 0.5f, v = (y - origin_y_) * scale_ - 0.5f;
    const IntLanes inside = (u >= 0) & (v >= 0) & (u < limit_x_) & (v < limit_y_);
    u = inside ? u : none;
    v = inside ? v : none;
    const IntLanes i = to_int(v), j = to_int(u), texel = i * columns_ + j;
    const FloatLanes fx = u - to_float(j), fy = v - to_float(i);
    const auto [upper_left, upper_right] = load_pairs(inverse_depth_.data(), texel);
    const auto [lower_left, lower_right] = load_pairs(inverse_depth_.data() + columns_, texel);
    const FloatLanes tolerated = inverse_depth + bias_ * inverse_depth * inverse_depth;
    const FloatLanes at = tolerated - fx * slope_x - fy * slope_y;
    const IntLanes a = upper_left <= at, b = upper_right <= at + slope_x;
    const IntLanes c = lower_left <= at + slope_y, d = lower_right <= at + slope_x + slope_y;
    const FloatLanes one = none + 1;
    const FloatLanes top = (1 - fx) * (a ? one : none) + fx * (b ? one : none);
    const FloatLanes bottom = (1 - fx) * (c ? one : none) + fx * (d ? one : none);
    return (a & b & c & d) | ~inside ? one : (1 - fy) * top + fy * bottom;
  }

 private:
  void place(const std::vector<Vertex>& vertices);
  using Triangle = std::array<int, 3>;
  void draw_triangles(const std::vector<Vertex>& vertices, const Triangle* triangles, int count,
                      Slope* slopes);
  void draw_rows(const TriangleSpans::Rows& rows, FloatLanes start, float slope);

  float requested_scale_, bias_;
  float scale_ = 1;
  float origin_x_ = 0, origin_y_ = 0;
  float limit_x_ = 0, limit_y_ = 0;
  int columns_ = 0, rows_ = 0;
  std::vector<float> inverse_depth_ = std::vector<float>(kFloatLanes);  ///< longer by a pack
};

}  // namespace weft
