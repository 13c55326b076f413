#include "weft/estimate/landscape.h"

#include <fmt/core.h>

#include <memory>
#include <string>

#include "commands.h"
#include "options.h"
#include "weft/base/error.h"
#include "weft/base/interrupt.h"
#include "weft/report/figures.h"

namespace weft::app {
namespace {

struct LandscapeArguments {
  std::string capture;
  std::string fabric;
  std::string out = "landscape.svg";
  LandscapeOptions options;
  std::string y = options.y_parameter;
  int count = 16;
  TrialArguments trial;
};

const ParameterInfo& info_of(const Fabric& fabric, const std::string& parameter) {
  return model_parameters(
      fabric.model)[static_cast<std::size_t>(parameter_index(fabric.model, parameter))];
}

ReportSurface to_report(const Landscape& landscape, const Fabric& fabric,
                        const std::string& capture) {
  const ParameterInfo& x = info_of(fabric, landscape.x_parameter);
  ReportSurface surface;
  surface.capture = capture;
  surface.x_parameter = x.name;
  surface.x_unit = x.unit;
  surface.x_logarithmic = x.scale == Scale::logarithmic;
  surface.x = landscape.x;
  surface.y = landscape.y;
  surface.error = landscape.error;
  surface.x_estimate = fabric.value(x.name);
  if (landscape.y_parameter.empty()) return surface;
  const ParameterInfo& y = info_of(fabric, landscape.y_parameter);
  surface.y_parameter = y.name;
  surface.y_unit = y.unit;
  surface.y_logarithmic = y.scale == Scale::logarithmic;
  surface.y_estimate = fabric.value(y.name);
  return surface;
}

void run_landscape(LandscapeArguments arguments) {
  const InterruptGuard guard;
  const Fabric fabric = find_fabric(arguments.fabric);
  require_motion_model(fabric);
  check_parameters("--x", fabric.model, {arguments.options.x_parameter});
  const bool along_x = arguments.y == "none";
  if (!along_x) check_parameters("--y", fabric.model, {arguments.y});
  const Capture capture = read_capture(arguments.capture);
  check_plot_file("--out", arguments.out);
  const int frames = arguments.options.frame_count;
  const int last = frames == 0 ? capture.fit_last : capture.fit_first + frames - 1;
  if (last > capture.fit_last) {
    throw Error(fmt::format("--frames {}: the capture has {} fit frames", frames,
                            capture.fit_last - capture.fit_first + 1));
  }
  const auto trial = arguments.trial.prepare_for(fabric, capture, capture.fit_first, last);
  LandscapeOptions& options = arguments.options;
  options.x_count = options.y_count = arguments.count;
  options.threads = arguments.trial.threads();
  options.y_parameter = along_x ? "" : arguments.y;
  std::vector<std::string> free{options.x_parameter};
  if (!along_x) free.push_back(options.y_parameter);
  const Problem problem({trial}, fabric, free);
  const Landscape surface =
      landscape(problem, fabric, options, nullptr, progress_observer("landscape"));
  const ReportSurface shown = to_report(surface, fabric, capture.name);
  if (along_x)
    write_plot(arguments.out, surface_line(shown));
  else
    write_plot(arguments.out, surface_map(shown));
  end_if_stopped(surface.stopped, arguments.out + " has gaps");
  fmt::print("{}\n", arguments.out);
}

}  // namespace

void add_landscape(CLI::App& app) {
  auto* command = add_command(
      app, "landscape", "the error of a video over two parameters, or along one, as a picture");
  auto arguments = std::make_shared<LandscapeArguments>();
  command->add_option("capture", arguments->capture, "capture folder")->required();
  command->add_option("--fabric", arguments->fabric, "the other parameters: preset or fabric.toml")
      ->required();
  command->add_option("--x", arguments->options.x_parameter, "parameter along x")
      ->capture_default_str();
  command->add_option("--y", arguments->y, "parameter along y; none: the error along x alone")
      ->capture_default_str();
  command->add_option("--count", arguments->count, "values of each")
      ->check(integer_in(2, 1000))
      ->capture_default_str();
  command
      ->add_option("--frames", arguments->options.frame_count, "compared frames; 0: all fit frames")
      ->check(integer_in(0, 1000000))
      ->capture_default_str();
  command->add_option("--out", arguments->out, "picture (.svg); the data go next to it (.csv)")
      ->capture_default_str();
  arguments->trial.add_to(*command);
  arguments->trial.add_start_to(*command);
  command->footer(
      "Example:\n  weft landscape data/captures/cotton_waving_A --fabric out/fabric.toml --out "
      "landscape.svg");
  command->callback([arguments] { run_landscape(*arguments); });
}

}  // namespace weft::app
