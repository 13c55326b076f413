#include "weft/optics/render.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "weft/base/error.h"
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
  float x = 0, y = 0;  ///< camera image, samples
  float cosine = 0;    ///< of normal and direction to the projector, signed
  float row = 0;       ///< projector px, for the size of footprints
  float inverse_depth() const { return over_depth[3]; }
  bool lit() const { return over_depth[2] > 0; }
};

/// A drawn triangle, as shading needs it.
struct Piece {
  BarycentricGradient gradient;
  float facing;       ///< +1: the normal points to the camera, -1: away; 0: no light
  float footprint;    ///< projector rows a sample
  float depth_range;  ///< change of the inverse depth from one sample to the next one, diagonally
};

struct Shade {
  float intensity;
  float depth;
  float row;
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
    slopes.resize(surface.triangles().size(), ShadowMap::Slope{0, 0});
    sample_columns = rig.width * samples;
    const auto buffer = static_cast<std::size_t>(sample_columns) * rig.height * samples;
    inverse_depth.resize(buffer);
    piece_at.resize(buffer);
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
  bool resolve_whole(int i, int j);
  void resolve_sampled(int i, int j);
  int piece_at_centre(int i, int j) const;
  Shade shade(int t, float x, float y, float footprint_samples) const;
  void write(int i, int j, float intensity, bool inside, const Shade& centre);

  std::size_t at(int row, int column) const {
    return static_cast<std::size_t>(row) * sample_columns + column;
  }

 public:
  Rig rig;
  RenderOptions options;
  SmoothSurface surface;
  StripeFilter filter;
  ShadowMap shadow_map;
  int samples;
  int sample_columns = 0;
  float albedo;
  float ambient;  ///< times albedo
  std::vector<Vertex> vertices;
  std::vector<ShadowMap::Vertex> shadow_vertices;
  std::vector<ShadowMap::Slope> slopes;
  std::vector<Piece> pieces;
  std::vector<float> inverse_depth;               ///< z-buffer; 0: nothing
  std::vector<int> piece_at;                      ///< valid where inverse_depth is not 0
  std::vector<std::array<int, 2>> central_first;  ///< samples of a pixel (row, column) by distance
  Extent rows, columns;                           ///< of pixels that the surface may touch
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
  for (int row = rows.first * samples; row < rows.last * samples; ++row)
    std::fill(&inverse_depth[at(row, columns.first * samples)],
              &inverse_depth[at(row, columns.last * samples - 1)] + 1, 0.0f);
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
  piece.facing = !lit ? 0.0f : piece.gradient.twice_area < 0 ? 1.0f : -1.0f;
  piece.footprint = std::sqrt(row.x * row.x + row.y * row.y);
  piece.depth_range = std::abs(depth.x) + std::abs(depth.y);
  for_each_span(
      pa, pb, pc, sample_columns, rig.height * samples, [&](int line, int begin, int end) {
        const float start = a.inverse_depth() + (static_cast<float>(line) + 0.5f - a.y) * depth.y +
                            (0.5f - a.x) * depth.x;
        float* nearest = &inverse_depth[at(line, 0)];
        int* owner = &piece_at[at(line, 0)];
        for (int column = begin; column < end; ++column) {
          const float z = start + static_cast<float>(column) * depth.x;
          if (z > nearest[column]) {
            nearest[column] = z;
            owner[column] = t;
          }
        }
      });
}

