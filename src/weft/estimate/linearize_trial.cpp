#include "weft/estimate/linearize_trial.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "weft/base/clock.h"
#include "weft/base/dense.h"
#include "weft/base/error.h"
#include "weft/base/parallel.h"
#include "weft/estimate/evaluate_trial.h"
#include "weft/estimate/patch_parts.h"
#include "weft/objective/residual_patches.h"

namespace weft {
namespace {

/// Frames of one trial, compared or linearized.
struct TrialFrames {
  std::vector<FrameLinearization> frames;  ///< gradient and hessian empty where only compared
  bool diverged = false;
  double wall_s = 0;
  long inexact = 0;
};

Scene shortened(const Trial& trial, int compared) {
  Scene scene = trial.scene;
  scene.frame_times.resize(static_cast<std::size_t>(trial.first_frame + compared));
  return scene;
}

int compared_frames(const Trial& trial, int frame_count) {
  return frame_count > 0 ? std::min(frame_count, trial.frame_count()) : trial.frame_count();
}

class TrialComparer {
 public:
  TrialComparer(const Trial& trial, const LinearizationOptions& options, int threads)
      : trial_(trial),
        residual_(options.residual),
        compared_(compared_frames(trial, options.frame_count)),
        least_motion_(options.least_motion),
        unstable_motion_(options.unstable_motion),
        threads_(threads) {
    residual_.alpha = trial.options.alpha;
  }

  TrialFrames evaluate(const Fabric& fabric) const {
    const auto begin = Clock::now();
    TrialFrames result;
    result.frames.resize(static_cast<std::size_t>(compared_));
    std::vector<Points> shapes(result.frames.size());
    const std::size_t reached = for_each_while_made(
        shapes.size(), threads_, [&] { return residuals(); },
        [&](const auto& ready) {
          const Trajectory motion =
              simulate_compared(trial_, shortened(trial_, compared_), fabric, shapes, ready);
          result.diverged = motion.diverged;
        },
        [&](FrameResiduals& tool, std::size_t i) {
          static_cast<FrameCost&>(result.frames[i]) = tool.evaluate(trial_.features[i], shapes[i]);
        });
    result.diverged = result.diverged || reached < shapes.size();
    if (result.diverged) result.frames.clear();
    result.wall_s = seconds_since(begin);
    return result;
  }

  /// `slopes`: d value / d scaled of each parameter.
  TrialFrames linearize(const Fabric& fabric, const std::vector<int>& parameters,
                        const VecX& slopes, const SensitivitySimulator& simulator) const {
    const auto begin = Clock::now();
    const TrajectoryWithSensitivities motion = simulator(
        shortened(trial_, compared_), fabric, parameters, trial_.options.simulation, threads_);
    TrialFrames result = prepare(motion.trajectory);
    result.inexact = motion.sensitivities.inexact;
    each_frame(result, [&](FrameResiduals& residuals, std::size_t i) {
      const Directions& dx = motion.sensitivities.x[i + first()];
      result.frames[i] =
          linearize_frame(residuals, trial_.features[i], motion.trajectory.frames[i + first()],
                          dx.leftCols(slopes.size()) * slopes.asDiagonal());
    });
    result.wall_s = seconds_since(begin);
    return result;
  }

  /// Frames and their patches; the frames without gradient and hessian.
  struct Patches {
    TrialFrames frames;
    std::vector<std::vector<PatchLinearization::Sums>> patches;
  };
  Patches linearize_patches(const Fabric& fabric, const std::vector<int>& parameters,
                            const VecX& slopes, const SensitivitySimulator& simulator) const {
    const TrajectoryWithSensitivities motion = simulator(
        shortened(trial_, compared_), fabric, parameters, trial_.options.simulation, threads_);
    Patches result{prepare(motion.trajectory), {}};
    const std::size_t count = result.frames.frames.size();
    result.patches.resize(count);
    const PatchGrid grid = patch_grid();
    parallel_for(count, threads_, [&](std::size_t i) {
      const Directions& dx = motion.sensitivities.x[i + first()];
      const Principal principal =
          principal_motion(dx.leftCols(slopes.size()) * slopes.asDiagonal());
      PatchLinearization found = weft::linearize_patches(
          trial_.capture.rig, trial_.scene.mesh, trial_.options.render, trial_.options.angle_map,
          residual_, trial_.features[i], motion.trajectory.frames[i + first()],
          principal.directions, grid);
      static_cast<FrameCost&>(result.frames.frames[i]) = found.whole;
      for (PatchLinearization::Sums& sums : found.patches) {
        sums.gradient = (principal.back * sums.gradient).eval();
        sums.hessian = (principal.back * sums.hessian * principal.back.transpose()).eval();
      }
      result.patches[i] = std::move(found.patches);
    });
    return result;
  }

