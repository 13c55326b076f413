#include "weft/dynamics/clip_poses.h"

#include <cmath>

#include "weft/base/dense.h"

namespace weft {
namespace {

constexpr double kSmallTurn = 1e-4;  // rad, below which series serve

Mat3 cross_matrix(const Vec3& a) {
  Mat3 m;
  m << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return m;
}

Vec3 in_clip(const Clip& clip, const Vec2& uv) {
  const Vec2 d = uv - clip.region.center();
  return {d.x(), d.y(), 0};
}

}  // namespace

double half_length(const Clip& clip) {
  return 0.5 * (clip.region.upper - clip.region.lower).maxCoeff();
}

Clip moved_clip(const Clip& clip, const Vec6& move) {
  Clip result = clip;
  result.position += move.head<3>();
  const Vec3 turn = move.tail<3>();
  if (turn.norm() > 0)
    result.rotation =
        (Eigen::AngleAxisd(turn.norm(), turn.normalized()) * clip.rotation).normalized();
  return result;
}

Vec6 pose_difference(const Clip& to, const Clip& from) {
  Eigen::Quaterniond turn = to.rotation * from.rotation.conjugate();
  if (turn.w() < 0) turn.coeffs() *= -1;
  const double sine = turn.vec().norm();
  // Of half of the angle, which is sine to third order.
  const double factor = sine < kSmallTurn ? 2 : 2 * std::atan2(sine, turn.w()) / sine;
  Vec6 difference;
  difference << to.position - from.position, factor * turn.vec();
  return difference;
}

Mat6 pose_difference_derivative(const Vec6& difference) {
  const Vec3 turn = difference.tail<3>();
  const double t = turn.norm();
  const double factor = t < kSmallTurn ? 1.0 / 12 : 1 / (t * t) - 1 / (2 * t * std::tan(0.5 * t));
  const Mat3 cross = cross_matrix(turn);
  Mat6 derivative = Mat6::Identity();
  derivative.bottomRightCorner<3, 3>() += -0.5 * cross + factor * cross * cross;
  return derivative;
}

Clip clip_of_shape(const Clip& clip, const TriangleMesh& mesh, const std::vector<int>& clip_of,
                   int index, const Points& x) {
  std::vector<Eigen::Index> held;
  for (Eigen::Index i = 0; i < x.cols(); ++i)
    if (clip_of[at(i)] == index) held.push_back(i);
  const auto count = static_cast<Eigen::Index>(held.size());
  Points from(3, count), to(3, count);
  for (Eigen::Index k = 0; k < count; ++k) {
    from.col(k) = in_clip(clip, mesh.material.col(held[at(k)]));
    to.col(k) = x.col(held[at(k)]);
  }
  const Vec3 center = from.rowwise().mean(), position = to.rowwise().mean();
  const Mat3 rotation = nearest_rotation(
      singular_values_3((to.colwise() - position) * (from.colwise() - center).transpose()));
  Clip result = clip;
  result.position = position - rotation * center;
  result.rotation = Eigen::Quaterniond(rotation).normalized();
  return result;
}

namespace detail {

std::vector<char> flags_of_held(const std::vector<int>& clip_of) {
  std::vector<char> held;
  for (const int clip : clip_of) held.push_back(clip >= 0 ? 1 : 0);
  return held;
}

void place_held(const std::vector<Clip>& clips, const std::vector<int>& clip_of,
                const TriangleMesh& mesh, Points& x) {
  for (Eigen::Index i = 0; i < x.cols(); ++i) {
    const int clip = clip_of[at(i)];
    if (clip >= 0) x.col(i) = clips[at(clip)].place(mesh.material.col(i));
  }
}

void sum_reactions(const Points& gradient, const std::vector<int>& clip_of,
                   const std::vector<Clip>& clips, ClipEquilibrium& result) {
  const auto count = static_cast<Eigen::Index>(clips.size());
  result.forces = Points::Zero(3, count);
  result.torques = Points::Zero(3, count);
  for (Eigen::Index i = 0; i < gradient.cols(); ++i) {
    const int clip = clip_of[at(i)];
    if (clip < 0) continue;
    const Vec3 force = gradient.col(i);
    const Vec3 arm = result.x.col(i) - clips[at(clip)].position;
    result.forces.col(clip) += force;
    result.torques.col(clip) += arm.cross(force);
  }
}

MatX sum_over_clips(const MatX& of_vertices, const std::vector<int>& clip_of, std::size_t clips) {
  MatX sums = MatX::Zero(3 * static_cast<Eigen::Index>(clips), of_vertices.cols());
  for (std::size_t i = 0; i < clip_of.size(); ++i)
    if (clip_of[i] >= 0)
      sums.middleRows(3 * clip_of[i], 3) +=
          of_vertices.middleRows(3 * static_cast<Eigen::Index>(i), 3);
  return sums;
}

MatX moves_by_poses(const Points& x, const std::vector<int>& clip_of,
                    const std::vector<Clip>& clips) {
  MatX moves = MatX::Zero(x.size(), 6 * static_cast<Eigen::Index>(clips.size()));
  for (Eigen::Index i = 0; i < x.cols(); ++i) {
    const int clip = clip_of[at(i)];
    if (clip < 0) continue;
    const Vec3 arm = x.col(i) - clips[at(clip)].position;
    for (Eigen::Index k = 0; k < 3; ++k) {
      moves.block<3, 1>(3 * i, 6 * clip + k) = Vec3::Unit(k);
      moves.block<3, 1>(3 * i, 6 * clip + 3 + k) = Vec3::Unit(k).cross(arm);
    }
  }
  return moves;
}

}  // namespace detail
}  // namespace weft
