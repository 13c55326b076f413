/// How well can the model explain a capture at all? Fits all nine parameters to the true surface
/// itself (least squares of the distance at the same (u, v) over the fit frames, then annealing
/// from there), from the same start surface as a video fit, and prints what is left: the part of a
/// fit's distance that is the model's.
///
///     weft_truth_fit CAPTURE FABRIC_OUT [--grid N] [START ...]
///
/// START: fabrics to start from (presets or files); the best end counts. Default: the middle of the
/// ranges. N: vertices along each side, 25 by default.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>

#include "program.h"
#include "weft/base/error.h"
#include "weft/dynamics/sensitivity.h"
#include "weft/estimate/evaluate_capture.h"
#include "weft/estimate/least_squares.h"
#include "weft/estimate/linearize_trial.h"
#include "weft/estimate/optimize.h"

namespace {

using namespace weft;

/// Where snapping makes derivatives larger than this (m rms per range), they say nothing about
/// steps of a useful size and count less.
constexpr double kUnstableMotion = 0.5;
constexpr std::size_t kAnnealingEvaluations = 100;

class TruthFit {
 public:
  TruthFit(const Problem& problem, const TruthSurface& truth)
      : problem_(problem), scene_(problem.trials().front()->scene) {
    const MaterialLocator locator(truth.mesh);
    for (const Points& frame : truth.frames)
      target_.push_back(interpolate(truth.mesh, locator, frame, scene_.mesh.material));
    weights_ = vertex_areas(scene_.mesh);
    weights_ /= weights_.sum();
    for (int i = 0; i < problem.dimension(); ++i) {
      parameters_.push_back(problem.initial().value_index(problem.info(i).name));
    }
  }

  /// Mean squared distance over surface and fit frames, m^2; infinity if the motion diverged.
  double cost(const VecX& scaled) const {
    const Trajectory motion = simulate(scene_, problem_.fabric(scaled));
    if (motion.diverged) return kInfinity;
    double sum = 0;
    for (std::size_t k = 0; k < motion.frames.size(); ++k)
      sum += squared_distance(motion.frames[k], k);
    return sum / static_cast<double>(motion.frames.size());
  }

  LeastSquaresResult descend(const VecX& start) const {
    LeastSquaresOptions options;
    options.max_iterations = 25;
    return minimize_least_squares([this](const VecX& x) { return linearize(x); },
                                  [this](const VecX& x) { return cost(x); }, start,
                                  VecX::Zero(start.size()), VecX::Ones(start.size()), options);
  }

  /// The cost of swinging cloth is rough: a descent ends in the first dent.
  SearchResult anneal_from(const VecX& start, std::size_t evaluations) const {
    AnnealingOptions options;
    options.max_evaluations = evaluations;
    options.simplex_size = 0.1;
    return anneal([this](const VecX& x) { return cost(x); }, start, options);
  }

 private:
  /// Mean squared distance over surface and frames, m^2.
  double squared_distance(const Points& x, std::size_t frame) const {
    return (x - target_[frame]).colwise().squaredNorm().dot(weights_.transpose());
  }

  QuadraticModel linearize(const VecX& scaled) const {
    const auto n = scaled.size();
    const TrajectoryWithSensitivities motion =
        simulate_with_sensitivities(scene_, problem_.fabric(scaled), parameters_);
    QuadraticModel model{0, VecX::Zero(n), MatX::Zero(n, n)};
    if (motion.trajectory.diverged) {
      model.cost = kInfinity;
      return model;
    }
    VecX slopes(n);
    for (Eigen::Index i = 0; i < n; ++i)
      slopes[i] = scaled_slope(problem_.info(static_cast<int>(i)), scaled[i]);
    const auto count = motion.trajectory.frames.size();
    for (std::size_t k = 0; k < count; ++k) {
      model.cost += squared_distance(motion.trajectory.frames[k], k) / static_cast<double>(count);
      const Points difference = motion.trajectory.frames[k] - target_[k];
      const MatX jacobian = motion.sensitivities.x[k].leftCols(n) * slopes.asDiagonal();
      VecX weight(difference.size());
      for (Eigen::Index i = 0; i < weight.size(); ++i) weight[i] = weights_[i / 3];
      const MatX weighted = weight.asDiagonal() * jacobian;
      const double motion_squared = jacobian.cwiseProduct(weighted).sum();
      const double trust = 2 / (1 + motion_squared / (kUnstableMotion * kUnstableMotion)) /
                           static_cast<double>(count);
      model.gradient += trust * weighted.transpose() * flat(difference);
      model.hessian += trust * weighted.transpose() * jacobian;
    }
    return model;
  }

  const Problem& problem_;
  Scene scene_;
  std::vector<Points> target_;  // the truth at the mesh's vertices
  VecX weights_;
  std::vector<int> parameters_;
};

int run(int argc, char** argv) {
  if (argc < 3) throw Error("usage: weft_truth_fit CAPTURE FABRIC_OUT [--grid N] [START ...]");
  TrialOptions options;
  std::vector<std::string> start_names(argv + 3, argv + argc);
  if (start_names.size() >= 2 && start_names[0] == "--grid") {
    options.columns = options.rows = validation::number("--grid", start_names[1], 3);
    start_names.erase(start_names.begin(), start_names.begin() + 2);
  }
  const Capture capture = read_capture(argv[1]);
  if (!capture.truth) throw Error(std::string(argv[1]) + ": has no [truth]");
  const TruthSurface truth = read_truth(capture);
  const auto trial = prepare_trial(capture, capture.fit_first, capture.fit_last, options);
  std::vector<std::string> free;
  for (const ParameterInfo& p : baraff_witkin_parameters()) free.emplace_back(p.name);
  const Problem problem({trial}, Fabric::with_defaults("truth fit"), free);
  const TruthFit truth_fit(problem, truth);

  std::vector<VecX> starts;
  for (const std::string& name : start_names)
    starts.push_back(problem.scaled(find_fabric(name)).cwiseMax(0).cwiseMin(1));
  if (starts.empty()) starts.push_back(VecX::Constant(problem.dimension(), 0.5));
  VecX best;
  double least = kInfinity;
  const auto consider = [&](const VecX& x, double cost) {
    if (!(cost < least)) return;
    best = x;
    least = cost;
  };
  for (const VecX& start : starts) {
    consider(start, truth_fit.cost(start));
    const LeastSquaresResult found = truth_fit.descend(start);
    consider(found.x, found.cost);
  }
  if (!std::isfinite(least)) throw Error("every simulation diverged");
  fmt::print(stderr, "descent ends at {:.2f} mm rms\n", 1e3 * std::sqrt(least));
  const SearchResult found = truth_fit.anneal_from(best, kAnnealingEvaluations);
  consider(found.best, found.error);
  const Fabric fabric = problem.fabric(best);
  write_fabric(argv[2], fabric);
  const auto all = prepare_trial(capture, capture.fit_first, capture.frame_count - 1, options);
  const CaptureEvaluation e = evaluate_capture(*all, fabric, TruthDistance::included);
  fmt::print("{}: distance fit {:.2f} mm, error per frame {:.4g}", capture.name,
             1e3 * e.fit.distance->mean, e.fit.error);
  if (e.validation) {
    fmt::print("; validation {:.2f} mm, error per frame {:.4g}", 1e3 * e.validation->distance->mean,
               e.validation->error);
  }
  fmt::print("\n");
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return weft::validation::run_program("weft_truth_fit", [&] { return run(argc, argv); });
}