 private:
  /// About the measured silhouettes of all frames.
  PatchGrid patch_grid() const {
    Eigen::Index top = trial_.capture.rig.height, left = trial_.capture.rig.width;
    Eigen::Index bottom = 0, right = 0;
    for (const FrameFeatures& features : trial_.features) {
      const Mask& mask = features.silhouette;
      for (Eigen::Index i = 0; i < mask.rows(); ++i) {
        for (Eigen::Index j = 0; j < mask.cols(); ++j) {
          if (mask(i, j) == 0) continue;
          top = std::min(top, i);
          bottom = std::max(bottom, i + 1);
          left = std::min(left, j);
          right = std::max(right, j + 1);
        }
      }
    }
    if (top >= bottom || left >= right) return {};
    return {double(left), double(top), double(right), double(bottom)};
  }

  /// Directions of the vertices along which the motion is looked at, and the way back to the
  /// parameters.
  struct Principal {
    MatX directions, back;
  };
  Principal principal_motion(const MatX& dx) const {
    // Past a snap derivatives may overflow: the limit of the trust below.
    if (!dx.allFinite()) return {MatX(dx.rows(), 0), MatX(dx.cols(), 0)};
    const double vertices = double(dx.rows()) / 3;
    const SymmetricEigen principal = symmetric_eigen(dx.transpose() * dx / vertices);
    const VecX motion = principal.values.cwiseMax(0).cwiseSqrt();  // ascending
    Eigen::Index still = 0;
    while (still < motion.size() && motion[still] < least_motion_) ++still;
    const Eigen::Index moving = motion.size() - still;
    const MatX basis = principal.vectors.rightCols(moving);
    const VecX trust =
        (1 + (motion.tail(moving) / unstable_motion_).array().square()).inverse().matrix();
    return {dx * basis, basis * trust.asDiagonal()};
  }

  FrameLinearization linearize_frame(FrameResiduals& residuals, const FrameFeatures& measured,
                                     const Points& x, const MatX& dx) const {
    const Principal principal = principal_motion(dx);
    FrameLinearization frame = residuals.linearize(measured, x, principal.directions);
    frame.gradient = (principal.back * frame.gradient).eval();
    frame.hessian = (principal.back * frame.hessian * principal.back.transpose()).eval();
    return frame;
  }

  std::size_t first() const { return static_cast<std::size_t>(trial_.first_frame); }

  TrialFrames prepare(const Trajectory& motion) const {
    TrialFrames result;
    result.diverged =
        motion.diverged || static_cast<int>(motion.frames.size()) < trial_.first_frame + compared_;
    if (!result.diverged) result.frames.resize(static_cast<std::size_t>(compared_));
    return result;
  }

  FrameResiduals residuals() const {
    return {trial_.capture.rig, trial_.scene.mesh, trial_.options.render, trial_.options.angle_map,
            residual_};
  }

  template <typename Task>
  void each_frame(const TrialFrames& result, const Task& task) const {
    for_each_with_tool(
        result.frames.size(), threads_, [&] { return residuals(); }, task);
  }

