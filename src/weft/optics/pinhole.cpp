#include "weft/optics/pinhole.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>

#include "weft/base/error.h"

namespace weft {

Pinhole::Pinhole(const Projection& projection, const Vec3& point_in_front, std::string_view name) {
  if (!projection.allFinite() || !point_in_front.allFinite())
    throw Error(fmt::format("{}: the projection has an entry that is not finite", name));
  const Mat3 left = projection.leftCols<3>();
  // Relative to the rows' lengths, so that the scale of the matrix does not matter.
  const double scale = left.row(0).norm() * left.row(1).norm() * left.row(2).norm();
  if (!(std::abs(left.determinant()) > 1e-12 * scale))
    throw Error(fmt::format("{}: the left 3x3 block of the projection is singular", name));

  projection_ = projection / left.row(2).norm();
  const double depth = projection_.row(2).head<3>().dot(point_in_front) + projection_(2, 3);
  if (depth == 0)
    throw Error(fmt::format("{}: the point in front lies in the plane of the device", name));
  if (depth < 0) projection_ = -projection_;

  const Mat3 block = projection_.leftCols<3>();
  if (block.determinant() < 0)
    throw Error(fmt::format(
        "{}: the projection is a mirror image, or looks away from ({:.4g}, {:.4g}, "
        "{:.4g}): the determinant of its left 3x3 block is {:.4g} with that point in "
        "front, and must be positive",
        name, point_in_front.x(), point_in_front.y(), point_in_front.z(), block.determinant()));
  inverse_ = block.inverse();
  center_ = -inverse_ * projection_.col(3);
}

Vec3 Pinhole::project(const Vec3& world) const {
  const Vec3 image = projection_.leftCols<3>() * world + projection_.col(3);
  return {image.x() / image.z(), image.y() / image.z(), image.z()};
}

Vec3 Pinhole::ray(const Vec2& pixel) const { return (inverse_ * pixel.homogeneous()).normalized(); }

Vec3 Pinhole::unproject(const Vec2& pixel, double depth) const {
  // The third row of the projection takes inverse * (x, y, 1) to 1, so its scale is the depth.
  return center_ + depth * (inverse_ * pixel.homogeneous());
}

}  // namespace weft
