/// What is each term of the residuals worth: folds, silhouette and the phase of the stripes?
///
///     weft_validate_residuals CAPTURE FABRIC [--grid N] [--weight W] [--part PART]
///
/// CAPTURE with [truth]; FABRIC a preset or file near that of the capture. N: vertices along each
/// side, 25 by default; W: phase_weight where folds or the silhouette count too, 0.1 by default.
/// PART, all of them by default:
/// - floor: each term at the true surface, and what a displaced true surface costs;
/// - minimum: at FABRIC, the rise of the cost when a parameter is changed by a factor of 4, and the
///   90 % intervals, for the terms alone and together;
/// - derivatives: analytic derivatives of the residuals against differences of images;
/// - fits: where least squares through each set of terms ends from the same start, and how far from
///   the true surface.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <numbers>
#include <string>

#include "program.h"
#include "weft/base/error.h"
#include "weft/estimate/least_squares.h"
#include "weft/estimate/linearize_trial.h"
#include "weft/estimate/uncertainty.h"

namespace {

using namespace weft;

constexpr double kAlpha = 0.1;  // of the silhouette
constexpr const char* kShown[] = {"stretch_stiffness", "shear_stiffness", "bend_stiffness"};

double cpu_seconds() { return double(std::clock()) / CLOCKS_PER_SEC; }

/// Which terms count, with their weights.
struct Terms {
  std::string name;
  double fold, silhouette, phase;
};

std::vector<Terms> term_sets(double weight) {
  return {{"folds", 1, 0, 0},
          {"silhouette", 0, 1, 0},
          {"phase", 0, 0, 1},
          {"folds + silhouette", 1, 1, 0},
          {"phase + silhouette", 0, 1, weight},
          {"folds + silhouette + phase", 1, 1, weight}};
}

struct Sums {
  double fold = 0, silhouette = 0, phase = 0, masked = 0, overlap = 0;
  int samples = 0, seen = 0;
  double of(const Terms& terms) const {
    return terms.fold * fold + terms.silhouette * silhouette + terms.phase * phase;
  }
};

ResidualOptions all_terms() {
  ResidualOptions options;
  options.alpha = kAlpha;
  options.phase_weight = 1;
  return options;
}

class Study {
 public:
  Study(const std::string& capture, const Fabric& fabric, int grid, double weight)
      : capture_(read_capture(capture)), fabric_(fabric), weight_(weight) {
    if (!capture_.truth) throw Error(capture + ": has no [truth]");
    truth_ = read_truth(capture_);
    TrialOptions options;
    options.columns = options.rows = grid;
    options.alpha = kAlpha;
    trial_ = prepare_trial(capture_, capture_.fit_first, capture_.fit_last, options);
    for (const ParameterInfo& p : baraff_witkin_parameters()) free_.emplace_back(p.name);
    fmt::print("{}, {} x {} vertices, frames {} to {}, start: {}\n", capture_.name, grid, grid,
               capture_.fit_first, capture_.fit_last, trial_->start_name);
  }

  void floor() const;
  void discrimination() const;
  void derivatives() const;
  void slopes(const TrajectoryWithSensitivities& motion, const VecX& per_range) const;
  void fits() const;

 private:
  Problem problem(double silhouette, const Fabric& initial) const {
    auto trial = std::make_shared<Trial>(*trial_);
    trial->options.alpha = silhouette * kAlpha;
    return Problem({trial}, initial, free_);
  }
  static LinearizationOptions linearization(const Terms& terms) {
    LinearizationOptions options;
    options.residual.fold_weight = terms.fold;
    options.residual.phase_weight = terms.phase;
    return options;
  }
  /// Every `stride`-th compared frame.
  Sums compare(const TriangleMesh& mesh, const std::vector<Points>& frames,
               const ResidualOptions& options, std::size_t stride = 1) const;
  Sums compare(const Fabric& fabric) const {
    const Trajectory motion = simulate(trial_->scene, fabric, trial_->options.simulation);
    if (motion.diverged) throw Error("the motion diverged");
    return compare(trial_->scene.mesh, motion.frames, all_terms());
  }
  Uncertainty uncertainty(const Problem& problem, const VecX& scaled,
                          const std::vector<CostPart>& parts) const {
    UncertaintyOptions options;
    options.frames_per_cluster = 5;
    return estimate_uncertainty(problem, scaled, parts, options);
  }
  static std::string intervals(const Uncertainty& uncertainty);
  void print_distance(const Fabric& fabric) const;
  VecX first_guess() const;

