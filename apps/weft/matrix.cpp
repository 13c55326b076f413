#include <fmt/core.h>

#include <cmath>
#include <memory>
#include <string>

#include "commands.h"
#include "options.h"
#include "weft/base/error.h"
#include "weft/estimate/cross.h"
#include "weft/report/plot.h"

namespace weft::app {
namespace {

struct Arguments {
  std::vector<std::string> captures;
  std::vector<std::string> fabrics;
  std::string out = "matrix.svg";
  TrialArguments trial;
};

HeatMap to_heat_map(const CrossEvaluation& cross, const std::vector<Fabric>& fabrics,
                    const std::vector<std::shared_ptr<const Trial>>& trials) {
  HeatMap map;
  map.title = "Each fabric simulated in each capture";
  map.x_axis.label = "fabric";
  map.y_axis.label = "capture";
  for (std::size_t i = 0; i < fabrics.size(); ++i) {
    map.x.push_back(static_cast<double>(i));
    map.x_axis.categories.push_back(fabrics[i].name);
  }
  for (std::size_t j = 0; j < trials.size(); ++j) {
    map.y.push_back(static_cast<double>(j));
    map.y_axis.categories.push_back(trials[j]->capture.name);
  }
  map.values = cross.error_per_mask_pixel.transpose();
  map.label = "error per masked pixel";
  map.unit = "rad^2";
  map.print_values = true;
  map.outline_row_minimum = true;
  return map;
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

void run(const Arguments& arguments) {
  std::vector<Fabric> fabrics;
  for (const std::string& name : arguments.fabrics) fabrics.push_back(find_fabric(name));
  std::vector<std::shared_ptr<const Trial>> trials;
  for (const std::string& folder : arguments.captures) {
    trials.push_back(arguments.trial.prepare(folder, TrialArguments::Frames::fit));
  }
  const CrossEvaluation cross =
      cross_evaluate(fabrics, trials, arguments.trial.threads(), progress_observer("matrix"));
  write_plot(arguments.out, to_heat_map(cross, fabrics, trials));
  print_table(cross, fabrics, trials);
  if (cross.diverged > 0) fmt::print("{} simulations diverged\n", cross.diverged);
  fmt::print("{}\n", arguments.out);
}

}  // namespace

void add_matrix(CLI::App& app) {
  auto* command = app.add_subcommand("matrix", "every fabric against every capture");
  auto arguments = std::make_shared<Arguments>();
  command->add_option("captures", arguments->captures, "capture folders")->required();
  command->add_option("--fabrics", arguments->fabrics, "presets or fabric.toml files")->required();
  command->add_option("--out", arguments->out, "picture (.svg); the data go next to it (.csv)")
      ->capture_default_str();
  arguments->trial.add_to(*command);
  command->footer(
      "Example:\n  weft matrix data/captures/cotton_waving_A --fabrics satin linen "
      "out/fabric.toml");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace weft::app
