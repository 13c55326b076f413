#include "weft/dynamics/clips.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "weft/base/error.h"
#include "weft/dynamics/equilibrium_derivatives.h"

namespace weft {
namespace {

constexpr double kOnBorder = 1e-7;       // m
constexpr double kLeastDistance = 1e-6;  // m, of a point from a clip, for its weight

std::size_t at(Eigen::Index i) { return static_cast<std::size_t>(i); }

std::vector<char> flags_of_held(const std::vector<int>& clip_of) {
  std::vector<char> held;
  for (const int clip : clip_of) held.push_back(clip >= 0 ? 1 : 0);
  return held;
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

/// The sum over each clip's vertices: 3 clips x columns, of 3 vertices x columns.
MatX sum_over_clips(const MatX& of_vertices, const std::vector<int>& clip_of, std::size_t clips) {
  MatX sums = MatX::Zero(3 * static_cast<Eigen::Index>(clips), of_vertices.cols());
  for (std::size_t i = 0; i < clip_of.size(); ++i)
    if (clip_of[i] >= 0)
      sums.middleRows(3 * clip_of[i], 3) +=
          of_vertices.middleRows(3 * static_cast<Eigen::Index>(i), 3);
  return sums;
}

/// Moves of the vertices by the poses of the clips that hold them: 3 vertices x 6 clips.
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

}  // namespace

bool MaterialRectangle::contains(const Vec2& uv) const {
  return (uv.array() >= lower.array() - kOnBorder).all() &&
         (uv.array() <= upper.array() + kOnBorder).all();
}

double MaterialRectangle::distance(const Vec2& uv) const {
  return (uv - uv.cwiseMax(lower).cwiseMin(upper)).norm();
}

Vec3 Clip::place(const Vec2& uv) const {
  const Vec2 d = uv - region.center();
  return position + rotation * Vec3(d.x(), d.y(), 0);
}

std::vector<int> clip_of_vertices(const TriangleMesh& mesh, const std::vector<Clip>& clips) {
  std::vector<int> clip_of(at(mesh.vertex_count()), -1);
  for (std::size_t c = 0; c < clips.size(); ++c) {
    int count = 0;
    for (std::size_t i = 0; i < clip_of.size(); ++i) {
      const Vec2 uv = mesh.material.col(static_cast<Eigen::Index>(i));
      if (!clips[c].region.contains(uv)) continue;
      if (clip_of[i] >= 0)
        throw Error(fmt::format("clips {} and {} both hold the point ({:g}, {:g}) m", clip_of[i], c,
                                uv.x(), uv.y()));
      clip_of[i] = static_cast<int>(c);
      ++count;
    }
    if (count < 2)
      throw Error(
          fmt::format("clip {} holds {} vertices of the mesh; at least 2 are needed", c, count));
  }
  return clip_of;
}

Points blend_of_clips(const MaterialPoints& material, const std::vector<Clip>& clips) {
  Points x(3, material.cols());
  for (Eigen::Index i = 0; i < material.cols(); ++i) {
    Vec3 sum = Vec3::Zero();
    double weights = 0;
    for (const Clip& clip : clips) {
      const double d = clip.region.distance(material.col(i)) + kLeastDistance;
      sum += clip.place(material.col(i)) / (d * d);
      weights += 1 / (d * d);
    }
    x.col(i) = sum / weights;
  }
  return x;
}

HeavyCloth::HeavyCloth(const ElasticModel& model, double areal_density, const Vec3& gravity)
    : model_(model), masses_(areal_density * model.vertex_areas()), gravity_(gravity) {
  if (!(areal_density > 0) || !std::isfinite(areal_density))
    throw Error(fmt::format("areal density is {:g} kg/m^2, must be above 0", areal_density));
}

double HeavyCloth::value(const Points& x) const {
  return model_.energy(x) - gravity_.dot(x * masses_);
}

void HeavyCloth::gradient(const Points& x, Points& gradient) const {
  model_.gradient(x, gradient);
  gradient.noalias() -= gravity_ * masses_.transpose();
}

void HeavyCloth::hessian(const Points& x, HessianKind kind, Points& gradient,
                         SparseMatrix& hessian) const {
  model_.hessian(x, kind, gradient, hessian);
  gradient.noalias() -= gravity_ * masses_.transpose();
}

ClippedCloth::ClippedCloth(const HeavyCloth& cloth, std::vector<Clip> clips)
    : cloth_(cloth),
      clips_(std::move(clips)),
      clip_of_(clip_of_vertices(cloth.mesh(), clips_)),
      system_(std::make_unique<StaticSystem>(cloth, flags_of_held(clip_of_))) {}

ClippedCloth::~ClippedCloth() = default;

ClipEquilibrium ClippedCloth::solve(Points start, const StaticOptions& options) {
  for (Eigen::Index i = 0; i < start.cols(); ++i) {
    const int clip = clip_of_[at(i)];
    if (clip >= 0) start.col(i) = clips_[at(clip)].place(cloth_.mesh().material.col(i));
  }
  StaticResult found = system_->solve(std::move(start), options);
  ClipEquilibrium result;
  result.x = std::move(found.x);
  result.residual = found.residual;
  result.iterations = found.iterations;
  result.converged = found.converged;
  Points gradient;
  cloth_.gradient(result.x, gradient);
  sum_reactions(gradient, clip_of_, clips_, result);
  return result;
}

ClipSensitivities ClippedCloth::sensitivities(const Points& x, const MatX& history_derivative) {
  detail::EquilibriumDerivatives found =
      detail::equilibrium_derivatives(cloth_, *system_, x, history_derivative);
  ClipSensitivities result;
  result.x = std::move(found.x);
  result.inexact = found.inexact;
  result.forces = sum_over_clips(found.gradient, clip_of_, clips_.size());
  return result;
}

MatX ClippedCloth::pose_sensitivities(const Points& x) {
  const MatX forces = detail::held_stiffness(*system_, x, moves_by_poses(x, clip_of_, clips_));
  return sum_over_clips(forces, clip_of_, clips_.size());
}

ClipEquilibrium solve_clips(const HeavyCloth& cloth, const std::vector<Clip>& clips, Points start,
                            const StaticOptions& options) {
  return ClippedCloth(cloth, clips).solve(std::move(start), options);
}

ClipSensitivities clip_sensitivities(const HeavyCloth& cloth, const std::vector<Clip>& clips,
                                     const Points& x, const MatX& history_derivative) {
  return ClippedCloth(cloth, clips).sensitivities(x, history_derivative);
}

MatX clip_pose_sensitivities(const HeavyCloth& cloth, const std::vector<Clip>& clips,
                             const Points& x) {
  return ClippedCloth(cloth, clips).pose_sensitivities(x);
}

}  // namespace weft
