#include "weft/estimate/motion_fit.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "weft/base/clock.h"
#include "weft/base/error.h"
#include "weft/base/parallel.h"
#include "weft/base/quantile.h"
#include "weft/estimate/estimate_scatter.h"
#include "weft/estimate/evaluate_trial.h"

namespace weft {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kOffMesh = 1e-9;  // m
constexpr double kSameDispersion = 1.05;

Eigen::Index row(std::size_t i) { return static_cast<Eigen::Index>(i); }

ParameterInfo delay_info(const MotionUnknowns& unknowns) {
  return {"delay",
          "s",
          unknowns.delay_lower,
          unknowns.delay_upper,
          unknowns.delay_initial,
          Scale::linear,
          "Time by which the stamps of the tracks are later than those of the fixtures.",
          "estimate/motion_fit.h"};
}

/// Weights of a Hermite cubic on positions and velocities of the two nodes about a time, and their
/// derivatives by the time.
struct HermiteWeights {
  std::size_t first = 0;
  double x0 = 1, v0 = 0, x1 = 0, v1 = 0;
  double dx0 = 0, dv0 = 0, dx1 = 0, dv1 = 0;
};
HermiteWeights hermite(const std::vector<double>& nodes, double time) {
  HermiteWeights w;
  if (nodes.size() < 2 || time <= nodes.front()) return w;
  const auto after = std::upper_bound(nodes.begin(), nodes.end(), time);
  w.first = std::min(at(after - nodes.begin() - 1), nodes.size() - 2);
  const double h = nodes[w.first + 1] - nodes[w.first], s = (time - nodes[w.first]) / h;
  w.x0 = 1 + s * s * (2 * s - 3);
  w.x1 = 1 - w.x0;
  w.v0 = h * s * (1 - s) * (1 - s);
  w.v1 = h * s * s * (s - 1);
  w.dx0 = 6 * s * (s - 1) / h;
  w.dx1 = -w.dx0;
  w.dv0 = (1 - s) * (1 - 3 * s);
  w.dv1 = s * (3 * s - 2);
  return w;
}

/// The tracked points on the simulated surface.
class MotionSampler {
 public:
  MotionSampler(const TriangleMesh& mesh, const MaterialPoints& uv) : mesh_(mesh) {
    const MaterialLocator locator(mesh);
    for (Eigen::Index p = 0; p < uv.cols(); ++p) hits_.push_back(locator.locate(uv.col(p)));
  }
  Points positions(const Trajectory& motion, const HermiteWeights& w) const {
    const Points& x0 = motion.frames[w.first];
    if (w.x0 == 1) return sample(x0);
    return sample(Points(w.x0 * x0 + w.v0 * motion.velocities[w.first] +
                         w.x1 * motion.frames[w.first + 1] +
                         w.v1 * motion.velocities[w.first + 1]));
  }
  Points velocities(const Trajectory& motion, const HermiteWeights& w) const {
    if (w.x0 == 1 && w.dv0 == 0) return Points::Zero(3, row(hits_.size()));
    return sample(Points(w.dx0 * motion.frames[w.first] + w.dv0 * motion.velocities[w.first] +
                         w.dx1 * motion.frames[w.first + 1] +
                         w.dv1 * motion.velocities[w.first + 1]));
  }
  /// 3 points rows, kDirections columns.
  Directions derivatives(const Sensitivities& s, const HermiteWeights& w) const {
    if (w.x0 == 1) return sample(s.x[w.first]);
    return sample(Directions(w.x0 * s.x[w.first] + w.v0 * s.v[w.first] + w.x1 * s.x[w.first + 1] +
                             w.v1 * s.v[w.first + 1]));
  }

 private:
  Points sample(const Points& x) const {
    Points out = Points::Zero(3, row(hits_.size()));
    for (std::size_t p = 0; p < hits_.size(); ++p)
      for (std::size_t k = 0; k < 3; ++k)
        out.col(row(p)) += hits_[p].barycentric[at(k)] * x.col(corner(p, k));
    return out;
  }
  Directions sample(const Directions& x) const {
    Directions out = Directions::Zero(row(3 * hits_.size()), kDirections);
    for (std::size_t p = 0; p < hits_.size(); ++p)
      for (std::size_t k = 0; k < 3; ++k)
        out.middleRows<3>(row(3 * p)) +=
            hits_[p].barycentric[at(k)] * x.middleRows<3>(3 * corner(p, k));
    return out;
  }
  int corner(std::size_t p, std::size_t k) const {
    return mesh_.triangles[static_cast<std::size_t>(hits_[p].triangle)][k];
  }

