#include "weft/optics/render.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "weft/base/error.h"
#include "weft/optics/float_lanes.h"
#include "weft/optics/raster.h"
#include "weft/optics/shadow_map.h"
#include "weft/optics/smooth_surface.h"
#include "weft/optics/stripe_filter.h"

namespace weft {
namespace {

constexpr double kNearest = 1e-3;      // m, from the plane of a device
constexpr double kLargestImage = 1e6;  // px; farther out, rounding would spoil the edges
// Rows of pixels that are drawn and then resolved together: their samples stay in the cache.
constexpr int kBandHeight = 16;

void require(bool good, const char* what, double value, const char* valid) {
  if (!good) throw Error(fmt::format("render: {} is {}; must be {}", what, value, valid));
}

void check(const Rig& rig, const RenderOptions& o) {
  require(rig.width >= 1 && rig.width <= 16384, "image width", rig.width, "1 to 16384 px");
  require(rig.height >= 1 && rig.height <= 16384, "image height", rig.height, "1 to 16384 px");
  if (rig.camera.projection().isZero()) throw Error("render: the rig has no camera");
  if (rig.projector.projection().isZero()) throw Error("render: the rig has no projector");
  require(rig.projector_width >= 0, "projector width", rig.projector_width, "0 or more px");
  require(rig.projector_height >= 0, "projector height", rig.projector_height, "0 or more px");
  const auto fraction = [](double value) { return value >= 0 && value <= 1; };
  require(o.supersampling >= 1 && o.supersampling <= 8, "supersampling", o.supersampling, "1 to 8");
  require(fraction(o.ambient), "ambient", o.ambient, "in [0, 1]");
  require(fraction(o.albedo), "albedo", o.albedo, "in [0, 1]");
  require(fraction(o.background), "background", o.background, "in [0, 1]");
  require(o.shadow_bias > 0 && std::isfinite(o.shadow_bias), "shadow_bias", o.shadow_bias, "> 0 m");
  require(o.shadow_scale > 0 && o.shadow_scale <= 8, "shadow_scale", o.shadow_scale, "in (0, 8]");
}

/// A point of the surface as both devices see it. Quantities divided by the camera's depth are
/// affine over the image of a triangle.
struct alignas(32) Vertex {
  /// Homogeneous projector coordinates and 1, over the camera's depth. Last one 0: the camera does
  /// not see it; third one 0: the projector does not.
  std::array<float, 4> over_depth{};
  float cosine = 0;    ///< of normal and direction to the projector, signed
  float row = 0;       ///< projector px, for the size of footprints
  float x = 0, y = 0;  ///< camera image, samples
  float inverse_depth() const { return over_depth[3]; }
  const float* row_of_table() const { return over_depth.data(); }
};
static_assert(sizeof(Vertex) == 8 * sizeof(float));

/// Several of them.
struct VertexLanes {
  std::array<FloatLanes, 4> over_depth;
  FloatLanes cosine, row;
  PointLanes image;
  FloatLanes inverse_depth() const { return over_depth[3]; }
  IntLanes lit() const { return over_depth[2] > 0; }
};

/// What shading needs at a point, each affine over the image of a triangle or constant: homogeneous
/// projector coordinates and 1, over the camera's depth; the cosine on the camera's side (0: no
/// light); projector rows a sample; the slope of the shadow map's depth.
enum AffineEntry { kColumn, kRow, kDepth, kOne, kCosine, kFootprint, kSlopeX, kSlopeY };
constexpr int kAffine = kFootprint;  // entries before are affine, the others constant
using Affine = std::array<FloatLanes, 8>;

/// A drawn triangle, as shading needs it: a row of a table.
struct alignas(32) Piece {
  std::array<float, 8> at_corner;
  /// From the corner to the second and third one: changes of the affine entries, then the gradient
  /// of its barycentric coordinate, and of the corner's position in the image one coordinate each.
  struct Side {
    std::array<float, kAffine> change;
    float gradient_x, gradient_y, corner;
  } second, third;
  float* row() { return at_corner.data(); }
  const float* row() const { return at_corner.data(); }
};
static_assert(sizeof(Piece) == 24 * sizeof(float));

/// Of several points.
struct Shades {
  FloatLanes intensity, depth, row;
};

/// Points of the image, samples, and the pieces that are seen there.
struct ShadePoints {
  FloatLanes x{}, y{};
  IntLanes piece{};
};

/// Pixels beside each other: the nearest and the farthest inverse depth of their samples, and the
/// piece at the one in the middle.
struct PixelLanes {
  FloatLanes nearest, farthest;
  IntLanes piece;
};

/// A pixel's column and what covers it.
struct Covered {
  int column, piece;
};

/// A vertex among the rows of samples: the first row whose samples lie below it, and the bands of
/// that row and of the one before.
struct RowOfVertex {
  int row, band, band_before;
};
constexpr int kUnseen = std::numeric_limits<int>::max();
}  // namespace

struct Renderer::Impl {
  Impl(const Rig& rig, const TriangleMesh& mesh, const RenderOptions& options)
      : rig(rig),
        options((check(rig, options), options)),
        surface(mesh, options.subdivision),
        filter(rig.pattern),
        shadow_map(options.shadow_scale, options.shadow_bias),
        samples(options.supersampling),
        albedo(static_cast<float>(options.albedo)),
        ambient(static_cast<float>(options.albedo * options.ambient)) {
    const auto count = static_cast<std::size_t>(surface.points().cols());
    vertices.resize(count);
    shadow_vertices.resize(count);
    pieces.resize(surface.triangles().size());
    depth_range.resize(pieces.size());
    row_of.resize(count);
    bands_of.resize(pieces.size());
    band_begin.resize(static_cast<std::size_t>((rig.height - 1) / kBandHeight) + 2);
    slopes.resize(surface.triangles().size(), ShadowMap::Slope{0, 0});
    sample_columns = rig.width * samples;
    // An odd number of cache lines: rows at the same column do not fight for the same places.
    stride = sample_columns / 32 * 32 + 48;
    const auto buffer = static_cast<std::size_t>(stride) * kBandHeight * samples;
    const auto beyond = static_cast<std::size_t>(kFloatLanes) * samples;  // whole packs of pixels
    inverse_depth.resize(buffer + beyond);
    piece_at.resize(buffer + beyond);
    frame.intensity.setConstant(rig.height, rig.width, static_cast<float>(options.background));
    frame.silhouette.setZero(rig.height, rig.width);
    frame.depth.setZero(rig.height, rig.width);
    if (options.projector_row) frame.projector_row.setConstant(rig.height, rig.width, kNoRow);
    order_samples();
  }

