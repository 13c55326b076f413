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
struct Vertex {
  /// Homogeneous projector coordinates and 1, over the camera's depth. Last one 0: the camera does
  /// not see it; third one 0: the projector does not.
  Eigen::Array4f over_depth{0, 0, 0, 0};
  float cosine = 0;    ///< of normal and direction to the projector, signed
  float row = 0;       ///< projector px, for the size of footprints
  float x = 0, y = 0;  ///< camera image, samples
  float inverse_depth() const { return over_depth[3]; }
  bool lit() const { return over_depth[2] > 0; }
};

/// What shading needs at a point, each affine over the image of a triangle or constant: homogeneous
/// projector coordinates and 1, over the camera's depth; the cosine on the camera's side (0: no
/// light); projector rows a sample; the slope of the shadow map's depth.
using Affine = Eigen::Array<float, 8, 1>;
enum AffineEntry { kColumn, kRow, kDepth, kOne, kCosine, kFootprint, kSlopeX, kSlopeY };

/// A drawn triangle, as shading needs it.
struct alignas(32) Piece {
  Affine at_corner, along_second, along_third;
  BarycentricGradient gradient;
  float x, y;  ///< the corner, samples
};

/// Of several points.
struct Shades {
  FloatLanes intensity, depth, row;
};

/// Points of the image, samples, and the pieces that are seen there.
struct ShadePoints {
  FloatLanes x{}, y{};
  IntLanes piece{};
};

/// A pixel's column and what covers it.
struct Covered {
  int column, piece;
};

