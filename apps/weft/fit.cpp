#include "weft/estimate/fit.h"

#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "command_line.h"
#include "commands.h"
#include "estimate_of_fit.h"
#include "fit_curves.h"
#include "mechanical.h"
#include "mechanical_beside.h"
#include "options.h"
#include "report_of_fit.h"
#include "report_of_mechanical.h"
#include "scan.h"
#include "weft/base/clock.h"
#include "weft/base/error.h"
#include "weft/base/interrupt.h"
#include "weft/base/parallel.h"
#include "weft/base/progress.h"
#include "weft/base/text_file.h"
#include "weft/estimate/choose_start.h"
#include "weft/estimate/least_squares_fit.h"
#include "weft/estimate/uncertainty.h"
#include "weft/estimate/variability.h"
#include "weft/estimate/video_mesh_error.h"
#include "weft/mesh/mesh_io.h"
#include "weft/report/report_html.h"
#include "weft/report/result.h"

namespace weft::app {
namespace {

constexpr double kLargestVariability = 100;  // %: beyond, the data do not determine the parameter
const std::string kStoreName = "evaluations.sqlite";

struct FitArguments {
  std::vector<std::string> captures;
  std::vector<std::string> videos, tests;  ///< of them, by kind
  std::string out;
  std::string initial;
  std::string model;  ///< empty: the default of the captures' kind
  std::vector<std::string> include;
  std::vector<std::string> parameters;
  std::vector<std::string> coarse = FitOptions().coarse_parameters;
  std::string method = "auto";
  std::string start = "middle";
  std::optional<std::size_t> iterations;
  std::optional<double> simplex;
  int hops = AutoFitOptions().least_squares.hops.rounds;
  int searches = AutoFitOptions().searches;
  int coarse_frames = 1;
  int coarse_levels = 4;
  std::uint64_t seed = 1;
  std::optional<std::uint64_t> start_seed;
  bool no_variability = false;
  bool variability_curves = false;
  Existing existing = Existing::refuse;
  bool no_mesh_error = false;
  std::string name;
  TrialArguments trial;
  MechanicalArguments mechanical;
  MechanicalFitArguments mechanical_fit;  // what only mechanical captures have
  CurveFitArguments curves;
  ScanArguments scan;
  ScanFitArguments scan_fit;  // what only scans have
};

MeshError mesh_error_of(const FitArguments& arguments) {
  return arguments.no_mesh_error ? MeshError::left_out : MeshError::included;
}

/// What both methods share, over the defaults of each.
FitOptions fit_options(const FitArguments& arguments, FitOptions options) {
  options.coarse_parameters = arguments.coarse;
  options.coarse_levels = arguments.coarse_levels;
  options.coarse_frames = arguments.coarse_frames;
  options.start = arguments.start == "random"    ? FitOptions::Start::random
                  : arguments.start == "initial" ? FitOptions::Start::initial
                                                 : FitOptions::Start::middle;
  AnnealingOptions& annealing = options.annealing;
  annealing.max_evaluations = arguments.iterations.value_or(annealing.max_evaluations);
  annealing.simplex_size = arguments.simplex.value_or(annealing.simplex_size);
  options.with_variability = !arguments.no_variability &&
                             (arguments.method == "annealing" || arguments.variability_curves);
  options.seed = arguments.seed;
  options.start_seed = arguments.start_seed;
  options.threads = arguments.trial.threads();
  return options;
}

AutoFitOptions auto_options(const FitArguments& arguments) {
  AutoFitOptions options;
  options.annealing = fit_options(arguments, options.annealing);
  options.least_squares.start = options.annealing.start;
  if (!arguments.tests.empty()) {
    options.least_squares.start = FitOptions::Start::initial;
    options.least_squares.screening_points = 0;
  }
  HopOptions& hops = options.least_squares.hops;
  hops.rounds = arguments.hops;
  hops.patience = std::max(hops.patience, arguments.hops / 4);
  options.searches = arguments.searches;
  options.least_squares.seed = arguments.seed;
  options.least_squares.start_seed = arguments.start_seed;
  options.least_squares.threads = arguments.trial.threads();
  return options;
}

/// Nothing where there are no derivatives.
std::vector<PatchPart> linearize_at(const Problem& problem, const FitResult& fit,
                                    const TrialArguments& trial) {
  if (fit.stopped || !std::isfinite(fit.final.error)) return {};
  if (trial.options().simulation.integrator == Integrator::runge_kutta) return {};
  LinearizationOptions options;
  options.threads = trial.threads();
  return linearize_patches(problem, fit.scaled, options);
}

void add_uncertainty(const Uncertainty& uncertainty, Report& report) {
  ReportCertainty& certainty = report.certainty.emplace();
  certainty.confidence = uncertainty.confidence;
  certainty.clusters = uncertainty.clusters;
  certainty.condition = uncertainty.condition;
  certainty.noise = uncertainty.noise;
  certainty.dispersion = uncertainty.dispersion;
  certainty.frames_per_cluster = uncertainty.frames_per_cluster;
  for (const ParameterInterval& p : uncertainty.parameters) certainty.parameters.push_back(p.name);
  certainty.correlation = uncertainty.correlation;
  certainty.covariance = uncertainty.covariance;
  certainty.information = uncertainty.information;
  certainty.slope = uncertainty.slope;
  for (ReportParameter& p : report.parameters) {
    for (const ParameterInterval& interval : uncertainty.parameters) {
      if (interval.name != p.name) continue;
      p.determined = p.determined && interval.determined;
      p.interval_lower = interval.lower;
      p.interval_upper = interval.upper;
    }
  }
}

/// From the derivatives at the estimate.
void add_variability(const Problem& problem, const FitResult& fit,
                     const std::vector<CostPart>& frames, Report& report) {
  QuadraticModel model{fit.final.error, frames.front().gradient, frames.front().hessian};
  for (std::size_t k = 1; k < frames.size(); ++k) {
    model.gradient += frames[k].gradient;
    model.hessian += frames[k].hessian;
  }
  const VecX percent = variability_from_derivatives(problem, fit.scaled, fit.final.error, model);
  for (ReportParameter& p : report.parameters) {
    const int i = problem.index_of(p.name);
    if (i < 0) continue;
    p.variability_percent = percent[i];
    // The error is the video's: of tests beside it the interval alone knows.
    if (!problem.other().cost) p.determined = p.determined && percent[i] <= kLargestVariability;
  }
}

/// The fabric that holds the values which are not searched.
Fabric initial_fabric(const FitArguments& arguments, const Capture& first) {
  Fabric fabric = !arguments.initial.empty() ? find_fabric(arguments.initial)
                  : arguments.model.empty()  ? Fabric::with_defaults(first.name)
                                             : Fabric::with_defaults(first.name, arguments.model);
  require_motion_model(fabric);
  return start_of_fit(std::move(fabric), arguments.include,
                      arguments.name.empty() ? first.name : arguments.name, first.areal_density,
                      arguments.captures);
}

/// One bar a phase of the search, or a part of one.
class PhaseProgress {
 public:
  bool operator()(const FitProgress& progress) {
    const std::string phase = progress.part.empty()
                                  ? progress.step.phase
                                  : fmt::format("{}, {}", progress.step.phase, progress.part);
    if (phase != phase_) {
      phase_ = phase;
      bar_.reset();
      Progress::Options options;
      options.start = phase_begin_;
      bar_ = std::make_unique<Progress>(phase_, progress.total, options);
    }
    phase_begin_ = Clock::now();  // of the next, if this was the last step
    bar_->update(progress.done,
                 fmt::format("error {:.4g}, best {:.4g}{}", progress.step.error, progress.step.best,
                             progress.replayed > replayed_ ? " (replayed)" : ""));
    replayed_ = progress.replayed;
    return !interrupted();
  }