/// The surface at (x, y), in samples, on the plane of piece t, which may end a little before.
Shade Renderer::Impl::shade(int t, float x, float y, float footprint_samples) const {
  const Piece& piece = pieces[t];
  const auto& corners = surface.triangles()[t];
  const Vertex &p = vertices[corners[0]], &q = vertices[corners[1]], &r = vertices[corners[2]];
  const BarycentricGradient& g = piece.gradient;
  const float dx = x - p.x, dy = y - p.y;
  // Not far beyond the piece: the plane of one seen edge-on is steep.
  const float beta = std::clamp(g.x1 * dx + g.y1 * dy, -0.5f, 1.5f);
  const float gamma = std::clamp(g.x2 * dx + g.y2 * dy, -0.5f, 1.5f);
  const Eigen::Array4f over_depth =
      p.over_depth + beta * (q.over_depth - p.over_depth) + gamma * (r.over_depth - p.over_depth);
  Shade result{ambient, 1 / over_depth[3], kNoRow};
  const float cosine =
      piece.facing * (p.cosine + beta * (q.cosine - p.cosine) + gamma * (r.cosine - p.cosine));
  if (!(cosine > 0)) return result;
  const float scale = 1 / over_depth[2];
  const float column = over_depth[0] * scale, row = over_depth[1] * scale;
  const auto outside = [](float value, double size) {
    return size > 0 && !(value >= 0 && value <= static_cast<float>(size));
  };
  if (outside(column, rig.projector_width) || outside(row, rig.projector_height)) return result;
  const float lit =
      options.shadows ? shadow_map.lit(column, row, over_depth[3] * scale, slopes[t]) : 1.0f;
  if (lit >= 0.5f) result.row = row;
  if (!(lit > 0)) return result;
  const float light = options.filter_stripes ? filter.mean(row, piece.footprint * footprint_samples)
                                             : static_cast<float>(rig.pattern.light(row));
  result.intensity += albedo * light * cosine * lit;
  return result;
}

void Renderer::Impl::write(int i, int j, float intensity, bool inside, const Shade& centre) {
  frame.intensity(i, j) = std::min(intensity, 1.0f);
  if (!inside) return;
  frame.silhouette(i, j) = 1;
  frame.depth(i, j) = centre.depth;
  if (options.projector_row) frame.projector_row(i, j) = centre.row;
}

template <int kSamples>
void Renderer::Impl::resolve() {
  for (int i = rows.first; i < rows.last; ++i)
    for (int j = columns.first; j < columns.last; ++j)
      if (!options.filter_stripes || !resolve_whole<kSamples>(i, j)) resolve_sampled(i, j);
}

/// A pixel that one smooth piece of surface fills: one point of shading, at its centre. False if it
/// is not such a pixel.
template <int kSamples>
bool Renderer::Impl::resolve_whole(int i, int j) {
  const int n = kSamples > 0 ? kSamples : samples;
  float nearest = 0, farthest = std::numeric_limits<float>::infinity();
  for (int r = 0; r < n; ++r)
    for (int c = 0; c < n; ++c) {
      const float z = inverse_depth[at(i * n + r, j * n + c)];
      nearest = std::max(nearest, z);
      farthest = std::min(farthest, z);
    }
  if (nearest == 0) return true;  // only background
  if (farthest == 0) return false;
  const int t = piece_at[at(i * n + n / 2, j * n + n / 2)];
  // A jump in depth of more than 1e-3 of it, beyond what the slant explains, is another layer.
  const float smooth = static_cast<float>(n - 1) * pieces[t].depth_range + 1e-3f * nearest;
  if (nearest - farthest > smooth) return false;
  const float half = 0.5f * static_cast<float>(n);
  const Shade centre = shade(t, static_cast<float>(j * n) + half, static_cast<float>(i * n) + half,
                             static_cast<float>(n));
  write(i, j, centre.intensity, true, centre);
  return true;
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

void Renderer::Impl::resolve_sampled(int i, int j) {
  const int n = samples;
  float sum = 0;
  int covered = 0, central = -1;
  for (const auto& [r, c] : central_first) {
    const std::size_t sample = at(i * n + r, j * n + c);
    if (inverse_depth[sample] == 0) continue;
    ++covered;
    if (central < 0) central = piece_at[sample];
    sum += shade(piece_at[sample], static_cast<float>(j * n + c) + 0.5f,
                 static_cast<float>(i * n + r) + 0.5f, 1)
               .intensity;
  }
  if (covered == 0) return;
  const int all = n * n;
  sum += static_cast<float>(all - covered) * static_cast<float>(options.background);
  const int at_centre = piece_at_centre(i, j);
  const bool inside = 2 * covered == all ? at_centre >= 0 : 2 * covered > all;
  const float half = 0.5f * static_cast<float>(n);
  const Shade centre =
      inside ? shade(at_centre >= 0 ? at_centre : central, static_cast<float>(j * n) + half,
                     static_cast<float>(i * n) + half, 1)
             : Shade{};
  write(i, j, sum / static_cast<float>(all), inside, centre);
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