  const TriangleMesh& mesh_;
  std::vector<MaterialLocator::Hit> hits_;
};

void check_positive(std::string_view name, double value) {
  if (!(value > 0)) throw Error(fmt::format("motion fit: {} is {}, must be above 0", name, value));
}

/// Whether `nodes` reach the last frame of the tracks.
void check_end(const MotionTrial& trial, const MotionTracks& tracks, double delay) {
  if (tracks.times.empty()) return;
  const double last = tracks.times.back() - delay, end = trial.experiment.scene.frame_times.back();
  if (last > end + 1e-9)
    throw Error(fmt::format(
        "trial \"{}\": the tracks end at {:.6g} s on the clock of the fixtures with a delay of "
        "{:.4g} s, the simulation at {:.6g} s",
        trial.name, last, delay, end));
}

void check_sizes(const std::string& name, const MotionTracks& tracks) {
  const auto fail = [&](const std::string& what) {
    throw Error(fmt::format("trial \"{}\": {}", name, what));
  };
  const std::size_t frames = tracks.times.size();
  if (tracks.position.size() != frames || tracks.normal.size() != frames ||
      tracks.weight.size() != frames)
    fail("times, positions, normals and weights of the tracks differ in their number of frames");
  const Eigen::Index points = tracks.uv.cols();
  for (std::size_t k = 0; k < frames; ++k) {
    if (!std::isfinite(tracks.times[k]) || (k > 0 && tracks.times[k] <= tracks.times[k - 1]))
      fail(fmt::format("times of the tracks must be finite and increase, but frame {} is at {} s",
                       k, tracks.times[k]));
    if (tracks.position[k].cols() != points || tracks.normal[k].cols() != points ||
        tracks.weight[k].size() != points)
      fail(fmt::format("frame {} of the tracks does not have {} points", k, points));
    for (Eigen::Index p = 0; p < points; ++p) {
      const double weight = tracks.weight[k][p];
      if (!(weight >= 0) || !std::isfinite(weight) ||
          (weight > 0 &&
           !(tracks.position[k].col(p).allFinite() && tracks.normal[k].col(p).allFinite())))
        fail(fmt::format("point {} of frame {} has a weight below 0 or is not finite", p, k));
    }
  }
}

}  // namespace

MotionTracks frames_of(const MotionTracks& tracks, std::size_t first, std::size_t last) {
  const auto part = [&](const auto& all) {
    using List = std::remove_cvref_t<decltype(all)>;
    return List(all.begin() + row(first), all.begin() + row(last));
  };
  return {tracks.uv, part(tracks.times), part(tracks.position), part(tracks.normal),
          part(tracks.weight)};
}

Points grid_normals(const Points& position, const VecX& weight, int columns, int rows) {
  Points normals = Points::Zero(3, position.cols());
  // The difference of the neighbours that were seen, the point itself in place of one that was not.
  const auto along = [&](int index, int place, int count, int stride) -> Vec3 {
    int low = index, high = index;
    if (place > 0 && weight[index - stride] > 0) low = index - stride;
    if (place + 1 < count && weight[index + stride] > 0) high = index + stride;
    return position.col(high) - position.col(low);
  };
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const int p = row * columns + column;
      if (!(weight[p] > 0)) continue;
      const Vec3 n = along(p, column, columns, 1).cross(along(p, row, rows, columns));
      if (n.norm() > 0) normals.col(p) = n.normalized();
    }
  }
  return normals;
}

void MotionProblem::check(const MotionTrial& trial) const {
  check_sizes(trial.name, trial.tracks);
  const Scene& scene = trial.experiment.scene;
  if (scene.frame_times.size() < 2)
    throw Error(fmt::format("trial \"{}\": fewer than two nodes", trial.name));
  check_end(trial, trial.tracks, unknowns_.delay ? unknowns_.delay_lower : unknowns_.delay_initial);
  const Vec2 lower = scene.mesh.material.rowwise().minCoeff(),
             upper = scene.mesh.material.rowwise().maxCoeff();
  for (Eigen::Index p = 0; p < trial.tracks.uv.cols(); ++p) {
    const Vec2 uv = trial.tracks.uv.col(p);
    if (!((uv - lower).minCoeff() >= -kOffMesh && (upper - uv).minCoeff() >= -kOffMesh))
      throw Error(fmt::format("trial \"{}\": tracked point {} at ({}, {}) is off the mesh",
                              trial.name, p, uv[0], uv[1]));
  }
}

