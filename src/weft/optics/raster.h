#pragma once
#include <algorithm>
#include <utility>

namespace weft {

struct ImagePoint {
  float x, y;
};

/// Affine function over a triangle's image: 1 at one vertex and 0 at the other two are the
/// barycentric coordinates; gradients of the second and third one. False for a triangle without
/// area.
struct BarycentricGradient {
  float x1, y1, x2, y2;
  float twice_area;  ///< positive if the vertices run clockwise as seen (y down)

  bool set(ImagePoint a, ImagePoint b, ImagePoint c) {
    const float bx = b.x - a.x, by = b.y - a.y, cx = c.x - a.x, cy = c.y - a.y;
    twice_area = bx * cy - by * cx;
    if (!(twice_area > 1e-9f || twice_area < -1e-9f)) return false;
    const float inverse = 1 / twice_area;
    x1 = cy * inverse, y1 = -cx * inverse;
    x2 = -by * inverse, y2 = bx * inverse;
    return true;
  }
  /// Gradient of the affine function with these values at the vertices.
  ImagePoint of(float a, float b, float c) const {
    return {x1 * (b - a) + x2 * (c - a), y1 * (b - a) + y2 * (c - a)};
  }
};

/// Calls visit(row, begin, end) for the samples (column + 0.5, row + 0.5), columns begin..end - 1,
/// inside a triangle; clipped to `columns` x `rows`. A sample on an edge that two triangles share
/// belongs to exactly one of them: the crossing of an edge with a row is computed from its upper to
/// its lower end, hence alike for both.
template <class Visit>
void for_each_span(ImagePoint a, ImagePoint b, ImagePoint c, int columns, int rows, Visit&& visit) {
  if (b.y < a.y) std::swap(a, b);
  if (c.y < a.y) std::swap(a, c);
  if (c.y < b.y) std::swap(b, c);
  const auto index = [](float coordinate, int limit) {
    return static_cast<int>(std::clamp(coordinate + 0.5f, 0.0f, static_cast<float>(limit)));
  };
  const int top = index(a.y, rows), middle = index(b.y, rows), bottom = index(c.y, rows);
  if (top == bottom) return;
  const auto slope = [](ImagePoint from, ImagePoint to) {
    return (to.x - from.x) / (to.y - from.y);
  };
  const float long_slope = slope(a, c);
  const auto sweep = [&](int first, int last, ImagePoint from, ImagePoint to) {
    if (first == last) return;
    const float short_slope = slope(from, to);
    for (int row = first; row < last; ++row) {
      const float y = static_cast<float>(row) + 0.5f;
      const float x0 = a.x + (y - a.y) * long_slope, x1 = from.x + (y - from.y) * short_slope;
      const int begin = index(std::min(x0, x1), columns), end = index(std::max(x0, x1), columns);
      if (begin < end) visit(row, begin, end);
    }
  };
  sweep(top, middle, a, b);
  sweep(middle, bottom, b, c);
}

}  // namespace weft
