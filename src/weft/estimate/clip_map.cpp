#include "weft/estimate/clip_map.h"

#include <Eigen/QR>

namespace weft {
namespace {

constexpr double kLeastSine = 0.1;  // of the angle between the clip and the threads across

}  // namespace

Eigen::Matrix<double, 3, 2> map_of_clips(const std::vector<Clip>& clips) {
  const auto count = static_cast<Eigen::Index>(4 * clips.size());
  Eigen::MatrixX3d from(count, 3);
  Eigen::MatrixX3d to(count, 3);
  Eigen::Index k = 0;
  for (const Clip& clip : clips) {
    for (int corner = 0; corner < 4; ++corner, ++k) {
      const Vec2 uv(corner % 2 ? clip.region.upper.x() : clip.region.lower.x(),
                    corner / 2 ? clip.region.upper.y() : clip.region.lower.y());
      from.row(k) << uv.x(), uv.y(), 1;
      to.row(k) = clip.place(uv);
    }
  }
  const Mat3 map = from.colPivHouseholderQr().solve(to).transpose();
  return map.leftCols<2>();
}

Vec3 shear_direction(const std::vector<Clip>& clips, std::size_t clip) {
  const Clip& own = clips[clip];
  const Vec2 size = own.region.upper - own.region.lower;
  const int longer = size.x() >= size.y() ? 0 : 1;
  const Vec3 along = own.rotation * Vec3::Unit(longer);
  const Vec3 threads = map_of_clips(clips).col(1 - longer);
  if (!(threads.norm() > 0)) return along;
  const Vec3 across = threads.normalized();
  const Vec3 square = along - along.dot(across) * across;
  return square.norm() > kLeastSine ? Vec3(square.normalized()) : along;
}

}  // namespace weft