  void render(const Points& x) {
    const Extent last_rows = rows, last_columns = columns;
    surface.evaluate(x);
    project();
    erase_beside(last_rows, last_columns);
    if (options.shadows) shadow_map.draw(shadow_vertices, surface.triangles(), slopes);
    switch (samples) {
      case 1:
        draw<1>();
        break;
      case 2:
        draw<2>();
        break;
      default:
        draw<0>();
    }
  }

 private:
  static constexpr float kNoRow = std::numeric_limits<float>::quiet_NaN();

  void order_samples();
  void erase(Extent erased_rows, Extent erased_columns);
  void erase_beside(Extent last_rows, Extent last_columns);
  void project();
  Vertex project_vertex(const Vec3& point, const Vec3& normal, ShadowMap::Vertex& shadow) const;
  void set_extent(const Eigen::Array2f& low, const Eigen::Array2f& high);
  void find_rows();
  void sort_into_bands();
  template <int kSamples>
  void draw();
  void draw_pieces(const int* t, int count, Extent lines);
  VertexLanes corners(const std::array<int, kFloatLanes>& pieces, std::size_t corner) const;
  void set_pieces(const std::array<int, kFloatLanes>& at_lane, const VertexLanes& a,
                  const VertexLanes& b, const VertexLanes& c, const GradientLanes& gradient);
  void draw_rows(int t, const TriangleSpans::Rows& rows, FloatLanes start, float slope);
  template <int kSamples>
  PixelLanes look_at_pixels(int i, int j) const;
  template <int kSamples>
  void resolve_row(int i);
  void shade_run(int i, int j, IntLanes piece);
  void shade_whole(int i);
  void resolve_sampled(int i, int j);
  int piece_at_centre(int i, int j) const;
  Shades shade(const ShadePoints& points, float footprint_samples) const;
  Shades shine(const Affine& affine, float footprint_samples) const;
  void write_intensity(int i, int j, float intensity);
  void write_surface(int i, int j, float depth, float row);

