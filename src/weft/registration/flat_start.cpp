#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "weft/base/dense.h"
#include "weft/base/error.h"
#include "weft/base/quantile.h"
#include "weft/base/random.h"
#include "weft/registration/nonrigid_icp.h"
#include "weft/registration/point_tree.h"

namespace weft {
namespace {

/// The grid with its centre at `center` and sides along `u` and `v`.
Points place(const GridTemplate& grid, const Vec3& center, const Vec3& u, const Vec3& v) {
  Points x(3, grid.mesh.vertex_count());
  for (Eigen::Index k = 0; k < x.cols(); ++k) {
    const Vec2 uv = grid.mesh.material.col(k);
    x.col(k) = center + (uv.x() - grid.width / 2) * u + (uv.y() - grid.height / 2) * v;
  }
  return x;
}

/// The middle of the values between their 2 % and 98 % quantiles, and how far apart these are.
std::array<double, 2> middle_and_range(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const auto at = [&](double share) {
    return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
  };
  return {(at(0.02) + at(0.98)) / 2, at(0.98) - at(0.02)};
}

/// In the plane of `points`, as flat_starts says.
Points lay_flat(const GridTemplate& grid, const std::vector<Vec3>& points, const Vec3& u_direction,
                const Vec3& v_direction) {
  Vec3 mean = Vec3::Zero();
  for (const Vec3& p : points) mean += p / static_cast<double>(points.size());
  Mat3 scatter = Mat3::Zero();
  for (const Vec3& p : points) scatter += (p - mean) * (p - mean).transpose();
  const Mat3 axes = symmetric_eigen_3(scatter).vectors;
  const Vec3 normal = axes.col(0);
  // The rectangle of least area about the points gives the sides; the directions, which is which.
  Vec3 side = axes.col(2), across = normal.cross(side), center = mean;
  double least = kInfinity;
  constexpr int turns = 45;
  for (int k = 0; k < turns; ++k) {
    const double angle = M_PI / 2 * k / turns;
    const Vec3 a = std::cos(angle) * axes.col(2) + std::sin(angle) * normal.cross(axes.col(2));
    const Vec3 b = normal.cross(a);
    std::vector<double> along_a, along_b;
    for (const Vec3& p : points) {
      along_a.push_back(a.dot(p - mean));
      along_b.push_back(b.dot(p - mean));
    }
    const auto [middle_a, range_a] = middle_and_range(std::move(along_a));
    const auto [middle_b, range_b] = middle_and_range(std::move(along_b));
    if (range_a * range_b >= least) continue;
    least = range_a * range_b;
    side = a;
    across = b;
    center = mean + middle_a * a + middle_b * b;
  }
  double best = -kInfinity;
  Vec3 u = side, v = across;
  for (const auto& [a, b] : {std::pair{side, across}, std::pair{across, side}}) {
    for (const double sign_a : {1.0, -1.0}) {
      for (const double sign_b : {1.0, -1.0}) {
        const double fit = sign_a * a.dot(u_direction) + sign_b * b.dot(v_direction);
        if (fit <= best) continue;
        best = fit;
        u = sign_a * a;
        v = sign_b * b;
      }
    }
  }
  return place(grid, center, u, v);
}

using Indices = std::vector<int>;

std::vector<Vec3> at(const Scan& scan, const Indices& indices) {
  std::vector<Vec3> points;
  for (const int i : indices) points.push_back(scan.position.col(i));
  return points;
}

/// The pieces of a set of points in which each step is shorter than `step`, m; largest first.
std::vector<Indices> connected(const Scan& scan, const Indices& points, double step) {
  Points columns(3, static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) {
    columns.col(static_cast<Eigen::Index>(i)) = scan.position.col(points[i]);
  }
  const PointTree tree(columns);
  std::vector<char> seen(points.size(), 0);
  std::vector<Indices> pieces;
  std::vector<PointTree::Neighbour> near;
  for (std::size_t first = 0; first < points.size(); ++first) {
    if (seen[first]) continue;
    seen[first] = 1;
    std::vector<std::size_t> open{first};
    Indices piece;
    while (!open.empty()) {
      const std::size_t here = open.back();
      open.pop_back();
      piece.push_back(points[here]);
      tree.within(columns.col(static_cast<Eigen::Index>(here)), step, near);
      for (const auto& other : near) {
        const auto next = static_cast<std::size_t>(other.index);
        if (!seen[next]) open.push_back(next);
        seen[next] = 1;
      }
    }
    pieces.push_back(std::move(piece));
  }
  std::stable_sort(pieces.begin(), pieces.end(),
                   [](const auto& a, const auto& b) { return a.size() > b.size(); });
  return pieces;
}

/// The points further than `thickness`, m, from the plane that holds most of them (found by trying
/// planes through three, Fischler and Bolles 1981); all of them if it holds less than `share`.
Indices without_main_plane(const Scan& scan, const Indices& points, double thickness,
                           double share) {
  constexpr int trials = 200;
  constexpr std::size_t judges = 2000;
  Rng rng(1);
  const auto any = [&]() -> Vec3 {
    const auto k = static_cast<std::size_t>(rng.uniform() * static_cast<double>(points.size()));
    return scan.position.col(points[k]);
  };
  const std::size_t stride = points.size() / judges + 1;
  std::size_t most = 0;
  Vec3 normal = Vec3::Zero();
  double offset = 0;
  for (int k = 0; k < trials; ++k) {
    const Vec3 a = any(), b = any(), c = any();
    const Vec3 n = (b - a).cross(c - a).normalized();
    if (!(n.norm() > 0.5)) continue;
    std::size_t count = 0;
    for (std::size_t i = 0; i < points.size(); i += stride) {
      count += std::abs(n.dot(scan.position.col(points[i]) - a)) < thickness;
    }
    if (count <= most) continue;
    most = count;
    normal = n;
    offset = n.dot(a);
  }
  Indices rest;
  for (const int i : points) {
    if (std::abs(normal.dot(scan.position.col(i)) - offset) >= thickness) rest.push_back(i);
  }
  const double kept = static_cast<double>(rest.size()) / static_cast<double>(points.size());
  return 1 - kept < share ? points : rest;
}

}  // namespace

std::vector<RegistrationStart> flat_starts(const GridTemplate& grid, const Scan& scan,
                                           const ScanGeometry& geometry, const Vec3& u_direction,
                                           const Vec3& v_direction) {
  constexpr double least_piece = 0.1, whole = 0.95;  // of the points
  constexpr double table = 0.15;
  Indices points;
  std::vector<double> spacing;
  for (int i = 0; i < scan.size(); ++i) {
    if (!geometry.on_surface[static_cast<std::size_t>(i)]) continue;
    points.push_back(i);
    spacing.push_back(geometry.spacing[i]);
  }
  if (points.size() < 3) {
    throw Error(fmt::format("{} points of the scan lie on a surface; at least 3", points.size()));
  }
  const double usual = quantile(std::move(spacing), 0.5);
  std::vector<RegistrationStart> starts;
  const auto add = [&](const Indices& some) {
    const auto count = static_cast<double>(some.size());
    if (count < std::max(3.0, least_piece * static_cast<double>(points.size()))) return;
    RegistrationStart start{lay_flat(grid, at(scan, some), u_direction, v_direction),
                            std::vector<char>(static_cast<std::size_t>(scan.size()), 0),
                            RegistrationStart::View::part};
    for (const int i : some) start.piece[static_cast<std::size_t>(i)] = 1;
    starts.push_back(std::move(start));
  };
  const auto pieces = connected(scan, points, 4 * usual);
  const double largest = static_cast<double>(pieces.front().size());
  if (largest > whole * static_cast<double>(points.size())) {
    add(points);
  } else {
    for (std::size_t k = 0; k < std::min<std::size_t>(3, pieces.size()); ++k) add(pieces[k]);
  }
  const Indices rest = without_main_plane(scan, points, 2 * usual, table);
  if (rest.size() < points.size() && !rest.empty()) add(connected(scan, rest, 4 * usual).front());
  if (starts.empty()) add(points);
  starts.push_back(starts.front());
  starts.back().view = RegistrationStart::View::whole;
  return starts;
}

Points flat_start(const GridTemplate& grid, const std::vector<Landmark>& landmarks) {
  if (landmarks.size() < 3) {
    throw Error(fmt::format("{} landmarks; at least 3 place a sheet", landmarks.size()));
  }
  const double share = 1 / static_cast<double>(landmarks.size());
  Vec3 mean_flat = Vec3::Zero(), mean = Vec3::Zero();
  for (const Landmark& landmark : landmarks) {
    mean_flat.head<2>() += share * landmark.uv;
    mean += share * landmark.position;
  }
  Mat3 covariance = Mat3::Zero();
  for (const Landmark& landmark : landmarks) {
    const Vec3 flat(landmark.uv.x(), landmark.uv.y(), 0);
    covariance += (landmark.position - mean) * (flat - mean_flat).transpose();
  }
  const SingularValues3 svd = singular_values_3(covariance);
  if (svd.values[1] <= 1e-6 * svd.values[0]) {
    throw Error("the landmarks are on one line; they do not place a sheet");
  }
  const Mat3 rotation = nearest_rotation(svd);
  const Vec3 middle(grid.width / 2, grid.height / 2, 0);
  return place(grid, mean + rotation * (middle - mean_flat), rotation.col(0), rotation.col(1));
}

}  // namespace weft