/// Samples first..last - 1 along one axis; empty if last <= first.
struct Extent {
  int first = 0, last = 0;
};

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
    slopes.resize(surface.triangles().size(), ShadowMap::Slope{0, 0});
    sample_columns = rig.width * samples;
    // An odd number of cache lines: rows at the same column do not fight for the same places.
    stride = sample_columns / 32 * 32 + 48;
    const auto buffer = static_cast<std::size_t>(stride) * rig.height * samples;
    inverse_depth.resize(buffer + kFloatLanes);
    piece_at.resize(buffer + kFloatLanes);
    nearest.resize(static_cast<std::size_t>(rig.width));
    farthest.resize(nearest.size());
    frame.intensity.setConstant(rig.height, rig.width, static_cast<float>(options.background));
    frame.silhouette.setZero(rig.height, rig.width);
    frame.depth.setZero(rig.height, rig.width);
    if (options.projector_row) frame.projector_row.setConstant(rig.height, rig.width, kNoRow);
    order_samples();
  }

  void render(const Points& x) {
    erase_last_frame();
    surface.evaluate(x);
    project();
    if (options.shadows) shadow_map.draw(shadow_vertices, surface.triangles(), slopes);
    draw();
    switch (samples) {
      case 1:
        resolve<1>();
        break;
      case 2:
        resolve<2>();
        break;
      default:
        resolve<0>();
    }
  }

 private:
  static constexpr float kNoRow = std::numeric_limits<float>::quiet_NaN();

  void order_samples();
  void erase_last_frame();
  void project();
  Vertex project_vertex(const Vec3& point, const Vec3& normal, ShadowMap::Vertex& shadow) const;
  void set_extent(const Eigen::Array2f& low, const Eigen::Array2f& high);
  void draw();
  void draw_piece(int t);
  template <int kSamples>
  void resolve();
  template <int kSamples>
  void find_depths(int i);
  template <int kSamples>
  void resolve_row(int i);
  void shade_whole(int i);
  void resolve_sampled(int i, int j);
  int piece_at_centre(int i, int j) const;
  Shades shade(const ShadePoints& points, float footprint_samples) const;
  Shades shine(const std::array<FloatLanes, 8>& affine, float footprint_samples) const;
  void write_intensity(int i, int j, float intensity);
  void write_surface(int i, int j, float depth, float row);

  std::size_t at(int row, int column) const {
    return static_cast<std::size_t>(row) * stride + column;
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
  std::vector<float> inverse_depth;  ///< z-buffer; 0: nothing, everywhere between frames
  std::vector<int> piece_at;         ///< valid where inverse_depth is not 0
  std::vector<std::array<int, 2>> central_first;  ///< samples of a pixel (row, column) by distance
  Extent rows, columns;                           ///< of pixels that the surface may touch
  std::vector<float> nearest, farthest;           ///< inverse depth in each pixel of a row
  std::vector<Covered> whole;  ///< pixels of a row that one piece of surface fills
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

void Renderer::Impl::erase_last_frame() {
  const int height = rows.last - rows.first, width = columns.last - columns.first;
  if (height <= 0 || width <= 0) return;
  const auto erase = [&](auto& image, auto value) {
    image.block(rows.first, columns.first, height, width).setConstant(value);
  };
  erase(frame.intensity, static_cast<float>(options.background));
  erase(frame.silhouette, std::uint8_t{0});
  erase(frame.depth, 0.0f);
  if (options.projector_row) erase(frame.projector_row, kNoRow);
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
  out.over_depth.head<3>() = Eigen::Array3d(lit.x() * ratio, lit.y() * ratio, ratio).cast<float>();
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

void Renderer::Impl::draw() {
  if (columns.last <= columns.first) return;
  for (int t = 0; t < static_cast<int>(pieces.size()); ++t) draw_piece(t);
}

void Renderer::Impl::draw_piece(int t) {
  const auto& corners = surface.triangles()[t];
  const Vertex &a = vertices[corners[0]], &b = vertices[corners[1]], &c = vertices[corners[2]];
  if (a.inverse_depth() <= 0 || b.inverse_depth() <= 0 || c.inverse_depth() <= 0) return;
  const ImagePoint pa{a.x, a.y}, pb{b.x, b.y}, pc{c.x, c.y};
  Piece& piece = pieces[t];
  if (!piece.gradient.set(pa, pb, pc)) return;
  const ImagePoint depth =
      piece.gradient.of(a.inverse_depth(), b.inverse_depth(), c.inverse_depth());
  const ImagePoint row = piece.gradient.of(a.row, b.row, c.row);
  const bool lit = a.lit() && b.lit() && c.lit();
  const float facing = !lit ? 0.0f : piece.gradient.twice_area < 0 ? 1.0f : -1.0f;
  piece.x = a.x, piece.y = a.y;
  depth_range[t] = std::abs(depth.x) + std::abs(depth.y);
  piece.at_corner << a.over_depth, facing * a.cosine, std::sqrt(row.x * row.x + row.y * row.y),
      slopes[t].x, slopes[t].y;
  piece.along_second << b.over_depth - a.over_depth, facing * (b.cosine - a.cosine), 0, 0, 0;
  piece.along_third << c.over_depth - a.over_depth, facing * (c.cosine - a.cosine), 0, 0, 0;
  for_each_span(
      pa, pb, pc, sample_columns, rig.height * samples, [&](int line, int begin, int end) {
        const float start = a.inverse_depth() + (static_cast<float>(line) + 0.5f - a.y) * depth.y +
                            (0.5f - a.x) * depth.x;
        float* nearest_here = &inverse_depth[at(line, 0)];
        int* owner = &piece_at[at(line, 0)];
        // In packs, as long as most spans: no loop whose length must be guessed. Beyond the end
        // nothing changes.
        for (int first = begin; first < end; first += kFloatLanes) {
          const IntLanes column = first + int_lanes([](int k) { return k; });
          const FloatLanes before = load_lanes<FloatLanes>(nearest_here + first);
          const FloatLanes z = start + to_float(column) * depth.x;
          const IntLanes seen = (column < end) & (z > before);
          store_lanes(nearest_here + first, seen ? z : before);
          const IntLanes owned = load_lanes<IntLanes>(owner + first);
          store_lanes(owner + first, seen ? IntLanes{} + t : owned);
        }
      });
}

/// The surface at points on the planes of pieces, which may end a little before.
Shades Renderer::Impl::shade(const ShadePoints& points, float footprint_samples) const {
  std::array<Affine, kFloatLanes> by_point;
  for (int k = 0; k < kFloatLanes; ++k) {
    const Piece& piece = pieces[points.piece[k]];
    const BarycentricGradient& g = piece.gradient;
    const float dx = points.x[k] - piece.x, dy = points.y[k] - piece.y;
    // Not far beyond the piece: the plane of one seen edge-on is steep.
    const float beta = std::clamp(g.x1 * dx + g.y1 * dy, -0.5f, 1.5f);
    const float gamma = std::clamp(g.x2 * dx + g.y2 * dy, -0.5f, 1.5f);
    by_point[k] = piece.at_corner + beta * piece.along_second + gamma * piece.along_third;
  }
  std::array<FloatLanes, 8> by_entry;
  for (int entry = 0; entry < 8; ++entry)
    by_entry[entry] = float_lanes([&](int k) { return by_point[k][entry]; });
  return shine(by_entry, footprint_samples);
}

/// Without branches, so that the points are shaded side by side.
Shades Renderer::Impl::shine(const std::array<FloatLanes, 8>& affine,
                             float footprint_samples) const {
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

template <int kSamples>
void Renderer::Impl::resolve() {
  if (columns.last <= columns.first) return;
  for (int i = rows.first; i < rows.last; ++i) resolve_row<kSamples>(i);
}

/// Nearest and farthest inverse depth in the pixels of row i.
template <int kSamples>
void Renderer::Impl::find_depths(int i) {
  const int n = kSamples > 0 ? kSamples : samples;
  const auto first = static_cast<std::size_t>(columns.first);
  const int count = columns.last - columns.first;
  float* most = &nearest[first];
  float* least = &farthest[first];
  std::fill_n(most, count, 0.0f);
  std::fill_n(least, count, std::numeric_limits<float>::infinity());
  for (int r = 0; r < n; ++r) {
    const float* line = &inverse_depth[at(i * n + r, columns.first * n)];
    for (int j = 0; j < count; ++j)
      for (int c = 0; c < n; ++c) {
        most[j] = std::max(most[j], line[j * n + c]);
        least[j] = std::min(least[j], line[j * n + c]);
      }
  }
}

template <int kSamples>
void Renderer::Impl::resolve_row(int i) {
  const int n = kSamples > 0 ? kSamples : samples;
  find_depths<kSamples>(i);
  whole.clear();
  const int* middle = &piece_at[at(i * n + n / 2, n / 2)];
  for (int j = columns.first; j < columns.last; ++j) {
    const float near = nearest[static_cast<std::size_t>(j)];
    const float far = farthest[static_cast<std::size_t>(j)];
    if (near == 0) continue;  // only background
    const int t = middle[j * n];
    // A jump in depth of more than 1e-3 of it, beyond what the slant explains, is another layer.
    // Without one, one smooth piece of surface fills the pixel.
    const float smooth = static_cast<float>(n - 1) * depth_range[t] + 1e-3f * near;
    if (options.filter_stripes && far != 0 && near - far <= smooth)
      whole.push_back({j, t});
    else
      resolve_sampled(i, j);
  }
  shade_whole(i);
  // For the next frame, while it is in the cache.
  for (int r = 0; r < n; ++r)
    std::fill_n(&inverse_depth[at(i * n + r, columns.first * n)],
                (columns.last - columns.first) * n, 0.0f);
}

/// One point of shading a pixel, at its centre, for the pixels `whole` of row i.
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
    const BarycentricGradient& g = pieces[t].gradient;
    const float dx = x - vertices[p].x, dy = y - vertices[p].y;
    const float beta = g.x1 * dx + g.y1 * dy, gamma = g.x2 * dx + g.y2 * dy;
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
