/// Fits from scanned shapes, against what made them.
///
///     weft_validate_scan [table1] [noise] [--cells N] [--fine N] [--out FOLDER]
///
/// table1: targets of the paper's section 4.2 on the mesh of the fit (Larionov et al. 2022, Table
/// 1). noise: the same from a finer mesh with noise.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <numbers>
#include <string>
#include <vector>

#include "weft/base/error.h"
#include "weft/estimate/scan_fit.h"
#include "weft/estimate/scan_synthetic.h"
#include "weft/fabric/orthotropic.h"

namespace weft {
namespace {

constexpr double kSide = 0.15;      // m
constexpr double kDensity = 0.224;  // kg/m^2, of the paper's cotton
constexpr double kDegree = std::numbers::pi / 180;

struct Arguments {
  std::vector<std::string> parts;
  int cells = 24, fine = 48;
  DescriptorKind descriptor = DescriptorKind::fourier;
  std::filesystem::path out;  ///< captures are kept here
  bool has(const std::string& part) const {
    return std::find(parts.begin(), parts.end(), part) != parts.end();
  }
};

struct Targets {
  ScanCapture capture;
  std::vector<ScanShape> shapes;
};

TriangleMesh square(int cells) {
  return make_swatch(kSide, kSide, cells + 1, cells + 1, GridPattern::uniform);
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

Targets make_targets(const std::vector<ScanExperiment>& experiments, int cells,
                     const Fabric& fabric, const ScanSynthesis& options) {
  Targets targets;
  targets.capture.name = "synthetic";
  targets.capture.width = targets.capture.height = kSide;
  targets.capture.areal_density = options.areal_density;
  const TriangleMesh mesh = square(cells);
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

void print_moduli(const char* name, const Fabric& fabric) {
  const OrthotropicModuli m = moduli_of(stiffness_of(fabric));
  fmt::print("{:<9} {:>10.4f} {:>10.4f} {:>10.4f} {:>9.5f} {:>12.5g}\n", name, m.e_u, m.e_v,
             m.shear, m.poisson, m.b);
}

void print_errors(const Fabric& found, const Fabric& truth) {
  const OrthotropicModuli a = moduli_of(stiffness_of(found)), b = moduli_of(stiffness_of(truth));
  fmt::print("{:<9} {:>9.3f}% {:>9.3f}% {:>9.3f}% {:>8.3f}% {:>11.3f}%\n", "error",
             100 * (a.e_u / b.e_u - 1), 100 * (a.e_v / b.e_v - 1), 100 * (a.shear / b.shear - 1),
             100 * (a.poisson / b.poisson - 1), 100 * (a.b / b.b - 1));
}

void print_fit(const ScanFitResult& fit, const Fabric& truth) {
  fmt::print("{:<9} {:>10} {:>10} {:>10} {:>9} {:>12}\n", "", "E_u N/m", "E_v N/m", "mu N/m", "nu",
             "b N m");
  print_moduli("start", fit.start);
  print_moduli("found", fit.fabric);
  print_moduli("truth", truth);
  print_errors(fit.fabric, truth);
  fmt::print(
      "cost {:.4g} from {:.4g}; {} iterations, {} evaluations, {:.1f} s; residuals in units of "
      "noise: shape {:.3g}, force {:.3g}; {} inexact\n",
      fit.cost, fit.cost_start, fit.iterations, fit.evaluations, fit.wall_s, fit.shape_rms,
      fit.force_rms, fit.inexact);
  for (const ParameterInterval& p : fit.intervals) {
    fmt::print("  {:<15} {:>11.5g} {:<4} ", p.name, p.value, p.unit);
    if (p.determined)
      fmt::print("90 % {:.5g} to {:.5g}\n", p.lower, p.upper);
    else
      fmt::print("not determined\n");
  }
  std::fflush(stdout);
}

/// Same start, two fabrics: the largest distance of a vertex.
void compare_unseen(const Fabric& found, const Fabric& truth, int cells) {
  const TriangleMesh mesh = square(cells);
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

void table1(const Arguments& arguments, bool noisy) {
  const Fabric truth = find_fabric("larionov-cotton"), start = find_fabric("larionov-initial");
  ScanSynthesis options;
  options.areal_density = kDensity;
  options.noise = noisy ? 2e-4 : 0;
  options.force_noise = noisy ? 0.01 : 0;
  options.stated_noise = noisy ? 2e-4 : 1e-6;
  options.stated_force_noise = noisy ? 0.01 : 1e-4;
  fmt::print("\n{}\n", noisy ? fmt::format("targets on {} cells with 0.2 mm and 0.01 N of noise, "
                                           "fit on {} cells",
                                           arguments.fine, arguments.cells)
                             : fmt::format("targets and fit on {} cells", arguments.cells));
  const Targets targets =
      make_targets(table1_experiments(), noisy ? arguments.fine : arguments.cells, truth, options);
  ScanOptions scan;
  scan.cells = noisy ? arguments.cells : 0;
  scan.descriptor = arguments.descriptor;
  if (!arguments.out.empty())
    write_scan_capture(arguments.out / (noisy ? "noise" : "table1"), targets.capture,
                       targets.shapes);
  const auto trials = prepare_scan(targets.capture, targets.shapes, scan);
  const ScanProblem problem(trials, make_static_solver(), truth, default_scan_parameters());
  const ScanFitResult fit = fit_scan(problem, start, {}, [](const ScanFitStep& step) {
    fmt::print(stderr, "{} {} cost {:.6g} best {:.6g}\n", step.evaluation, step.phase, step.cost,
               step.best);
    return true;
  });
  print_fit(fit, truth);
  compare_unseen(fit.fabric, truth, arguments.cells);
}

Arguments parse(int argc, char** argv) {
  Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--cells" && i + 1 < argc)
      arguments.cells = std::stoi(argv[++i]);
    else if (word == "--fine" && i + 1 < argc)
      arguments.fine = std::stoi(argv[++i]);
    else if (word == "--out" && i + 1 < argc)
      arguments.out = argv[++i];
    else if (word == "--descriptor" && i + 1 < argc)
      arguments.descriptor = descriptor_from_name(argv[++i]);
    else
      arguments.parts.push_back(word);
  }
  if (arguments.parts.empty()) arguments.parts = {"table1", "noise"};
  return arguments;
}

void run(const Arguments& arguments) {
  if (arguments.has("table1")) table1(arguments, false);
  if (arguments.has("noise")) table1(arguments, true);
}

}  // namespace
}  // namespace weft

int main(int argc, char** argv) {
  try {
    weft::run(weft::parse(argc, argv));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
  return 0;
}
