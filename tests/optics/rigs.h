#pragma once
#include <Eigen/LU>
#include <cmath>
#include <numbers>

#include "weft/optics/render.h"

namespace weft::testing {

/// Projection of a device at `from` that looks at `at`, x right, y down with `up` upwards; focal
/// length and middle in px. Written from the definition: x = focal right.d / forward.d + middle.
inline Projection look_at(const Vec3& from, const Vec3& at, double focal, const Vec2& middle) {
  const Vec3 up(0, 0, 1);
  const Vec3 forward = (at - from).normalized();
  const Vec3 right =
      Vec3(forward.y() * up.z() - forward.z() * up.y(), forward.z() * up.x() - forward.x() * up.z(),
           forward.x() * up.y() - forward.y() * up.x())
          .normalized();
  const Vec3 down(forward.y() * right.z() - forward.z() * right.y(),
                  forward.z() * right.x() - forward.x() * right.z(),
                  forward.x() * right.y() - forward.y() * right.x());
  Projection p;
  p.row(0).head<3>() = focal * right + middle.x() * forward;
  p.row(1).head<3>() = focal * down + middle.y() * forward;
  p.row(2).head<3>() = forward;
  p.col(3) = -p.leftCols<3>() * from;
  return p;
}

/// A view of 160 x 120 px of the world's x-z plane around the origin from 1 m in front of it, 2 mm
/// a pixel; the projector is above and to the left.
inline Rig small_rig() {
  Rig rig;
  rig.width = 160;
  rig.height = 120;
  rig.camera = Pinhole(look_at({0, -1, 0}, {0, 0, 0}, 500, {80, 60}), {0, 0, 0}, "camera");
  rig.projector =
      Pinhole(look_at({-0.2, -1.1, 0.3}, {0, 0, 0}, 700, {150, 110}), {0, 0, 0}, "projector");
  rig.pattern.period = 20;
  return rig;
}

/// Point where the ray of `device` through `pixel` meets the plane through `on` with this normal.
inline Vec3 on_plane(const Projection& device, const Vec2& pixel, const Vec3& on,
                     const Vec3& normal) {
  // Two planes hold the ray, (row_x - x row_z) . (p, 1) = 0 and the same for y; with the given
  // plane they make three equations.
  Mat3 a;
  Vec3 b;
  for (int k = 0; k < 2; ++k) {
    const Eigen::RowVector4d plane = device.row(k) - pixel[k] * device.row(2);
    a.row(k) = plane.head<3>();
    b[k] = -plane[3];
  }
  a.row(2) = normal.transpose();
  b[2] = normal.dot(on);
  return a.inverse() * b;
}

}  // namespace weft::testing
