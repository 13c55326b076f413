#include "weft/estimate/fit.h"

#include <fmt/chrono.h>
#include <fmt/core.h>
#include <fmt/ranges.h>

#include <cmath>
#include <ctime>
#include <memory>
#include <string>

#include "command_line.h"
#include "commands.h"
#include "options.h"
#include "report_of_fit.h"
#include "weft/base/error.h"
#include "weft/base/interrupt.h"
#include "weft/base/parallel.h"
#include "weft/base/progress.h"
#include "weft/report/report_html.h"
#include "weft/report/result.h"

namespace weft::app {
namespace {

constexpr int kStoppedEarly = 130;  // as the shell reports a program ended by Ctrl-C

struct Arguments {
  std::vector<std::string> captures;
  std::string out;
  std::string initial;
  std::vector<std::string> parameters;
  std::vector<std::string> coarse = FitOptions().coarse_parameters;
  std::string start = "middle";
  std::size_t iterations = 600;
  double simplex = AnnealingOptions().simplex_size;
  int coarse_frames = 1;
  int coarse_levels = 4;
  std::uint64_t seed = 1;
  bool no_variability = false;
  bool overwrite = false;
  std::string name;
  TrialArguments trial;
};

FitOptions fit_options(const Arguments& arguments) {
  FitOptions options;
  options.coarse_parameters = arguments.coarse;
  options.coarse_levels = arguments.coarse_levels;
  options.coarse_frames = arguments.coarse_frames;
  options.start = arguments.start == "random"    ? FitOptions::Start::random
                  : arguments.start == "initial" ? FitOptions::Start::initial
                                                 : FitOptions::Start::middle;
  options.annealing.max_evaluations = arguments.iterations;
  options.annealing.simplex_size = arguments.simplex;
  options.with_variability = !arguments.no_variability;
  options.seed = arguments.seed;
  options.threads = arguments.trial.threads();
  return options;
}

/// The fabric that holds the values which are not searched.
Fabric initial_fabric(const Arguments& arguments, const Capture& first) {
  Fabric fabric = arguments.initial.empty() ? Fabric::with_defaults(first.name)
                                            : find_fabric(arguments.initial);
  fabric.name = arguments.name.empty() ? first.name : arguments.name;
  fabric.areal_density = first.areal_density;
  fabric.provenance =
      fmt::format("fitted to {} by weft " WEFT_VERSION, fmt::join(arguments.captures, ", "));
  return fabric;
}

/// One bar a phase of the search.
class PhaseProgress {
 public:
  bool operator()(const FitProgress& progress) {
    if (progress.step.phase != phase_) {
      phase_ = progress.step.phase;
      bar_ = std::make_unique<Progress>(phase_, progress.total);
    }
    bar_->update(progress.done,
                 fmt::format("error {:.4g}, best {:.4g}{}", progress.step.error, progress.step.best,
                             progress.replayed ? " (replayed)" : ""));
    return !interrupted();
  }

