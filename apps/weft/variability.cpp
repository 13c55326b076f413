#include "weft/estimate/variability.h"

#include <fmt/core.h>

#include <cmath>
#include <memory>
#include <string>

#include "commands.h"
#include "options.h"
#include "report_of_fit.h"
#include "weft/base/error.h"
#include "weft/base/interrupt.h"
#include "weft/report/figures.h"

namespace weft::app {
namespace {

struct VariabilityArguments {
  std::vector<std::string> captures;
  std::string fabric;
  std::string out = "variability";
  std::vector<std::string> parameters;
  bool overwrite = false;
  TrialArguments trial;
};

void print_table(const std::vector<PerturbationCurve>& curves, const Fabric& fabric) {
  for (const PerturbationCurve& curve : curves) {
    const std::string variability = std::isfinite(curve.variability_percent)
                                        ? fmt::format("{:.3g} %", curve.variability_percent)
                                        : "infinite";
    fmt::print("{:<20} {:>12.5g}  variability {:>9}  {}\n", curve.name, fabric.value(curve.name),
               variability, curve.warning);
  }
}

void run_variability(const VariabilityArguments& arguments) {
  const InterruptGuard guard;
  const Fabric fabric = find_fabric(arguments.fabric);
  require_motion_model(fabric);
  check_parameters("--parameters", fabric.model, arguments.parameters);
  const std::vector<Capture> captures = read_captures(arguments.captures);
  const std::vector<std::string> names =
      arguments.parameters.empty() ? fabric.value_names() : arguments.parameters;
  const std::filesystem::path out = arguments.out;
  prepare_output_folder(out, {"variability.svg"},
                        arguments.overwrite ? Existing::overwrite : Existing::refuse);
  const auto trials = arguments.trial.prepare_for(fabric, captures, TrialArguments::Frames::fit);
  const Problem problem(trials, fabric, names);
  VariabilityOptions options;
  options.threads = arguments.trial.threads();
  const std::vector<PerturbationCurve> curves =
      variability(problem, fabric, options, nullptr, [] { return !interrupted(); });
  std::vector<ReportParameter> rows;
  for (const PerturbationCurve& curve : curves) {
    const int index = problem.index_of(curve.name);
    rows.push_back(report_parameter(problem.info(index), fabric, &curve));
    write_plot(out / (curve.name + ".svg"), perturbation_plot(report_perturbation(curve)));
  }
  if (!rows.empty()) write_plot(out / "variability.svg", variability_chart(rows));
  print_table(curves, fabric);
  end_if_stopped(curves.size() < names.size(),
                 fmt::format("{} of {} parameters are there", curves.size(), names.size()));
  fmt::print("{}\n", (out / "variability.svg").string());
}

}  // namespace

void add_variability(CLI::App& app) {
  auto* command =
      add_command(app, "variability",
                  "how far each parameter can change before the error of videos rises by 1 %");
  auto arguments = std::make_shared<VariabilityArguments>();
  command->add_option("captures", arguments->captures, "capture folders")->required();
  command->add_option("--fabric", arguments->fabric, "preset or fabric.toml")->required();
  command->add_option("--parameters", arguments->parameters, "default: all of the model");
  command->add_option("--out", arguments->out, "folder for the plots")->capture_default_str();
  command->add_flag("--overwrite", arguments->overwrite, "replace an earlier result");
  arguments->trial.add_to(*command);
  arguments->trial.add_starts_to(*command);
  command->footer(
      "Example:\n  weft variability data/captures/cotton_waving_A --fabric out/fabric.toml --out "
      "out/variability");
  command->callback([arguments] { run_variability(*arguments); });
}

}  // namespace weft::app
