/// How well can the model explain a capture at all? Fits all nine parameters to the true surface
/// itself (mean distance at the same (u, v) over the fit frames), from the same start surface as a
/// video fit, and prints what is left: the part of a fit's distance that is the model's.
///
///     weft_truth_fit CAPTURE FABRIC_OUT [EVALUATIONS] [GRID]
#include <fmt/core.h>

#include <cstdlib>
#include <limits>
#include <string>

#include "weft/base/error.h"
#include "weft/base/progress.h"
#include "weft/estimate/evaluate_capture.h"
#include "weft/estimate/optimize.h"

namespace {

using namespace weft;

/// Mean distance over the frames of a trajectory, m; infinity if it diverged.
double mean_distance(const Scene& scene, const Fabric& fabric, const SimulationOptions& options,
                     const TruthSurface& truth) {
  const Trajectory trajectory = simulate(scene, fabric, options);
  if (trajectory.diverged) return std::numeric_limits<double>::infinity();
  double sum = 0;
  for (std::size_t k = 0; k < trajectory.frames.size(); ++k) {
    sum += distance_to_truth(scene.mesh, trajectory.frames[k], truth, static_cast<int>(k)).mean;
  }
  return sum / static_cast<double>(trajectory.frames.size());
}

int run(int argc, char** argv) {
  if (argc < 3) throw Error("usage: weft_truth_fit CAPTURE FABRIC_OUT [EVALUATIONS] [GRID]");
  const Capture capture = read_capture(argv[1]);
  if (!capture.truth) throw Error(std::string(argv[1]) + ": has no [truth]");
  TrialOptions options;
  if (argc > 4) options.columns = options.rows = std::atoi(argv[4]);
  const TruthSurface truth = read_truth(capture);
  const auto fit = prepare_trial(capture, capture.fit_first, capture.fit_last, options);
  std::vector<std::string> free;
  for (const ParameterInfo& p : baraff_witkin_parameters()) free.emplace_back(p.name);
  const Problem problem({fit}, Fabric::with_defaults("truth fit"), free);
  const ErrorFunction error = [&](const VecX& scaled) {
    return mean_distance(fit->scene, problem.fabric(scaled), options.simulation, truth);
  };
  CoarseOptions coarse;
  coarse.dimensions = {0, 1, 2};
  Progress progress("coarse", 64);
  const SearchResult grid =
      coarse_search(error, problem.scaled(problem.initial()), coarse,
                    [&](std::size_t done, double, double best, double) {
                      progress.update(done, fmt::format("best {:.2f} mm", 1e3 * best));
                      return true;
                    });
  progress.finish();
  AnnealingOptions annealing;
  annealing.max_evaluations = argc > 3 ? static_cast<std::size_t>(std::atol(argv[3])) : 400;
  Progress anneal_progress("anneal", annealing.max_evaluations);
  const SearchResult found =
      anneal(error, grid.best, annealing, [&](std::size_t done, double, double best, double) {
        anneal_progress.update(done, fmt::format("best {:.2f} mm", 1e3 * best));
        return true;
      });
  anneal_progress.finish();
  const Fabric fabric = problem.fabric(found.best);
  write_fabric(argv[2], fabric);
  const auto all = prepare_trial(capture, capture.fit_first, capture.frame_count - 1, options);
  const CaptureEvaluation e = evaluate_capture(*all, fabric, true);
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
  try {
    return run(argc, argv);
  } catch (const weft::Error& error) {
    fmt::print(stderr, "weft_truth_fit: {}\n", error.what());
    return 2;
  }
}