  /// Of a sample in the band at hand.
  std::size_t at(int row, int column) const {
    return static_cast<std::size_t>(row - first_line) * stride + column;
  }

 public:
  Rig rig;
  RenderOptions options;
  SmoothSurface surface;
  StripeFilter filter;
  ShadowMap shadow_map;
  int samples;
  int sample_columns = 0;
  int stride = 0;  ///< of the buffers of samples
  float albedo;
  float ambient;  ///< times albedo
  std::vector<Vertex> vertices;
  std::vector<ShadowMap::Vertex> shadow_vertices;
  std::vector<ShadowMap::Slope> slopes;
  std::vector<Piece> pieces;
  /// Change of a piece's inverse depth from one sample to the next one, diagonally.
  std::vector<float> depth_range;
  std::vector<RowOfVertex> row_of;
  std::vector<Extent> bands_of;      ///< of each piece
  std::vector<int> band_begin;       ///< the first one of a band among `in_band`, and the end
  std::vector<int> in_band;          ///< the pieces of each band, in order
  int first_line = 0;                ///< row of samples where the band at hand begins
  std::vector<float> inverse_depth;  ///< z-buffer of a band; 0: nothing, everywhere between bands
  std::vector<int> piece_at;         ///< valid where inverse_depth is not 0
  std::vector<std::array<int, 2>> central_first;  ///< samples of a pixel (row, column) by distance
  Extent rows, columns;                           ///< of pixels that the surface may touch
  std::vector<Covered> whole;  ///< pixels of a row that one piece of surface fills, but for runs
  RenderedFrame frame;
};

/// The first covered one of these stands for the pixel's centre if no piece is known to cover it.
void Renderer::Impl::order_samples() {
  for (int i = 0; i < samples; ++i)
    for (int j = 0; j < samples; ++j) central_first.push_back({i, j});
  const auto distance = [&](const std::array<int, 2>& s) {
    const int y = 2 * s[0] + 1 - samples, x = 2 * s[1] + 1 - samples;
    return x * x + y * y;
  };
  std::stable_sort(central_first.begin(), central_first.end(),
                   [&](const auto& s, const auto& t) { return distance(s) < distance(t); });
}

void Renderer::Impl::erase(Extent erased_rows, Extent erased_columns) {
  const int height = erased_rows.last - erased_rows.first;
  const int width = erased_columns.last - erased_columns.first;
  if (height <= 0 || width <= 0) return;
  const auto fill = [&](auto& image, auto value) {
    image.block(erased_rows.first, erased_columns.first, height, width).setConstant(value);
  };
  fill(frame.intensity, static_cast<float>(options.background));
  fill(frame.silhouette, std::uint8_t{0});
  fill(frame.depth, 0.0f);
  if (options.projector_row) fill(frame.projector_row, kNoRow);
}

/// What the last frame covers and this one does not; the rest is erased row by row, before it is
/// written.
void Renderer::Impl::erase_beside(Extent last_rows, Extent last_columns) {
  if (columns.last <= columns.first || rows.last <= rows.first)
    return erase(last_rows, last_columns);
  const Extent both{std::clamp(rows.first, last_rows.first, last_rows.last),
                    std::clamp(rows.last, last_rows.first, last_rows.last)};
  erase({last_rows.first, both.first}, last_columns);
  erase({both.last, last_rows.last}, last_columns);
  erase(both, {last_columns.first, std::min(last_columns.last, columns.first)});
  erase(both, {std::max(last_columns.first, columns.last), last_columns.last});
}

void Renderer::Impl::project() {
  const Points& points = surface.points();
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  Eigen::Array2f low(kInfinity, kInfinity), high(-kInfinity, -kInfinity);
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    const auto column = static_cast<Eigen::Index>(v);
    const Vertex vertex =
        project_vertex(points.col(column), surface.normals().col(column), shadow_vertices[v]);
    vertices[v] = vertex;
    if (vertex.inverse_depth() <= 0) continue;
    const Eigen::Array2f position(vertex.x, vertex.y);
    low = low.min(position);
    high = high.max(position);
  }
  set_extent(low, high);
}

