/// Fits from scanned shapes, against what made them.
///
///     weft_validate_scan [table1] [noise] [descriptors] [mechanical] [captures] [--data FOLDER]
///     [--cells N] [--pattern P] [--fine N] [--fine-pattern P] [--force-noise N] [--surface S]
///     [--twist] [--thread-model NAME] [--out FOLDER] ... (kUsage)
///
/// table1: targets of the paper's section 4.2 on the mesh of the fit (Larionov et al. 2022, Table
/// 1). noise: the same from a finer mesh with noise. mechanical, captures: targets that other
/// programs made, in FOLDER/mechanical and FOLDER/captures; of the latter the surface as "shown",
/// or the "lattice" of its control points; --twist: with twist_stiffness as an unknown of its own;
/// --thread-model: baraff-witkin-diagonals or baraff-witkin-hinges.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "program.h"
#include "scan_validation.h"
#include "weft/base/error.h"
#include "weft/estimate/scan_fit.h"
#include "weft/estimate/scan_synthetic.h"
#include "weft/fabric/orthotropic.h"

namespace weft {
namespace {

constexpr double kSide = 0.15;      // m
constexpr double kDensity = 0.224;  // kg/m^2, of the paper's cotton

struct Targets {
  ScanCapture capture;
  std::vector<ScanShape> shapes;
};

TriangleMesh square(int cells, GridPattern pattern) {
  return make_swatch(kSide, kSide, cells + 1, cells + 1, pattern);
}

/// Two picture frames and two stretches.
std::vector<ScanExperiment> table1_experiments() {
  return {picture_frame(kSide, kSide, 12 * kDegree, 5e-4),
          picture_frame(kSide, kSide, -20 * kDegree, 5e-4),
          edge_stretch(kSide, kSide, ScanAxis::u, 0.08, 5e-4),
          edge_stretch(kSide, kSide, ScanAxis::v, 0.08, 5e-4)};
}

/// Not seen by a fit.
std::vector<ScanExperiment> unseen_experiments() {
  return {picture_frame(kSide, kSide, 6 * kDegree, 5e-4),
          picture_frame(kSide, kSide, -15 * kDegree, 5e-4),
          edge_stretch(kSide, kSide, ScanAxis::u, 0.03, 5e-4),
          corner_weights(kSide, kSide, 0.95, 0.1, 0.02),
          ledge(kSide, kSide, ScanAxis::u, 0.05),
          ledge(kSide, kSide, ScanAxis::v, 0.05)};
}

Targets make_targets(const std::vector<ScanExperiment>& experiments, const TriangleMesh& mesh,
                     const Fabric& fabric, const ScanSynthesis& options) {
  Targets targets;
  targets.capture.name = "synthetic";
  targets.capture.width = targets.capture.height = kSide;
  targets.capture.areal_density = options.areal_density;
  for (std::size_t i = 0; i < experiments.size(); ++i) {
    ScanSynthesis own = options;
    own.seed = options.seed + 100 * i;
    SynthesizedScan made = synthesize_scan(experiments[i], mesh, fabric, own);
    fmt::print("target {:<22} {} net force {:.1e} N, depth {:.2f} mm, forces", made.target.name,
               made.converged ? "at rest," : "NOT at rest,", made.residual,
               1e3 * (made.exact.row(2).maxCoeff() - made.exact.row(2).minCoeff()));
    for (const ScanClamp& clamp : made.target.clamps) fmt::print(" {:.3f}", *clamp.force);
    fmt::print(" N\n");
    targets.capture.targets.push_back(made.target);
    targets.shapes.push_back(made.shape);
  }
  std::fflush(stdout);
  return targets;
}

/// Same start, two fabrics: the largest distance of a vertex.
void compare_unseen(const Fabric& found, const Fabric& truth, const TriangleMesh& mesh) {
  for (const ScanExperiment& experiment : unseen_experiments()) {
    ScanSynthesis options;
    options.areal_density = kDensity;
    const SynthesizedScan a = synthesize_scan(experiment, mesh, truth, options);
    // From the shape of the truth, as the paper re-simulates.
    ScanExperiment again = experiment;
    again.perturbation = 0;
    const MaterialLocator locator(mesh);
    again.start = [&](const Vec2& uv) {
      MaterialPoints point(2, 1);
      point = uv;
      return Vec3(interpolate(mesh, locator, a.exact, point));
    };
    const SynthesizedScan b = synthesize_scan(again, mesh, found, options);
    const auto distances = (a.exact - b.exact).colwise().norm();
    fmt::print("unseen {:<22} distance mean {:.4f}, max {:.4f} mm{}\n", experiment.name,
               1e3 * distances.mean(), 1e3 * distances.maxCoeff(),
               a.converged && b.converged ? "" : "  (not at rest)");
    std::fflush(stdout);
  }
}

enum class TargetNoise { none, added };

void table1(const Arguments& arguments, TargetNoise noise) {
  const bool noisy = noise == TargetNoise::added;
  const Fabric truth = find_fabric("larionov-cotton"), start = find_fabric("larionov-initial");
  ScanSynthesis options;
  options.seed = arguments.seed;
  options.areal_density = kDensity;
  options.noise = noisy ? 2e-4 : 0;
  options.force_noise = noisy ? arguments.force_noise : 0;
  options.stated_noise = noisy ? 2e-4 : 1e-6;
  options.stated_force_noise = noisy ? std::max(arguments.force_noise, 1e-4) : 1e-4;
  fmt::print("\n{}\n", noisy ? fmt::format("targets on {} cells with 0.2 mm and {:g} N of noise, "
                                           "fit on {} cells",
                                           arguments.fine, arguments.force_noise, arguments.cells)
                             : fmt::format("targets and fit on {} cells", arguments.cells));
  const Targets targets = make_targets(table1_experiments(),
                                       noisy ? square(arguments.fine, arguments.fine_pattern)
                                             : square(arguments.cells, arguments.pattern),
                                       truth, options);
  ScanOptions scan;
  scan.cells = noisy ? arguments.cells : 0;
  scan.pattern = arguments.pattern;
  scan.descriptor = arguments.descriptor;
  if (!arguments.out.empty())
    write_scan_capture(arguments.out / (noisy ? "noise" : "table1"), targets.capture,
                       targets.shapes);
  const auto trials = prepare_scan(targets.capture, targets.shapes, scan);
  const ScanProblem problem(trials, arguments.make_solver(), truth, default_scan_parameters(truth));
  print_targets(problem, truth, "at the truth");
  const ScanFitResult fit =
      fit_scan(problem, start, arguments.with_mesh_error(), [](const ScanFitStep& step) {
        fmt::print(stderr, "{} {} cost {:.6g} best {:.6g}\n", step.evaluation, step.phase,
                   step.cost, step.best);
        return true;
      });
  print_fit(problem, fit, &truth);
  print_targets(problem, fit.fabric, "at the estimate");
  compare_unseen(fit.fabric, truth, square(arguments.cells, arguments.pattern));
}

constexpr const char* kUsage =
    "usage: weft_validate_scan [table1] [noise] [descriptors] [mechanical] [captures]\n"
    "  [--data FOLDER] [--fabric NAME] [--cells N] [--fine N] [--pattern uniform|alternating]\n"
    "  [--fine-pattern uniform|alternating] [--force-noise N] [--seed N] [--descriptor NAME]\n"
    "  [--solver static|xpbd] [--balance noise|residual] [--schedule together|alternating]\n"
    "  [--starts N] [--surface shown|lattice] [--thread-model NAME] [--twist] [--out FOLDER]";

Arguments parse(int argc, char** argv) {
  Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--cells" && i + 1 < argc)
      arguments.cells = validation::number<int>(word, argv[++i], 2);
    else if (word == "--fine" && i + 1 < argc)
      arguments.fine = validation::number<int>(word, argv[++i], 2);
    else if (word == "--pattern" && i + 1 < argc)
      arguments.pattern = grid_pattern_from_name(argv[++i]);
    else if (word == "--fine-pattern" && i + 1 < argc)
      arguments.fine_pattern = grid_pattern_from_name(argv[++i]);
    else if (word == "--force-noise" && i + 1 < argc)
      arguments.force_noise = validation::number<double>(word, argv[++i], 0);
    else if (word == "--seed" && i + 1 < argc)
      arguments.seed = validation::number<std::uint64_t>(word, argv[++i], 0);
    else if (word == "--data" && i + 1 < argc)
      arguments.data = argv[++i];
    else if (word == "--fabric" && i + 1 < argc)
      arguments.fabrics = {argv[++i]};
    else if (word == "--solver" && i + 1 < argc)
      arguments.solver = argv[++i];
    else if (word == "--out" && i + 1 < argc)
      arguments.out = argv[++i];
    else if (word == "--balance" && i + 1 < argc)
      arguments.fit.balance = scan_balance_from_name(argv[++i]);
    else if (word == "--schedule" && i + 1 < argc)
      arguments.fit.schedule = scan_schedule_from_name(argv[++i]);
    else if (word == "--starts" && i + 1 < argc)
      arguments.fit.random_starts = validation::number<int>(word, argv[++i], 0);
    else if (word == "--surface" && i + 1 < argc)
      arguments.surface = validation::surface_from_name(argv[++i]);
    else if (word == "--thread-model" && i + 1 < argc)
      arguments.thread_model = argv[++i];
    else if (word == "--twist")
      arguments.search_twist = true;
    else if (word == "--descriptor" && i + 1 < argc)
      arguments.descriptor = descriptor_from_name(argv[++i]);
    else
      arguments.parts.push_back(validation::part(
          word, {"table1", "noise", "descriptors", "mechanical", "captures"}, kUsage));
  }
  if (arguments.parts.empty()) arguments.parts = {"table1", "noise"};
  return arguments;
}

void run(const Arguments& arguments) {
  if (arguments.has("table1")) table1(arguments, TargetNoise::none);
  if (arguments.has("noise")) table1(arguments, TargetNoise::added);
  if (arguments.has("descriptors")) descriptors(arguments);
  if (arguments.has("mechanical")) mechanical_scans(arguments);
  if (arguments.has("captures")) capture_scans(arguments);
}

}  // namespace
}  // namespace weft

int main(int argc, char** argv) {
  return weft::validation::run_program("weft_validate_scan", [&] {
    weft::run(weft::parse(argc, argv));
    return 0;
  });
}