void MotionProblem::add_unknowns() {
  for (const std::string& name : unknowns_.free) {
    const int index = fabric_.value_index(name);
    if (std::find(indices_.begin(), indices_.end(), index) != indices_.end())
      throw Error(fmt::format("parameter \"{}\" is searched twice", name));
    indices_.push_back(index);
    infos_.push_back(fabric_.info(index));
  }
  if (unknowns_.delay) {
    if (!(unknowns_.delay_lower < unknowns_.delay_upper))
      throw Error("motion fit: the range of the delay is empty");
    infos_.push_back(delay_info(unknowns_));
  }
  for (const SceneUnknown& unknown : unknowns_.scene) {
    check_positive("the step of an unknown of the scene", unknown.step);
    infos_.push_back(unknown.info);
  }
  if (infos_.empty()) throw Error("motion fit: nothing is searched");
  prior_mean_ = VecX::Zero(dimension());
  prior_precision_ = VecX::Zero(dimension());
  const auto set = [&](std::size_t i, const ScaledPrior& prior) {
    prior_mean_[row(i)] = prior.mean;
    prior_precision_[row(i)] = 1 / (prior.deviation * prior.deviation);
  };
  for (const ParameterPrior& prior : unknowns_.priors)
    for (std::size_t i = 0; i < indices_.size(); ++i)
      if (infos_[i].name == prior.parameter) set(i, scaled_prior(infos_[i], prior));
  const std::size_t first = infos_.size() - unknowns_.scene.size();
  for (std::size_t i = 0; i < unknowns_.scene.size(); ++i)
    if (unknowns_.scene[i].prior) set(first + i, *unknowns_.scene[i].prior);
}

MotionProblem::MotionProblem(std::vector<MotionTrial> trials, Fabric fabric,
                             MotionUnknowns unknowns, const MotionNoise& noise, int threads)
    : trials_(std::move(trials)),
      fabric_(std::move(fabric)),
      unknowns_(std::move(unknowns)),
      noise_(noise),
      threads_(threads) {
  require_motion_model(fabric_);
  if (trials_.empty()) throw Error("motion fit: no trials");
  check_positive("the noise along the normal", noise_.normal);
  check_positive("the noise across", noise_.tangential);
  check_positive("where outliers begin", noise_.outlier);
  add_unknowns();
  for (const MotionTrial& trial : trials_) {
    check(trial);
    for (const VecX& weight : trial.tracks.weight) residual_count_ += 3 * weight.sum();
  }
  if (!(residual_count_ > 0)) throw Error("motion fit: no tracked point has a weight");
  dispersion_ = 2 / residual_count_;
}

VecX MotionProblem::scaled(const Fabric& fabric) const {
  VecX x(dimension());
  Eigen::Index i = 0;
  for (const int index : indices_) {
    x[i] = to_scaled(infos_[at(i)], fabric.values[index]);
    ++i;
  }
  if (unknowns_.delay) {
    x[i] = to_scaled(infos_[at(i)], unknowns_.delay_initial);
    ++i;
  }
  for (const SceneUnknown& unknown : unknowns_.scene) {
    x[i] = to_scaled(unknown.info, unknown.initial);
    ++i;
  }
  return x;
}

Fabric MotionProblem::fabric(const VecX& scaled) const {
  Fabric fabric = fabric_;
  for (std::size_t i = 0; i < indices_.size(); ++i)
    fabric.values[indices_[i]] = from_scaled(infos_[i], scaled[row(i)]);
  return fabric;
}

double MotionProblem::delay(const VecX& scaled) const {
  if (!unknowns_.delay) return unknowns_.delay_initial;
  return from_scaled(infos_[indices_.size()], scaled[row(indices_.size())]);
}

MotionExperiment MotionProblem::experiment(std::size_t trial, const VecX& scaled) const {
  MotionExperiment experiment = trials_[trial].experiment;
  const std::size_t first = infos_.size() - unknowns_.scene.size();
  for (std::size_t i = 0; i < unknowns_.scene.size(); ++i)
    unknowns_.scene[i].apply(from_scaled(infos_[first + i], scaled[row(first + i)]), experiment);
  return experiment;
}