Vertex Renderer::Impl::project_vertex(const Vec3& point, const Vec3& normal,
                                      ShadowMap::Vertex& shadow) const {
  Vertex out;
  shadow = {};
  if (!point.allFinite()) return out;
  const Vec3 seen = rig.camera.project(point);
  const Vec3 lit = rig.projector.project(point);
  const auto usable = [](const Vec3& image, double scale) {
    return image.z() > kNearest && image.head<2>().cwiseAbs().maxCoeff() * scale < kLargestImage;
  };
  if (usable(lit, options.shadow_scale))
    shadow = {static_cast<float>(lit.x()), static_cast<float>(lit.y()),
              static_cast<float>(1 / lit.z())};
  if (!usable(seen, samples)) return out;
  const double inverse = 1 / seen.z(), ratio = lit.z() * inverse;
  out.x = static_cast<float>(seen.x() * samples);
  out.y = static_cast<float>(seen.y() * samples);
  out.over_depth[3] = static_cast<float>(inverse);
  if (shadow.inverse_depth <= 0) return out;
  out.over_depth = {static_cast<float>(lit.x() * ratio), static_cast<float>(lit.y() * ratio),
                    static_cast<float>(ratio), static_cast<float>(inverse)};
  out.cosine = static_cast<float>(normal.dot((rig.projector.center() - point).normalized()));
  out.row = shadow.y;
  return out;
}

void Renderer::Impl::set_extent(const Eigen::Array2f& low, const Eigen::Array2f& high) {
  const auto clipped = [&](float from, float to, int size) {
    if (!(from <= to)) return Extent{};
    const auto pixel = [&](float sample) {
      const float limit = static_cast<float>(size);
      return static_cast<int>(std::clamp(sample / static_cast<float>(samples), 0.0f, limit));
    };
    return Extent{pixel(from), std::min(pixel(to) + 1, size)};
  };
  columns = clipped(low.x(), high.x(), rig.width);
  rows = clipped(low.y(), high.y(), rig.height);
}

void Renderer::Impl::find_rows() {
  const auto last = static_cast<float>(rig.height * samples);
  const int lines = kBandHeight * samples;
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    if (vertices[v].inverse_depth() <= 0) {
      row_of[v] = {0, kUnseen, kUnseen};
      continue;
    }
    const int row = static_cast<int>(std::clamp(vertices[v].y + 0.5f, 0.0f, last));
    row_of[v] = {row, row / lines, (row - 1) / lines};
  }
}

/// Pieces that have no sample or a vertex that is not seen are in none.
void Renderer::Impl::sort_into_bands() {
  find_rows();
  std::fill(band_begin.begin(), band_begin.end(), 0);
  for (std::size_t t = 0; t < pieces.size(); ++t) {
    const auto& [a, b, c] = surface.triangles()[t];
    const RowOfVertex &p = row_of[a], &q = row_of[b], &r = row_of[c];
    const int top = std::min({p.row, q.row, r.row}), bottom = std::max({p.row, q.row, r.row});
    Extent& bands = bands_of[t];
    bands = {std::min({p.band, q.band, r.band}),
             std::max({p.band_before, q.band_before, r.band_before})};
    if (top == bottom || bands.last == kUnseen)
      bands = {};
    else
      ++bands.last;
    for (int band = bands.first; band < bands.last; ++band) ++band_begin[band + 1];
  }
  for (std::size_t band = 1; band < band_begin.size(); ++band)
    band_begin[band] += band_begin[band - 1];
  in_band.resize(static_cast<std::size_t>(band_begin.back()));
  for (std::size_t t = 0; t < pieces.size(); ++t)
    for (int band = bands_of[t].first; band < bands_of[t].last; ++band)
      in_band[band_begin[band]++] = static_cast<int>(t);
  // Where each began.
  std::copy_backward(band_begin.begin(), band_begin.end() - 1, band_begin.end());
  band_begin.front() = 0;
}

/// Band by band: pieces first, then pixels.
template <int kSamples>
void Renderer::Impl::draw() {
  if (columns.last <= columns.first) return;
  sort_into_bands();
  for (int band = rows.first / kBandHeight; band * kBandHeight < rows.last; ++band) {
    const int first = band * kBandHeight, last = std::min(first + kBandHeight, rig.height);
    first_line = first * samples;
    const int begin = band_begin[band], end = band_begin[band + 1];
    for (int k = begin; k < end; k += kFloatLanes)
      draw_pieces(&in_band[k], std::min(kFloatLanes, end - k), {first_line, last * samples});
    for (int i = std::max(first, rows.first); i < std::min(last, rows.last); ++i)
      resolve_row<kSamples>(i);
  }
}