 private:
  std::string phase_;
  std::unique_ptr<Progress> bar_;
  std::size_t replayed_ = 0;  // until the step before
  Clock::time_point phase_begin_ = Clock::now();
};

std::vector<std::pair<std::string, ReportValue>> settings(const FitArguments& arguments,
                                                          const TrialOptions& trial) {
  const SimulationOptions& simulation = trial.simulation;
  const FitOptions annealing =
      arguments.method == "auto" ? auto_options(arguments).annealing : fit_options(arguments, {});
  std::vector<std::pair<std::string, ReportValue>> values{
      {"method", arguments.method},
      {"start", arguments.start},
      {"iterations", static_cast<std::int64_t>(annealing.annealing.max_evaluations)},
      {"simplex", annealing.annealing.simplex_size}};
  if (arguments.start == "random")
    values.emplace_back("start seed",
                        fmt::format("{}", arguments.start_seed.value_or(arguments.seed)));
  if (arguments.method == "auto") {
    values.emplace_back("hops", static_cast<std::int64_t>(arguments.hops));
    values.emplace_back("searches", static_cast<std::int64_t>(arguments.searches));
  }
  if (arguments.method == "annealing") {
    values.insert(values.end(),
                  {{"coarse parameters", fmt::format("{}", fmt::join(arguments.coarse, ", "))},
                   {"coarse levels", static_cast<std::int64_t>(arguments.coarse_levels)},
                   {"coarse frames", static_cast<std::int64_t>(arguments.coarse_frames)}});
  }
  values.insert(values.end(),
                {{"grid", fmt::format("{} x {} vertices", trial.columns, trial.rows)},
                 {"integrator", std::string(name_of(simulation.integrator))},
                 {"steps per frame", static_cast<std::int64_t>(simulation.steps_per_frame)},
                 {"alpha", trial.alpha},
                 {"fold threshold (rad/px)", trial.angle_map.mask_threshold},
                 {"filter kernel radius (px)", trial.angle_map.kernel_radius},
                 {"blur sigma (px)", trial.angle_map.blur_sigma}});
  return values;
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
    if (p.interval_upper) {
      certainty += certainty.empty() ? "" : ", ";
      certainty += interval_ends(p) == IntervalEnds::none ? "interval " : "";
      certainty += ends_in_words(p);
    }
    if (p.at_bound != ReportParameter::Bound::none) {
      certainty += certainty.empty() ? "" : ", ";
      certainty += p.at_bound == ReportParameter::Bound::lower ? "at the lower end of its range"
                                                               : "at the upper end of its range";
    }
    fmt::print("{:<20} {:>12.5g} {:<11} {}\n", p.name, p.value, p.unit, certainty);
  }
  fmt::print(
      "error {:.5g}, at the middle of the ranges {:.5g}; {} evaluations ({} replayed, {} "
      "diverged) in {:.1f} s\n",
      fit.final.error, fit.initial.error, fit.evaluations, fit.replayed, fit.diverged, fit.wall_s);
  fmt::print("{}", prior_line(report, fit.prior_weight));
  for (const ReportSearch& search : report.searches)
    fmt::print("search with seed {}: error {:.5g}{}\n", search.seed, search.error,
               search.kept ? ", kept" : "");
  for (std::size_t i = 0; i < evaluations.size(); ++i) {
    const CaptureEvaluation& e = evaluations[i];
    fmt::print("{}: error per frame {:.5g} (fit frames)", report.captures[i].name, e.fit.error);
    if (e.validation) fmt::print(", {:.5g} (validation frames)", e.validation->error);
    fmt::print("\n");
  }
  for (const std::string& warning : report_warnings(report)) fmt::print("warning: {}\n", warning);
}

EvaluationStore open_store(const std::filesystem::path& out, const Problem& problem) {
  EvaluationStore store(out / kStoreName, "weft " WEFT_VERSION);
  if (store.count() > 0 && store.count(problem) == 0) {
    throw Error(
        fmt::format("{}: holds {} of another run (other captures, or other options of simulating "
                    "and comparing); name another folder, or give --overwrite",
                    out.string(), kStoreName));
  }
  return store;
}

MechanicalFitArguments tests_of(const FitArguments& arguments) {
  MechanicalFitArguments tests = arguments.mechanical_fit;
  tests.captures = arguments.tests;
  tests.out = arguments.out;
  tests.threads = arguments.trial.threads();
  tests.options = arguments.mechanical.options();
  tests.existing = arguments.existing;
  return tests;
}

/// result.json with what the mesh does and, if there are any, the mechanical tests.
std::string result_text(const Report& report, const Problem& problem, const FitResult& fit,
                        const MeshShift& mesh, const MechanicalBeside::Shown& tests) {
  nlohmann::ordered_json result = nlohmann::ordered_json::parse(result_to_json(report));
  std::vector<ParameterInfo> infos;
  for (int i = 0; i < problem.dimension(); ++i) infos.push_back(problem.info(i));
  result["problem"] = problem.fingerprint();
  result["mesh_shift"] = mesh_shift_json(infos, fit.scaled, mesh);
  if (!tests.json.is_null()) {
    result["mechanical"] = tests.json;
    result["responses"] = responses_json(tests.report.responses);
  }
  return result.dump(1) + "\n";
}

/// How sure the estimate is.
struct Sureness {
  std::vector<CostPart> frames;            ///< its linearization; empty without derivatives
  std::optional<Uncertainty> uncertainty;  ///< of two frames or more
  MeshShift mesh;                          ///< empty: left out
};

Sureness sureness_of(const Problem& problem, const FitResult& fit, const TrialArguments& trial,
                     MeshError mesh_error) {
  const std::vector<PatchPart> parts = linearize_at(problem, fit, trial);
  Sureness sure{frames_of(parts), {}, {}};
  if (sure.frames.size() < 2) return sure;
  sure.uncertainty = estimate_uncertainty(problem, fit.scaled, parts);
  if (mesh_error == MeshError::left_out) return sure;
  fmt::print(stderr, "the same on cells and steps of half the width\n");
  LinearizationOptions options;
  options.threads = trial.threads();
  auto with_mesh = estimate_uncertainty_with_mesh(problem, fit.scaled, parts,
                                                  sure.uncertainty->dispersion, options);
  sure.uncertainty = std::move(with_mesh.uncertainty);
  sure.mesh = std::move(with_mesh.mesh);
  return sure;
}

/// start_1.obj ...: where the motion in each capture starts, for --start-surface of other commands.
void write_starts(const std::filesystem::path& out,
                  const std::vector<std::shared_ptr<const Trial>>& trials) {
  for (std::size_t k = 0; k < trials.size(); ++k)
    write_obj(start_file(out, k), trials[k]->scene.mesh, trials[k]->scene.start,
              fmt::format("where settling starts in {}", trials[k]->capture.name));
}

/// The default list may name what is not searched.
void check_coarse(const std::vector<std::string>& coarse, const std::vector<std::string>& free) {
  if (coarse == FitOptions().coarse_parameters) return;
  for (const std::string& name : coarse)
    if (std::ranges::find(free, name) == free.end())
      throw Error(
          fmt::format("--coarse: {} is not searched; these are: {}", name, fmt::join(free, ", ")));
}

/// What is searched, read and checked before anything is written.
struct FitInput {
  std::vector<Capture> captures;
  Fabric initial;
  std::vector<ParameterPrior> priors;
  std::vector<std::string> free;  ///< parameters that are searched
};

FitInput read_input(const FitArguments& arguments) {
  FitInput input;
  input.captures = read_captures(arguments.videos);
  input.initial = initial_fabric(arguments, input.captures.front());
  input.priors = priors_of(arguments.initial);
  if (!input.priors.empty() && arguments.method == "annealing")
    throw Error(
        fmt::format("{}: has priors, which --method annealing cannot weigh against the "
                    "data; use --method auto",
                    arguments.initial));
  check_parameters("--parameters", input.initial.model, arguments.parameters);
  check_parameters("--coarse", input.initial.model, arguments.coarse);
  input.free = arguments.parameters.empty() ? input.initial.value_names() : arguments.parameters;
  check_coarse(arguments.coarse, input.free);
  return input;
}

FitResult search(const FitArguments& arguments, const Problem& problem, EvaluationStore& store) {
  PhaseProgress progress;
  const FitObserver observer = [&](const FitProgress& p) { return progress(p); };
  return arguments.method == "annealing"
             ? run_fit(problem, fit_options(arguments, {}), &store, observer)
             : run_auto_fit(problem, auto_options(arguments), &store, observer);
}

/// Of the estimate, capture by capture, over all frames.
struct Look {
  std::vector<CaptureEvaluation> evaluations;
  std::vector<CapturePictures> pictures;
};

Look look_at_captures(const FitArguments& arguments, const std::vector<Capture>& captures,
                      const FitResult& fit) {
  Look look;
  for (std::size_t k = 0; k < captures.size(); ++k) {
    const auto all = with_start_of(
        *fit.compared[k],
        arguments.trial.prepare(captures[k], TrialArguments::Frames::from_fit_to_end));
    Trajectory trajectory;
    look.evaluations.push_back(evaluate_capture(*all, fit.fabric, TruthDistance::left_out,
                                                arguments.trial.threads(), &trajectory));
    look.pictures.push_back(pictures_of(*all, trajectory, arguments.trial.threads()));
  }
  return look;
}

std::string method_of(const FitArguments& arguments) {
  if (arguments.method == "annealing") return "coarse search, then simulated annealing";
  std::string method = "least squares through the motion";
  if (auto_options(arguments).annealing.annealing.max_evaluations > 0)
    method += ", then simulated annealing";
  return method;
}

/// How it was made.
void add_origin(const FitArguments& arguments, const Sureness& sure, Report& report) {
  report.command = command_line();
  report.created = now();
  report.method = method_of(arguments);
  report.threads = arguments.trial.threads() ? arguments.trial.threads() : hardware_threads();
  report.settings = settings(arguments, arguments.trial.options());
  if (sure.uncertainty)
    report.settings.emplace_back(std::string(intervals_setting),
                                 interval_contents(mesh_error_of(arguments), sure.mesh));
  if (!arguments.tests.empty())
    report.settings.emplace_back(kMechanicalSetting,
                                 fmt::format("{}", fmt::join(arguments.tests, ", ")));
}

/// An error that the last hops lowered by less is not said to be falling still.
constexpr double kStillFalling = 0.01;

void add_hop_remark(int hops, const FitResult& fit, Report& report) {
  if (fit.hop_gain < kStillFalling) return;
  report.remarks.push_back(
      fmt::format("Hops still lowered the error when their rounds ended, by {:.2g} % in the last "
                  "ones: more may lower it further, at another fabric. --hops {} --extend goes on "
                  "from here.",
                  100 * fit.hop_gain, 4 * hops));
}

std::string title_of(const std::vector<Capture>& captures,
                     const std::vector<ReportMechanical>& tests) {
  std::vector<std::string> names;
  for (const Capture& capture : captures) names.push_back(capture.name);
  for (const ReportMechanical& test : tests) names.push_back(test.name);
  return fmt::format("Fit of {}", fmt::join(names, ", "));
}

void run_fit(const FitArguments& arguments) {
  const InterruptGuard guard;
  const std::filesystem::path out = arguments.out;
  const FitInput input = read_input(arguments);
  std::vector<std::string> stores{kStoreName};
  if (!arguments.tests.empty()) stores.emplace_back(kMechanicalStoreName);
  prepare_fit_folder(out, stores, arguments.existing);
  const auto trials = arguments.trial.prepare(input.captures, TrialArguments::Frames::fit);
  std::optional<MechanicalBeside> tests;
  if (!arguments.tests.empty()) tests.emplace(tests_of(arguments), input.initial, input.free);
  const Problem problem(trials, tests ? tests->fabric() : input.initial, input.free, {},
                        input.priors, tests ? tests->data() : OtherData{});
  if (arguments.existing == Existing::overwrite) remove_earlier_fit(out, {kStoreName});
  EvaluationStore store = open_store(out, problem);
  if (arguments.existing == Existing::extend) remove_earlier_fit(out, {});
  const FitResult fit = search(arguments, problem, store);
  write_fabric(out / "fabric.toml", fit.fabric);
  write_starts(out, fit.compared);

  const Problem compared = problem.with_trials(fit.compared);
  Look look;
  Sureness sure;
  // Side by side: most of each is a simulation, which uses one core.
  parallel_for(2, arguments.trial.threads(), [&](std::size_t i) {
    if (i == 0)
      look = look_at_captures(arguments, input.captures, fit);
    else
      sure = sureness_of(compared, fit, arguments.trial, mesh_error_of(arguments));
  });
  MechanicalBeside::Shown shown;
  if (tests) {
    const Uncertainty known = sure.uncertainty.value_or(Uncertainty{});
    shown = tests->show(fit.fabric, known.parameters, known.correlation);
  }

  Report report = report_of_fit(compared, fit, look.evaluations);
  add_hop_remark(arguments.hops, fit, report);
  if (sure.uncertainty) {
    add_uncertainty(*sure.uncertainty, report);
    add_mesh_remark(sure.mesh, report);
  }
  if (!sure.frames.empty() && !arguments.no_variability && fit.variability.empty())
    add_variability(compared, fit, sure.frames, report);
  report.title = title_of(input.captures, shown.report.captures);
  add_origin(arguments, sure, report);
  write_text(out / "result.json", result_text(report, compared, fit, sure.mesh, shown));
  write_report_html(out / "report.html", report, look.pictures, shown.report);
  print_result(fit, report, look.evaluations);
  for (const std::string& line : shown.lines) fmt::print("{}", line);
  fmt::print("{}\n", (out / "report.html").string());
  if (fit.stopped) throw CLI::RuntimeError(stopped_early);
}

const std::vector<std::string> kVideoFitOptions{
    "--method",     "--coarse",         "--coarse-levels",     "--coarse-frames",
    "--hops",       "--searches",       "--iterations",        "--simplex",
    "--start-seed", "--no-variability", "--variability-curves"};

void run_mechanical(const FitArguments& arguments, const CLI::App& command) {
  refuse_options(command, kVideoFitOptions, "mechanical captures");
  refuse_options(command, {"--extend"}, "mechanical captures");
  refuse_options(command, video_option_names(), "mechanical captures");
  MechanicalFitArguments fit = tests_of(arguments);
  fit.mesh_error = mesh_error_of(arguments);
  fit.initial = arguments.initial;
  if (!arguments.model.empty()) fit.model = arguments.model;
  if (command.count("--start") > 0) fit.start = arguments.start;
  fit.name = arguments.name;
  fit.include = arguments.include;
  fit.parameters = arguments.parameters;
  fit.seed = arguments.seed;
  fit.existing = arguments.existing;
  if (command.count("--points") > 0 && command.count("--smooth") == 0)
    refuse_without(command, "--subdivide", {"--points"});
  if (arguments.start != "random" && command.count("--seed") > 0)
    throw Error("--seed: of mechanical captures only with --start random");
  if (CurveFitArguments::given(command)) fit.curves = arguments.curves.options();
  run_mechanical_fit(fit);
}

void run_scan(const FitArguments& arguments, const CLI::App& command) {
  refuse_options(command, kVideoFitOptions, "scans");
  refuse_options(command, video_option_names(), "scans");
  refuse_options(command, cost_option_names(), "scans");
  refuse_options(command, {"--start"}, "scans");
  refuse_without(command, "--random-starts", {"--seed"});
  std::vector<ScanCapture> captures;
  for (const std::string& folder : arguments.captures)
    captures.push_back(read_scan_capture(folder));
  check_registered_cells(command, captures);
  if (arguments.scan_fit.schedule != "alternating" && command.count("--rounds") > 0)
    throw Error("--rounds: only with --schedule alternating");
  ScanFitArguments fit = arguments.scan_fit;
  fit.mesh_error = mesh_error_of(arguments);
  fit.captures = arguments.captures;
  fit.out = arguments.out;
  fit.model = arguments.model;
  fit.initial = arguments.initial;
  fit.name = arguments.name;
  fit.include = arguments.include;
  fit.parameters = arguments.parameters;
  fit.seed = arguments.seed;
  fit.existing = arguments.existing;
  fit.threads = arguments.trial.threads();
  fit.options = arguments.scan.options(command, fit.threads);
  fit.solver = arguments.scan.solver();
  fit.mesh_solver = arguments.scan.mesh_solver();
  run_scan_fit(fit);
}

void run_by_kind(FitArguments& arguments, const CLI::App& command) {
  refuse_twice(arguments.captures);
  std::size_t scans = 0;
  for (const std::string& folder : arguments.captures) {
    const CaptureKind kind = capture_kind(folder);
    scans += kind == CaptureKind::scan;
    (kind == CaptureKind::video ? arguments.videos : arguments.tests).push_back(folder);
  }
  if (scans == arguments.captures.size()) {
    run_scan(arguments, command);
    return;
  }
  if (scans > 0)
    throw Error("captures: scans cannot be fitted together with videos or mechanical captures");
  refuse_options(command, ScanArguments::names(), "anything but scans");
  refuse_options(command, ScanFitArguments::names(), "anything but scans");
  if (arguments.videos.empty()) {
    run_mechanical(arguments, command);
    return;
  }
  refuse_options(command, CurveFitArguments::names(), "videos");
  if (arguments.tests.empty()) {
    refuse_options(command, MechanicalArguments::names(), "videos");
    refuse_options(command, cost_option_names(), "videos");
  } else {
    // The tests say where to start.
    refuse_options(command, {"--start", "--coarse", "--coarse-levels", "--coarse-frames"},
                   "videos with mechanical captures");
    if (arguments.method != "auto")
      throw Error("--method: annealing takes no mechanical captures; use auto");
  }
  if (arguments.method == "auto") arguments.trial.need_derivatives("--method auto");
  if (arguments.coarse == std::vector<std::string>{"none"}) arguments.coarse.clear();
  run_fit(arguments);
}

/// Which fabric, and what of it is searched.
void add_fabric_options(CLI::App& command, FitArguments& arguments) {
  command.add_option("--name", arguments.name, "of the fabric (default: the capture's)");
  command.add_option("--model", arguments.model,
                     "to fit where --initial names no fabric (default: baraff-witkin; of "
                     "mechanical captures and scans stvk); `weft fabrics` lists them");
  command.add_option("--initial", arguments.initial,
                     "preset or fabric.toml: values that are not searched, the start with "
                     "--start initial, and priors");
  command.add_option("--include", arguments.include,
                     "optional terms of the model to take in, at their defaults, such as "
                     "drag_normal_linear; `weft fabrics` lists them");
  command.add_option("--parameters", arguments.parameters,
                     "parameters to search (default: all of the fabric; of mechanical captures "
                     "alone those that act at rest)");
}

void add_search_options(CLI::App& command, FitArguments& arguments) {
  command
      .add_option(
          "--method", arguments.method,
          "auto: least squares through the derivatives of the motion, then from points about its "
          "end, then annealing if --iterations says so; annealing: a coarse search, then annealing")
      ->check(CLI::IsMember({"auto", "annealing"}))
      ->capture_default_str();
  command
      .add_option("--start", arguments.start,
                  "where parameters start that no search places: middle (of their ranges), "
                  "random, or initial (for mechanical captures the default)")
      ->check(CLI::IsMember({"middle", "random", "initial"}))
      ->capture_default_str();
  command
      .add_option("--coarse", arguments.coarse,
                  "parameters of the coarse search (--method annealing); none: no coarse search")
      ->capture_default_str();
  command.add_option("--coarse-levels", arguments.coarse_levels, "values of each")
      ->check(integer_in(1, 100))
      ->capture_default_str();
  command.add_option("--coarse-frames", arguments.coarse_frames, "frames compared in it")
      ->check(integer_in(1, 100000))
      ->capture_default_str();
  command
      .add_option(
          "--hops", arguments.hops,
          "rounds, at most, of a descent from the best of ten points about the best so "
          "far, of some 25 evaluations' time each; a quarter of them, two at least, that gain "
          "nothing in turn are the last (--method auto)")
      ->check(integer_in(0, 100000))
      ->capture_default_str();
  command
      .add_option("--searches", arguments.searches,
                  "whole ones, with --seed and the seeds after it; the best is kept, and what the "
                  "others found is told (--method auto)")
      ->check(integer_in(1, 1000))
      ->capture_default_str();
  command
      .add_option("--iterations", arguments.iterations,
                  "evaluations of the annealing (default: 0 with auto, 600 with annealing)")
      ->check(integer_in(0, 10000000));
  command
      .add_option("--simplex", arguments.simplex,
                  "edge of the annealing's first simplex, of each parameter's scaled range "
                  "(default: 0.1 with auto, 0.25 with annealing)")
      ->check(number_in(1e-4, 1));
  command.add_option("--seed", arguments.seed, "of everything random")
      ->check(unsigned_integer())
      ->capture_default_str();
  command
      .add_option("--start-seed", arguments.start_seed,
                  "of --start random alone (default: that of --seed)")
      ->check(unsigned_integer());
  command.add_flag("--no-variability", arguments.no_variability,
                   "leave out the variability of the parameters");
  command.add_flag("--variability-curves", arguments.variability_curves,
                   "variability by perturbing each parameter, with curves, some 130 evaluations "
                   "(always with --method annealing; else from the derivatives at the estimate)");
}

void check_together(const CLI::App& command, const FitArguments& arguments) {
  for (const char* name : {"--coarse", "--coarse-levels", "--coarse-frames"}) {
    if (arguments.method != "annealing" && command.count(name) > 0)
      throw Error(fmt::format("{}: only with --method annealing", name));
  }
  if (arguments.method == "annealing" && arguments.iterations == 0)
    throw Error("--iterations: 0, with --method annealing 1 to 10000000");
  for (const char* name : {"--hops", "--searches"}) {
    if (arguments.method != "auto" && command.count(name) > 0)
      throw Error(fmt::format("{}: only with --method auto", name));
  }
  if (arguments.start != "random" && command.count("--start-seed") > 0)
    throw Error("--start-seed: only with --start random");
  if (arguments.no_variability && arguments.variability_curves)
    throw Error("--no-variability and --variability-curves exclude each other");
  if (command.count("--overwrite") > 0 && command.count("--extend") > 0)
    throw Error("--overwrite and --extend exclude each other");
  if (arguments.method == "auto" && command.count("--simplex") > 0 &&
      arguments.iterations.value_or(0) == 0)
    throw Error("--simplex: of the annealing; with --method auto only with --iterations");
  if (command.count("--model") > 0 && command.count("--initial") > 0)
    throw Error("--model: the fabric of --initial says which");
}

}  // namespace

