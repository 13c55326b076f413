/// Mechanical captures of known parameters, against the model at the true parameters and against
/// fits from wrong ones.
///
///     weft_validate_mechanical DATA [truth] [refinement] [fit] [strips] [models]
///                              [--cells N] [--pattern uniform|alternating] [--fabric NAME]
///                              [--starts N]
///
/// DATA: a folder with FABRIC_TEST/capture.toml for the tests stretch_u, stretch_v, shear, bend_u,
/// bend_v and strip_00 to strip_90, each with truth/parameters.toml (membrane A11, A12, A22, A66 in
/// N/m, bending D11, D12, D22, D66 in N m).
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "program.h"
#include "thread_models.h"
#include "weft/base/clock.h"
#include "weft/base/error.h"
#include "weft/base/toml_reader.h"
#include "weft/estimate/curve_fit.h"
#include "weft/estimate/mechanical_fit.h"

namespace weft::validation {
namespace {

struct Truth {
  const char *table, *key, *parameter;
};
constexpr Truth kTruth[] = {
    {"membrane", "A11", "membrane_uu"}, {"membrane", "A12", "membrane_uv"},
    {"membrane", "A22", "membrane_vv"}, {"membrane", "A66", "membrane_shear"},
    {"bending", "D11", "bend_uu"},      {"bending", "D12", "bend_uv"},
    {"bending", "D22", "bend_vv"},      {"bending", "D66", "bend_twist"},
};
constexpr const char* kIsolatedTests[] = {"stretch_u", "stretch_v", "shear", "bend_u", "bend_v"};
constexpr int kTestsInPlane = 3;  // the first ones
constexpr const char* kFittedStrips[] = {"strip_00", "strip_45", "strip_90"};
constexpr const char* kPredictedStrips[] = {"strip_15", "strip_30", "strip_60", "strip_75"};

struct Arguments {
  std::filesystem::path data;
  std::vector<std::string> parts;
  std::vector<std::string> fabrics{"knit", "blend"};
  MechanicalOptions options;
  std::size_t starts = 3;
  bool has(const std::string& part) const {
    return std::find(parts.begin(), parts.end(), part) != parts.end();
  }
};

std::vector<std::string> all_tests() {
  std::vector<std::string> tests(std::begin(kIsolatedTests), std::end(kIsolatedTests));
  for (int angle = 0; angle <= 90; angle += 15) tests.push_back(fmt::format("strip_{:02}", angle));
  return tests;
}

std::shared_ptr<const MechanicalTrial> trial_of(const Arguments& arguments,
                                                const std::string& fabric, const std::string& test,
                                                const MechanicalOptions& options) {
  return prepare_mechanical(read_mechanical_capture(arguments.data / (fabric + "_" + test)),
                            options);
}

Fabric true_fabric(const MechanicalCapture& capture) {
  if (!capture.truth) throw Error(capture.name + " has no [truth]");
  const TomlTable file = TomlTable::parse_file(*capture.truth);
  Fabric fabric = Fabric::with_defaults("truth", "stvk");
  for (const Truth& row : kTruth)
    fabric.set(row.parameter, file.table(row.table).number(row.key, {0, 1e6}));
  return fabric;
}

void print_difference(const std::string& name, const MechanicalTrial& trial,
                      const std::vector<MechanicalFrame>& frames) {
  const MechanicalEvaluation e = compare_mechanical(trial, frames);
  double worst = 0;
  int vertices = 0;
  for (const MechanicalDifference& frame : e.frames) worst = std::max(worst, frame.force_max);
  for (const MechanicalStage& stage : trial.stages)
    vertices = std::max(vertices, stage.mesh.vertex_count());
  fmt::print("{:<18} {:>6} {:>9} {:>10.4f} {:>8.2f} {:>8.2f}   {:>7.3f} {:>7.3f} {:>7.3f} {:>6}\n",
             name, trial.options.cells, vertices, e.largest_force, 100 * e.force_relative,
             100 * worst / e.largest_force, 1e3 * e.distance.mean, 1e3 * e.distance.rms,
             1e3 * e.distance.max, e.not_converged);
  std::fflush(stdout);
}

void print_difference_header() {
  fmt::print("{:<18} {:>6} {:>9} {:>10} {:>8} {:>8}   {:>7} {:>7} {:>7} {:>6}\n", "capture",
             "cells", "vertices", "force (N)", "rms (%)", "max (%)", "mean", "rms", "max mm",
             "failed");
}

void truth_table(const Arguments& arguments, const std::vector<std::string>& tests,
                 const std::vector<int>& cells) {
  fmt::print(
      "\nstvk at the true parameters: difference of forces, of the largest measured force, "
      "and of points outside the clips (mm)\n");
  print_difference_header();
  for (const std::string& fabric : arguments.fabrics)
    for (const std::string& test : tests)
      for (const int count : cells) {
        MechanicalOptions options = arguments.options;
        options.cells = count;
        const auto trial = trial_of(arguments, fabric, test, options);
        const auto frames = simulate_mechanical({trial}, true_fabric(trial->capture));
        print_difference(fmt::format("{}_{}", fabric, test), *trial, frames.front());
      }
}

struct Start {
  const char* name;
  double membrane, bend;
};
constexpr Start kStarts[] = {{"all x 5", 5, 5}, {"all / 5", 0.2, 0.2}, {"A x 5, D / 5", 5, 0.2}};

Fabric wrong_fabric(const Fabric& truth, const Start& start) {
  Fabric fabric = truth;
  for (const Truth& row : kTruth)
    fabric.set(row.parameter,
               truth.value(row.parameter) *
                   (std::string(row.table) == "membrane" ? start.membrane : start.bend));
  return fabric;
}

MechanicalFitOptions with_mesh_error() {
  MechanicalFitOptions options;
  options.mesh_error = MeshError::included;
  return options;
}

void print_fit(const MechanicalFitResult& fit, const Fabric& truth, const std::string& title) {
  fmt::print("\n{}: error {:.4g} (start {:.4g}), {} evaluations, {:.0f} s\n", title, fit.cost,
             fit.cost_start, fit.evaluations, fit.wall_s);
  fmt::print("  {:<16} {:>12} {:>12} {:>9}   {}\n", "parameter", "true", "estimate", "error",
             "90 % interval");
  for (const ParameterInterval& p : fit.intervals) {
    const double expected = truth.value(p.name);
    fmt::print("  {:<16} {:>12.5g} {:>12.5g} {:>8.2f}%   ", p.name, expected, p.value,
               100 * (p.value / expected - 1));
    if (p.determined)
      fmt::print("{:.5g} to {:.5g}\n", p.lower, p.upper);
    else
      fmt::print("not determined\n");
  }
  std::fflush(stdout);
}

std::vector<std::string> parameters_of(const std::set<std::string>& tables) {
  std::vector<std::string> names;
  for (const Truth& row : kTruth)
    if (tables.contains(row.table)) names.emplace_back(row.parameter);
  return names;
}

void isolated_fit(const Arguments& arguments, const std::string& fabric) {
  std::vector<std::shared_ptr<const MechanicalTrial>> trials;
  for (const char* test : kIsolatedTests)
    trials.push_back(trial_of(arguments, fabric, test, arguments.options));
  const Fabric truth = true_fabric(trials.front()->capture);
  const std::size_t starts = std::min(arguments.starts, std::size(kStarts));
  for (const Start& start : std::span(kStarts).first(starts)) {
    const MechanicalProblem problem(trials, truth, parameters_of({"membrane", "bending"}));
    const MechanicalFitResult fit =
        fit_mechanical(problem, wrong_fabric(truth, start), with_mesh_error());
    print_fit(fit, truth,
              fmt::format("{}: joint fit to stretch, shear and bend from {}", fabric, start.name));
    if (&start != &kStarts[0]) continue;
    print_difference_header();
    const auto frames = simulate_mechanical(trials, fit.fabric);
    for (std::size_t i = 0; i < trials.size(); ++i)
      print_difference(trials[i]->capture.name, *trials[i], frames[i]);
  }
}

void strip_fit(const Arguments& arguments, const std::string& fabric) {
  std::vector<std::shared_ptr<const MechanicalTrial>> fitted, predicted;
  for (const char* test : kFittedStrips)
    fitted.push_back(trial_of(arguments, fabric, test, arguments.options));
  for (const char* test : kPredictedStrips)
    predicted.push_back(trial_of(arguments, fabric, test, arguments.options));
  const Fabric truth = true_fabric(fitted.front()->capture);
  // Strips in their plane do not bend.
  const MechanicalProblem problem(fitted, truth, parameters_of({"membrane"}));
  const MechanicalFitResult fit =
      fit_mechanical(problem, wrong_fabric(truth, {"", 5, 1}), with_mesh_error());
  print_fit(fit, truth, fabric + ": fit to the strips at 0, 45 and 90 degrees from all x 5");
  fmt::print("prediction of the other angles\n");
  print_difference_header();
  const auto frames = simulate_mechanical(predicted, fit.fabric);
  for (std::size_t i = 0; i < predicted.size(); ++i)
    print_difference(predicted[i]->capture.name, *predicted[i], frames[i]);
}

/// Linear and with curves, each model fitted to the tests that isolate a strain, from values five
/// times too large: what it leaves.
void other_models(const Arguments& arguments, const std::string& name) {
  std::vector<std::shared_ptr<const MechanicalTrial>> all;
  for (const char* test : kIsolatedTests)
    all.push_back(trial_of(arguments, name, test, arguments.options));
  const Fabric truth = true_fabric(all.front()->capture);
  for (const char* model : {"stvk-diagonal", "soft-constraints", "springs"}) {
    const Fabric start = thread_fabric(
        name, model, [&](const ThreadParameter& p) { return 5 * truth.value(p.of_stvk); });
    const auto trials =
        in_plane_only(model) ? std::vector(all.begin(), all.begin() + kTestsInPlane) : all;
    for (const CurveShape shape : {CurveShape::linear, CurveShape::subdivided}) {
      CurveFitOptions options;
      options.shape = shape;
      const CurveFitResult found = fit_curves(trials, start, searched_parameters(model), options);
      fmt::print("\n{}: {}, {}: error {:.4g}, {} evaluations, {:.0f} s\n", name, model,
                 shape == CurveShape::linear ? "constants" : "curves", found.fit.cost,
                 found.fit.evaluations, found.fit.wall_s);
      print_difference_header();
      const auto frames = simulate_mechanical(trials, found.fit.fabric);
      for (std::size_t i = 0; i < trials.size(); ++i)
        print_difference(trials[i]->capture.name, *trials[i], frames[i]);
    }
  }
}

constexpr const char* kUsage =
    "usage: weft_validate_mechanical DATA [truth] [refinement] [fit] [strips] "
    "[models] [--cells N] [--pattern NAME] [--fabric NAME] [--starts N]";

Arguments parse(int argc, char** argv) {
  Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--cells" && i + 1 < argc)
      arguments.options.cells = validation::number<int>(word, argv[++i], 2);
    else if (word == "--pattern" && i + 1 < argc)
      arguments.options.pattern = grid_pattern_from_name(argv[++i]);
    else if (word == "--starts" && i + 1 < argc)
      arguments.starts = validation::number<std::size_t>(word, argv[++i], 0);
    else if (word == "--fabric" && i + 1 < argc)
      arguments.fabrics = {argv[++i]};
    else if (arguments.data.empty())
      arguments.data = word;
    else
      arguments.parts.push_back(
          part(word, {"truth", "refinement", "fit", "strips", "models"}, kUsage));
  }
  if (arguments.data.empty()) throw Error(kUsage);
  if (arguments.parts.empty()) arguments.parts = {"truth", "refinement", "fit", "strips", "models"};
  return arguments;
}

void run(const Arguments& arguments) {
  const auto begin = Clock::now();
  if (arguments.has("truth")) truth_table(arguments, all_tests(), {arguments.options.cells});
  if (arguments.has("refinement"))
    truth_table(arguments, {"stretch_u", "shear", "bend_v", "strip_15"}, {8, 16, 32});
  for (const std::string& fabric : arguments.fabrics) {
    if (arguments.has("fit")) isolated_fit(arguments, fabric);
    if (arguments.has("strips")) strip_fit(arguments, fabric);
    if (arguments.has("models")) other_models(arguments, fabric);
  }
  fmt::print("\n{:.0f} s\n", seconds_since(begin));
}

}  // namespace
}  // namespace weft::validation

int main(int argc, char** argv) {
  return weft::validation::run_program("weft_validate_mechanical", [&] {
    weft::validation::run(weft::validation::parse(argc, argv));
    return 0;
  });
}