VertexLanes Renderer::Impl::corners(const std::array<int, kFloatLanes>& pieces_at,
                                    std::size_t corner) const {
  std::array<const float*, kFloatLanes> row;
  for (int k = 0; k < kFloatLanes; ++k)
    row[k] = vertices[surface.triangles()[pieces_at[k]][corner]].row_of_table();
  const auto [cosine, projector_row, x, y] = load_columns(row, 4);
  return {load_columns(row, 0), cosine, projector_row, {x, y}};
}

/// Up to kFloatLanes of them, which are set up side by side.
void Renderer::Impl::draw_pieces(const int* t, int count, Extent lines) {
  std::array<int, kFloatLanes> at_lane;
  for (int k = 0; k < kFloatLanes; ++k) at_lane[k] = t[std::min(k, count - 1)];
  const VertexLanes a = corners(at_lane, 0), b = corners(at_lane, 1), c = corners(at_lane, 2);
  GradientLanes gradient;
  const IntLanes drawn = gradient.set(a.image, b.image, c.image);
  const PointLanes depth = gradient.of(a.inverse_depth(), b.inverse_depth(), c.inverse_depth());
  set_pieces(at_lane, a, b, c, gradient);
  const FloatLanes at_left = (0.5f - a.image.x) * depth.x;
  const TriangleSpans spans(a.image, b.image, c.image, lines);
  for (int k = 0; k < count; ++k) {
    if (!drawn[k]) continue;
    depth_range[t[k]] = std::abs(depth.x[k]) + std::abs(depth.y[k]);
    spans.for_rows(k, sample_columns, [&](const TriangleSpans::Rows& rows) {
      const FloatLanes below = rows.y - a.image.y[k];
      draw_rows(t[k], rows, a.inverse_depth()[k] + below * depth.y[k] + at_left[k], depth.x[k]);
    });
  }
}

void Renderer::Impl::set_pieces(const std::array<int, kFloatLanes>& at_lane, const VertexLanes& a,
                                const VertexLanes& b, const VertexLanes& c,
                                const GradientLanes& gradient) {
  const FloatLanes one = FloatLanes{} + 1;
  const FloatLanes facing =
      a.lit() & b.lit() & c.lit() ? (gradient.twice_area < 0 ? one : -one) : FloatLanes{};
  const PointLanes row = gradient.of(a.row, b.row, c.row);
  const FloatLanes square = row.x * row.x + row.y * row.y;
  const auto slope = [&](auto ShadowMap::Slope::*axis) {
    return float_lanes([&](int k) { return slopes[at_lane[k]].*axis; });
  };
  std::array<float*, kFloatLanes> to;
  for (int k = 0; k < kFloatLanes; ++k) to[k] = pieces[at_lane[k]].row();
  store_columns(to, 0, a.over_depth[0], a.over_depth[1], a.over_depth[2], a.over_depth[3]);
  store_columns(to, 4, facing * a.cosine, float_lanes([&](int k) { return std::sqrt(square[k]); }),
                slope(&ShadowMap::Slope::x), slope(&ShadowMap::Slope::y));
  const auto store_side = [&](std::size_t first, const VertexLanes& v, FloatLanes x, FloatLanes y,
                              FloatLanes corner) {
    std::array<FloatLanes, 4> change;
    for (std::size_t i = 0; i < 4; ++i) change[i] = v.over_depth[i] - a.over_depth[i];
    store_columns(to, first, change[0], change[1], change[2], change[3]);
    store_columns(to, first + 4, facing * (v.cosine - a.cosine), x, y, corner);
  };
  store_side(8, b, gradient.x1, gradient.y1, a.image.x);
  store_side(16, c, gradient.x2, gradient.y2, a.image.y);
}

