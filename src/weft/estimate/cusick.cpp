#include "weft/estimate/cusick.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "weft/base/error.h"
#include "weft/base/parallel.h"
#include "weft/base/random.h"
#include "weft/estimate/mechanical_trial.h"
#include "weft/mesh/annulus.h"
#include "weft/model/elastic_model.h"

namespace weft {
namespace {

constexpr int kDirectionsAround = 360;
constexpr double kShadowPixel = 2.5e-4;  // m
constexpr int kLeastFolds = 2, kMostFolds = 12;

void check(const DrapeTest& test) {
  if (test.support > 0 && test.radius > test.support && std::isfinite(test.radius)) return;
  throw Error(fmt::format("drape: a specimen of radius {:g} m on a support of {:g} m", test.radius,
                          test.support));
}

/// Furthest cover by direction, and the covered area.
struct Cover {
  VecX outline = VecX::Zero(kDirectionsAround);
  double area = 0;
  void add(const Vec2& p, double cell) {
    const double turn = std::atan2(p.y(), p.x()) / (2 * std::numbers::pi);
    const auto i =
        static_cast<Eigen::Index>(std::floor((turn + 1) * kDirectionsAround)) % kDirectionsAround;
    outline[i] = std::max(outline[i], p.norm());
    area += cell;
  }
};

DrapeShadow finished(const Cover& cover, const DrapeTest& test) {
  DrapeShadow shadow;
  shadow.area = cover.area;
  shadow.outline = cover.outline;
  shadow.coefficient = drape_coefficient(cover.area, test);
  shadow.lobes = count_lobes(cover.outline);
  return shadow;
}

/// Marks the pixels whose centres a triangle covers.
void fill(Mask& mask, const std::array<Vec2, 3>& corners) {
  const auto cross = [](const Vec2& a, const Vec2& b) { return a.x() * b.y() - a.y() * b.x(); };
  const auto& [a, b, c] = corners;
  const double area = cross(b - a, c - a);
  if (area == 0) return;
  const auto first = [](double least) { return std::max(0, static_cast<int>(std::floor(least))); };
  const int x0 = first(std::min({a.x(), b.x(), c.x()}) - 0.5);
  const int y0 = first(std::min({a.y(), b.y(), c.y()}) - 0.5);
  const int x1 = std::min<int>(static_cast<int>(mask.cols()) - 1,
                               static_cast<int>(std::max({a.x(), b.x(), c.x()})));
  const int y1 = std::min<int>(static_cast<int>(mask.rows()) - 1,
                               static_cast<int>(std::max({a.y(), b.y(), c.y()})));
  for (int i = y0; i <= y1; ++i)
    for (int j = x0; j <= x1; ++j) {
      const Vec2 p(j + 0.5, i + 0.5);
      const double wa = cross(b - p, c - p) / area, wb = cross(c - p, a - p) / area;
      if (wa >= 0 && wb >= 0 && wa + wb <= 1) mask(i, j) = 1;
    }
}

Points start_of(const TriangleMesh& mesh, const DrapeOptions& options) {
  Rng random(options.seed);
  constexpr int kCount = kMostFolds - kLeastFolds + 1;
  std::array<double, kCount> amplitude, phase;
  double square = 0;
  for (std::size_t i = 0; i < kCount; ++i) {
    amplitude[i] = random.normal();
    phase[i] = 2 * std::numbers::pi * random.uniform();
    square += 0.5 * amplitude[i] * amplitude[i];
  }
  const double scale = options.perturbation / std::sqrt(square);
  Points x(3, mesh.vertex_count());
  for (Eigen::Index k = 0; k < x.cols(); ++k) {
    const Vec2 uv = mesh.material.col(k);
    const double angle = std::atan2(uv.y(), uv.x());
    const double out = std::max(0.0, uv.norm() - options.test.support) /
                       (options.test.radius - options.test.support);
    double height = 0;
    for (std::size_t i = 0; i < kCount; ++i)
      height += amplitude[i] * std::cos((kLeastFolds + static_cast<double>(i)) * angle + phase[i]);
    x.col(k) = Vec3(uv.x(), uv.y(), scale * out * out * height);
  }
  return x;
}

}  // namespace

double drape_coefficient(double shadow_area, const DrapeTest& test) {
  check(test);
  const double support = std::numbers::pi * test.support * test.support;
  return (shadow_area - support) / (std::numbers::pi * test.radius * test.radius - support);
}

int count_lobes(const VecX& outline, double prominence) {
  // Highs and lows in turn, each the furthest since the last turn that counts.
  if (outline.size() == 0) return 0;
  Eigen::Index start = 0;
  outline.minCoeff(&start);
  int lobes = 0;
  bool rising = true;
  double extreme = outline[start];
  double low = extreme;
  for (Eigen::Index k = 1; k <= outline.size(); ++k) {
    const double r = outline[(start + k) % outline.size()];
    if (rising) {
      extreme = std::max(extreme, r);
      low = std::min(low, r);
      if (extreme - low >= prominence && extreme - r >= prominence) {
        ++lobes;
        rising = false;
        extreme = r;
      }
    } else {
      extreme = std::min(extreme, r);
      if (r - extreme >= prominence) {
        rising = true;
        low = extreme;
        extreme = r;
      }
    }
  }
  return lobes;
}

DrapeShadow shadow_of(const TriangleMesh& mesh, const Points& x, const DrapeTest& test) {
  check(test);
  const double reach = test.radius * 1.05;
  const int side = 2 * static_cast<int>(std::ceil(reach / kShadowPixel));
  Mask mask = Mask::Zero(side, side);
  const Vec2 centre(0.5 * side, 0.5 * side);
  for (const auto& triangle : mesh.triangles) {
    std::array<Vec2, 3> corners;
    for (std::size_t k = 0; k < 3; ++k)
      corners[k] = x.col(triangle[k]).head<2>() / kShadowPixel + centre;
    fill(mask, corners);
  }
  Cover cover;
  for (int i = 0; i < side; ++i)
    for (int j = 0; j < side; ++j) {
      const Vec2 p = kShadowPixel * (Vec2(j + 0.5, i + 0.5) - centre);
      // The support casts its own shadow.
      if (mask(i, j) || p.norm() <= test.support) cover.add(p, kShadowPixel * kShadowPixel);
    }
  return finished(cover, test);
}

DrapeShadow shadow_of(const Mask& mask, double pixel, const DrapeTest& test) {
  check(test);
  if (!(pixel > 0)) throw Error(fmt::format("drape: a pixel of {:g} m; must be above 0", pixel));
  Vec2 sum(0, 0);
  double count = 0;
  for (Eigen::Index i = 0; i < mask.rows(); ++i)
    for (Eigen::Index j = 0; j < mask.cols(); ++j)
      if (mask(i, j)) {
        sum += Vec2(static_cast<double>(j) + 0.5, static_cast<double>(i) + 0.5);
        ++count;
      }
  if (count == 0) throw Error("drape: the picture has no shadow");
  const Vec2 centre = sum / count;
  Cover cover;
  for (Eigen::Index i = 0; i < mask.rows(); ++i)
    for (Eigen::Index j = 0; j < mask.cols(); ++j)
      if (mask(i, j)) {
        const Vec2 p(static_cast<double>(j) + 0.5, static_cast<double>(i) + 0.5);
        cover.add(pixel * (p - centre), pixel * pixel);
      }
  return finished(cover, test);
}

DrapeShape simulate_drape(const Fabric& fabric, double areal_density, const DrapeOptions& options) {
  check(options.test);
  if (options.rings < 3 || options.rings > 100 || options.sectors < 24 || options.sectors > 720 ||
      options.sectors % 2 != 0 || !(options.perturbation >= 0))
    throw Error(
        "drape: 3 to 100 rings, 24 to 720 sectors, an even number, and a perturbation of 0 "
        "or more are valid");
  if (fabric.model == "springs") throw Error("drape: springs stand on a rectangular grid");
  const double cell = (options.test.radius - options.test.support) / options.rings;
  // A dihedral angle belongs to the triangles on both sides of its edge (bending.h), D / (2 h) + D
  // / (2 e) per width and angle for cells of h and e; what should be there is 2 D / h, the
  // curvature over half a cell. With a strip of e = h / 3 inside the support the clamp is where it
  // is.
  constexpr double kClampStrip = 1.0 / 3;
  std::vector<double> radii{options.test.support - kClampStrip * cell};
  for (int i = 0; i <= options.rings; ++i) radii.push_back(options.test.support + i * cell);
  DrapeShape shape;
  shape.mesh = make_annulus(radii, options.sectors, GridPattern::uniform);
  const auto model = make_elastic_model(shape.mesh, fabric);
  const HeavyCloth cloth(*model, areal_density, Vec3(0, 0, -9.81));
  std::vector<char> held(static_cast<std::size_t>(shape.mesh.vertex_count()), 0);
  std::fill_n(held.begin(), 2 * options.sectors, char{1});
  const StaticResult found =
      solve_static(cloth, start_of(shape.mesh, options), held, options.statics);
  shape.x = found.x;
  shape.residual = found.residual;
  shape.converged = found.converged;
  shape.shadow = shadow_of(shape.mesh, shape.x, options.test);
  return shape;
}

std::vector<DrapeShape> sample_drapes(const Fabric& fabric, double areal_density, int count,
                                      const DrapeOptions& options, int threads) {
  if (count < 1) throw Error(fmt::format("drape: {} starts; at least 1 is needed", count));
  std::vector<DrapeShape> shapes(static_cast<std::size_t>(count));
  parallel_for(shapes.size(), threads, [&](std::size_t i) {
    DrapeOptions own = options;
    own.seed += i;
    shapes[i] = simulate_drape(fabric, areal_density, own);
  });
  return shapes;
}

}  // namespace weft
