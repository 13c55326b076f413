#include "weft/estimate/cusick.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "weft/base/error.h"
#include "weft/base/parallel.h"
#include "weft/base/random.h"
#include "weft/estimate/mechanical_trial.h"
#include "weft/estimate/uncertainty.h"
#include "weft/mesh/annulus.h"
#include "weft/model/elastic_model.h"

namespace weft {
namespace {

constexpr int kDirectionsAround = 360;
constexpr double kShadowPixel = 2.5e-4;  // m
constexpr int kLeastFolds = 2, kMostFolds = 12;
const double kBracketStep = std::log(4.0);
constexpr double kBoard = 0.95;  // above, pixels hide what the bend does
constexpr double kNearCoefficient = 1e-3, kNearFactor = 0.02;  // where a search ends
constexpr double kPictureSlack = 0.02;  // of a picture's coefficient: its rim is of whole pixels
constexpr double kNearEnd = 0.1;        // that of an end of the interval, of half of it

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

DrapeStatistics::Number number_of(const VecX& values) {
  const double mean = values.mean(), n = static_cast<double>(values.size());
  if (values.size() < 2) return {mean, std::numeric_limits<double>::quiet_NaN()};
  return {mean, std::sqrt((values.array() - mean).square().sum() / (n - 1))};
}

/// The second of the two points between which the coefficient is, or is looked for.
std::size_t upper_neighbour(const std::vector<DrapePoint>& points, double coefficient) {
  std::size_t i = 1;
  while (i + 1 < points.size() && points[i].drapes.coefficient.mean < coefficient) ++i;
  return i;
}

bool is_bend(const Fabric& fabric, Eigen::Index i) {
  return fabric.info(static_cast<int>(i)).unit == "N m";
}

/// All constants of bend times `factor`, within their ranges.
Fabric with_bend(const Fabric& fabric, double factor) {
  Fabric result = fabric;
  for (Eigen::Index i = 0; i < result.values.size(); ++i) {
    if (!is_bend(fabric, i)) continue;
    const ParameterInfo info = fabric.info(static_cast<int>(i));
    double& value = result.values[i];
    const double least = std::min(info.lower, value), most = std::max(info.upper, value);
    value = std::clamp(factor * value, least, most);
  }
  return result;
}

/// Whether a limper fabric still hangs lower, or is as good as a board.
bool is_further(const DrapeStatistics& limper, const DrapeStatistics& before) {
  if (2 * limper.not_converged > limper.count) return false;
  return limper.coefficient.mean < before.coefficient.mean || before.coefficient.mean > kBoard;
}

/// Means of the coefficient by the logarithm of the factor, simulated as they are needed.
class DrapeSearch {
 public:
  DrapeSearch(const Fabric& fabric, double areal_density, const DrapeFitOptions& options)
      : fabric_(fabric), areal_density_(areal_density), options_(options) {
    double largest = 0;
    for (Eigen::Index i = 0; i < fabric.values.size(); ++i) {
      if (!is_bend(fabric, i) || !(fabric.values[i] > largest)) continue;
      const ParameterInfo info = fabric.info(static_cast<int>(i));
      largest = fabric.values[i];
      least_ = std::min(0.0, std::log(info.lower / largest));
      most_ = std::max(0.0, std::log(info.upper / largest));
    }
    if (!(largest > 0)) throw Error("drape: the fabric has no bend to scale");
    points_.push_back(simulated(0));
  }

  const std::vector<DrapePoint>& points() const { return points_; }

  DrapePoint simulated(double bend) const {
    return {bend,
            drape_statistics(sample_drapes(with_bend(fabric_, std::exp(bend)), areal_density_,
                                           options_.starts, options_.drape, options_.threads))};
  }

  DrapeFit::Reach reach(double coefficient) {
    while (!(points_.front().drapes.coefficient.mean < coefficient)) {
      if (!(points_.front().bend > least_)) return DrapeFit::Reach::below;
      const DrapePoint limper = simulated(std::max(least_, points_.front().bend - kBracketStep));
      if (!is_further(limper.drapes, points_.front().drapes))
        least_ = points_.front().bend;
      else
        points_.insert(points_.begin(), limper);
    }
    while (points_.back().drapes.coefficient.mean < coefficient) {
      if (!(points_.back().bend < most_)) return DrapeFit::Reach::above;
      points_.push_back(simulated(std::min(most_, points_.back().bend + kBracketStep)));
    }
    return DrapeFit::Reach::inside;
  }

