/// Is the experiment that `weft suggest` ranks first the one that shrinks the intervals most when
/// it is made? Three candidates are ranked for a known fabric; then each is made, several times
/// with independent sensor noise, fitted by least squares from the neighbourhood, and the intervals
/// that the fits report, and the errors that they make, are compared with the ranking:
///
///     weft_validate_suggest OUT [REPEATS]
///
/// Small: 17 x 17 vertices, 10 frames of 160 x 120 px; the truth has the mesh and steps of the fit,
/// so that the noise is all that is wrong. Writes suggest.svg and suggest.csv and prints a table;
/// status 1 if the one that is ranked first does not have the narrowest intervals.
#include "weft/estimate/suggest.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "program.h"
#include "weft/base/error.h"
#include "weft/base/parallel.h"
#include "weft/base/random.h"
#include "weft/estimate/patch_parts.h"
#include "weft/estimate/synthetic.h"
#include "weft/estimate/uncertainty.h"
#include "weft/report/plot.h"

namespace {

using namespace weft;
using Axis = CandidateExperiment::Axis;

constexpr int kGrid = 17, kFrames = 10;
/// Half width, in the scale of the search, of what a uniform distribution over the range leaves.
const double kWidest = 1.645 / std::sqrt(12.0);
const std::vector<std::string> kTargets{"bend_stiffness", "shear_stiffness", "drag_quadratic"};

Capture rig() {
  LayoutOptions layout;
  layout.width = layout.height = 0.3;
  layout.image_width = 160;
  layout.image_height = 120;
  layout.stripe_period = 0.022;
  layout.frame_count = layout.fit_frames = kFrames;
  return make_layout(layout);
}

TrialOptions trial_options() {
  TrialOptions options;
  options.columns = options.rows = kGrid;
  options.angle_map.kernel_radius = 4;
  options.angle_map.blur_sigma = 2;
  return options;
}

/// Geometric means over the targets, in the scale of the search.
struct Made {
  double half_width = 0;  ///< of the intervals, mean over the repeats
  double error = 0;       ///< rms over the repeats
};

class Maker {
 public:
  explicit Maker(const Fabric& fabric) : fabric_(fabric) {
    for (const ParameterInfo& p : baraff_witkin_parameters()) names_.emplace_back(p.name);
  }

  Made make(const CandidateExperiment& experiment, int repeats) const {
    const std::size_t targets = kTargets.size();
    MatX widths(static_cast<Eigen::Index>(targets), repeats), errors = widths;
    parallel_for(static_cast<std::size_t>(repeats), 0, [&](std::size_t repeat) {
      const auto column = static_cast<Eigen::Index>(repeat);
      fit(experiment, repeat, widths.col(column), errors.col(column));
    });
    const auto logarithmic_mean = [](const VecX& values) {
      return std::exp(values.array().max(1e-12).log().mean());
    };
    return {
        logarithmic_mean(widths.rowwise().mean()),
        logarithmic_mean(errors.rowwise().squaredNorm().cwiseSqrt() / std::sqrt(double(repeats)))};
  }

 private:
  void fit(const CandidateExperiment& experiment, std::size_t repeat, Eigen::Ref<VecX> widths,
           Eigen::Ref<VecX> errors) const {
    SyntheticOptions truth;
    truth.columns = truth.rows = kGrid;
    truth.pattern = GridPattern::alternating;
    truth.simulation = trial_options().simulation;
    truth.seed = 100 + repeat;
    truth.threads = 1;
    const auto trial =
        simulate_trial(experiment_capture(rig(), experiment), fabric_, trial_options(), truth);
    const Problem problem({trial}, fabric_, names_);
    const VecX known = problem.scaled(fabric_);
    VecX start = known;
    Rng rng(7, repeat);
    for (double& coordinate : start)
      coordinate = std::clamp(coordinate + rng.uniform(-0.03, 0.03), 0.0, 1.0);
    LinearizationOptions how;
    how.threads = 1;
    LeastSquaresOptions solver;
    solver.max_iterations = 12;
    solver.step_tolerance = 3e-4;
    solver.cost_tolerance = 1e-5;
    const LeastSquaresResult found =
        minimize_least_squares([&](const VecX& x) { return linearize(problem, x, how).model; },
                               [&](const VecX& x) { return evaluate_cost(problem, x, how).cost; },
                               start, VecX::Zero(start.size()), VecX::Ones(start.size()), solver);
    const Uncertainty uncertainty =
        estimate_uncertainty(problem, found.x, linearize_patches(problem, found.x, how));
    for (std::size_t i = 0; i < kTargets.size(); ++i) {
      const int at = problem.index_of(kTargets[i]);
      const auto row = static_cast<Eigen::Index>(i);
      widths[row] =
          std::min(kWidest, uncertainty.parameters[static_cast<std::size_t>(at)].half_width);
      errors[row] = found.x[at] - known[at];
    }
  }

  const Fabric& fabric_;
  std::vector<std::string> names_;
};

int run(int argc, char** argv) {
  if (argc < 2) throw Error("usage: weft_validate_suggest OUT [REPEATS]");
  const std::filesystem::path out = argv[1];
  const int repeats = argc > 2 ? validation::number("REPEATS", argv[2], 2) : 6;
  std::filesystem::create_directories(out);
  Fabric fabric = Fabric::with_defaults("known");
  fabric.set("stretch_stiffness", 200);
  fabric.set("bend_stiffness", 5e-5);
  const std::vector<Candidate> candidates{
      CandidateExperiment{"hanging still", 0.85, Axis::across, 0, 1, kFrames},
      CandidateExperiment{"small and slow", 0.85, Axis::across, 0.015, 1, kFrames},
      CandidateExperiment{"wide and fast", 0.85, Axis::across, 0.06, 2.5, kFrames}};
  SuggestOptions options;
  options.trial = trial_options();
  options.targets = kTargets;
  const std::vector<Suggestion> ranked = suggest_experiments(rig(), fabric, candidates, options);

  const Maker maker(fabric);
  BarChart chart;
  chart.title = "Width of the intervals of three experiments, expected and found";
  chart.value.label = "of the width before";
  chart.value.unit = "%";
  std::vector<double> found;
  fmt::print("{:>4}  {:<16} {:>12} {:>12} {:>16}\n", "rank", "experiment", "expected", "found",
             "rms error");
  for (std::size_t k = 0; k < ranked.size(); ++k) {
    const Suggestion& s = ranked[k];
    const Made made = maker.make(std::get<CandidateExperiment>(s.experiment), repeats);
    found.push_back(made.half_width / kWidest);
    fmt::print("{:>4}  {:<16} {:>10.2f} % {:>10.2f} % {:>14.4f} %\n", k + 1, name_of(s.experiment),
               100 * s.remaining, 100 * found.back(), 100 * made.error / kWidest);
    chart.bars.push_back({name_of(s.experiment) + ", expected", 100 * s.remaining, "", false});
    chart.bars.push_back({name_of(s.experiment) + ", found", 100 * found.back(), "", true});
  }
  write_plot(out / "suggest.svg", chart);
  const bool right = std::ranges::min_element(found) == found.begin();
  fmt::print("the experiment ranked first has the narrowest intervals: {}\n", right ? "yes" : "NO");
  return right ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  return weft::validation::run_program("weft_validate_suggest", [&] { return run(argc, argv); });
}