std::vector<MotionFrames> MotionProblem::simulate(const VecX& scaled,
                                                  const std::vector<MotionTracks>* others) const {
  if (others && others->size() != trials_.size())
    throw Error("motion fit: the tracks are not one a trial");
  const Fabric fabric = this->fabric(scaled);
  const double delay = this->delay(scaled);
  std::vector<MotionFrames> out(trials_.size());
  parallel_for(trials_.size(), threads_, [&](std::size_t t) {
    const MotionTracks& tracks = others ? (*others)[t] : trials_[t].tracks;
    const MotionExperiment e = experiment(t, scaled);
    check_end(trials_[t], tracks, delay);
    const Trajectory motion = weft::simulate(e.scene, e.air, fabric, trials_[t].simulation);
    out[t].diverged = motion.diverged;
    out[t].divergence = motion.divergence;
    if (motion.diverged) return;
    const MotionSampler sampler(e.scene.mesh, tracks.uv);
    for (const double time : tracks.times)
      out[t].position.push_back(
          sampler.positions(motion, hermite(e.scene.frame_times, time - delay)));
  });
  return out;
}

/// Adds the frame's part to `part` (gradient and matrix, without 1 / N) and returns its sum.
double MotionProblem::add_frame(std::size_t trial, std::size_t frame, const Points& x,
                                const MatX* jacobian, CostPart* part) const {
  const MotionTracks& tracks = trials_[trial].tracks;
  const double normal = 1 / (noise_.normal * noise_.normal),
               tangential = 1 / (noise_.tangential * noise_.tangential);
  double sum = 0;
  for (Eigen::Index p = 0; p < x.cols(); ++p) {
    const double weight = tracks.weight[frame][p];
    if (!(weight > 0)) continue;
    const Vec3 d = x.col(p) - tracks.position[frame].col(p);
    const Vec3 n = tracks.normal[frame].col(p);
    const Vec3 metric_d = tangential * d + (normal - tangential) * n.dot(d) * n;
    const double square = d.dot(metric_d);
    const double robust = 1 / (1 + square / (noise_.outlier * noise_.outlier));
    sum += weight * square * robust;
    if (!part) continue;
    const Mat3 metric = tangential * Mat3::Identity() + (normal - tangential) * n * n.transpose();
    const MatX j = jacobian->middleRows(3 * p, 3);
    const double pull = 2 * weight * robust * robust;
    part->gradient += pull * j.transpose() * metric_d;
    part->hessian += pull * j.transpose() * metric * j;
  }
  return sum;
}

PriorTerm MotionProblem::prior(const VecX& scaled) const {
  PriorTerm term;
  term.gradient = dispersion_ * prior_precision_.cwiseProduct(scaled - prior_mean_);
  term.hessian = (dispersion_ * prior_precision_).asDiagonal();
  term.gradient_covariance = (dispersion_ * dispersion_ * prior_precision_).asDiagonal();
  return term;
}

double MotionProblem::prior_cost(const VecX& scaled) const {
  const VecX off = scaled - prior_mean_;
  return 0.5 * prior(scaled).gradient.dot(off);
}

double MotionProblem::cost(const VecX& scaled) const {
  double sum = 0;
  const std::vector<MotionFrames> frames = simulate(scaled);
  for (std::size_t t = 0; t < trials_.size(); ++t) {
    if (frames[t].diverged) return kInfinity;
    for (std::size_t k = 0; k < frames[t].position.size(); ++k)
      sum += add_frame(t, k, frames[t].position[k], nullptr, nullptr) / residual_count_;
  }
  return sum + prior_cost(scaled);
}

/// A trial's simulated frames with their derivatives.
struct MotionProblem::Frames {
  std::vector<Points> position;
  std::vector<MatX> jacobian;  // 3 points x unknowns, scaled coordinates
  bool diverged = false;
  long inexact = 0;
};

