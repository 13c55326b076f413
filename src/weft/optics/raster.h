#pragma once
#include <algorithm>

#include "weft/optics/float_lanes.h"

namespace weft {

/// Of float, or of FloatLanes: several points.
template <class Value>
struct BasicPoint {
  Value x, y;
};
using ImagePoint = BasicPoint<float>;
using PointLanes = BasicPoint<FloatLanes>;

/// Affine function over a triangle's image: 1 at one vertex and 0 at the other two are the
/// barycentric coordinates; gradients of the second and third one.
template <class Value>
struct BasicGradient {
  using Point = BasicPoint<Value>;
  Value x1, y1, x2, y2;
  Value twice_area;  ///< positive if the vertices run clockwise as seen (y down)

  /// Whether the triangle has an area; else the gradients mean nothing.
  auto set(Point a, Point b, Point c) {
    const Value bx = b.x - a.x, by = b.y - a.y, cx = c.x - a.x, cy = c.y - a.y;
    twice_area = bx * cy - by * cx;
    const Value inverse = 1 / twice_area;
    x1 = cy * inverse, y1 = -cx * inverse;
    x2 = -by * inverse, y2 = bx * inverse;
    return (twice_area > 1e-9f) | (twice_area < -1e-9f);
  }
  /// Gradient of the affine function with these values at the vertices.
  Point of(Value a, Value b, Value c) const {
    return {x1 * (b - a) + x2 * (c - a), y1 * (b - a) + y2 * (c - a)};
  }
};
using BarycentricGradient = BasicGradient<float>;
using GradientLanes = BasicGradient<FloatLanes>;

/// Samples first..last - 1 along one axis; empty if last <= first.
struct Extent {
  int first = 0, last = 0;
};

/// Which samples (column + 0.5, row + 0.5) several triangles cover. A sample on a side that two
/// triangles share belongs to exactly one of them: the crossing of a side with a row is computed
/// from its upper to its lower end, hence alike for both.
class TriangleSpans {
 public:
  /// Samples begin..end - 1 of each of the rows first..first + count - 1; may be empty. `y` is that
  /// of the samples. What is beyond `count` lanes means nothing.
  struct Rows {
    int first, count;
    FloatLanes y;
    IntLanes begin, end;
  };

  /// Clipped to these rows.
  TriangleSpans(PointLanes a, PointLanes b, PointLanes c, Extent rows) {
    const auto order = [](PointLanes& upper, PointLanes& lower) {
      const IntLanes wrong = lower.y < upper.y;
      const PointLanes before = upper;
      upper = {wrong ? lower.x : before.x, wrong ? lower.y : before.y};
      lower = {wrong ? before.x : lower.x, wrong ? before.y : lower.y};
    };
    order(a, b);
    order(a, c);
    order(b, c);
    const auto index = [&](FloatLanes y) { return clamped(y + 0.5f, rows.first, rows.last); };
    top_ = index(a.y), middle_ = index(b.y), bottom_ = index(c.y);
    const auto slope = [](PointLanes from, PointLanes to) {
      return (to.x - from.x) / (to.y - from.y);
    };
    long_slope_ = slope(a, c), upper_slope_ = slope(a, b), lower_slope_ = slope(b, c);
    upper_ = a, side_ = b;
  }

  /// Calls visit(Rows) for triangle k, clipped to the columns 0..columns - 1.
  template <class Visit>
  void for_rows(int k, int columns, Visit&& visit) const {
    const int middle = middle_[k], bottom = bottom_[k];
    const float ax = upper_.x[k], ay = upper_.y[k], bx = side_.x[k], by = side_.y[k];
    const float long_slope = long_slope_[k], upper = upper_slope_[k], lower = lower_slope_[k];
    // Where a side is level its slope is not finite, and no row takes it.
    for (int first = top_[k]; first < bottom; first += kFloatLanes) {
      const IntLanes row = first + int_lanes([](int lane) { return lane; });
      const FloatLanes y = to_float(row) + 0.5f;
      const FloatLanes x0 = ax + (y - ay) * long_slope;
      const FloatLanes x1 = row < middle ? ax + (y - ay) * upper : bx + (y - by) * lower;
      const auto index = [&](FloatLanes x) { return clamped(x + 0.5f, 0, columns); };
      visit(Rows{first, std::min(kFloatLanes, bottom - first), y, index(x1 < x0 ? x1 : x0),
                 index(x0 < x1 ? x1 : x0)});
    }
  }

 private:
  static IntLanes clamped(FloatLanes a, int from, int to) {
    const FloatLanes lower = FloatLanes{} + static_cast<float>(from);
    const FloatLanes upper = FloatLanes{} + static_cast<float>(to);
    return to_int(a < lower ? lower : upper < a ? upper : a);
  }

  IntLanes top_, middle_, bottom_;
  FloatLanes long_slope_, upper_slope_, lower_slope_;
  PointLanes upper_, side_;  ///< the first two corners by their height
};

/// Calls visit(row, begin, end) for the samples of one triangle, columns begin..end - 1; clipped to
/// `columns` x `rows`.
template <class Visit>
void for_each_span(ImagePoint a, ImagePoint b, ImagePoint c, int columns, int rows, Visit&& visit) {
  const auto lanes = [](ImagePoint p) {
    return PointLanes{FloatLanes{} + p.x, FloatLanes{} + p.y};
  };
  const TriangleSpans spans(lanes(a), lanes(b), lanes(c), {0, rows});
  spans.for_rows(0, columns, [&](const TriangleSpans::Rows& row) {
    for (int k = 0; k < row.count; ++k)
      if (row.begin[k] < row.end[k]) visit(row.first + k, row.begin[k], row.end[k]);
  });
}

}  // namespace weft