 private:
  std::string phase_;
  std::unique_ptr<Progress> bar_;
};

std::string now() {
  return fmt::format("{:%Y-%m-%dT%H:%M:%S%z}", fmt::localtime(std::time(nullptr)));
}

std::vector<std::pair<std::string, ReportValue>> settings(const Arguments& arguments,
                                                          const TrialOptions& trial) {
  const SimulationOptions& simulation = trial.simulation;
  return {{"iterations", static_cast<std::int64_t>(arguments.iterations)},
          {"simplex", arguments.simplex},
          {"start", arguments.start},
          {"coarse parameters", fmt::format("{}", fmt::join(arguments.coarse, ", "))},
          {"coarse levels", static_cast<std::int64_t>(arguments.coarse_levels)},
          {"coarse frames", static_cast<std::int64_t>(arguments.coarse_frames)},
          {"grid", fmt::format("{} x {} vertices", trial.columns, trial.rows)},
          {"integrator", std::string(name_of(simulation.integrator))},
          {"steps per frame", static_cast<std::int64_t>(simulation.steps_per_frame)},
          {"alpha", trial.alpha},
          {"fold threshold (rad/px)", trial.angle_map.mask_threshold},
          {"filter kernel radius (px)", trial.angle_map.kernel_radius},
          {"blur sigma (px)", trial.angle_map.blur_sigma}};
}

void print_result(const FitResult& fit, const Report& report,
                  const std::vector<CaptureEvaluation>& evaluations) {
  for (const ReportParameter& p : report.parameters) {
    if (!p.free) continue;
    std::string certainty;
    if (p.variability_percent) {
      certainty = p.determined ? fmt::format("variability {:.3g} %", *p.variability_percent)
                               : "not determined by the data";
    }
    fmt::print("{:<20} {:>12.5g} {:<11} {}\n", p.name, p.value, p.unit, certainty);
  }
  fmt::print(
      "error {:.5g}, at the middle of the ranges {:.5g}; {} evaluations ({} replayed, {} "
      "diverged) in {:.1f} s\n",
      fit.final.error, fit.initial.error, fit.evaluations, fit.replayed, fit.diverged, fit.wall_s);
  for (std::size_t i = 0; i < evaluations.size(); ++i) {
    const CaptureEvaluation& e = evaluations[i];
    fmt::print("{}: error per frame {:.5g} (fit frames)", report.captures[i].name, e.fit.error);
    if (e.validation) fmt::print(", {:.5g} (held-back frames)", e.validation->error);
    fmt::print("\n");
  }
  for (const std::string& warning : report_warnings(report)) fmt::print("warning: {}\n", warning);
}

void run(const Arguments& arguments) {
  const InterruptGuard guard;
  const std::filesystem::path out = arguments.out;
  std::vector<Capture> captures;
  for (const std::string& folder : arguments.captures) captures.push_back(read_capture(folder));
  // A run that was killed has its evaluations but no result; it continues.
  prepare_output_folder(out, {"result.json"},
                        arguments.overwrite ? Existing::overwrite : Existing::refuse);
  std::vector<std::shared_ptr<const Trial>> trials;
  for (const Capture& capture : captures) {
    trials.push_back(arguments.trial.prepare(capture, capture.fit_first, capture.fit_last));
  }
  const Fabric initial = initial_fabric(arguments, captures.front());
  std::vector<std::string> free = arguments.parameters;
  if (free.empty()) {
    for (const ParameterInfo& info : model_parameters(initial.model)) free.emplace_back(info.name);
  }
  const Problem problem(trials, initial, free);
  const std::filesystem::path store_path = out / "evaluations.sqlite";
  if (arguments.overwrite) std::filesystem::remove(store_path);
  EvaluationStore store(store_path);
  PhaseProgress progress;
  const FitResult fit = run_fit(problem, fit_options(arguments), &store,
                                [&](const FitProgress& p) { return progress(p); });
  write_fabric(out / "fabric.toml", fit.fabric);

  std::vector<CaptureEvaluation> evaluations;
  std::vector<CapturePictures> pictures;
  for (const Capture& capture : captures) {
    const auto all = arguments.trial.prepare(capture, capture.fit_first, capture.frame_count - 1);
    Trajectory trajectory;
    evaluations.push_back(
        evaluate_capture(*all, fit.fabric, false, arguments.trial.threads(), &trajectory));
    pictures.push_back(pictures_of(*all, trajectory));
  }
  Report report = report_of_fit(problem, fit, evaluations);
  std::vector<std::string> names;
  for (const Capture& capture : captures) names.push_back(capture.name);
  report.title = fmt::format("Fit of {}", fmt::join(names, ", "));
  report.command = command_line();
  report.created = now();
  report.method = "coarse search, then simulated annealing";
  report.threads = arguments.trial.threads() ? arguments.trial.threads() : hardware_threads();
  report.settings = settings(arguments, arguments.trial.options());
  write_result(out / "result.json", report);
  write_report_html(out / "report.html", report, pictures);
  print_result(fit, report, evaluations);
  fmt::print("{}\n", (out / "report.html").string());
  if (fit.stopped) throw CLI::RuntimeError(kStoppedEarly);
}

}  // namespace

void add_fit(CLI::App& app) {
  auto* command =
      app.add_subcommand("fit", "the fabric that explains one or more captures, with a report");
  auto arguments = std::make_shared<Arguments>();
  command->add_option("captures", arguments->captures, "capture folders of one fabric")->required();
  command
      ->add_option("--out", arguments->out,
                   "folder for fabric.toml, result.json, evaluations.sqlite, report.html; a run "
                   "that was killed continues")
      ->required();
  command->add_option("--name", arguments->name, "of the fabric (default: the capture's)");
  command->add_option("--initial", arguments->initial,
                      "preset or fabric.toml: values that are not searched, and the start with "
                      "--start initial");
  command->add_option("--parameters", arguments->parameters,
                      "parameters to search (default: all of the model)");
  command
      ->add_option("--start", arguments->start,
                   "where parameters that the coarse search leaves alone start: middle (of "
                   "their ranges), random, or initial")
      ->check(CLI::IsMember({"middle", "random", "initial"}))
      ->capture_default_str();
  command
      ->add_option("--coarse", arguments->coarse,
                   "parameters of the coarse search; none: no coarse search")
      ->capture_default_str();
  command->add_option("--coarse-levels", arguments->coarse_levels, "values of each")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  command->add_option("--coarse-frames", arguments->coarse_frames, "frames compared in it")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  command->add_option("--iterations", arguments->iterations, "evaluations of the annealing")
      ->check(CLI::Range(1, 10000000))
      ->capture_default_str();
  command
      ->add_option("--simplex", arguments->simplex,
                   "edge of the annealing's first simplex, of each parameter's scaled range")
      ->check(CLI::Range(1e-4, 1.0))
      ->capture_default_str();
  command->add_option("--seed", arguments->seed, "of everything random")->capture_default_str();
  command->add_flag("--no-variability", arguments->no_variability,
                    "leave out the variability of the parameters");
  command->add_flag("--overwrite", arguments->overwrite, "replace an earlier result");
  arguments->trial.add_to(*command);
  command->footer(
      "Example:\n  weft fit data/captures/cotton_waving_A --out out/cotton --iterations 150");
  command->callback([arguments] {
    if (arguments->coarse == std::vector<std::string>{"none"}) arguments->coarse.clear();
    run(*arguments);
  });
}

}  // namespace weft::app
