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
  for (std::size_t t = 0; t < triangles.size(); ++t)
    draw_triangle(vertices[triangles[t][0]], vertices[triangles[t][1]], vertices[triangles[t][2]],
                  slopes[t]);
}

void ShadowMap::draw_triangle(const Vertex& a, const Vertex& b, const Vertex& c, Slope& slope) {
  if (a.inverse_depth <= 0 || b.inverse_depth <= 0 || c.inverse_depth <= 0) return;
  const auto texel = [&](const Vertex& v) {
    return ImagePoint{(v.x - origin_x_) * scale_, (v.y - origin_y_) * scale_};
  };
  const ImagePoint pa = texel(a), pb = texel(b), pc = texel(c);
  BarycentricGradient gradient;
  if (!gradient.set(pa, pb, pc)) return;
  const Slope g = gradient.of(a.inverse_depth, b.inverse_depth, c.inverse_depth);
  const float steepest = kSteepest * bias_ * a.inverse_depth * a.inverse_depth;
  slope = {std::clamp(g.x, -steepest, steepest), std::clamp(g.y, -steepest, steepest)};
  for_each_span(pa, pb, pc, columns_, rows_, [&](int row, int begin, int end) {
    float* line = &inverse_depth_[static_cast<std::size_t>(row) * columns_];
    const float start =
        a.inverse_depth + (static_cast<float>(row) + 0.5f - pa.y) * g.y + (0.5f - pa.x) * g.x;
    // In packs, as long as most spans; beyond the end nothing changes.
    for (int first = begin; first < end; first += kFloatLanes) {
      const IntLanes column = first + int_lanes([](int k) { return k; });
      const FloatLanes before = load_lanes<FloatLanes>(line + first);
      const FloatLanes here = start + to_float(column) * g.x;
      store_lanes(line + first, ((column < end) & (before < here)) ? here : before);
    }
  });
}

}  // namespace weft
