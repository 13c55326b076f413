#include "weft/optics/shadow_map.h"

#include <limits>

namespace weft {
namespace {

// Texels along an axis; a surface that spans more gets a coarser map.
constexpr float kLargestMap = 4096;
// A slanted triangle's depth is continued by at most this many biases per texel: an edge-on
// triangle has no usable gradient.
constexpr float kSteepest = 10;

}  // namespace

ShadowMap::ShadowMap(double texels_per_pixel, double bias)
    : requested_scale_(static_cast<float>(texels_per_pixel)), bias_(static_cast<float>(bias)) {}

void ShadowMap::place(const std::vector<Vertex>& vertices) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  float left = kInfinity, right = -kInfinity, top = kInfinity, bottom = -kInfinity;
  for (const Vertex& v : vertices) {
    if (v.inverse_depth <= 0) continue;
    left = std::min(left, v.x), right = std::max(right, v.x);
    top = std::min(top, v.y), bottom = std::max(bottom, v.y);
  }
  columns_ = rows_ = 0;
  limit_x_ = limit_y_ = 0;
  if (!(left <= right)) return;
  scale_ = std::min(requested_scale_, kLargestMap / std::max({right - left, bottom - top, 1e-3f}));
  // Two texels of margin: the neighbourhood of every point of the surface is inside.
  origin_x_ = left - 2 / scale_;
  origin_y_ = top - 2 / scale_;
  columns_ = static_cast<int>((right - left) * scale_) + 5;
  rows_ = static_cast<int>((bottom - top) * scale_) + 5;
  limit_x_ = static_cast<float>(columns_ - 1);
  limit_y_ = static_cast<float>(rows_ - 1);
  inverse_depth_.assign(static_cast<std::size_t>(columns_) * rows_ + kFloatLanes, 0.0f);
}

void ShadowMap::draw(const std::vector<Vertex>& vertices,
                     const std::vector<std::array<int, 3>>& triangles, std::vector<Slope>& slopes) {
  place(vertices);
  slopes.assign(triangles.size(), Slope{0, 0});
  const int count = static_cast<int>(triangles.size());
  for (int first = 0; first < count; first += kFloatLanes)
    draw_triangles(vertices, &triangles[first], std::min(kFloatLanes, count - first),
                   &slopes[first]);
}

/// Up to kFloatLanes of them, which are set up side by side.
void ShadowMap::draw_triangles(const std::vector<Vertex>& vertices, const Triangle* triangles,
                               int count, Slope* slopes) {
  const auto corner = [&](std::size_t i) {
    std::array<const float*, kFloatLanes> row;
    for (int k = 0; k < kFloatLanes; ++k)
      row[k] = &vertices[triangles[std::min(k, count - 1)][i]].x;
    return load_columns(row, 0);
  };
  const std::array<std::array<FloatLanes, 4>, 3> corners{corner(0), corner(1), corner(2)};
  const auto texel = [&](std::size_t i) {
    return PointLanes{(corners[i][0] - origin_x_) * scale_, (corners[i][1] - origin_y_) * scale_};
  };
  const PointLanes pa = texel(0), pb = texel(1), pc = texel(2);
  const FloatLanes a = corners[0][2], b = corners[1][2], c = corners[2][2];
  GradientLanes gradient;
  const IntLanes drawn = gradient.set(pa, pb, pc) & (a > 0) & (b > 0) & (c > 0);
  const PointLanes g = gradient.of(a, b, c);
  const FloatLanes steepest = kSteepest * bias_ * a * a;
  const auto clamped = [&](FloatLanes s) {
    return s < -steepest ? -steepest : steepest < s ? steepest : s;
  };
  const PointLanes slope{clamped(g.x), clamped(g.y)};
  const FloatLanes at_left = (0.5f - pa.x) * g.x;
  const TriangleSpans spans(pa, pb, pc, {0, rows_});
  for (int k = 0; k < count; ++k) {
    if (!drawn[k]) continue;
    slopes[k] = {slope.x[k], slope.y[k]};
    spans.for_rows(k, columns_, [&](const TriangleSpans::Rows& rows) {
      draw_rows(rows, a[k] + (rows.y - pa.y[k]) * g.y[k] + at_left[k], g.x[k]);
    });
  }
}

/// `start` is the inverse depth at column 0, less half a column.
void ShadowMap::draw_rows(const TriangleSpans::Rows& rows, FloatLanes start, float slope) {
  float* line = &inverse_depth_[static_cast<std::size_t>(rows.first) * columns_];
  for (int k = 0; k < rows.count; ++k, line += columns_) {
    const int end = rows.end[k];
    int first = rows.begin[k];
    // In packs, as long as most spans; beyond the end nothing changes. One at least: whether a span
    // is empty cannot be guessed.
    do {
      const IntLanes column = first + int_lanes([](int lane) { return lane; });
      const FloatLanes before = load_lanes<FloatLanes>(line + first);
      const FloatLanes here = start[k] + to_float(column) * slope;
      store_lanes(line + first, ((column < end) & (before < here)) ? here : before);
      first += kFloatLanes;
    } while (first < end);
  }
}

}  // namespace weft
