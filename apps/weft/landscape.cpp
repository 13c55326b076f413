#include "weft/estimate/landscape.h"

#include <fmt/core.h>

#include <memory>
#include <string>

#include "commands.h"
#include "options.h"
#include "weft/base/error.h"
#include "weft/report/plot.h"

namespace weft::app {
namespace {

struct Arguments {
  std::string capture;
  std::string fabric;
  std::string out = "landscape.svg";
  LandscapeOptions options;
  int count = 16;
  TrialArguments trial;
};

PlotAxis axis_of(const std::string& parameter) {
  const ParameterInfo& info = baraff_witkin_parameters()[static_cast<std::size_t>(
      parameter_index("baraff-witkin", parameter))];
  PlotAxis axis;
  axis.label = parameter;
  axis.unit = info.unit;
  axis.logarithmic = info.scale == Scale::logarithmic;
  return axis;
}

HeatMap to_heat_map(const Landscape& surface, const Fabric& fabric, const std::string& capture) {
  HeatMap map;
  map.title = fmt::format("Error of {} over two parameters", capture);
  map.x_axis = axis_of(surface.x_parameter);
  map.y_axis = axis_of(surface.y_parameter);
  map.x = surface.x;
  map.y = surface.y;
  map.values = surface.error;
  map.label = "error per masked pixel";
  map.unit = "rad^2";
  map.logarithmic = true;
  map.markers = {{fabric.value(surface.x_parameter), fabric.value(surface.y_parameter),
                  fabric.name.empty() ? "given fabric" : fabric.name}};
  return map;
}

void run(Arguments arguments) {
  const Fabric fabric = find_fabric(arguments.fabric);
  const Capture capture = read_capture(arguments.capture);
  const int frames = arguments.options.frame_count;
  const int last = frames == 0 ? capture.fit_last : capture.fit_first + frames - 1;
  if (last > capture.fit_last) {
    throw Error(fmt::format("--frames {}: the capture has {} fit frames", frames,
                            capture.fit_last - capture.fit_first + 1));
  }
  const auto trial = arguments.trial.prepare(capture, capture.fit_first, last);
  LandscapeOptions& options = arguments.options;
  options.x_count = options.y_count = arguments.count;
  options.threads = arguments.trial.threads();
  const Problem problem({trial}, fabric, {options.x_parameter, options.y_parameter});
  const Landscape surface =
      landscape(problem, fabric, options, nullptr, progress_observer("landscape"));
  write_plot(arguments.out, to_heat_map(surface, fabric, capture.name));
  fmt::print("{}{}\n", arguments.out, surface.stopped ? " (stopped early)" : "");
}

}  // namespace

void add_landscape(CLI::App& app) {
  auto* command = app.add_subcommand("landscape", "the error over two parameters, as a picture");
  auto arguments = std::make_shared<Arguments>();
  command->add_option("capture", arguments->capture, "capture folder")->required();
  command->add_option("--fabric", arguments->fabric, "the other parameters: preset or fabric.toml")
      ->required();
  command->add_option("--x", arguments->options.x_parameter, "parameter along x")
      ->capture_default_str();
  command->add_option("--y", arguments->options.y_parameter, "parameter along y")
      ->capture_default_str();
  command->add_option("--count", arguments->count, "values of each")
      ->check(CLI::Range(2, 1000))
      ->capture_default_str();
  command
      ->add_option("--frames", arguments->options.frame_count, "compared frames; 0: all fit frames")
      ->check(CLI::Range(0, 1000000))
      ->capture_default_str();
  command->add_option("--out", arguments->out, "picture (.svg); the data go next to it (.csv)")
      ->capture_default_str();
  arguments->trial.add_to(*command);
  command->footer(
      "Example:\n  weft landscape data/captures/cotton_waving_A --fabric out/fabric.toml --out "
      "landscape.svg");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace weft::app