  Capture capture_;
  Fabric fabric_;
  double weight_;
  TruthSurface truth_;
  std::shared_ptr<const Trial> trial_;
  std::vector<std::string> free_;
};

Sums Study::compare(const TriangleMesh& mesh, const std::vector<Points>& frames,
                    const ResidualOptions& options, std::size_t stride) const {
  FrameResiduals residuals(capture_.rig, mesh, trial_->options.render, trial_->options.angle_map,
                           options);
  Sums sums;
  const auto first = static_cast<std::size_t>(trial_->first_frame);
  for (std::size_t i = 0; i < trial_->features.size(); i += stride) {
    const FrameCost cost = residuals.evaluate(trial_->features[i], frames[first + i]);
    sums.fold += cost.fold_cost;
    sums.silhouette += cost.silhouette_cost;
    sums.phase += cost.phase_cost;
    sums.masked += cost.error.mask_pixels;
    sums.overlap += cost.error.overlap_pixels;
    sums.samples += cost.phase_samples;
    sums.seen += cost.phase_seen;
  }
  return sums;
}

/// Factors by which the upper ends of the intervals lie above the values.
std::string Study::intervals(const Uncertainty& uncertainty) {
  std::string text;
  for (const char* name : kShown)
    for (const ParameterInterval& p : uncertainty.parameters)
      if (p.name == name)
        text += p.determined ? fmt::format(" {:9.2f}", p.upper / p.value) : "      none";
  return text;
}

void Study::floor() const {
  // Noise is what the bulk of the residuals has: with losses this narrow outliers count little.
  ResidualOptions options = all_terms();
  options.fold_scale = 0.1;
  options.phase_scale = 0.3;
  const auto print = [&](const char* name, const Vec3& shift, double wave) {
    std::vector<Points> frames = truth_.frames;
    for (Points& frame : frames)
      for (Eigen::Index v = 0; v < frame.cols(); ++v) {
        const Vec2 at = truth_.mesh.material.col(v);
        frame.col(v) += shift;
        frame(1, v) += wave * std::sin(2 * std::numbers::pi * (at.x() + at.y()) / 0.1);
      }
    const Sums sums = compare(truth_.mesh, frames, options, 5);
    fmt::print("  {:34} {:8.2f} {:10.4f} {:12.3f} {:10.4f} {:8.1f}\n", name,
               180 / std::numbers::pi * std::sqrt(sums.fold / sums.overlap),
               std::sqrt(sums.phase / sums.samples), sums.silhouette / kAlpha / sums.masked,
               sums.seen / double(sums.samples), sums.samples / sums.masked * 100);
  };
  fmt::print(
      "\nfloor: the true surface, every 5th frame\n  {:34} {:>8} {:>10} {:>12} {:>10} {:>8}\n", "",
      "fold/deg", "phase/rad", "silh./masked", "edges seen", "edges/100 masked");
  print("true surface", Vec3::Zero(), 0);
  print("5 mm away from the camera", Vec3(0, 5e-3, 0), 0);
  print("5 mm along x", Vec3(5e-3, 0, 0), 0);
  print("waves of 2 mm, 71 mm long", Vec3::Zero(), 2e-3);
}

void Study::discrimination() const {
  const Sums here = compare(fabric_);
  std::vector<Sums> changed;
  for (const char* name : kShown)
    for (const double factor : {0.25, 4.0}) {
      Fabric other = fabric_;
      other.set(name, factor * fabric_.value(name));
      changed.push_back(compare(other));
    }
  const Problem with = problem(1, fabric_), without = problem(0, fabric_);
  const VecX scaled = with.scaled(fabric_).cwiseMax(0).cwiseMin(1);
  const auto parts_of = [&](const Problem& p, double fold, double phase) {
    return linearize(p, scaled, linearization({"", fold, 0, phase})).parts;
  };
  const auto fold = parts_of(without, 1, 0), phase = parts_of(without, 0, 1);
  const auto silhouette = parts_of(with, 0, 0);
  fmt::print(
      "\nat {}: cost per masked pixel; rise when a stiffness is divided and multiplied by 4; "
      "90 % interval, upper end over value\n",
      fabric_.name);
  fmt::print("  {:27} {:>8} {:^18} {:^18} {:^18} {:>9} {:>9} {:>9}\n", "", "cost", "stretch",
             "shear", "bend", "stretch", "shear", "bend");
  for (const Terms& terms : term_sets(weight_)) {
    std::string rises;
    for (const Sums& other : changed)
      rises += fmt::format(" {:8.2f}", other.of(terms) / here.of(terms));
    std::vector<CostPart> parts = fold;
    for (std::size_t k = 0; k < parts.size(); ++k) {
      parts[k].gradient = terms.fold * fold[k].gradient +
                          terms.silhouette * silhouette[k].gradient +
                          terms.phase * phase[k].gradient;
      parts[k].hessian = terms.fold * fold[k].hessian + terms.silhouette * silhouette[k].hessian +
                         terms.phase * phase[k].hessian;
    }
    fmt::print("  {:27} {:8.4f}{}{}\n", terms.name, here.of(terms) / here.masked, rises,
               intervals(uncertainty(with, scaled, parts)));
  }
}

void Study::derivatives() const {
  const Problem with = problem(1, fabric_), without = problem(0, fabric_);
  const VecX scaled = with.scaled(fabric_).cwiseMax(0).cwiseMin(1);
  std::vector<int> indices;
  for (const std::string& name : free_) indices.push_back(parameter_index(fabric_.model, name));
  const TrajectoryWithSensitivities motion = simulate_with_sensitivities(
      trial_->scene, with.fabric(scaled), indices, trial_->options.simulation);
  VecX per_range(with.dimension());
  for (int i = 0; i < with.dimension(); ++i) per_range[i] = scaled_slope(with.info(i), scaled[i]);
  slopes(motion, per_range);
  fmt::print(
      "\nanalytic derivatives; then differences of images by 1 px and by 4 px. CPU ms a frame; "
      "analytic against differences: cosine of the gradients, difference over norm, matrix "
      "likewise\n");
  for (const Terms& terms : term_sets(weight_)) {
    LinearizationOptions options = linearization(terms);
    options.threads = 1;
    options.simulator = [&](const Scene&, const Fabric&, const std::vector<int>&,
                            const SimulationOptions&,
                            int) -> const TrajectoryWithSensitivities& { return motion; };
    const Problem& p = terms.silhouette > 0 ? with : without;
    const double frames = trial_->frame_count();
    const auto timed = [&](QuadraticModel& model) {
      const double begin = cpu_seconds();
      model = linearize(p, scaled, options).model;
      return 1e3 * (cpu_seconds() - begin) / frames;
    };
    QuadraticModel analytic;
    fmt::print("  {:27} {:7.1f}", terms.name, timed(analytic));
    options.residual.derivatives = ResidualOptions::Derivatives::differences;
    for (const double step : {1.0, 4.0}) {
      options.residual.image_step = step;
      QuadraticModel model;
      const double milliseconds = timed(model);
      fmt::print("   {:7.1f} {:7.4f} {:7.3f} {:7.3f}", milliseconds,
                 analytic.gradient.dot(model.gradient) /
                     (analytic.gradient.norm() * model.gradient.norm()),
                 (analytic.gradient - model.gradient).norm() / model.gradient.norm(),
                 (analytic.hessian - model.hessian).norm() / model.hessian.norm());
    }
    fmt::print("\n");
    std::fflush(stdout);
  }
}

/// Gradients of single frames against the slope of the cost itself, between shapes moved by some px
/// to either side along each parameter's sensitivity.
void Study::slopes(const TrajectoryWithSensitivities& motion, const VecX& per_range) const {
  const std::vector<Terms> sets = {{"folds", 1, 0, 0}, {"silhouette", 0, 1, 0}, {"phase", 0, 0, 1}};
  const auto residuals = [&](const Terms& terms, ResidualOptions::Derivatives derivatives) {
    ResidualOptions options;
    options.fold_weight = terms.fold;
    options.alpha = terms.silhouette * kAlpha;
    options.phase_weight = terms.phase;
    options.derivatives = derivatives;
    return FrameResiduals(capture_.rig, trial_->scene.mesh, trial_->options.render,
                          trial_->options.angle_map, options);
  };
  FrameResiduals all(capture_.rig, trial_->scene.mesh, trial_->options.render,
                     trial_->options.angle_map, all_terms());
  // Columns: analytic, differences, slopes over +-1 and +-3 px; rows: frames and directions.
  std::array<std::vector<std::array<double, 4>>, 3> found;
  const double metres_per_px =
      1 /
      (capture_.rig.camera.project(truth_.frames[0].rowwise().mean() + Vec3(1e-3, 0, 0)) -
       capture_.rig.camera.project(truth_.frames[0].rowwise().mean()))
          .head<2>()
          .norm() *
      1e-3;
  for (std::size_t i = 4; i < trial_->features.size(); i += 10) {
    const auto at = static_cast<std::size_t>(trial_->first_frame) + i;
    const Points& x = motion.trajectory.frames[at];
    MatX d = motion.sensitivities.x[at].leftCols(per_range.size()) * per_range.asDiagonal();
    for (auto column : d.colwise()) {
      const double fastest = column.reshaped(3, x.cols()).colwise().norm().maxCoeff();
      column *= metres_per_px / std::max(fastest, 1e-12);  // now 1 px per unit
    }
    const std::size_t row = found[0].size();
    for (std::size_t k = 0; k < 3; ++k) {
      found[k].resize(row + std::size_t(d.cols()));
      for (const std::size_t way : {0U, 1U}) {
        const VecX gradient =
            residuals(sets[k], way == 0 ? ResidualOptions::Derivatives::analytic
                                        : ResidualOptions::Derivatives::differences)
                .linearize(trial_->features[i], x, d)
                .gradient;
        for (Eigen::Index j = 0; j < d.cols(); ++j)
          found[k][row + std::size_t(j)][way] = gradient[j];
      }
    }
    for (Eigen::Index j = 0; j < d.cols(); ++j)
      for (const std::size_t way : {2U, 3U}) {
        const double width = way == 2 ? 1 : 3;
        Points above = x, below = x;
        flat(above) += width * d.col(j);
        flat(below) -= width * d.col(j);
        const FrameCost a = all.evaluate(trial_->features[i], above);
        const FrameCost b = all.evaluate(trial_->features[i], below);
        const double rises[] = {a.fold_cost - b.fold_cost, a.silhouette_cost - b.silhouette_cost,
                                a.phase_cost - b.phase_cost};
        for (std::size_t k = 0; k < 3; ++k)
          found[k][row + std::size_t(j)][way] = rises[k] / (2 * width);
      }
  }
  fmt::print(
      "\ngradients of every 10th frame, directions of 1 px: cosine with, and size over, the slope "
      "of the cost over +-1 px and over +-3 px; analytic, then differences of images; then the "
      "first slope with the second\n");
  for (std::size_t k = 0; k < 3; ++k) {
    const auto product = [&](std::size_t a, std::size_t b) {
      double sum = 0;
      for (const auto& row : found[k]) sum += row[a] * row[b];
      return sum;
    };
    fmt::print("  {:12}", sets[k].name);
    for (const auto& [a, b] :
         {std::pair<std::size_t, std::size_t>{0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}})
      fmt::print("   {:7.3f} {:7.3f}", product(a, b) / std::sqrt(product(a, a) * product(b, b)),
                 std::sqrt(product(a, a) / product(b, b)));
    fmt::print("\n");
  }
  std::fflush(stdout);
}

/// The middle of the ranges, with the bend stiffness of three that fits five frames best.
VecX Study::first_guess() const {
  const Problem p = problem(1, Fabric::with_defaults("middle"));
  VecX best;
  double least = kInfinity;
  for (const double bend : {0.25, 0.5, 0.75}) {
    VecX scaled = VecX::Constant(p.dimension(), 0.5);
    scaled[p.index_of("bend_stiffness")] = bend;
    const double error = evaluate(p, p.fabric(scaled), 5, 0).error;
    if (best.size() > 0 && !(error < least)) continue;
    best = scaled;
    least = error;
  }
  return best;
}

void Study::print_distance(const Fabric& fabric) const {
  const TrialOptions& options = trial_->options;
  Scene scene = make_scene(capture_, options.columns, options.rows, 0, capture_.frame_count - 1);
  scene.start = trial_->scene.start;
  const Trajectory motion = simulate(scene, fabric, options.simulation);
  double fit = 0, held_back = 0;
  for (int k = capture_.fit_first; k < int(motion.frames.size()); ++k)
    (k <= capture_.fit_last ? fit : held_back) +=
        distance_to_truth(scene.mesh, motion.frames[static_cast<std::size_t>(k)], truth_, k).mean;
  const int later = capture_.frame_count - 1 - capture_.fit_last;
  fmt::print(" {:7.2f} {:7.2f}{}", 1e3 * fit / (capture_.fit_last - capture_.fit_first + 1),
             1e3 * held_back / std::max(later, 1), motion.diverged ? " (diverged)" : "");
}

void Study::fits() const {
  const VecX start = first_guess();
  fmt::print(
      "\nleast squares from one start: the paper's error per masked pixel, distance / mm over "
      "fit and later frames, stiffnesses, intervals, CPU s\n");
  std::vector<Terms> sets = term_sets(weight_);
  std::reverse(sets.begin(), sets.end());  // the sets that matter most first
  for (const Terms& terms : sets) {
    const double begin = cpu_seconds();
    const Problem p = problem(terms.silhouette, Fabric::with_defaults("middle"));
    struct Stage {
      int frames, iterations;
      double sigma, pull;
    };
    VecX x = start;
    LinearizationOptions options = linearization(terms);
    for (const Stage& stage : {Stage{10, 5, 6, 0.05}, {25, 6, 4, 0.05}, {0, 8, 3, 0.05}}) {
      options.frame_count = stage.frames;
      options.residual.silhouette_sigma = stage.sigma;
      const VecX middle = VecX::Constant(x.size(), 0.5);
      double pull = -1;
      const auto linearized = [&](const VecX& at) {
        QuadraticModel model = linearize(p, at, options).model;
        if (pull < 0) pull = std::isfinite(model.cost) ? stage.pull * model.cost : 0;
        model.cost += pull * (at - middle).squaredNorm();
        model.gradient += 2 * pull * (at - middle);
        model.hessian.diagonal().array() += 2 * pull;
        return model;
      };
      const auto cost = [&](const VecX& at) {
        return evaluate_cost(p, at, options).cost + pull * (at - middle).squaredNorm();
      };
      LeastSquaresOptions solver;
      solver.max_iterations = stage.iterations;
      x = minimize_least_squares(linearized, cost, x, VecX::Zero(x.size()), VecX::Ones(x.size()),
                                 solver)
              .x;
    }
    const double seconds = cpu_seconds() - begin;
    const ProblemLinearization end = linearize(p, x, options);
    const Fabric fabric = p.fabric(x);
    // The paper's error has the silhouette whether or not it was fitted.
    const double error = evaluate(problem(1, fabric), fabric, 0, 0).error;
    fmt::print("  {:27} {:8.4f}", terms.name, error);
    print_distance(fabric);
    for (const char* name : kShown) fmt::print(" {:9.3g}", fabric.value(name));
    fmt::print(" {} {:6.1f}\n", intervals(uncertainty(p, x, end.parts)), seconds);
    std::fflush(stdout);
  }
}

int run(int argc, char** argv) {
  const char* usage =
      "usage: weft_validate_residuals CAPTURE FABRIC [--grid N] [--weight W] [--part floor | "
      "minimum | derivatives | fits]";
  if (argc < 3 || argc % 2 == 0) throw Error(usage);
  int grid = 25;
  double weight = 0.1;
  std::string part;
  for (int i = 3; i < argc; i += 2) {
    const std::string key = argv[i], value = argv[i + 1];
    if (key == "--grid")
      grid = validation::number(key, value, 3);
    else if (key == "--weight")
      weight = validation::number(key, value, 0.0);
    else if (key == "--part")
      part = value;
    else
      throw Error(usage);
  }
  const Study study(argv[1], find_fabric(argv[2]), grid, weight);
  bool any = false;
  const auto run_part = [&](const char* name, void (Study::*what)() const) {
    if (!part.empty() && part != name) return;
    (study.*what)();
    any = true;
  };
  run_part("floor", &Study::floor);
  run_part("minimum", &Study::discrimination);
  run_part("derivatives", &Study::derivatives);
  run_part("fits", &Study::fits);
  if (!any) throw Error(usage);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return weft::validation::run_program("weft_validate_residuals", [&] { return run(argc, argv); });
}