/// `slopes`: of the values by their scaled coordinates. Columns of the scene's numbers stay zero.
MotionProblem::Frames MotionProblem::differentiate(std::size_t trial, const VecX& scaled,
                                                   const VecX& slopes, int threads) const {
  const MotionTracks& tracks = trials_[trial].tracks;
  const SimulationOptions& simulation = trials_[trial].simulation;
  const MotionExperiment e = experiment(trial, scaled);
  const Fabric fabric = this->fabric(scaled);
  const double delay = this->delay(scaled);
  TrajectoryWithSensitivities motion;
  if (indices_.empty()) {
    motion.trajectory = weft::simulate(e.scene, e.air, fabric, simulation);
  } else {
    motion = simulate_with_sensitivities(e.scene, e.air, fabric, indices_, simulation, threads);
  }
  Frames out;
  out.diverged = motion.trajectory.diverged;
  out.inexact = motion.sensitivities.inexact;
  if (out.diverged) return out;
  const MotionSampler sampler(e.scene.mesh, tracks.uv);
  for (const double time : tracks.times) {
    const HermiteWeights w = hermite(e.scene.frame_times, time - delay);
    out.position.push_back(sampler.positions(motion.trajectory, w));
    MatX jacobian = MatX::Zero(3 * tracks.uv.cols(), dimension());
    const Eigen::Index own = row(indices_.size());
    if (own > 0)
      jacobian.leftCols(own) = sampler.derivatives(motion.sensitivities, w).leftCols(own) *
                               slopes.head(own).asDiagonal();
    if (unknowns_.delay) {
      const Points v = sampler.velocities(motion.trajectory, w);
      jacobian.col(own) = -slopes[own] * flat(v);
    }
    out.jacobian.push_back(std::move(jacobian));
  }
  return out;
}

MotionProblem::Linearization MotionProblem::linearize(const VecX& scaled) const {
  const int n = dimension();
  const std::size_t scene_first = infos_.size() - unknowns_.scene.size();
  VecX slopes(n);
  for (Eigen::Index i = 0; i < n; ++i) slopes[i] = scaled_slope(infos_[at(i)], scaled[i]);

  // Two simulations more for each number of the scene; a task of its own each.
  const std::size_t others = unknowns_.scene.size();
  const std::size_t tasks = trials_.size() + 2 * others;
  const int task_threads = threads_each(tasks, threads_);

  std::vector<Frames> frames(trials_.size());
  std::vector<std::vector<MotionFrames>> ahead(others), behind(others);
  parallel_for(tasks, threads_, [&](std::size_t task) {
    if (task < trials_.size()) {
      frames[task] = differentiate(task, scaled, slopes, task_threads);
      return;
    }
    const std::size_t i = (task - trials_.size()) / 2;
    const bool forward = (task - trials_.size()) % 2 == 0;
    VecX moved = scaled;
    moved[row(scene_first + i)] += forward ? unknowns_.scene[i].step : -unknowns_.scene[i].step;
    (forward ? ahead : behind)[i] = simulate(moved);
  });

  Linearization result;
  result.model.gradient = VecX::Zero(n);
  result.model.hessian = MatX::Zero(n, n);
  for (std::size_t t = 0; t < trials_.size(); ++t) {
    bool diverged = frames[t].diverged;
    for (std::size_t i = 0; i < others; ++i)
      diverged = diverged || ahead[i][t].diverged || behind[i][t].diverged;
    if (diverged) {
      result.model.cost = kInfinity;
      return result;
    }
    result.inexact += frames[t].inexact;
    for (std::size_t k = 0; k < frames[t].position.size(); ++k) {
      MatX& jacobian = frames[t].jacobian[k];
      for (std::size_t i = 0; i < others; ++i) {
        const Points difference = ahead[i][t].position[k] - behind[i][t].position[k];
        jacobian.col(row(scene_first + i)) = flat(difference) / (2 * unknowns_.scene[i].step);
      }
      CostPart part{t, static_cast<int>(k), VecX::Zero(n), MatX::Zero(n, n), 1 / residual_count_};
      result.model.cost +=
          add_frame(t, k, frames[t].position[k], &jacobian, &part) / residual_count_;
      part.gradient /= residual_count_;
      part.hessian /= residual_count_;
      result.model.gradient += part.gradient;
      result.model.hessian += part.hessian;
      result.parts.push_back(std::move(part));
    }
  }
  result.prior = prior(scaled);
  result.model.cost += prior_cost(scaled);
  result.model.gradient += result.prior.gradient;
  result.model.hessian += result.prior.hessian;
  return result;
}

