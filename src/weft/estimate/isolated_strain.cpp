#include "weft/estimate/isolated_strain.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "weft/base/dense.h"
#include "weft/base/error.h"

namespace weft {
namespace {

/// Tangent of 22.5 degrees: directions further from both threads are nearer to their diagonal.
constexpr double kDiagonal = 0.41421356237309503;

/// Green strain along the threads, (E_uu, E_vv, 2 E_uv), of an even deformation.
Vec3 strain_of_threads(const Eigen::Matrix<double, 3, 2>& deformation, double grain_angle) {
  const Eigen::Matrix<double, 3, 2> f =
      deformation * Eigen::Rotation2Dd(grain_angle).toRotationMatrix();
  return {0.5 * (f.col(0).squaredNorm() - 1), 0.5 * (f.col(1).squaredNorm() - 1),
          f.col(0).dot(f.col(1))};
}

/// That of the affine map nearest to where a frame's clips have their corners.
Vec3 strain_of_clips(const std::vector<Clip>& clips, double grain_angle) {
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
  const Mat3 map = least_squares_solution(from, to).transpose();
  return strain_of_threads(map.leftCols<2>(), grain_angle);
}

Vec3 strain_of_frame(const MechanicalCapture& capture, int frame) {
  if (!capture.picture_frame) return strain_of_clips(capture.clips(frame), capture.grain_angle);
  return strain_of_threads(frame_threads(capture.picture_frame->shear[frame]).along,
                           capture.grain_angle);
}

/// From the clip to the side on which most free cloth lies, in material coordinates.
Vec2 overhang_direction(const MaterialRectangle& held, const Vec2& size) {
  const std::array<double, 4> free{size.x() - held.upper.x(), held.lower.x(),
                                   size.y() - held.upper.y(), held.lower.y()};
  const auto most = std::max_element(free.begin(), free.end()) - free.begin();
  return most < 2 ? Vec2::UnitX() : Vec2::UnitY();
}

}  // namespace

std::string_view name_of(IsolatedStrain strain) {
  constexpr std::array<std::string_view, 6> kNames{"weft stretch", "warp stretch", "shear",
                                                   "weft bend",    "warp bend",    "diagonal bend"};
  return kNames[static_cast<std::size_t>(strain)];
}

bool is_stretch(IsolatedStrain strain) {
  return strain == IsolatedStrain::weft_stretch || strain == IsolatedStrain::warp_stretch;
}

IsolatedStrain isolated_strain(const MechanicalCapture& capture) {
  if (capture.fixtures.size() == 1 && !capture.picture_frame) {
    const Vec2 direction = Eigen::Rotation2Dd(-capture.grain_angle) *
                           overhang_direction(capture.fixtures[0].frames.back().region,
                                              Vec2(capture.width, capture.height));
    const double along = std::abs(direction.x()), across = std::abs(direction.y());
    if (std::min(along, across) > kDiagonal * std::max(along, across))
      return IsolatedStrain::diagonal_bend;
    return along >= across ? IsolatedStrain::weft_bend : IsolatedStrain::warp_bend;
  }
  Vec3 most = Vec3::Zero();
  for (int frame = 0; frame < capture.frame_count; ++frame)
    most = most.cwiseMax(strain_of_frame(capture, frame).cwiseAbs());
  if (most[2] >= most[0] && most[2] >= most[1]) return IsolatedStrain::shear;
  return most[0] >= most[1] ? IsolatedStrain::weft_stretch : IsolatedStrain::warp_stretch;
}

}  // namespace weft