/// `start` is the inverse depth at column 0, less half a column.
void Renderer::Impl::draw_rows(int t, const TriangleSpans::Rows& rows, FloatLanes start,
                               float slope) {
  float* nearest_here = &inverse_depth[at(rows.first, 0)];
  int* owner = &piece_at[at(rows.first, 0)];
  for (int k = 0; k < rows.count; ++k, nearest_here += stride, owner += stride) {
    const int end = rows.end[k];
    int first = rows.begin[k];
    // In packs, as long as most spans: no loop whose length must be guessed. Beyond the end nothing
    // changes. One at least: nor can be guessed whether a span is empty.
    do {
      const IntLanes column = first + int_lanes([](int lane) { return lane; });
      const FloatLanes before = load_lanes<FloatLanes>(nearest_here + first);
      const FloatLanes z = start[k] + to_float(column) * slope;
      const IntLanes seen = (column < end) & (z > before);
      store_lanes(nearest_here + first, seen ? z : before);
      const IntLanes owned = load_lanes<IntLanes>(owner + first);
      store_lanes(owner + first, seen ? IntLanes{} + t : owned);
      first += kFloatLanes;
    } while (first < end);
  }
}

/// The surface at points on the planes of pieces, which may end a little before.
Shades Renderer::Impl::shade(const ShadePoints& points, float footprint_samples) const {
  std::array<const float*, kFloatLanes> row;
  for (int k = 0; k < kFloatLanes; ++k) row[k] = pieces[points.piece[k]].row();
  const auto [second_4, second_x, second_y, x] = load_columns(row, 12);
  const auto [third_4, third_x, third_y, y] = load_columns(row, 20);
  const FloatLanes dx = points.x - x, dy = points.y - y;
  // Not far beyond the piece: the plane of one seen edge-on is steep.
  const FloatLanes lower = FloatLanes{} - 0.5f, upper = FloatLanes{} + 1.5f;
  const auto clamped = [&](FloatLanes a) { return a < lower ? lower : upper < a ? upper : a; };
  const FloatLanes beta = clamped(second_x * dx + second_y * dy);
  const FloatLanes gamma = clamped(third_x * dx + third_y * dy);
  const auto corner = load_columns(row, 0), second = load_columns(row, 8);
  const auto third = load_columns(row, 16);
  const auto [corner_4, footprint, slope_x, slope_y] = load_columns(row, 4);
  Affine affine;
  for (std::size_t k = 0; k < 4; ++k) affine[k] = corner[k] + beta * second[k] + gamma * third[k];
  affine[kCosine] = corner_4 + beta * second_4 + gamma * third_4;
  affine[kFootprint] = footprint;
  affine[kSlopeX] = slope_x;
  affine[kSlopeY] = slope_y;
  return shine(affine, footprint_samples);
}

/// Without branches, so that the points are shaded side by side.
Shades Renderer::Impl::shine(const Affine& affine, float footprint_samples) const {
  const FloatLanes none = {};
  const FloatLanes scale = 1 / affine[kDepth];
  FloatLanes column = affine[kColumn] * scale, row = affine[kRow] * scale;
  IntLanes shone = affine[kCosine] > 0;
  const auto restrict_to = [&](FloatLanes value, double size) {
    if (size > 0) shone &= (value >= 0) & (value <= static_cast<float>(size));
  };
  restrict_to(column, rig.projector_width);
  restrict_to(row, rig.projector_height);
  column = shone ? column : none;
  row = shone ? row : none;
  const FloatLanes lit = options.shadows ? shadow_map.lit(column, row, affine[kOne] * scale,
                                                          affine[kSlopeX], affine[kSlopeY])
                                         : none + 1;
  const FloatLanes light =
      options.filter_stripes
          ? filter.mean(row, affine[kFootprint] * footprint_samples)
          : float_lanes([&](int k) { return static_cast<float>(rig.pattern.light(row[k])); });
  const FloatLanes more = albedo * light * affine[kCosine] * lit;
  return {(shone & (lit > 0)) ? ambient + more : none + ambient, 1 / affine[kOne],
          (shone & (lit >= 0.5f)) ? row : none + kNoRow};
}

void Renderer::Impl::write_intensity(int i, int j, float intensity) {
  frame.intensity(i, j) = std::min(intensity, 1.0f);
}

/// Of a pixel inside the silhouette.
void Renderer::Impl::write_surface(int i, int j, float depth, float row) {
  frame.silhouette(i, j) = 1;
  frame.depth(i, j) = depth;
  if (options.projector_row) frame.projector_row(i, j) = row;
}

