#include "weft/dynamics/loaded_clips.h"

#include <algorithm>
#include <cmath>

#include "weft/base/dense.h"
#include "weft/base/error.h"
#include "weft/dynamics/equilibrium_derivatives.h"

namespace weft {
namespace {

constexpr int kMostSteps = 200;
constexpr double kTolerated = 100;      // times the tolerance, where the net forces fall no further
constexpr double kHessianServes = 0.2;  // of the net forces before, that a former Hessian may leave
constexpr double kFirstRadius = 0.5;    // of the trust region, of half of a clip's longer side
constexpr double kLargestRadius = 1;    // the same: a turn of some 60 degrees
constexpr double kLeastRadius = 1e-9;   // the same
constexpr double kFirstEscapeWay = 1e-2;  // the same
constexpr double kEnoughOfPredicted = 1e-4;
constexpr double kClearlyLower = 0.5;     // of the net forces before
constexpr double kLeastCurvature = 1e-9;  // of the largest

Eigen::Index six(std::size_t i) { return 6 * static_cast<Eigen::Index>(i); }

/// Of a potential with the gradient g at a point that turns about an origin, at the arm r: what the
/// second order of exp([turn]) r adds to the Hessian.
Mat3 curvature_of_turn(const Vec3& g, const Vec3& r) {
  return 0.5 * (g * r.transpose() + r * g.transpose()) - g.dot(r) * Mat3::Identity();
}

/// A symmetric matrix by its eigenvalues.
struct Eigensystem : SymmetricEigen {
  explicit Eigensystem(const MatX& matrix) : SymmetricEigen(symmetric_eigen(matrix)) {}
  double floor() const { return kLeastCurvature * values.cwiseAbs().maxCoeff(); }
  bool definite() const { return values.minCoeff() > floor(); }
  /// Negative curvatures as if positive, with `shift` added.
  MatX solve(const MatX& b, double shift = 0) const {
    const VecX curvatures = values.cwiseAbs().cwiseMax(floor()).array() + shift;
    return vectors * curvatures.cwiseInverse().asDiagonal() * (vectors.transpose() * b);
  }
  /// Of a gradient, the step that is no longer than `radius`.
  VecX step(const VecX& gradient, double radius) const {
    VecX found = -solve(gradient);
    if (found.norm() <= radius) return found;
    double lower = 0, upper = gradient.norm() / radius;
    for (int i = 0; i < 60; ++i) {
      const double middle = 0.5 * (lower + upper);
      found = -solve(gradient, middle);
      (found.norm() > radius ? lower : upper) = middle;
    }
    return -solve(gradient, upper);
  }
  double predicted(const VecX& gradient, const VecX& step) const {
    const VecX along = vectors.transpose() * step;
    return gradient.dot(step) + 0.5 * along.cwiseAbs2().dot(values.cwiseAbs().cwiseMax(floor()));
  }
};

}  // namespace

LoadPotential potential_of(const ClipLoad& load, const Clip& clip, const Vec3& gravity) {
  LoadPotential result;
  const Vec3 weight = load.mass * gravity;
  result.value = -weight.dot(clip.position);
  result.gradient.head<3>() = -weight;
  for (const Cord& cord : load.cords) {
    const Vec3 arm = clip.rotation * cord.at, point = clip.position + arm;
    Vec3 gradient = -cord.force;
    Mat3 hessian = Mat3::Zero();
    if (cord.pulley) {
      const Vec3 from = point - *cord.pulley;
      const double length = from.norm();
      result.value += cord.tension * length;
      gradient = cord.tension / length * from;
      hessian =
          cord.tension / length * (Mat3::Identity() - from * from.transpose() / (length * length));
    } else {
      result.value -= cord.force.dot(point);
    }
    Eigen::Matrix<double, 3, 6> by_move;
    by_move.leftCols<3>().setIdentity();
    for (Eigen::Index k = 0; k < 3; ++k) by_move.col(3 + k) = Vec3::Unit(k).cross(arm);
    result.gradient += by_move.transpose() * gradient;
    result.hessian += by_move.transpose() * hessian * by_move;
    result.hessian.bottomRightCorner<3, 3>() += curvature_of_turn(gradient, arm);
  }
  return result;
}

/// The cloth at rest with the clips at one place.
struct LoadedCloth::Place {
  std::vector<Clip> clips;
  ClipEquilibrium cloth;
  Points gradient;      ///< of the cloth's potential, N
  double value = 0;     ///< of the reduced energy, J
  VecX net;             ///< its gradient, 6 loaded clips, turns over half_length(): N
  double residual = 0;  ///< N, of the clips
};

/// In coordinates whose turns are multiplied by half_length(), of the loaded clips.
struct LoadedCloth::Stiffness {
  Eigensystem hessian;  ///< N/m
  MatX x;               ///< moves of all vertices, 3 vertices x 6 loaded clips
  MatX forces;          ///< that hold the vertices, N/m
};

LoadedCloth::LoadedCloth(const HeavyCloth& cloth, std::vector<Clip> clips,
                         std::vector<std::optional<ClipLoad>> loads, const StaticSystem* like)
    : cloth_(cloth),
      clips_(std::move(clips)),
      loads_(std::move(loads)),
      clip_of_(clip_of_vertices(cloth.mesh(), clips_)) {
  for (std::size_t c = 0; c < loads_.size(); ++c)
    if (loads_[c]) loaded_.push_back(c);
  if (loads_.size() != clips_.size() || loaded_.empty())
    throw Error("loaded clips: none of the clips has a load");
  if (loaded_.size() == clips_.size())
    throw Error("loaded clips: none of the clips is held; at least one must be");
  system_ = std::make_unique<StaticSystem>(cloth, detail::flags_of_held(clip_of_), like);
}

LoadedCloth::~LoadedCloth() = default;

std::vector<Clip> LoadedCloth::clips_of_shape(const Points& x) const {
  std::vector<Clip> clips = clips_;
  for (const std::size_t c : loaded_)
    clips[c] = clip_of_shape(clips_[c], cloth_.mesh(), clip_of_, static_cast<int>(c), x);
  return clips;
}

/// Lengths that turns are multiplied by, 1 for shifts.
VecX LoadedCloth::scales() const {
  VecX scales = VecX::Ones(six(loaded_.size()));
  for (std::size_t k = 0; k < loaded_.size(); ++k)
    scales.segment<3>(six(k) + 3).setConstant(half_length(clips_[loaded_[k]]));
  return scales;
}

/// Of forces on the vertices, 3 vertices x columns, those on the loaded clips in scaled
/// coordinates, 6 loaded clips x columns.
MatX LoadedCloth::net_forces(const MatX& of_vertices, const Points& x,
                             const std::vector<Clip>& clips) const {
  MatX all = detail::moves_by_poses(x, clip_of_, clips).transpose() * of_vertices;
  MatX net(six(loaded_.size()), of_vertices.cols());
  for (std::size_t k = 0; k < loaded_.size(); ++k)
    net.middleRows<6>(six(k)) = all.middleRows<6>(six(loaded_[k]));
  return scales().cwiseInverse().asDiagonal() * net;
}

LoadedCloth::Place LoadedCloth::place_at(std::vector<Clip> clips, Points start,
                                         const StaticOptions& options) {
  Place place;
  place.clips = std::move(clips);
  detail::place_held(place.clips, clip_of_, cloth_.mesh(), start);
  StaticResult found = system_->solve(std::move(start), options);
  place.cloth.x = std::move(found.x);
  place.cloth.residual = found.residual;
  place.cloth.iterations = found.iterations;
  place.cloth.converged = found.converged;
  cloth_.gradient(place.cloth.x, place.gradient);
  detail::sum_reactions(place.gradient, clip_of_, place.clips, place.cloth);
  place.value = cloth_.value(place.cloth.x);
  place.net = VecX(six(loaded_.size()));
  for (std::size_t k = 0; k < loaded_.size(); ++k) {
    const std::size_t c = loaded_[k];
    const auto column = static_cast<Eigen::Index>(c);
    const LoadPotential load = potential_of(*loads_[c], place.clips[c], cloth_.gravity());
    place.value += load.value;
    place.net.segment<6>(six(k)) = load.gradient;
    place.net.segment<3>(six(k)) += place.cloth.forces.col(column);
    place.net.segment<3>(six(k) + 3) += place.cloth.torques.col(column);
  }
  place.net = place.net.cwiseQuotient(scales());
  for (Eigen::Index i = 0; i < place.net.size(); i += 3)
    place.residual = std::max(place.residual, place.net.segment<3>(i).norm());
  return place;
}

LoadedCloth::Stiffness LoadedCloth::stiffness_at(const Place& place) {
  const Points& x = place.cloth.x;
  const MatX all = detail::moves_by_poses(x, clip_of_, place.clips);
  MatX moves(x.size(), six(loaded_.size()));
  for (std::size_t k = 0; k < loaded_.size(); ++k)
    moves.middleCols<6>(six(k)) = all.middleCols<6>(six(loaded_[k]));
  const VecX scale = scales();
  moves = moves * scale.cwiseInverse().asDiagonal();
  HeldResponse response = detail::held_response(*system_, x, moves);
  MatX hessian = moves.transpose() * response.forces;
  for (std::size_t k = 0; k < loaded_.size(); ++k) {
    const std::size_t c = loaded_[k];
    const Clip& clip = place.clips[c];
    Mat6 own = potential_of(*loads_[c], clip, cloth_.gravity()).hessian;
    for (std::size_t i = 0; i < clip_of_.size(); ++i) {
      if (clip_of_[i] != static_cast<int>(c)) continue;
      const auto column = static_cast<Eigen::Index>(i);
      own.bottomRightCorner<3, 3>() +=
          curvature_of_turn(place.gradient.col(column), x.col(column) - clip.position);
    }
    const auto scaling = scale.segment<6>(six(k)).cwiseInverse().asDiagonal();
    hessian.block<6, 6>(six(k), six(k)) += scaling * own * scaling;
  }
  const MatX symmetric = 0.5 * (hessian + hessian.transpose());
  return {Eigensystem(symmetric), std::move(response.x), std::move(response.forces)};
}

double LoadedCloth::least_half() const {
  double half = half_length(clips_[loaded_.front()]);
  for (const std::size_t c : loaded_) half = std::min(half, half_length(clips_[c]));
  return half;
}

/// `here` after a move of the loaded clips, in scaled coordinates, along which the free vertices
/// start as they answer to first order.
LoadedCloth::Place LoadedCloth::moved(const Place& here, const Stiffness& stiffness,
                                      const VecX& move, const StaticOptions& options) {
  const VecX unscaled = move.cwiseQuotient(scales());
  std::vector<Clip> clips = here.clips;
  for (std::size_t k = 0; k < loaded_.size(); ++k)
    clips[loaded_[k]] = moved_clip(clips[loaded_[k]], unscaled.segment<6>(six(k)));
  const VecX shift = stiffness.x * move;
  Place there = place_at(std::move(clips),
                         here.cloth.x + Points::Map(shift.data(), 3, shift.size() / 3), options);
  there.cloth.iterations += here.cloth.iterations;
  return there;
}

/// Takes a step that lowers the reduced energy. False where there is none.
bool LoadedCloth::step(const Stiffness& stiffness, const StaticOptions& options, double& radius,
                       Place& here) {
  const double half = least_half();
  for (; radius > kLeastRadius * half; radius *= 0.25) {
    const VecX move = stiffness.hessian.step(here.net, radius);
    Place there = moved(here, stiffness, move, options);
    const double predicted = stiffness.hessian.predicted(here.net, move);
    const double change = there.value - here.value;
    // Near the end the energy is known no better than the cloth is at rest.
    const bool falls = change <= kEnoughOfPredicted * predicted ||
                       (there.residual < kClearlyLower * here.residual &&
                        change <= options.force_tolerance * half);
    if (!there.cloth.converged || !falls) continue;
    if (change <= 0.5 * predicted) radius = std::min(2 * radius, kLargestRadius * half);
    here = std::move(there);
    return true;
  }
  return false;
}

/// Leaves a saddle along its most negative curvature. False where the reduced energy does not fall.
bool LoadedCloth::escape(const Stiffness& stiffness, const StaticOptions& options, Place& here) {
  for (double way = kFirstEscapeWay; way > kLeastRadius; way *= 0.1) {
    for (const double side : {way, -way}) {
      const VecX move = side * least_half() * stiffness.hessian.vectors.col(0);
      Place there = moved(here, stiffness, move, options);
      if (!there.cloth.converged || !(there.value < here.value)) continue;
      here = std::move(there);
      return true;
    }
  }
  return false;
}

LoadedEquilibrium LoadedCloth::solve(Points start, const std::vector<Clip>& from,
                                     const StaticOptions& options) {
  std::vector<Clip> clips = clips_;
  for (const std::size_t c : loaded_) clips[c] = from[c];
  Place here = place_at(std::move(clips), std::move(start), options);
  StaticOptions following = options;
  following.start = StaticOptions::Start::near_equilibrium;
  const bool near = options.start == StaticOptions::Start::near_equilibrium;
  double radius = kFirstRadius * least_half();
  bool settled = false;
  std::optional<Stiffness> stiffness;
  double before = 0;  // net force that the Hessian at hand was used at
  for (int steps = 0; steps < kMostSteps && here.cloth.converged && !settled; ++steps) {
    const bool there = here.residual < options.force_tolerance;
    settled = there && near;  // stability is that of the start then
    if (settled) break;
    const bool serves = stiffness && !there && here.residual < kHessianServes * before;
    if (!serves) stiffness.emplace(stiffness_at(here));
    before = here.residual;
    if (there) {
      settled = stiffness->hessian.definite();
      if (!settled && !escape(*stiffness, following, here)) break;
      stiffness.reset();
    } else if (!step(*stiffness, following, radius, here)) {
      if (!serves) {
        settled =
            here.residual < kTolerated * options.force_tolerance && stiffness->hessian.definite();
        break;
      }
      stiffness.reset();
      radius = kFirstRadius * least_half();
    }
  }
  LoadedEquilibrium result{std::move(here.cloth), std::move(here.clips)};
  result.cloth.converged = result.cloth.converged && settled;
  result.cloth.residual = std::max(result.cloth.residual, here.residual);
  return result;
}

LoadedCloth::Place LoadedCloth::place_of(const LoadedEquilibrium& found) const {
  Place place;
  place.clips = found.clips;
  place.cloth.x = found.cloth.x;
  cloth_.gradient(place.cloth.x, place.gradient);
  return place;
}

LoadedSensitivities LoadedCloth::sensitivities(const LoadedEquilibrium& found,
                                               const MatX& history_derivative) {
  const Points& x = found.cloth.x;
  const Stiffness stiffness = stiffness_at(place_of(found));
  detail::EquilibriumDerivatives held =
      detail::equilibrium_derivatives(cloth_, *system_, x, history_derivative);
  const MatX moves = -stiffness.hessian.solve(net_forces(held.gradient, x, found.clips));
  LoadedSensitivities result;
  result.x = held.x + stiffness.x * moves;
  result.forces =
      detail::sum_over_clips(held.gradient + stiffness.forces * moves, clip_of_, clips_.size());
  result.poses = of_all_clips(moves);
  result.inexact = held.inexact || !stiffness.hessian.definite();
  return result;
}

/// Of moves of the loaded clips in scaled coordinates: 6 clips x columns.
MatX LoadedCloth::of_all_clips(const MatX& moves) const {
  const MatX unscaled = scales().cwiseInverse().asDiagonal() * moves;
  MatX all = MatX::Zero(six(clips_.size()), moves.cols());
  for (std::size_t k = 0; k < loaded_.size(); ++k)
    all.middleRows<6>(six(loaded_[k])) = unscaled.middleRows<6>(six(k));
  return all;
}

LoadedPoseSensitivities LoadedCloth::pose_sensitivities(const LoadedEquilibrium& found) {
  const Points& x = found.cloth.x;
  const Stiffness stiffness = stiffness_at(place_of(found));
  MatX of_held = detail::moves_by_poses(x, clip_of_, found.clips);
  for (const std::size_t c : loaded_) of_held.middleCols<6>(six(c)).setZero();
  const MatX forces = detail::held_response(*system_, x, of_held).forces;
  const MatX moves = -stiffness.hessian.solve(net_forces(forces, x, found.clips));
  return {detail::sum_over_clips(forces + stiffness.forces * moves, clip_of_, clips_.size()),
          of_all_clips(moves)};
}

}  // namespace weft
