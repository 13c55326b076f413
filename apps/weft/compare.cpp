#include <fmt/core.h>

#include <memory>
#include <string>

#include "commands.h"
#include "options.h"
#include "weft/base/error.h"
#include "weft/base/interrupt.h"
#include "weft/estimate/cross.h"
#include "weft/estimate/evaluate_capture.h"
#include "weft/report/plot.h"

namespace weft::app {
namespace {

struct CompareArguments {
  std::vector<std::string> captures;
  std::vector<std::string> fabrics;
  std::string keep;
  std::string out;
  bool overwrite = false;
  TrialArguments trial;
};

struct Comparison {
  std::vector<Fabric> fabrics;
  std::vector<std::shared_ptr<const Trial>> trials;
  CrossEvaluation cross;
  VecX sum;
  int selected = 0;
};

Comparison compare_fabrics(const CompareArguments& arguments, std::vector<Fabric> fabrics,
                           const std::vector<Capture>& captures) {
  Comparison c;
  c.fabrics = std::move(fabrics);
  c.trials = arguments.trial.prepare(captures, TrialArguments::Frames::fit);
  c.cross =
      cross_evaluate(c.fabrics, c.trials, arguments.trial.threads(), progress_observer("compare"));
  c.sum = c.cross.error.rowwise().sum();
  Eigen::Index best = 0;
  c.sum.minCoeff(&best);
  c.selected = static_cast<int>(best);
  return c;
}

void print_table(const Comparison& c) {
  fmt::print("error per frame\n{:<28}", "fabric");
  for (const auto& trial : c.trials) fmt::print(" {:>20}", trial->capture.name);
  fmt::print(" {:>12}\n", "sum");
  for (std::size_t i = 0; i < c.fabrics.size(); ++i) {
    fmt::print("{:<28}", c.fabrics[i].name);
    for (double error : c.cross.error.row(static_cast<long>(i))) fmt::print(" {:>20.5g}", error);
    fmt::print(" {:>12.5g}{}\n", c.sum[static_cast<long>(i)],
               static_cast<int>(i) == c.selected ? "  kept" : "");
  }
}

/// By position: names of captures may be the same, or hold slashes.
std::string plot_name(std::size_t capture) { return fmt::format("capture_{}.svg", capture + 1); }

std::vector<std::string> result_names(std::size_t captures) {
  std::vector<std::string> names;
  for (std::size_t k = 0; k < captures; ++k) {
    names.push_back(plot_name(k));
    names.push_back(std::filesystem::path(plot_name(k)).replace_extension(".csv").string());
  }
  return names;
}

/// Error of each frame for each fabric, one picture a capture. Those of an earlier run go, for it
/// may have had more captures.
void write_plots(const CompareArguments& arguments, const Comparison& c) {
  if (arguments.overwrite) remove_results(arguments.out, R"(capture_\d+\.(svg|csv))");
  for (std::size_t column = 0; column < c.trials.size(); ++column) {
    const auto& trial = c.trials[column];
    LinePlot plot;
    plot.title = fmt::format("Error per frame of {}", trial->capture.name);
    plot.x.label = "time";
    plot.x.unit = "s";
    plot.y.label = "error per frame";
    plot.y.from_zero = true;
    for (std::size_t row = 0; row < c.fabrics.size(); ++row) {
      const TrialEvaluation& evaluation = c.cross.evaluations[row * c.trials.size() + column];
      PlotSeries series;
      series.name = c.fabrics[row].name;
      for (std::size_t k = 0; k < evaluation.frames.size(); ++k) {
        series.x.push_back((trial->first_frame + static_cast<double>(k)) /
                           trial->capture.frame_rate);
        series.y.push_back(evaluation.frames[k].total(trial->options.alpha));
      }
      plot.series.push_back(series);
    }
    write_plot(std::filesystem::path(arguments.out) / plot_name(column), plot);
  }
}

/// Before anything is simulated.
void check_outputs(const CompareArguments& arguments) {
  const std::vector<std::string> results = result_names(arguments.captures.size());
  std::vector<NamedFile> fabrics, outputs;
  for (const std::string& name : arguments.fabrics) fabrics.push_back({"one of --fabrics", name});
  if (!arguments.out.empty())
    for (const std::string& name : results)
      outputs.push_back({"--out", std::filesystem::path(arguments.out) / name});
  outputs.push_back({"--keep", arguments.keep});
  refuse_same_file(outputs, fabrics);
  if (!arguments.out.empty())
    prepare_output_folder(arguments.out, results,
                          arguments.overwrite ? Existing::overwrite : Existing::refuse);
  if (!arguments.keep.empty()) check_output_file(arguments.keep);
}

void run_compare(const CompareArguments& arguments) {
  const InterruptGuard guard;
  std::vector<Fabric> fabrics;
  for (const std::string& name : arguments.fabrics) fabrics.push_back(find_fabric(name));
  for (const Fabric& fabric : fabrics) require_motion_model(fabric);
  const std::vector<Capture> captures = read_captures(arguments.captures);
  check_outputs(arguments);
  const Comparison c = compare_fabrics(arguments, std::move(fabrics), captures);
  end_if_stopped(interrupted(), "nothing was compared");
  print_table(c);
  if (!arguments.keep.empty()) {
    write_fabric(arguments.keep, c.fabrics[static_cast<std::size_t>(c.selected)]);
    fmt::print("{}\n", arguments.keep);
  }
  if (!arguments.out.empty()) write_plots(arguments, c);
}

}  // namespace

void add_compare(CLI::App& app) {
  auto* command = add_command(
      app, "compare", "fabrics side by side on some videos; keeps the one with the smallest sum");
  auto arguments = std::make_shared<CompareArguments>();
  command->add_option("captures", arguments->captures, "capture folders, such as two trials")
      ->required();
  command
      ->add_option("--fabrics", arguments->fabrics,
                   "presets or fabric.toml files, such as the "
                   "fits of the two trials")
      ->required();
  command->add_option("--keep", arguments->keep,
                      "write the fabric with the smallest sum of errors to this file");
  command->add_option("--out", arguments->out,
                      "folder for plots of the error of each frame: capture_1.svg and so on, in "
                      "the order of the captures");
  command->add_flag("--overwrite", arguments->overwrite,
                    "with --out: replace the plots of another run");
  arguments->trial.add_to(*command);
  command->footer(
      "Example:\n  weft compare trial1 trial2 --fabrics fit1/fabric.toml fit2/fabric.toml --keep "
      "kept.toml");
  command->callback([arguments, command] {
    refuse_without(*command, "--out", {"--overwrite"});
    run_compare(*arguments);
  });
}

}  // namespace weft::app