/// The pixels from column j of row i on.
template <int kSamples>
PixelLanes Renderer::Impl::look_at_pixels(int i, int j) const {
  const int n = kSamples > 0 ? kSamples : samples;
  // Sample c of each pixel.
  const auto samples_of = [&]<class Values>(Values, const auto* line, int c) -> Values {
    if constexpr (kSamples == 1) return load_lanes<Values>(line);
    if constexpr (kSamples == 2)
      return even_and_odd(load_lanes<Values>(line), load_lanes<Values>(line + kFloatLanes))[c];
    Values values;
    for (int k = 0; k < kFloatLanes; ++k) values[k] = line[k * n + c];
    return values;
  };
  PixelLanes pixels;
  pixels.farthest = FloatLanes{} + std::numeric_limits<float>::infinity();
  pixels.nearest = FloatLanes{};
  for (int r = 0; r < n; ++r) {
    const float* line = &inverse_depth[at(i * n + r, j * n)];
    for (int c = 0; c < n; ++c) {
      const FloatLanes depth = samples_of(FloatLanes{}, line, c);
      pixels.nearest = pixels.nearest < depth ? depth : pixels.nearest;
      pixels.farthest = depth < pixels.farthest ? depth : pixels.farthest;
    }
  }
  pixels.piece = samples_of(IntLanes{}, &piece_at[at(i * n + n / 2, j * n)], n / 2);
  return pixels;
}

template <int kSamples>
void Renderer::Impl::resolve_row(int i) {
  const int n = kSamples > 0 ? kSamples : samples;
  erase({i, i + 1}, columns);
  whole.clear();
  for (int j = columns.first; j < columns.last; j += kFloatLanes) {
    const PixelLanes pixels = look_at_pixels<kSamples>(i, j);
    const FloatLanes near = pixels.nearest, far = pixels.farthest;
    const IntLanes piece = pixels.piece;
    const IntLanes column = j + int_lanes([](int k) { return k; });
    const IntLanes seen = (near > 0) & (column < columns.last);
    if (!any_of(seen)) continue;  // only background
    // A jump in depth of more than 1e-3 of it, beyond what the slant explains, is another layer.
    // Without one, one smooth piece of surface fills the pixel.
    const FloatLanes range = float_lanes([&](int k) { return depth_range[piece[k]]; });
    const FloatLanes smooth = static_cast<float>(n - 1) * range + 1e-3f * near;
    const IntLanes filled =
        options.filter_stripes ? seen & (far > 0) & (near - far <= smooth) : IntLanes{};
    if (all_of(filled)) {
      shade_run(i, j, piece);
      continue;
    }
    for (int k = 0; k < kFloatLanes; ++k) {
      if (filled[k])
        whole.push_back({column[k], piece[k]});
      else if (seen[k])
        resolve_sampled(i, column[k]);
    }
  }
  shade_whole(i);
  // For the next band, while it is in the cache.
  for (int r = 0; r < n; ++r)
    std::fill_n(&inverse_depth[at(i * n + r, columns.first * n)],
                (columns.last - columns.first) * n, 0.0f);
}

/// One point of shading a pixel, at its centre, for kFloatLanes of them beside each other.
void Renderer::Impl::shade_run(int i, int j, IntLanes piece) {
  const auto n = static_cast<float>(samples);
  ShadePoints points;
  const IntLanes column = j + int_lanes([](int k) { return k; });
  points.x = to_float(column * samples) + 0.5f * n;
  points.y += static_cast<float>(i * samples) + 0.5f * n;
  points.piece = piece;
  const Shades shades = shade(points, n);
  const FloatLanes one = FloatLanes{} + 1;
  store_lanes(&frame.intensity(i, j), one < shades.intensity ? one : shades.intensity);
  std::fill_n(&frame.silhouette(i, j), kFloatLanes, std::uint8_t{1});
  store_lanes(&frame.depth(i, j), shades.depth);
  if (options.projector_row) store_lanes(&frame.projector_row(i, j), shades.row);
}