void add_fit(CLI::App& app) {
  auto* command =
      add_command(app, "fit", "the fabric that explains one or more captures, with a report");
  auto arguments = std::make_shared<FitArguments>();
  command
      ->add_option("captures", arguments->captures,
                   "capture folders of one fabric: videos, mechanical "
                   "tests, or both; or scans")
      ->required();
  command
      ->add_option("--out", arguments->out,
                   "folder for fabric.toml, result.json, evaluations.sqlite, report.html; a run "
                   "that was killed continues")
      ->required();
  add_fabric_options(*command, *arguments);
  add_search_options(*command, *arguments);
  command->add_flag_callback(
      "--overwrite", [arguments] { arguments->existing = Existing::overwrite; },
      "replace an earlier result");
  command->add_flag_callback(
      "--extend", [arguments] { arguments->existing = Existing::extend; },
      "replace an earlier result, but make none of its evaluations again: for more hops, "
      "searches, iterations or random starts than it had");
  arguments->trial.add_to(*command);
  arguments->mechanical.add_to(*command);
  arguments->curves.add_to(*command);
  add_cost_options(*command, arguments->mechanical_fit);
  command->add_flag(
      "--no-mesh-error", arguments->no_mesh_error,
      "intervals without what the width of the cells (of video the time steps, too) does, which "
      "one evaluation on half of it tells");
  arguments->scan.add_to(*command);
  arguments->scan_fit.add_to(*command);
  command->footer(
      "Examples:\n  weft fit data/captures/cotton_waving_A --out out/cotton --hops 8\n"
      "  weft fit stretch_weft stretch_warp shear bend_weft bend_warp --out out/denim --model "
      "stvk-diagonal --order incremental --subdivide");
  command->callback([arguments, command] {
    check_together(*command, *arguments);
    run_by_kind(*arguments, *command);
  });
}

}  // namespace weft::app
