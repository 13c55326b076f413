#include "weft/dynamics/clips.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "weft/base/error.h"
#include "weft/dynamics/clip_poses.h"
#include "weft/dynamics/equilibrium_derivatives.h"

namespace weft {
namespace {

constexpr double kOnBorder = 1e-7;       // m
constexpr double kLeastDistance = 1e-6;  // m, of a point from a clip, for its weight

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

std::unique_ptr<StaticSystem> system_between_clips(const HeavyCloth& cloth,
                                                   const std::vector<Clip>& clips) {
  return std::make_unique<StaticSystem>(
      cloth, detail::flags_of_held(clip_of_vertices(cloth.mesh(), clips)));
}

ClippedCloth::ClippedCloth(const HeavyCloth& cloth, std::vector<Clip> clips,
                           const StaticSystem* like)
    : cloth_(cloth),
      clips_(std::move(clips)),
      clip_of_(clip_of_vertices(cloth.mesh(), clips_)),
      system_(std::make_unique<StaticSystem>(cloth, detail::flags_of_held(clip_of_), like)) {}

ClippedCloth::~ClippedCloth() = default;

ClipEquilibrium ClippedCloth::solve(Points start, const StaticOptions& options) {
  detail::place_held(clips_, clip_of_, cloth_.mesh(), start);
  StaticResult found = system_->solve(std::move(start), options);
  ClipEquilibrium result;
  result.x = std::move(found.x);
  result.residual = found.residual;
  result.iterations = found.iterations;
  result.converged = found.converged;
  Points gradient;
  cloth_.gradient(result.x, gradient);
  detail::sum_reactions(gradient, clip_of_, clips_, result);
  return result;
}

ClipSensitivities ClippedCloth::sensitivities(const Points& x, const MatX& history_derivative) {
  detail::EquilibriumDerivatives found =
      detail::equilibrium_derivatives(cloth_, *system_, x, history_derivative);
  ClipSensitivities result;
  result.x = std::move(found.x);
  result.inexact = found.inexact;
  result.forces = detail::sum_over_clips(found.gradient, clip_of_, clips_.size());
  return result;
}

ClipPoseSensitivities ClippedCloth::pose_sensitivities(const Points& x) {
  HeldResponse response =
      detail::held_response(*system_, x, detail::moves_by_poses(x, clip_of_, clips_));
  return {std::move(response.x), detail::sum_over_clips(response.forces, clip_of_, clips_.size())};
}

ClipEquilibrium solve_clips(const HeavyCloth& cloth, const std::vector<Clip>& clips, Points start,
                            const StaticOptions& options) {
  return ClippedCloth(cloth, clips).solve(std::move(start), options);
}

ClipSensitivities clip_sensitivities(const HeavyCloth& cloth, const std::vector<Clip>& clips,
                                     const Points& x, const MatX& history_derivative) {
  return ClippedCloth(cloth, clips).sensitivities(x, history_derivative);
}

ClipPoseSensitivities clip_pose_sensitivities(const HeavyCloth& cloth,
                                              const std::vector<Clip>& clips, const Points& x) {
  return ClippedCloth(cloth, clips).pose_sensitivities(x);
}

}  // namespace weft
