#pragma once
#include <algorithm>
#include <utility>

#include "weft/optics/float_lanes.h"

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
  const float long_slope = slope(a, c), upper_slope = slope(a, b), lower_slope = slope(b, c);
  // Several rows at a time. Where a side is level its slope is not finite, and no row takes it.
  for (int first = top; first < bottom; first += kFloatLanes) {
    const IntLanes row = first + int_lanes([](int k) { return k; });
    const FloatLanes y = to_float(row) + 0.5f;
    const FloatLanes x0 = a.x + (y - a.y) * long_slope;
    const FloatLanes x1 =
        row < middle ? a.x + (y - a.y) * upper_slope : b.x + (y - b.y) * lower_slope;
    const auto indices = [&](FloatLanes coordinate) {
      const FloatLanes lower = {}, upper = lower + static_cast<float>(columns);
      coordinate += 0.5f;
      return to_int(coordinate < lower ? lower : upper < coordinate ? upper : coordinate);
    };
    const IntLanes begin = indices(x1 < x0 ? x1 : x0), end = indices(x0 < x1 ? x1 : x0);
    const int count = std::min(kFloatLanes, bottom - first);
    for (int k = 0; k < count; ++k)
      if (begin[k] < end[k]) visit(first + k, begin[k], end[k]);
  }
}

}  // namespace weft
