#pragma once
/// Surfaces that a flat sheet takes without strain, known at every (u, v), and scans of them.
#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "weft/base/random.h"
#include "weft/registration/nonrigid_icp.h"

namespace weft::testing {

/// Position at (u, v), m.
using Surface = std::function<Vec3(const Vec2&)>;

/// A generalized cylinder over the plane curve whose tangent has the angle phi(s); its rulings are
/// turned by `turn` rad from v. The middle of the sheet is at the origin. Exact up to the
/// quadrature of the curve.
inline Surface cylinder_over(std::function<double(double)> phi, double turn, double width,
                             double height) {
  constexpr int steps = 4000;
  const double reach = std::hypot(width, height);
  auto table = std::make_shared<std::vector<Vec2>>(1, Vec2::Zero());
  const double ds = 2 * reach / steps;
  for (int k = 0; k < steps; ++k) {
    const double angle = phi(-reach + (k + 0.5) * ds);
    table->push_back(table->back() + ds * Vec2(std::cos(angle), std::sin(angle)));
  }
  const Vec2 middle = (*table)[steps / 2];
  for (Vec2& point : *table) point -= middle;
  return [=](const Vec2& uv) -> Vec3 {
    const Vec2 p = uv - Vec2(width / 2, height / 2);
    const double s = p.x() * std::cos(turn) + p.y() * std::sin(turn);
    const double t = -p.x() * std::sin(turn) + p.y() * std::cos(turn);
    const double at = (s + reach) / ds;
    const auto k = std::min(static_cast<std::size_t>(at), table->size() - 2);
    const double f = at - static_cast<double>(k);
    const Vec2 c = (1 - f) * (*table)[k] + f * (*table)[k + 1];
    // Turned back, so that u runs about along x and v about along -z.
    const double x = c.x() * std::cos(turn) - t * std::sin(turn);
    const double z = -(c.x() * std::sin(turn) + t * std::cos(turn));
    return {x, c.y(), z};
  };
}

inline Surface cylinder(double radius, double turn, double width, double height) {
  return cylinder_over([=](double s) { return s / radius; }, turn, width, height);
}

inline Surface wave(double steepness, double length, double turn, double width, double height) {
  return cylinder_over(
      [=](double s) { return steepness * std::sin(2 * std::numbers::pi * s / length); }, turn,
      width, height);
}

/// A cone of half angle `beta` rad, its apex `above` m over the middle of the edge v = 0.
inline Surface cone(double beta, double above, double width) {
  return [=](const Vec2& uv) -> Vec3 {
    const Vec2 p(uv.x() - width / 2, uv.y() + above);
    const double rho = p.norm(), psi = std::atan2(p.x(), p.y()) / std::sin(beta);
    return {rho * std::sin(beta) * std::sin(psi), rho * std::sin(beta) * std::cos(psi),
            -rho * std::cos(beta)};
  };
}

struct ScanMaking {
  int points = 12000;
  double noise = 0.0002;  ///< m, of each coordinate
  double outliers = 0;    ///< of the points: anywhere in the box about the surface, grown by 5 cm
  bool hole = false;      ///< nothing in a disc of 4 cm about the middle
  bool clutter = false;   ///< a table: a plane below, that the cloth nearly touches
  std::uint64_t seed = 1;
};

inline Scan scan_of(const Surface& surface, double width, double height,
                    const ScanMaking& making = {}) {
  Rng rng(making.seed);
  std::vector<Vec3> points;
  Vec3 lower = surface({0, 0}), upper = lower;
  while (static_cast<int>(points.size()) < making.points) {
    const Vec2 uv(rng.uniform(0, width), rng.uniform(0, height));
    if (making.hole && (uv - Vec2(0.6 * width, 0.45 * height)).norm() < 0.04) continue;
    const Vec3 p = surface(uv);
    lower = lower.cwiseMin(p);
    upper = upper.cwiseMax(p);
    points.push_back(p + making.noise * Vec3(rng.normal(), rng.normal(), rng.normal()));
  }
  const auto anywhere = [&] {
    Vec3 p;
    for (int k = 0; k < 3; ++k) p[k] = rng.uniform(lower[k] - 0.05, upper[k] + 0.05);
    return p;
  };
  const int strays = static_cast<int>(making.outliers * making.points);
  for (int k = 0; k < strays; ++k) points.push_back(anywhere());
  for (int k = 0; making.clutter && k < making.points / 3; ++k) {
    Vec3 p = anywhere();
    p.z() = lower.z() - 0.015 + making.noise * rng.normal();
    points.push_back(p);
  }
  Scan scan;
  scan.position.resize(3, static_cast<Eigen::Index>(points.size()));
  for (std::size_t k = 0; k < points.size(); ++k) {
    scan.position.col(static_cast<Eigen::Index>(k)) = points[k];
  }
  return scan;
}

inline Points sampled(const Surface& surface, const MaterialPoints& uv) {
  Points x(3, uv.cols());
  for (Eigen::Index k = 0; k < uv.cols(); ++k) x.col(k) = surface(uv.col(k));
  return x;
}

/// Distances of the registered vertices to the truth, m.
struct RegistrationError {
  double same_point = 0, same_point_max = 0;  ///< at the same (u, v): mean, largest
  double off_surface = 0;                     ///< along the true normal: mean
};
inline RegistrationError error_of(const GridTemplate& grid, const Points& x,
                                  const Surface& surface) {
  RegistrationError error;
  const double h = 1e-5;
  for (Eigen::Index k = 0; k < x.cols(); ++k) {
    const Vec2 uv = grid.mesh.material.col(k);
    const Vec3 d = x.col(k) - surface(uv);
    const Vec3 su = surface(uv + Vec2(h, 0)) - surface(uv - Vec2(h, 0));
    const Vec3 sv = surface(uv + Vec2(0, h)) - surface(uv - Vec2(0, h));
    error.same_point += d.norm() / static_cast<double>(x.cols());
    error.same_point_max = std::max(error.same_point_max, d.norm());
    error.off_surface += std::abs(d.dot(su.cross(sv).normalized())) / static_cast<double>(x.cols());
  }
  return error;
}

}  // namespace weft::testing
