#pragma once
#include <optional>
#include <string_view>

#include "weft/base/types.h"

namespace weft {

/// A pinhole device (camera or projector) given by its 3 x 4 projection. Scaled and signed on
/// construction so that the third homogeneous coordinate is the depth along the axis in m, positive
/// in front.
class Pinhole {
 public:
  Pinhole() = default;
  /// Throws Error if the left 3 x 3 block is singular, or is a mirror image (negative determinant
  /// after the sign is chosen so that `point_in_front` has positive depth).
  Pinhole(const Projection& projection, const Vec3& point_in_front, std::string_view name);

  const Projection& projection() const { return projection_; }
  const Vec3& center() const { return center_; }  ///< of projection, world, m
  /// (x, y, depth): continuous image coordinates in px, and depth in m (<= 0 behind the device).
  Vec3 project(const Vec3& world) const;
  /// Unit direction of the ray through continuous image coordinates.
  Vec3 ray(const Vec2& pixel) const;
  /// Point on the ray of `pixel` at `depth`.
  Vec3 unproject(const Vec2& pixel, double depth) const;

 private:
  Projection projection_ = Projection::Zero();
  Mat3 inverse_ = Mat3::Zero();
  Vec3 center_ = Vec3::Zero();
};

}  // namespace weft
