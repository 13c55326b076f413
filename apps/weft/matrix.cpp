#include <fmt/core.h>

#include <cmath>
#include <memory>
#include <string>

#include "commands.h"
#include "options.h"
#include "weft/base/error.h"
#include "weft/base/interrupt.h"
#include "weft/estimate/cross.h"
#include "weft/report/figures.h"

namespace weft::app {
namespace {

struct MatrixArguments {
  std::vector<std::string> captures;
  std::vector<std::string> fabrics;
  std::string out = "matrix";
  bool overwrite = false;
  TrialArguments trial;
};

ReportMatrix to_report(const CrossEvaluation& cross, const std::vector<Fabric>& fabrics,
                       const std::vector<std::shared_ptr<const Trial>>& trials) {
  ReportMatrix matrix;
  for (const Fabric& fabric : fabrics) matrix.fabrics.push_back(fabric.name);
  for (const auto& trial : trials) matrix.captures.push_back(trial->capture.name);
  matrix.error = cross.error_per_mask_pixel.transpose();
  return matrix;
}

void print_table(const CrossEvaluation& cross, const std::vector<Fabric>& fabrics,
                 const std::vector<std::shared_ptr<const Trial>>& trials) {
  fmt::print("error per frame\n{:<28}", "capture \\ fabric");
  for (const Fabric& fabric : fabrics) fmt::print(" {:>18}", fabric.name);
  fmt::print("  smallest\n");
  for (std::size_t j = 0; j < trials.size(); ++j) {
    fmt::print("{:<28}", trials[j]->capture.name);
    const VecX row = cross.error.col(static_cast<long>(j));
    for (double error : row) fmt::print(" {:>18.5g}", error);
    Eigen::Index best = 0;
    row.minCoeff(&best);
    fmt::print("  {}\n", fabrics[static_cast<std::size_t>(best)].name);
  }
}

void run_matrix(const MatrixArguments& arguments) {
  const InterruptGuard guard;
  std::vector<Fabric> fabrics;
  for (const std::string& name : arguments.fabrics) fabrics.push_back(find_fabric(name));
  for (const Fabric& fabric : fabrics) require_motion_model(fabric);
  const std::vector<Capture> captures = read_captures(arguments.captures);
  const std::filesystem::path out = arguments.out;
  prepare_output_folder(out, {"matrix.svg"},
                        arguments.overwrite ? Existing::overwrite : Existing::refuse);
  const auto trials = arguments.trial.prepare(captures, TrialArguments::Frames::fit);
  const CrossEvaluation cross =
      cross_evaluate(fabrics, trials, arguments.trial.threads(), progress_observer("matrix"));
  end_if_stopped(interrupted(), "no matrix was written");
  const ReportMatrix matrix = to_report(cross, fabrics, trials);
  write_plot(out / "matrix.svg", matrix_map(matrix));
  write_plot(out / "matrix_lines.svg", matrix_plot(matrix));
  print_table(cross, fabrics, trials);
  if (cross.diverged > 0) fmt::print("{} simulations diverged\n", cross.diverged);
  fmt::print("{}\n", (out / "matrix.svg").string());
}

}  // namespace

void add_matrix(CLI::App& app) {
  auto* command = add_command(app, "matrix", "every fabric against every video");
  auto arguments = std::make_shared<MatrixArguments>();
  command->add_option("captures", arguments->captures, "capture folders")->required();
  command->add_option("--fabrics", arguments->fabrics, "presets or fabric.toml files")->required();
  command
      ->add_option("--out", arguments->out, "folder for the pictures (.svg) and their data (.csv)")
      ->capture_default_str();
  command->add_flag("--overwrite", arguments->overwrite, "replace an earlier result");
  arguments->trial.add_to(*command);
  command->footer(
      "Example:\n  weft matrix data/captures/cotton_waving_A --fabrics satin linen "
      "out/fabric.toml");
  command->callback([arguments] { run_matrix(*arguments); });
}

}  // namespace weft::app
