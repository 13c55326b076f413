#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "weft/optics/raster.h"

namespace weft {

/// Depth of the surface as the projector sees it, for the question whether a point is lit. Depths
/// are kept inverted (1/m), which is affine over the image of a triangle.
class ShadowMap {
 public:
  struct Vertex {
    float x, y;           ///< projector px
    float inverse_depth;  ///< 1/m; 0: not in front of the projector
  };
  /// Gradient of the inverse depth over a triangle, per texel, along x and y.
  using Slope = ImagePoint;

  /// `texels_per_pixel` > 0; `bias` in m.
  ShadowMap(double texels_per_pixel, double bias);

  /// Draws the triangles; slopes[t] is what lit() asks for points of triangle t.
  void draw(const std::vector<Vertex>& vertices, const std::vector<std::array<int, 3>>& triangles,
            std::vector<Slope>& slopes);

  /// Fraction, 0 to 1, of the bilinear neighbourhood of (x, y) that the projector sees. The depth
  /// of the surface is continued along `slope` to the four texels, so that a slanted surface does
  /// not shadow itself.
  float lit(float x, float y, float inverse_depth, Slope slope) const {
    const float u = (x - origin_x_) * scale_ - 0.5f, v = (y - origin_y_) * scale_ - 0.5f;
    if (!(u >= 0 && v >= 0 && u < limit_x_ && v < limit_y_)) return 1;
    const int i = static_cast<int>(v), j = static_cast<int>(u);
    const float fx = u - static_cast<float>(j), fy = v - static_cast<float>(i);
    const float* upper = &inverse_depth_[static_cast<std::size_t>(i) * columns_ + j];
    const float* lower = upper + columns_;
    const float tolerated = inverse_depth + bias_ * inverse_depth * inverse_depth;
    const float at = tolerated - fx * slope.x - fy * slope.y;
    const bool a = upper[0] <= at, b = upper[1] <= at + slope.x;
    const bool c = lower[0] <= at + slope.y, d = lower[1] <= at + slope.x + slope.y;
    if (a && b && c && d) return 1;
    const float top = (1 - fx) * static_cast<float>(a) + fx * static_cast<float>(b);
    const float bottom = (1 - fx) * static_cast<float>(c) + fx * static_cast<float>(d);
    return (1 - fy) * top + fy * bottom;
  }

 private:
  void place(const std::vector<Vertex>& vertices);
  void draw_triangle(const Vertex& a, const Vertex& b, const Vertex& c, Slope& slope);

  float requested_scale_, bias_;
  float scale_ = 1;
  float origin_x_ = 0, origin_y_ = 0;
  float limit_x_ = 0, limit_y_ = 0;
  int columns_ = 0, rows_ = 0;
  std::vector<float> inverse_depth_;
};

}  // namespace weft