  /// Of a coefficient inside, to `near` in it.
  double solve(double coefficient, double near = kNearCoefficient) {
    for (bool halve = false;; halve = !halve) {
      const std::size_t i = upper_neighbour(points_, coefficient);
      const DrapePoint &a = points_[i - 1], &b = points_[i];
      const double width = b.bend - a.bend;
      const double expected = drape_at(points_, coefficient).bend;
      const auto off = [&](const DrapePoint& point) {
        return std::abs(point.drapes.coefficient.mean - coefficient);
      };
      if (width < kNearFactor || std::min(off(a), off(b)) < near) return expected;
      const double next = halve ? 0.5 * (a.bend + b.bend)
                                : std::clamp(expected, a.bend + 0.1 * width, b.bend - 0.1 * width);
      points_.insert(points_.begin() + static_cast<std::ptrdiff_t>(i), simulated(next));
    }
  }

 private:
  const Fabric& fabric_;
  double areal_density_;
  const DrapeFitOptions& options_;
  double least_ = 0, most_ = 0;
  std::vector<DrapePoint> points_;
};

/// Half of the interval of a coefficient.
double half_interval(const DrapeStatistics& drapes, const DrapeFitOptions& options) {
  const double n = drapes.count, s = drapes.coefficient.deviation;
  const double t = student_quantile(0.5 * (1 + options.confidence), n - 1);
  return t * std::hypot(s / std::sqrt(n), options.deviation.value_or(s));
}

void check(double coefficient, const DrapeFitOptions& options) {
  const auto require = [](bool valid, std::string_view what, double value, std::string_view range) {
    if (!valid) throw Error(fmt::format("drape: {} is {:g}, must be {}", what, value, range));
  };
  require(coefficient > 0 && coefficient < 1, "the coefficient", coefficient, "in (0, 1)");
  require(options.starts >= 2, "the number of starts", options.starts, "2 or more");
  require(options.confidence > 0 && options.confidence < 1, "the confidence", options.confidence,
          "in (0, 1)");
  const double deviation = options.deviation.value_or(0);
  require(deviation >= 0 && std::isfinite(deviation), "the deviation", deviation, "0 or more");
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
  const DrapeShadow shadow = finished(cover, test);
  if (!(shadow.coefficient >= -kPictureSlack && shadow.coefficient <= 1 + kPictureSlack))
    throw Error(
        fmt::format("drape: a shadow of {:.3g} m^2 has the coefficient {:.3g}, must be in "
                    "[0, 1]",
                    shadow.area, shadow.coefficient));
  return shadow;
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

DrapeStatistics drape_statistics(const std::vector<DrapeShape>& drapes) {
  if (drapes.empty()) throw Error("drape: statistics of no drapes");
  const auto n = static_cast<Eigen::Index>(drapes.size());
  DrapeStatistics result;
  VecX coefficients(n), lobes(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const DrapeShape& drape = drapes[static_cast<std::size_t>(i)];
    coefficients[i] = drape.shadow.coefficient;
    lobes[i] = drape.shadow.lobes;
    if (!drape.converged) ++result.not_converged;
  }
  result.count = static_cast<int>(n);
  result.coefficient = number_of(coefficients);
  result.lobes = number_of(lobes);
  return result;
}

DrapePoint drape_at(const std::vector<DrapePoint>& points, double coefficient) {
  if (points.size() < 2) throw Error("drape: two points or more are needed to look between");
  const std::size_t i = upper_neighbour(points, coefficient);
  const DrapePoint &a = points[i - 1], &b = points[i];
  const DrapeStatistics &x = a.drapes, &y = b.drapes;
  const double t = (coefficient - x.coefficient.mean) / (y.coefficient.mean - x.coefficient.mean);
  const auto mix = [t](double from, double to) { return from + t * (to - from); };
  DrapePoint result{mix(a.bend, b.bend), {}};
  result.drapes.coefficient = {coefficient, mix(x.coefficient.deviation, y.coefficient.deviation)};
  result.drapes.lobes = {mix(x.lobes.mean, y.lobes.mean),
                         mix(x.lobes.deviation, y.lobes.deviation)};
  return result;
}

DrapeFit fit_drape(const Fabric& fabric, double areal_density, double coefficient,
                   const DrapeFitOptions& options) {
  check(coefficient, options);
  DrapeSearch search(fabric, areal_density, options);
  DrapeFit fit;
  fit.reach = search.reach(coefficient);
  double bend = search.points().front().bend;
  if (fit.reach == DrapeFit::Reach::inside) bend = search.solve(coefficient);
  if (fit.reach == DrapeFit::Reach::above) bend = search.points().back().bend;
  fit.factor = std::exp(bend);
  fit.fabric = with_bend(fabric, fit.factor);
  fit.drapes = search.simulated(bend).drapes;
  const double half = half_interval(fit.drapes, options);
  const auto has = [&](double c) {
    return c > 0 && c < 1 && search.reach(c) == DrapeFit::Reach::inside;
  };
  const double near = std::max(kNearCoefficient, kNearEnd * half);
  if (has(coefficient - half)) fit.lower = std::exp(search.solve(coefficient - half, near));
  if (has(coefficient + half)) fit.upper = std::exp(search.solve(coefficient + half, near));
  fit.points = search.points();
  return fit;
}

}  // namespace weft