  const Trial& trial_;
  ResidualOptions residual_;
  int compared_;
  double least_motion_, unstable_motion_;
  int threads_;
};

/// Adds a trial's share to the problem's numbers; returns the factor of its frames' sums.
double add_trial_share(const Trial& trial, const TrialFrames& frames, double share,
                       ProblemEvaluation& evaluation, double& cost) {
  evaluation.wall_s += frames.wall_s;
  if (frames.diverged) {
    evaluation.diverged = true;
    evaluation.error = evaluation.error_per_frame = evaluation.fold = evaluation.silhouette =
        kInfinity;
    cost = kInfinity;
    return 0;
  }
  double fold = 0, silhouette = 0, masked = 0, sum = 0;
  for (const FrameCost& frame : frames.frames) {
    fold += frame.error.fold;
    silhouette += frame.error.silhouette;
    masked += frame.error.mask_pixels;
    sum += frame.cost;
  }
  const auto count = double(frames.frames.size());
  const double total = fold + trial.options.alpha * silhouette;
  const double factor = share / std::max(count, masked);
  evaluation.error += factor * total;
  evaluation.error_per_frame += share * total / count;
  evaluation.fold += share * fold / count;
  evaluation.silhouette += share * silhouette / count;
  cost += factor * sum;
  return factor;
}

/// Runs `task(trial index, threads for it)` over the trials.
template <typename Task>
void each_trial(std::size_t count, int threads, const Task& task) {
  const int inner = threads_each(count, threads);
  parallel_for(count, threads, [&](std::size_t i) { task(i, inner); });
}

}  // namespace

double scaled_slope(const ParameterInfo& info, double scaled) {
  // The map is an exponential: a step of 1e-4 leaves (c h)^2 / 6 of its slope, with c = log(upper /
  // lower) some 10 in the scaled coordinate, 2e-7. Outside [0, 1] it goes on.
  constexpr double h = 1e-4;
  return (from_scaled(info, scaled + h) - from_scaled(info, scaled - h)) / (2 * h);
}

ProblemCost evaluate_cost(const Problem& problem, const VecX& scaled,
                          const LinearizationOptions& options) {
  const auto& trials = problem.trials();
  const Fabric fabric = problem.fabric(scaled);
  std::vector<TrialFrames> frames(trials.size());
  each_trial(trials.size(), options.threads, [&](std::size_t i, int threads) {
    frames[i] = TrialComparer(*trials[i], options, threads).evaluate(fabric);
  });
  ProblemCost result;
  for (std::size_t i = 0; i < trials.size(); ++i)
    add_trial_share(*trials[i], frames[i], 1 / double(trials.size()), result.evaluation,
                    result.cost);
  return result;
}

namespace {

/// What the sensitivities of a problem are asked with.
struct Derivatives {
  Derivatives(const Problem& problem, const VecX& scaled, const LinearizationOptions& options)
      : slopes(problem.dimension()),
        simulator(options.simulator ? options.simulator
                                    : SensitivitySimulator(simulate_with_sensitivities)) {
    for (int i = 0; i < problem.dimension(); ++i) {
      parameters.push_back(
          problem.initial().value_index(problem.free()[static_cast<std::size_t>(i)]));
      slopes[i] = scaled_slope(problem.info(i), scaled[i]);
    }
  }
  std::vector<int> parameters;
  VecX slopes;
  SensitivitySimulator simulator;
};

}  // namespace

ProblemLinearization linearize(const Problem& problem, const VecX& scaled,
                               const LinearizationOptions& options) {
  const auto& trials = problem.trials();
  const Fabric fabric = problem.fabric(scaled);
  const int n = problem.dimension();
  const Derivatives by(problem, scaled, options);
  std::vector<TrialFrames> frames(trials.size());
  each_trial(trials.size(), options.threads, [&](std::size_t i, int threads) {
    frames[i] = TrialComparer(*trials[i], options, threads)
                    .linearize(fabric, by.parameters, by.slopes, by.simulator);
  });

  ProblemLinearization result;
  result.model.gradient = VecX::Zero(n);
  result.model.hessian = MatX::Zero(n, n);
  for (std::size_t i = 0; i < trials.size(); ++i) {
    const double factor = add_trial_share(*trials[i], frames[i], 1 / double(trials.size()),
                                          result.evaluation, result.model.cost);
    result.inexact += frames[i].inexact;
    for (std::size_t k = 0; k < frames[i].frames.size(); ++k) {
      const FrameLinearization& frame = frames[i].frames[k];
      result.parts.push_back(
          {i, static_cast<int>(k), factor * frame.gradient, factor * frame.hessian, factor});
      result.model.gradient += result.parts.back().gradient;
      result.model.hessian += result.parts.back().hessian;
    }
  }
  return result;
}

std::vector<PatchPart> linearize_patches(const Problem& problem, const VecX& scaled,
                                         const LinearizationOptions& options) {
  const auto& trials = problem.trials();
  const Fabric fabric = problem.fabric(scaled);
  const Derivatives by(problem, scaled, options);
  std::vector<TrialComparer::Patches> found(trials.size());
  each_trial(trials.size(), options.threads, [&](std::size_t i, int threads) {
    found[i] = TrialComparer(*trials[i], options, threads)
                   .linearize_patches(fabric, by.parameters, by.slopes, by.simulator);
  });
  std::vector<PatchPart> parts;
  for (std::size_t i = 0; i < trials.size(); ++i) {
    ProblemEvaluation evaluation;
    double cost = 0;
    if (found[i].frames.diverged) return {};
    const double factor =
        add_trial_share(*trials[i], found[i].frames, 1 / double(trials.size()), evaluation, cost);
    for (std::size_t k = 0; k < found[i].patches.size(); ++k)
      for (std::size_t p = 0; p < found[i].patches[k].size(); ++p) {
        const PatchLinearization::Sums& sums = found[i].patches[k][p];
        parts.push_back(
            {{i, static_cast<int>(k), factor * sums.gradient, factor * sums.hessian, factor},
             static_cast<int>(p)});
      }
  }
  return parts;
}

namespace {

/// Adds up those with the same trial and key.
template <typename Key>
std::vector<CostPart> add_up(const std::vector<PatchPart>& parts, const Key& key) {
  std::map<std::pair<std::size_t, int>, CostPart> sums;
  for (const PatchPart& p : parts) {
    const auto [at, fresh] = sums.try_emplace({p.part.trial, key(p)}, p.part);
    if (fresh) {
      at->second.frame = key(p);
      continue;
    }
    at->second.gradient += p.part.gradient;
    at->second.hessian += p.part.hessian;
  }
  std::vector<CostPart> result;
  for (auto& [at, sum] : sums) result.push_back(std::move(sum));
  return result;
}

}  // namespace

CostPart part_of_squares(std::size_t trial, int frame, double factor, const MatX& jacobian,
                         const VecX& residuals) {
  return {trial, frame, 2 * factor * (jacobian.transpose() * residuals),
          2 * factor * (jacobian.transpose() * jacobian)};
}

std::vector<CostPart> frames_of(const std::vector<PatchPart>& parts) {
  return add_up(parts, [](const PatchPart& p) { return p.part.frame; });
}

std::vector<CostPart> patches_of(const std::vector<PatchPart>& parts) {
  return add_up(parts, [](const PatchPart& p) { return p.patch; });
}

}  // namespace weft