namespace {

std::vector<CostPart> blocks_of(const std::vector<CostPart>& parts) {
  return join_frames(parts, frames_per_cluster(parts));
}

/// One that is held at a bound is anywhere; one as wide as half the range, or as half of what the
/// prior alone would give, is not of the data.
ParameterInterval interval_of(const MotionProblem& problem, const EstimateScatter& scatter,
                              const VecX& scaled, Eigen::Index i, double confidence) {
  const ParameterInfo& info = problem.infos()[at(i)];
  ParameterInterval out = interval_about(info, scaled[i], half_width(scatter, i, confidence));
  const double precision = problem.prior_precision()[i];
  double widest = widest_half_interval;
  if (precision > 0)
    widest = std::min(widest,
                      widest_beside_prior * normal_half_width(confidence) / std::sqrt(precision));
  out.determined = scatter.determined(i) && out.half_width <= widest;
  if (scatter.held(i)) {
    out.half_width = out.upper = kInfinity;
    out.lower = -kInfinity;
  }
  if (info.scale == Scale::shifted_log) out.lower = std::max(out.lower, 0.0);
  return out;
}

void add_intervals(const MotionProblem& problem, const MotionProblem::Linearization& found,
                   double confidence, MotionFitResult& result) {
  const EstimateScatter scatter = scatter_of(result.scaled, found.model, blocks_of(found.parts),
                                             problem.dispersion(), 1, found.prior);
  result.correlation = correlation_of(scatter.covariance);
  result.condition = scatter.condition;
  if (scatter.parts < 2) return;
  for (Eigen::Index i = 0; i < result.scaled.size(); ++i)
    result.intervals.push_back(interval_of(problem, scatter, result.scaled, i, confidence));
}

}  // namespace

MotionFitResult fit_motion(MotionProblem problem, const VecX& start,
                           const MotionFitOptions& options, const MotionFitObserver& observer) {
  if (options.passes < 1) throw Error("motion fit: passes must be at least 1");
  if (!(options.confidence > 0) || !(options.confidence < 1))
    throw Error("motion fit: the confidence must lie within 0 and 1");
  const auto begin = Clock::now();
  MotionFitResult result;
  VecX x = start.cwiseMax(0).cwiseMin(1);
  result.cost_start = problem.cost(x);
  if (!std::isfinite(result.cost_start)) throw Error("motion fit: the start diverges");
  const VecX zero = VecX::Zero(x.size()), one = VecX::Ones(x.size());
  bool stopped = false;
  MotionProblem::Linearization found;
  for (int pass = 0; pass < options.passes; ++pass) {
    const LeastSquaresResult descent =
        minimize_least_squares([&](const VecX& at_x) { return problem.linearize(at_x).model; },
                               [&](const VecX& at_x) { return problem.cost(at_x); }, x, zero, one,
                               options.least_squares, observer);
    x = descent.x;
    result.iterations += descent.iterations;
    stopped = descent.end == LeastSquaresEnd::stopped;
    found = problem.linearize(x);
    if (stopped || pass + 1 == options.passes) break;
    const std::vector<CostPart> blocks = blocks_of(found.parts);
    if (blocks.size() < 2) break;
    const double floor = 2 / problem.residual_count(), measured = cluster_dispersion(blocks);
    const double dispersion = std::isfinite(measured) ? std::max(floor, measured) : floor;
    const double change = dispersion / problem.dispersion();
    if (std::max(change, 1 / change) < kSameDispersion) break;
    problem.set_dispersion(dispersion);
  }
  result.scaled = x;
  result.fabric = problem.fabric(x);
  result.delay = problem.delay(x);
  result.cost = found.model.cost;
  result.inexact = found.inexact;
  add_intervals(problem, found, options.confidence, result);
  result.wall_s = seconds_since(begin);
  return result;
}

namespace {

MotionDistance summary(std::vector<double> distances) {
  if (distances.empty()) return {kNone, kNone, kNone};
  MotionDistance out;
  for (const double d : distances) {
    out.mean += d / static_cast<double>(distances.size());
    out.rms += d * d / static_cast<double>(distances.size());
  }
  out.rms = std::sqrt(out.rms);
  out.median = quantile(std::move(distances), 0.5);
  return out;
}

void collect(const MotionTracks& tracks, std::size_t frame, const Points& x,
             std::vector<double>& distances) {
  for (Eigen::Index p = 0; p < x.cols(); ++p)
    if (tracks.weight[frame][p] > 0)
      distances.push_back((x.col(p) - tracks.position[frame].col(p)).norm());
}

}  // namespace

MotionDistance motion_distance(const MotionTracks& tracks, std::size_t frame, const Points& x) {
  std::vector<double> distances;
  collect(tracks, frame, x, distances);
  return summary(std::move(distances));
}

MotionDistance motion_distance(const MotionTracks& tracks, const std::vector<Points>& x,
                               std::size_t first, std::size_t last) {
  std::vector<double> distances;
  for (std::size_t k = first; k < last; ++k) collect(tracks, k, x[k], distances);
  return summary(std::move(distances));
}

}  // namespace weft
