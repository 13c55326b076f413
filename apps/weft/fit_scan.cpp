#include <fmt/core.h>
#include <fmt/ranges.h>

#include <cmath>

#include "command_line.h"
#include "options.h"
#include "report_of_fit.h"
#include "report_of_scan.h"
#include "scan.h"
#include "weft/base/error.h"
#include "weft/base/interrupt.h"
#include "weft/base/progress.h"
#include "weft/base/text_file.h"
#include "weft/fabric/orthotropic.h"
#include "weft/mesh/mesh_io.h"
#include "weft/report/report_html.h"
#include "weft/report/result.h"

namespace weft::app {
namespace {

/// Where nothing is known: the middle of what cloth is.
constexpr OrthotropicModuli kUsualCloth{200, 200, 40, 0.3, 5e-6};

const std::string kScanStoreName = "scan_evaluations.sqlite";

Fabric usual_fabric(const std::string& model) {
  if (model.empty() || model == "stvk") return orthotropic_fabric("", stiffness_of(kUsualCloth));
  return Fabric::with_defaults("", model);
}

Fabric start_fabric(const ScanFitArguments& arguments, const std::vector<ScanCapture>& captures) {
  Fabric fabric =
      arguments.initial.empty() ? usual_fabric(arguments.model) : find_fabric(arguments.initial);
  return start_of_fit(std::move(fabric), arguments.include,
                      arguments.name.empty() ? captures.front().name : arguments.name,
                      captures.front().areal_density, arguments.captures);
}

/// The values of the fabric one by one; tied ones share the interval of what they are tied to, the
/// first of them stands for it.
std::vector<ReportParameter> report_parameters(const ScanProblem& problem,
                                               const ScanFitResult& fit) {
  std::vector<ReportParameter> list;
  for (int i = 0; i < fit.fabric.values.size(); ++i) {
    ReportParameter p = held_parameter(fit.fabric.info(i), fit.fabric, fit.start.values[i]);
    for (std::size_t k = 0; k < problem.parameters().size(); ++k) {
      for (const auto& [index, factor] : problem.parameters()[k].values) {
        if (index != i) continue;
        p.free = true;
        const int first = problem.parameters()[k].values.front().first;
        if (first != i) p.tied_to = fit.fabric.info(first).name;
        if (!fit.intervals.empty()) add_interval(fit.intervals[k], factor, p);
      }
    }
    list.push_back(p);
  }
  return list;
}

Report make_report(const ScanFitArguments& arguments, const ScanProblem& problem,
                   const ScanFitResult& fit, const std::vector<std::string>& names) {
  Report report = report_of_rest(fit.fabric, names, arguments.seed, arguments.threads);
  report.method = "least squares on shapes and forces at equilibrium";
  report.stopped = fit.stopped;
  report.error_initial = fit.cost_start;
  report.error = fit.cost;
  report.error_meaning =
      "mean of squared differences of descriptor entries and forces, each divided by its noise";
  report.evaluations = fit.evaluations;
  report.wall_s = fit.wall_s;
  report.settings = {
      {"descriptor", std::string(name_of(arguments.options.descriptor))},
      {"solver", std::string(problem.solver().name())},
      {"cells", static_cast<std::int64_t>(arguments.options.cells)},
      {"registered cells", static_cast<std::int64_t>(arguments.options.raw.cells)},
      {"pattern", std::string(name_of(arguments.options.pattern))},
      {"schedule", arguments.schedule},
      {"balance", arguments.balance},
      {"random starts", static_cast<std::int64_t>(arguments.random_starts)},
      {std::string(intervals_setting), interval_contents(arguments.mesh_error, fit.mesh)}};
  if (arguments.mesh_error == MeshError::included && arguments.mesh_solver)
    report.settings.emplace_back("solver of the mesh's error",
                                 std::string(arguments.mesh_solver->name()));
  report.parameters = report_parameters(problem, fit);
  for (const ScanFitStep& step : fit.history) {
    report.history.push_back({step.evaluation, step.phase, step.cost, step.best, 0});
    if (!std::isfinite(step.cost)) ++report.diverged;
  }
  report.certainty = report_certainty(fit.certainty, fit.intervals);
  add_mesh_remark(fit.mesh, report);
  add_inexact_remark(fit.inexact, "targets", report);
  return report;
}

/// Moduli of the paper's sheet; of other models what was searched.
nlohmann::json material_json(const ScanProblem& problem, const Fabric& fabric) {
  if (is_orthotropic_sheet(fabric)) {
    const OrthotropicModuli m = moduli_of(stiffness_of(fabric));
    return {{"E_u", m.e_u}, {"E_v", m.e_v}, {"mu", m.shear}, {"nu", m.poisson}, {"b", m.b}};
  }
  nlohmann::json values = nlohmann::json::object();
  for (const ScanParameter& p : problem.parameters())
    values[std::string(p.info.name)] = fabric.values[p.values.front().first];
  return values;
}

/// Of those that have one, by name.
nlohmann::json intervals_json(const std::vector<ReportModulus>& moduli) {
  nlohmann::json intervals = nlohmann::json::object();
  for (const ReportModulus& m : moduli)
    if (m.lower && m.upper) intervals[m.name] = {*m.lower, *m.upper};
  return intervals;
}

std::string result_text(const Report& report, const std::vector<std::string>& captures,
                        const ScanProblem& problem, const ScanFitResult& fit,
                        const std::vector<ReportModulus>& moduli,
                        const std::vector<std::shared_ptr<const ScanTrial>>& trials,
                        const std::vector<ScanDifference>& differences) {
  nlohmann::json result = nlohmann::json::parse(result_to_json(report));
  nlohmann::json ends = nlohmann::json::array();
  for (const ScanFitEnd& end : fit.ends) {
    nlohmann::json object = material_json(problem, end.fabric);
    object["error"] = std::isfinite(end.cost) ? nlohmann::json(end.cost) : nlohmann::json(nullptr);
    object["iterations"] = end.iterations;
    object["start"] = material_json(problem, end.start);
    ends.push_back(object);
  }
  nlohmann::json targets = scan_json(trials, differences);
  for (std::size_t i = 0; i < targets.size(); ++i)
    targets[i]["noise_factor"] = fit.scales[static_cast<Eigen::Index>(i)];
  result["scan"] = {
      {is_orthotropic_sheet(fit.fabric) ? "moduli" : "values", material_json(problem, fit.fabric)},
      {"iterations", fit.iterations},
      {"captures", captures},
      {"starts", ends},
      {"shape_rms", fit.shape_rms},
      {"force_rms", fit.force_rms},
      {"targets", targets}};
  if (!moduli.empty()) result["scan"]["moduli_intervals"] = intervals_json(moduli);
  result["mesh_shift"] = mesh_shift_json(problem.infos(), problem.scaled(fit.fabric), fit.mesh);
  return result.dump(2) + "\n";
}

void print_result(const ScanFitResult& fit, const Report& report,
                  const std::vector<std::shared_ptr<const ScanTrial>>& trials,
                  const std::vector<ScanDifference>& differences) {
  for (const ParameterInterval& p : fit.intervals) {
    std::string certainty = certainty_text(p);
    if (p.at_lower || p.at_upper) certainty += ", at the end of its range";
    fmt::print("{:<20} {:>12.5g} {:<11} {}\n", p.name, p.value, p.unit, certainty);
  }
  if (is_orthotropic_sheet(fit.fabric)) {
    const OrthotropicModuli m = moduli_of(stiffness_of(fit.fabric));
    fmt::print("E_u {:.5g}, E_v {:.5g}, mu {:.5g} N/m, nu {:.4g}, b {:.5g} N m\n", m.e_u, m.e_v,
               m.shear, m.poisson, m.b);
  }
  fmt::print(
      "error {:.5g}, at the start {:.5g}; {} iterations, {} evaluations ({} replayed) in {:.1f} "
      "s\n",
      report.error, report.error_initial, fit.iterations, report.evaluations, fit.replayed,
      report.wall_s);
  fmt::print("{}", prior_line(report, fit.prior_weight));
  for (std::size_t i = 0; i < trials.size(); ++i)
    fmt::print("{}{}", registration_summary(*trials[i]), scan_summary(*trials[i], differences[i]));
  for (const std::string& remark : report.remarks) fmt::print("warning: {}\n", remark);
}

/// Grids that were laid on raw scans, as a capture that names them as `grid` and `weights`.
void write_registered(const std::filesystem::path& out,
                      const std::vector<std::shared_ptr<const ScanTrial>>& trials) {
  for (std::size_t i = 0; i < trials.size(); ++i) {
    const ScanTrial& trial = *trials[i];
    if (!trial.registration) continue;
    const std::string stem = fmt::format("registered_{}", i + 1);
    write_obj(out / (stem + ".obj"), trial.shape.mesh, trial.shape.x,
              fmt::format("{}, registered to {}", trial.target.name,
                          trial.target.scan.filename().string()));
    std::string weights = "weight\n";
    for (const double w : trial.shape.weights) weights += fmt::format("{:.6g}\n", w);
    write_text(out / (stem + "_weights.csv"), weights);
  }
}

}  // namespace

void ScanFitArguments::add_to(CLI::App& command) {
  command
      .add_option("--schedule", schedule,
                  "scans: together: all parameters at once; alternating: bending, then membrane, "
                  "--rounds times")
      ->check(CLI::IsMember({"together", "alternating"}))
      ->capture_default_str();
  command.add_option("--rounds", rounds, "scans: of --schedule alternating")
      ->check(integer_in(1, 100))
      ->capture_default_str();
  add_balance_to(command);
  command
      .add_option(
          "--random-starts", random_starts,
          "scans: fits from moduli (of another model than stvk, parameters) within a factor "
          "of 3 of the start, besides the one from there; the best end counts")
      ->check(integer_in(0, 100))
      ->capture_default_str();
}

void ScanFitArguments::add_balance_to(CLI::App& command) {
  command
      .add_option("--balance", balance,
                  "scans: what divides shapes and forces before they are added: noise, as the "
                  "capture states it, or residual, what is left of each target after a fit with "
                  "noise, where that is more")
      ->check(CLI::IsMember({"noise", "residual"}))
      ->capture_default_str();
}

std::vector<std::shared_ptr<const ScanTrial>> prepare_scans(const ScanFitArguments& arguments) {
  std::vector<std::shared_ptr<const ScanTrial>> trials;
  for (const std::string& folder : arguments.captures)
    for (const auto& trial : prepare_scan(read_scan_capture(folder), arguments.options))
      trials.push_back(trial);
  return trials;
}

const std::vector<std::string>& ScanFitArguments::names() {
  static const std::vector<std::string> names{"--schedule", "--rounds", "--balance",
                                              "--random-starts"};
  return names;
}

void run_scan_fit(const ScanFitArguments& arguments) {
  const InterruptGuard guard;
  const std::filesystem::path out = arguments.out;
  std::vector<ScanCapture> captures;
  std::vector<std::string> names;
  std::vector<std::shared_ptr<const ScanTrial>> trials;
  for (const std::string& folder : arguments.captures) {
    captures.push_back(read_scan_capture(folder));
    names.push_back(captures.back().name);
    for (const auto& trial : prepare_scan(captures.back(), arguments.options))
      trials.push_back(trial);
  }
  const Fabric initial = start_fabric(arguments, captures);
  ScanFitOptions options;
  options.schedule = scan_schedule_from_name(arguments.schedule);
  options.rounds = arguments.rounds;
  options.balance = scan_balance_from_name(arguments.balance);
  options.random_starts = arguments.random_starts;
  options.seed = arguments.seed;
  options.mesh_error = arguments.mesh_error;
  options.mesh_solver = arguments.mesh_solver;
  ScanCostOptions cost;
  cost.priors = priors_of(arguments.initial);
  ScanProblem problem(
      trials, arguments.solver, initial,
      arguments.parameters.empty() ? default_scan_parameters(initial) : arguments.parameters, cost,
      arguments.threads);
  prepare_fit_folder(out, {kScanStoreName}, arguments.existing);
  if (arguments.existing == Existing::overwrite) remove_earlier_fit(out, {kScanStoreName});
  problem.keep_in(std::make_shared<NumberStore>(out / kScanStoreName, problem.fingerprint()));
  if (arguments.existing == Existing::extend) remove_earlier_fit(out, {});
  Progress progress("least squares", 0);
  const ScanFitResult fit = fit_scan(problem, initial, options, [&](const ScanFitStep& step) {
    progress.update(step.evaluation,
                    fmt::format("{}: error {:.4g}, best {:.4g}{}", step.phase, step.cost, step.best,
                                step.replayed ? " (replayed)" : ""));
    return !interrupted();
  });
  progress.finish();
  write_fabric(out / "fabric.toml", fit.fabric);
  write_registered(out, trials);
  const auto simulations = simulate_scans(trials, *arguments.solver, fit.fabric,
                                          HeldDerivatives::none, arguments.threads);
  std::vector<ScanDifference> differences;
  for (std::size_t i = 0; i < trials.size(); ++i)
    differences.push_back(compare_scan(*trials[i], simulations[i]));
  Report report = make_report(arguments, problem, fit, names);
  add_priors(cost.priors, fit.fabric, fit.prior_weight, fit.prior_error, report);
  MechanicalReport shown = report_of_scan(captures, trials, simulations, differences);
  shown.moduli = report_moduli(problem, fit);
  write_text(out / "result.json", result_text(report, arguments.captures, problem, fit,
                                              shown.moduli, trials, differences));
  write_report_html(out / "report.html", report, {}, shown);
  print_result(fit, report, trials, differences);
  fmt::print("{}\n", (out / "report.html").string());
  if (report.stopped) throw CLI::RuntimeError(stopped_early);
}

}  // namespace weft::app