/// The same for the pixels `whole` of row i.
void Renderer::Impl::shade_whole(int i) {
  const auto n = static_cast<float>(samples);
  const std::size_t count = whole.size();
  // The last pixel again where there are no more.
  for (int k = 1; k < kFloatLanes && count > 0; ++k) whole.push_back(whole[count - 1]);
  ShadePoints points;
  points.y += static_cast<float>(i * samples) + 0.5f * n;
  for (std::size_t first = 0; first < count; first += kFloatLanes) {
    const Covered* pixel = &whole[first];
    points.piece = int_lanes([&](int k) { return pixel[k].piece; });
    const IntLanes column = int_lanes([&](int k) { return pixel[k].column; });
    points.x = to_float(column * samples) + 0.5f * n;
    const Shades shades = shade(points, n);
    for (int k = 0; k < kFloatLanes && first + k < count; ++k) {
      write_intensity(i, pixel[k].column, shades.intensity[k]);
      write_surface(i, pixel[k].column, shades.depth[k], shades.row[k]);
    }
  }
}

/// The nearest piece at the pixel's centre, of those that cover one of its samples; -1 if none
/// does.
int Renderer::Impl::piece_at_centre(int i, int j) const {
  const float half = 0.5f * static_cast<float>(samples);
  const float x = static_cast<float>(j * samples) + half;
  const float y = static_cast<float>(i * samples) + half;
  int nearest = -1;
  float nearest_depth = 0;
  for (const auto& [r, c] : central_first) {
    const std::size_t sample = at(i * samples + r, j * samples + c);
    if (inverse_depth[sample] == 0) continue;
    const int t = piece_at[sample];
    const auto& [p, q, s] = surface.triangles()[t];
    const auto& [corner, second, third] = pieces[t];
    const float dx = x - second.corner, dy = y - third.corner;
    const float beta = second.gradient_x * dx + second.gradient_y * dy;
    const float gamma = third.gradient_x * dx + third.gradient_y * dy;
    if (!(beta >= 0 && gamma >= 0 && beta + gamma <= 1)) continue;
    const float origin = vertices[p].inverse_depth();
    const float depth = origin + beta * (vertices[q].inverse_depth() - origin) +
                        gamma * (vertices[s].inverse_depth() - origin);
    if (depth > nearest_depth) nearest = t, nearest_depth = depth;
  }
  return nearest;
}

/// Every covered sample is shaded, and the centre of a pixel inside.
void Renderer::Impl::resolve_sampled(int i, int j) {
  const int n = samples, all = n * n;
  ShadePoints points;
  float sum = 0;
  int covered = 0, central = -1, pending = 0;
  const auto add_pending = [&] {
    const Shades shades = shade(points, 1);
    for (int k = 0; k < pending; ++k) sum += shades.intensity[k];
    pending = 0;
  };
  for (const auto& [r, c] : central_first) {
    const std::size_t sample = at(i * n + r, j * n + c);
    if (inverse_depth[sample] == 0) continue;
    ++covered;
    if (central < 0) central = piece_at[sample];
    points.x[pending] = static_cast<float>(j * n + c) + 0.5f;
    points.y[pending] = static_cast<float>(i * n + r) + 0.5f;
    points.piece[pending] = piece_at[sample];
    if (++pending == kFloatLanes) add_pending();
  }
  if (covered == 0) return;
  const int at_centre = piece_at_centre(i, j);
  const bool inside = 2 * covered == all ? at_centre >= 0 : 2 * covered > all;
  const int centre = pending;
  points.x[centre] = static_cast<float>(j * n) + 0.5f * static_cast<float>(n);
  points.y[centre] = static_cast<float>(i * n) + 0.5f * static_cast<float>(n);
  points.piece[centre] = at_centre >= 0 ? at_centre : central;
  const Shades shades = shade(points, 1);
  for (int k = 0; k < pending; ++k) sum += shades.intensity[k];
  sum += static_cast<float>(all - covered) * static_cast<float>(options.background);
  write_intensity(i, j, sum / static_cast<float>(all));
  if (inside) write_surface(i, j, shades.depth[centre], shades.row[centre]);
}

Renderer::Renderer(const Rig& rig, const TriangleMesh& mesh, const RenderOptions& options)
    : impl_(std::make_unique<Impl>(rig, mesh, options)) {}
Renderer::~Renderer() = default;
Renderer::Renderer(Renderer&&) noexcept = default;

const RenderedFrame& Renderer::render(const Points& x) {
  impl_->render(x);
  return impl_->frame;
}

}  // namespace weft
