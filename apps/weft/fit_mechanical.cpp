#include <fmt/core.h>
#include <fmt/ranges.h>

#include "command_line.h"
#include "fit_curves.h"
#include "mechanical.h"
#include "options.h"
#include "report_of_fit.h"
#include "report_of_mechanical.h"
#include "weft/base/error.h"
#include "weft/base/interrupt.h"
#include "weft/base/progress.h"
#include "weft/base/random.h"
#include "weft/base/text_file.h"
#include "weft/estimate/mechanical_fit.h"
#include "weft/report/report_html.h"
#include "weft/report/result.h"

namespace weft::app {
namespace {

Fabric start_fabric(const MechanicalFitArguments& arguments,
                    const std::vector<MechanicalCapture>& captures) {
  Fabric fabric = arguments.initial.empty()
                      ? Fabric::with_defaults(captures.front().name, arguments.model)
                      : find_fabric(arguments.initial);
  return start_of_fit(std::move(fabric), arguments.include,
                      arguments.name.empty() ? captures.front().name : arguments.name,
                      captures.front().areal_density, arguments.captures);
}

std::vector<std::string> free_parameters(const MechanicalFitArguments& arguments,
                                         const Fabric& fabric) {
  check_parameters("--parameters", fabric, arguments.parameters);
  return arguments.parameters.empty() ? names_at_rest(fabric) : arguments.parameters;
}

/// The rows of a fit of curves. Throws Error where --subdivide has none to work on.
std::vector<std::string> free_rows(const MechanicalFitArguments& arguments, const Fabric& fabric) {
  std::vector<std::string> rows = arguments.parameters;
  if (rows.empty()) {
    for (const ParameterInfo& row : model_parameters(fabric.model))
      if (fabric.value_count(row.name) > 0 && acts_at_rest(row.name)) rows.emplace_back(row.name);
  }
  const auto may_be_curve = [&](const std::string& row) {
    const auto index = static_cast<std::size_t>(parameter_index(fabric.model, row));
    return !model_parameters(fabric.model)[index].curve_over.empty();
  };
  const CurveShape shape = arguments.curves->shape;
  if (finds_curves(shape) && std::ranges::none_of(rows, may_be_curve))
    throw Error(
        fmt::format("{}: no parameter of model \"{}\" that is searched may be a "
                    "curve; of stvk-diagonal stretch, shear and bend may",
                    shape == CurveShape::smooth ? "--smooth" : "--subdivide", fabric.model));
  return rows;
}

/// The start with what --start asks for in place of the free values.
Fabric placed(const MechanicalProblem& problem, const Fabric& start,
              const MechanicalFitArguments& arguments) {
  if (arguments.start == "initial") return start;
  VecX scaled = VecX::Constant(problem.dimension(), 0.5);
  if (arguments.start == "random") {
    Rng rng(arguments.seed);
    for (double& x : scaled) x = rng.uniform();
  }
  return problem.fabric(scaled);
}

/// What the start had at a control point: of a curve that was subdivided, its first value.
double initial_value(const Fabric& start, std::string_view name) {
  for (const ParameterInfo& row : model_parameters(start.model)) {
    if (!name.starts_with(row.name) || start.value_count(row.name) == 0) continue;
    const bool value_of_row =
        name == row.name || (!row.curve_over.empty() && name.size() == row.name.size() + 2 &&
                             name[row.name.size()] == '_');
    if (!value_of_row) continue;
    for (int i = 0; i < start.value_count(row.name); ++i)
      if (start.info(start.first_value(row.name) + i).name == name) return start.value(name);
    return start.values[start.first_value(row.name)];
  }
  return start.value(name);
}

Report make_report(const MechanicalFitArguments& arguments, const std::vector<std::string>& free,
                   const MechanicalFitResult& fit, const std::vector<std::string>& names) {
  Report report = report_of_rest(fit.fabric, names, arguments.seed, arguments.threads);
  report.method = "least squares on forces and shapes at equilibrium";
  report.stopped = fit.end == LeastSquaresEnd::stopped;
  report.error_initial = fit.cost_start;
  report.error = fit.cost;
  report.error_meaning =
      "mean of squared differences of force components, coordinates and overhangs, each divided by "
      "its noise";
  report.evaluations = fit.evaluations;
  report.wall_s = fit.wall_s;
  report.settings = {
      {"residuals", arguments.residuals},
      {"force noise (N)", arguments.force_noise},
      {"point noise (m)", arguments.point_noise},
      {"friction of cords", arguments.cord_friction},
      {"cells", static_cast<std::int64_t>(arguments.options.cells)},
      {std::string(intervals_setting), interval_contents(arguments.mesh_error, fit.mesh)},
      {"start", arguments.start}};
  if (arguments.curves && arguments.curves->symmetry == ThreadSymmetry::isotropic)
    report.settings.emplace_back(kSymmetrySetting, "isotropic");
  for (int i = 0; i < fit.fabric.values.size(); ++i) {
    const ParameterInfo info = fit.fabric.info(i);
    ReportParameter p = held_parameter(info, fit.fabric, initial_value(fit.start, info.name));
    p.free = std::find(free.begin(), free.end(), p.name) != free.end();
    p.determined = !p.free;  // until an interval says so
    for (const ParameterInterval& interval : fit.intervals)
      if (interval.name == p.name) add_interval(interval, 1, p);
    report.parameters.push_back(p);
  }
  for (const MechanicalFitStep& step : fit.history) {
    report.history.push_back({step.evaluation, "least squares", step.cost, step.best, 0});
    if (!std::isfinite(step.cost)) ++report.diverged;
  }
  report.certainty = report_certainty(fit.certainty, fit.intervals);
  add_mesh_remark(fit.mesh, report);
  add_inexact_remark(fit.inexact, "frames", report);
  return report;
}

/// result.json with one entry a capture under "mechanical".
std::string result_text(const Report& report, const std::vector<MechanicalCapture>& captures,
                        const std::vector<MechanicalEvaluation>& evaluations,
                        const CurveFitResult& found, const MechanicalReport& shown) {
  nlohmann::json result = nlohmann::json::parse(result_to_json(report));
  nlohmann::json list = nlohmann::json::array();
  for (std::size_t i = 0; i < captures.size(); ++i) {
    nlohmann::json entry = mechanical_json(evaluations[i]);
    entry["name"] = captures[i].name;
    entry["folder"] = captures[i].folder.string();
    entry["cord_friction"] = cord_friction_json(found.fit.cord_friction, i);
    add_series(shown.captures[i], entry);
    list.push_back(entry);
  }
  result["mechanical"] = list;
  result["responses"] = responses_json(shown.responses);
  std::vector<ParameterInfo> infos;
  for (const std::string& name : found.free)
    infos.push_back(found.fit.fabric.info(found.fit.fabric.value_index(name)));
  VecX scaled(static_cast<Eigen::Index>(infos.size()));
  for (std::size_t i = 0; i < infos.size(); ++i)
    scaled[static_cast<Eigen::Index>(i)] =
        to_scaled(infos[i], found.fit.fabric.value(found.free[i]));
  result["mesh_shift"] = mesh_shift_json(infos, scaled, found.fit.mesh);
  if (!found.stages.empty()) add_curves(found, result);
  return result.dump(2) + "\n";
}

void print_result(const Report& report, const MechanicalFitResult& fit,
                  const std::vector<MechanicalCapture>& captures,
                  const std::vector<MechanicalEvaluation>& evaluations) {
  for (const ReportParameter& p : report.parameters) {
    if (!p.free) continue;
    std::string certainty = "not determined by the data";
    for (const ParameterInterval& interval : fit.intervals)
      if (interval.name == p.name) certainty = certainty_text(interval);
    if (p.at_bound != ReportParameter::Bound::none) certainty += ", at the end of its range";
    fmt::print("{:<20} {:>12.5g} {:<11} {}\n", p.name, p.value, p.unit, certainty);
  }
  fmt::print("error {:.5g}, at the start {:.5g}; {} evaluations ({} replayed) in {:.1f} s\n",
             report.error, report.error_initial, report.evaluations, fit.replayed, report.wall_s);
  fmt::print("{}", prior_line(report, fit.prior_weight));
  for (std::size_t i = 0; i < captures.size(); ++i) {
    fmt::print("{}: {}\n", captures[i].name, summary(evaluations[i]));
    fmt::print("{}", complaints(evaluations[i]));
  }
  for (const std::string& remark : report.remarks) fmt::print("warning: {}\n", remark);
}

/// One fit of all parameters, or one of curves where options of those were given; then the stages
/// tell.
CurveFitResult search(const MechanicalFitArguments& arguments,
                      const std::vector<std::shared_ptr<const MechanicalTrial>>& trials,
                      const Fabric& initial, const MechanicalCostOptions& cost) {
  std::optional<Progress> progress;  // not before something was computed
  const CurveFitObserver observer = [&](const std::string& stage, const MechanicalFitStep& step) {
    if (!progress) progress.emplace("least squares", 0);
    progress->update(step.evaluation,
                     fmt::format("{}: error {:.4g}, best {:.4g}{}", stage, step.cost, step.best,
                                 step.replayed ? " (replayed)" : ""));
    return !interrupted();
  };
  MechanicalFitOptions fit;
  fit.mesh_error = arguments.mesh_error;
  CurveFitResult result;
  if (arguments.curves) {
    const MechanicalProblem all(trials, initial, initial.value_names(), cost, arguments.threads);
    CurveFitOptions options = *arguments.curves;
    options.cost = cost;
    options.fit = fit;
    options.threads = arguments.threads;
    const Fabric start = placed(all, initial, arguments);
    const std::vector<std::string> rows = free_rows(arguments, initial);
    options.store = open_mechanical_store(arguments, fit_fingerprint(trials, start, rows, options));
    result = fit_curves(trials, start, rows, options, observer);
  } else {
    result.free = free_parameters(arguments, initial);
    MechanicalProblem problem(trials, initial, result.free, cost, arguments.threads);
    const Fabric start = placed(problem, initial, arguments);
    problem.keep_in(open_mechanical_store(arguments, fit_fingerprint(problem, start, fit)));
    result.fit = fit_mechanical(
        problem, start, fit, [&](const MechanicalFitStep& step) { return observer("all", step); });
  }
  if (progress) progress->finish();
  return result;
}

}  // namespace

void run_mechanical_fit(const MechanicalFitArguments& arguments) {
  const InterruptGuard guard;
  const std::filesystem::path out = arguments.out;
  std::vector<MechanicalCapture> captures;
  std::vector<std::string> names;
  for (const std::string& folder : arguments.captures) {
    captures.push_back(read_mechanical_capture(folder));
    names.push_back(captures.back().name);
  }
  const Fabric initial = start_fabric(arguments, captures);
  if (arguments.curves) free_rows(arguments, initial);  // before the folder is made
  prepare_fit_folder(out, {kMechanicalStoreName}, arguments.existing);
  std::vector<std::shared_ptr<const MechanicalTrial>> trials;
  for (const MechanicalCapture& capture : captures)
    trials.push_back(prepare_mechanical(capture, arguments.options));
  MechanicalCostOptions cost = cost_options(arguments);
  cost.priors = priors_of(arguments.initial);
  const CurveFitResult found = search(arguments, trials, initial, cost);
  const MechanicalFitResult& fit = found.fit;
  write_fabric(out / "fabric.toml", fit.fabric);
  auto frames =
      simulate_mechanical(trials, fit.fabric, MechanicalDerivatives::all, arguments.threads);
  add_cord_friction(trials, fit.cord_friction, frames);
  std::vector<MechanicalEvaluation> evaluations;
  for (std::size_t i = 0; i < trials.size(); ++i)
    evaluations.push_back(compare_mechanical(*trials[i], frames[i]));
  Report report = make_report(arguments, found.free, fit, names);
  add_priors(cost.priors, fit.fabric, fit.prior_weight, fit.prior_error, report);
  add_match_remarks(captures, evaluations, arguments.point_noise, report);
  MechanicalReport shown =
      report_of_mechanical(trials, frames, evaluations, fit.fabric, fit.intervals,
                           fit.certainty.correlation, fit.cord_friction);
  if (arguments.curves) shown.stages = report_stages(found);
  write_text(out / "result.json", result_text(report, captures, evaluations, found, shown));
  write_report_html(out / "report.html", report, {}, shown);
  fmt::print("{}", stage_lines(found));
  print_result(report, fit, captures, evaluations);
  fmt::print("{}", cord_friction_lines(fit.cord_friction));
  fmt::print("{}\n", (out / "report.html").string());
  if (report.stopped) throw CLI::RuntimeError(stopped_early);
}

}  // namespace weft::app
