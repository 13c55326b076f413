/// What each descriptor sees: materials or states (Larionov et al. 2022, Figures 5 to 7).
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>

#include "scan_validation.h"
#include "weft/fabric/orthotropic.h"

namespace weft {
namespace {

constexpr double kSide = 0.15;      // m
constexpr double kDensity = 0.224;  // kg/m^2
constexpr DescriptorKind kKinds[] = {DescriptorKind::position, DescriptorKind::strain,
                                     DescriptorKind::energy, DescriptorKind::fourier};
constexpr const char* kMaterials[] = {"larionov-cotton", "larionov-denim", "larionov-silk"};

SynthesizedScan rest_of(const ScanExperiment& experiment, const TriangleMesh& mesh,
                        const Fabric& fabric, std::uint64_t seed, double noise) {
  ScanSynthesis options;
  options.areal_density = kDensity;
  options.noise = noise;
  options.stated_noise = noise > 0 ? noise : 1e-6;
  options.force_noise = noise > 0 ? 0.01 : 0;
  options.stated_force_noise = noise > 0 ? 0.01 : 1e-4;
  options.seed = seed;
  return synthesize_scan(experiment, mesh, fabric, options);
}

TriangleMesh square(int cells) {
  return make_swatch(kSide, kSide, cells + 1, cells + 1, GridPattern::uniform);
}

/// Differences of descriptors between materials, less those between states of one material: each
/// should be above zero.
void separate(const Arguments& arguments, double shear) {
  const DescriptorGrid grid{square(arguments.cells), arguments.cells + 1, arguments.cells + 1, {}};
  std::vector<std::vector<Points>> shapes;  // by material, by state
  fmt::print("\npicture frame at {:g} degrees on {} cells, from flat and from perturbed vertices\n",
             shear / kDegree, arguments.cells);
  for (const char* name : kMaterials) {
    const Fabric fabric = find_fabric(name);
    std::vector<Points> states;
    for (const double perturbation : {1e-6, 1e-3})
      states.push_back(rest_of(picture_frame(kSide, kSide, shear, perturbation), grid.mesh, fabric,
                               perturbation < 1e-5 ? 1 : 2, 0)
                           .exact);
    fmt::print("{:<16} depth {:.2f} and {:.2f} mm, apart by up to {:.2f} mm\n", name,
               1e3 * (states[0].row(2).maxCoeff() - states[0].row(2).minCoeff()),
               1e3 * (states[1].row(2).maxCoeff() - states[1].row(2).minCoeff()),
               1e3 * (states[0] - states[1]).colwise().norm().maxCoeff());
    shapes.push_back(states);
  }
  const VecX material = find_fabric(kMaterials[0]).values;
  for (const DescriptorKind kind : kKinds) {
    const auto descriptor = make_shape_descriptor(kind, grid);
    const auto difference = [&](const Points& a, const Points& b) {
      return (descriptor->value(a, material) - descriptor->value(b, material)).norm();
    };
    int positive = 0, cases = 0;
    double least = 1e300;  // of the ratios
    for (std::size_t m = 0; m < 3; ++m) {
      const double states = difference(shapes[m][0], shapes[m][1]);
      for (std::size_t other = 0; other < 3; ++other) {
        if (other == m) continue;
        for (const Points& a : shapes[m])
          for (const Points& b : shapes[other]) {
            const double materials = difference(a, b);
            ++cases;
            if (materials > states) ++positive;
            least = std::min(least, materials / states);
          }
      }
    }
    fmt::print("  {:<9} separates {} of {} cases; least ratio of materials to states {:.2f}\n",
               name_of(kind), positive, cases, least);
  }
  std::fflush(stdout);
}

/// A fit whose simulation starts in another state than the target is in.
void fit_from(const Arguments& arguments, const char* title,
              const std::vector<SynthesizedScan>& targets,
              const std::function<Points(const SynthesizedScan&, std::size_t)>& start) {
  ScanCapture capture;
  capture.width = capture.height = kSide;
  capture.areal_density = kDensity;
  std::vector<ScanShape> shapes;
  for (std::size_t i = 0; i < targets.size(); ++i) {
    capture.targets.push_back(targets[i].target);
    shapes.push_back(targets[i].shape);
    shapes.back().start = start(targets[i], i);
  }
  const OrthotropicModuli truth = moduli_of(stiffness_of(find_fabric("larionov-cotton")));
  for (const DescriptorKind kind : kKinds) {
    ScanOptions options;
    options.descriptor = kind;
    options.cells = arguments.cells;
    const Fabric from = find_fabric("larionov-initial");
    const ScanProblem problem(prepare_scan(capture, shapes, options), arguments.make_solver(), from,
                              default_scan_parameters(from));
    const ScanFitResult fit = fit_scan(problem, from, arguments.fit);
    const OrthotropicModuli m = moduli_of(stiffness_of(fit.fabric));
    fmt::print(
        "  {:<22} {:<9} E_u {:+8.2f} %, E_v {:+8.2f} %, mu {:+8.2f} %, nu {:+8.2f} %, b {:+8.2f} "
        "%; {:2} iterations, {:.0f} s\n",
        title, name_of(kind), 100 * (m.e_u / truth.e_u - 1), 100 * (m.e_v / truth.e_v - 1),
        100 * (m.shear / truth.shear - 1), 100 * (m.poisson / truth.poisson - 1),
        100 * (m.b / truth.b - 1), fit.iterations, fit.wall_s);
    std::fflush(stdout);
  }
}

std::vector<SynthesizedScan> targets_of(const std::vector<ScanExperiment>& experiments,
                                        const TriangleMesh& mesh, double noise,
                                        std::uint64_t seed) {
  std::vector<SynthesizedScan> targets;
  for (std::size_t i = 0; i < experiments.size(); ++i)
    targets.push_back(
        rest_of(experiments[i], mesh, find_fabric("larionov-cotton"), seed + 10 * i, noise));
  return targets;
}

}  // namespace

void descriptors(const Arguments& arguments) {
  for (const double shear : {10.0, 20.0}) separate(arguments, shear * kDegree);
  // Few broad wrinkles, and many fine ones, with a stretch along each thread.
  const auto with_frame = [](double shear) {
    return std::vector<ScanExperiment>{picture_frame(kSide, kSide, shear, 5e-4),
                                       edge_stretch(kSide, kSide, ScanAxis::u, 0.08, 5e-4),
                                       edge_stretch(kSide, kSide, ScanAxis::v, 0.08, 5e-4)};
  };
  const TriangleMesh mesh = square(arguments.fine);
  fmt::print("\nfits to targets on {} cells with 0.2 mm and 0.01 N of noise, on {} cells\n",
             arguments.fine, arguments.cells);
  for (const double degrees : {8.0, 16.0}) {
    const auto experiments = with_frame(degrees * kDegree);
    const auto targets = targets_of(experiments, mesh, 2e-4, 1);
    fit_from(arguments, fmt::format("{:g} degrees, at scan", degrees).c_str(), targets,
             [](const SynthesizedScan& t, std::size_t) { return t.shape.x; });
    fit_from(arguments, fmt::format("{:g} degrees, mirrored", degrees).c_str(), targets,
             [](const SynthesizedScan& t, std::size_t) {
               Points x = t.shape.x;
               x.row(2) *= -1;
               return x;
             });
    const auto others = targets_of(experiments, mesh, 0, 7);
    fit_from(arguments, fmt::format("{:g} degrees, other state", degrees).c_str(), targets,
             [&](const SynthesizedScan&, std::size_t i) { return others[i].exact; });
  }
}

}  // namespace weft
