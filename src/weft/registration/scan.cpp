#include "weft/registration/scan.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "weft/base/dense.h"
#include "weft/base/error.h"
#include "weft/base/parallel.h"
#include "weft/registration/point_tree.h"

namespace weft {
namespace {

// Points of which normals are computed in one task.
constexpr int kPointsAtOnce = 1024;
constexpr double kLargestSpacing = 4;
constexpr double kLargestThickness = 0.6;
constexpr double kMostSamples = 2e7;

double longest_edge(const Scan& scan, const std::array<int, 3>& t) {
  const Vec3 a = scan.position.col(t[0]), b = scan.position.col(t[1]), c = scan.position.col(t[2]);
  return std::max({(a - b).norm(), (b - c).norm(), (c - a).norm()});
}

/// Into how many parts the edges of a triangle are divided.
double parts_of(const Scan& scan, const std::array<int, 3>& t, double spacing) {
  return std::ceil(longest_edge(scan, t) / spacing);
}

/// Before any is made: they may be more than there is memory for.
void check_sample_count(const Scan& scan, double spacing) {
  double count = scan.size();
  for (const auto& t : scan.triangles) {
    const double parts = parts_of(scan, t, spacing);
    if (parts >= 2) count += parts * (parts + 1) / 2;
  }
  if (count <= kMostSamples) return;
  throw Error(
      fmt::format("a mesh of {} triangles would be {:.3g} points, {:.3g} m apart; valid: "
                  "up to {:g} (a coarser grid has points further apart)",
                  scan.triangles.size(), count, spacing, kMostSamples));
}

}  // namespace

Eigen::Vector3f ScanTexture::at(const Vec2& st) const {
  const double x = st.x() * width - 0.5, y = (1 - st.y()) * height - 0.5;
  const auto wrapped = [](double index, int count) {
    const auto k = static_cast<std::int64_t>(std::floor(index)) % count;
    return static_cast<int>(k < 0 ? k + count : k);
  };
  const auto pixel = [&](double column, double row) -> Eigen::Vector3f {
    return pixels.col(wrapped(row, height) * width + wrapped(column, width));
  };
  const auto f = static_cast<float>(x - std::floor(x)), g = static_cast<float>(y - std::floor(y));
  return (1 - g) * ((1 - f) * pixel(x, y) + f * pixel(x + 1, y)) +
         g * ((1 - f) * pixel(x, y + 1) + f * pixel(x + 1, y + 1));
}

Scan sample_scan(const Scan& scan, double spacing) {
  if (scan.triangles.empty()) return scan;
  check_sample_count(scan, spacing);
  Scan sampled;
  std::vector<Vec3> position;
  std::vector<Eigen::Vector3f> colour;
  const bool coloured = scan.colour.cols() > 0 || scan.texture;
  std::vector<char> used(static_cast<std::size_t>(scan.size()), 0);
  std::size_t triangle = 0;
  const auto add = [&](const std::array<int, 3>& t, const Vec3& w) {
    position.push_back(w[0] * scan.position.col(t[0]) + w[1] * scan.position.col(t[1]) +
                       w[2] * scan.position.col(t[2]));
    if (!coloured) return;
    if (scan.texture) {
      const auto& [a, b, c] = scan.texture->corners[triangle];
      return colour.push_back(scan.texture->at(w[0] * a + w[1] * b + w[2] * c));
    }
    const Eigen::Vector3f f = w.cast<float>();
    colour.push_back(f[0] * scan.colour.col(t[0]) + f[1] * scan.colour.col(t[1]) +
                     f[2] * scan.colour.col(t[2]));
  };
  for (triangle = 0; triangle < scan.triangles.size(); ++triangle) {
    const auto& t = scan.triangles[triangle];
    for (std::size_t k = 0; k < 3; ++k) {
      char& vertex_used = used[static_cast<std::size_t>(t[k])];
      if (!vertex_used) add(t, Vec3::Unit(static_cast<Eigen::Index>(k)));
      vertex_used = 1;
    }
    const int parts = static_cast<int>(parts_of(scan, t, spacing));
    if (parts < 2) continue;
    // Centres of the smaller triangles that stand upright: inside, and never twice.
    for (int i = 0; i < parts; ++i) {
      for (int j = 0; i + j < parts; ++j) {
        const double u = (i + 1.0 / 3) / parts, v = (j + 1.0 / 3) / parts;
        add(t, Vec3(1 - u - v, u, v));
      }
    }
  }
  sampled.position.resize(3, static_cast<Eigen::Index>(position.size()));
  for (std::size_t i = 0; i < position.size(); ++i) {
    sampled.position.col(static_cast<Eigen::Index>(i)) = position[i];
  }
  if (coloured) {
    sampled.colour.resize(3, sampled.position.cols());
    for (std::size_t i = 0; i < colour.size(); ++i) {
      sampled.colour.col(static_cast<Eigen::Index>(i)) = colour[i];
    }
  }
  return sampled;
}

ScanGeometry scan_geometry(const Scan& scan, int neighbours, int threads) {
  const int n = scan.size();
  ScanGeometry geometry;
  geometry.normal.setZero(3, n);
  geometry.spacing.setZero(n);
  geometry.on_surface.assign(static_cast<std::size_t>(n), 1);
  const PointTree tree(scan.position);
  const auto chunks = static_cast<std::size_t>((n + kPointsAtOnce - 1) / kPointsAtOnce);
  parallel_for(chunks, threads, [&](std::size_t chunk) {
    std::vector<PointTree::Neighbour> near;
    const int begin = static_cast<int>(chunk) * kPointsAtOnce;
    for (int i = begin; i < std::min(n, begin + kPointsAtOnce); ++i) {
      tree.nearest(scan.position.col(i), neighbours + 1, near);
      Vec3 mean = Vec3::Zero();
      for (const auto& other : near) mean += scan.position.col(other.index);
      mean /= static_cast<double>(near.size());
      Mat3 scatter = Mat3::Zero();
      for (const auto& other : near) {
        const Vec3 d = scan.position.col(other.index) - mean;
        scatter += d * d.transpose();
      }
      const SymmetricEigen3 axes = symmetric_eigen_3(scatter);
      geometry.normal.col(i) = axes.vectors.col(0);
      geometry.spacing[i] = std::sqrt(near.back().squared /
                                      static_cast<double>(std::max<std::size_t>(near.size(), 1)));
      const Vec3 spread = axes.values.cwiseMax(0).cwiseSqrt();
      if (spread[0] > kLargestThickness * spread[1]) {
        geometry.on_surface[static_cast<std::size_t>(i)] = 0;
      }
    }
  });
  if (n == 0) return geometry;
  VecX sorted = geometry.spacing;
  std::nth_element(sorted.data(), sorted.data() + n / 2, sorted.data() + n);
  const double limit = kLargestSpacing * sorted[n / 2];
  for (int i = 0; i < n; ++i) {
    if (geometry.spacing[i] > limit) geometry.on_surface[static_cast<std::size_t>(i)] = 0;
  }
  return geometry;
}

}  // namespace weft
