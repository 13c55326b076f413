#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>

#include "weft/base/error.h"
#include "weft/registration/nonrigid_icp.h"

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

}  // namespace

Points flat_start(const GridTemplate& grid, const Scan& scan, const ScanGeometry& geometry,
                  const Vec3& u_direction, const Vec3& v_direction) {
  std::vector<Vec3> points;
  for (int i = 0; i < scan.size(); ++i) {
    if (geometry.on_surface[static_cast<std::size_t>(i)]) points.push_back(scan.position.col(i));
  }
  if (points.size() < 3) {
    throw Error(fmt::format("{} points of the scan lie on a surface; at least 3", points.size()));
  }
  Vec3 mean = Vec3::Zero();
  for (const Vec3& p : points) mean += p / static_cast<double>(points.size());
  Mat3 scatter = Mat3::Zero();
  for (const Vec3& p : points) scatter += (p - mean) * (p - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Mat3> solver(scatter);
  const Vec3 normal = solver.eigenvectors().col(0);
  // The rectangle of least area about the points gives the sides; the directions, which is which.
  Vec3 side = solver.eigenvectors().col(2), across = normal.cross(side), center = mean;
  double least = std::numeric_limits<double>::infinity();
  constexpr int turns = 45;
  for (int k = 0; k < turns; ++k) {
    const double angle = M_PI / 2 * k / turns;
    const Vec3 a = std::cos(angle) * solver.eigenvectors().col(2) +
                   std::sin(angle) * normal.cross(solver.eigenvectors().col(2));
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
  double best = -std::numeric_limits<double>::infinity();
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
  const Eigen::JacobiSVD<Mat3> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  if (svd.singularValues()[1] <= 1e-6 * svd.singularValues()[0]) {
    throw Error("the landmarks are on one line; they do not place a sheet");
  }
  Mat3 sign = Mat3::Identity();
  sign(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  const Mat3 rotation = svd.matrixU() * sign * svd.matrixV().transpose();
  const Vec3 middle(grid.width / 2, grid.height / 2, 0);
  return place(grid, mean + rotation * (middle - mean_flat), rotation.col(0), rotation.col(1));
}

}  // namespace weft
