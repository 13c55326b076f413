#include <fmt/core.h>

#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "commands.h"
#include "mechanical.h"
#include "options.h"
#include "report_of_mechanical.h"
#include "scan.h"
#include "weft/base/error.h"
#include "weft/capture/capture.h"
#include "weft/estimate/evaluate_capture.h"

namespace weft::app {
namespace {

struct EvaluateArguments {
  std::string capture;
  std::string fabric;
  std::string strip;
  bool json = false;
  TrialArguments trial;
  MechanicalArguments mechanical;
  ScanArguments scan;
};

nlohmann::json to_json(const CaptureEvaluation::Part& part) {
  nlohmann::json object = {{"first", part.first},
                           {"last", part.last},
                           {"error", json_number(part.error)},
                           {"fold", json_number(part.fold)},
                           {"silhouette", json_number(part.silhouette)},
                           {"error_per_mask_pixel", json_number(part.error_per_mask_pixel)}};
  if (part.distance) add_distance(object, *part.distance);
  return object;
}

nlohmann::json to_json(const CaptureEvaluation& evaluation) {
  nlohmann::json frames = nlohmann::json::array();
  for (const CaptureEvaluation::Frame& frame : evaluation.frames) {
    nlohmann::json object = {{"frame", frame.frame},
                             {"error", json_number(frame.total)},
                             {"fold", json_number(frame.error.fold)},
                             {"silhouette", json_number(frame.error.silhouette)}};
    if (frame.distance) add_distance(object, *frame.distance);
    frames.push_back(object);
  }
  return {{"fit", to_json(evaluation.fit)},
          {"validation",
           evaluation.validation ? to_json(*evaluation.validation) : nlohmann::json(nullptr)},
          {"frames", frames},
          {"diverged", evaluation.diverged},
          {"divergence", evaluation.divergence},
          {"start", evaluation.start_name},
          {"wall_s", evaluation.wall_s}};
}

void print_part(const char* name, const CaptureEvaluation::Part& part) {
  fmt::print(
      "{:<11} frames {:>3} to {:>3}: error {:.4g} per frame (fold {:.4g}, silhouette {:.4g}), "
      "{:.4g} per masked pixel",
      name, part.first, part.last, part.error, part.fold, part.silhouette,
      part.error_per_mask_pixel);
  if (part.distance) {
    fmt::print("; distance to the truth: mean {:.2f}, rms {:.2f}, max {:.1f} mm",
               1e3 * part.distance->mean, 1e3 * part.distance->rms, 1e3 * part.distance->max);
  }
  fmt::print("\n");
}

void run_mechanical(const EvaluateArguments& arguments) {
  const Fabric fabric = find_fabric(arguments.fabric);
  const auto trial = prepare_mechanical(read_mechanical_capture(arguments.capture),
                                        arguments.mechanical.options());
  if (!arguments.strip.empty()) {
    if (!trial->capture.overhang)
      throw Error(fmt::format("--strip: capture \"{}\" is no overhang test", trial->capture.name));
    check_plot_file("--strip", arguments.strip);
  }
  const auto frames =
      simulate_mechanical({trial}, fabric, MechanicalDerivatives::none, arguments.trial.threads());
  const MechanicalEvaluation evaluation = compare_mechanical(*trial, frames.front());
  if (!arguments.strip.empty())
    write_plot(arguments.strip, overhang_plot(report_of_overhang(*trial, frames.front().front())));
  if (arguments.json)
    fmt::print("{}\n", mechanical_json(evaluation).dump(2));
  else
    fmt::print("{}\n{}", summary(evaluation), complaints(evaluation));
}

void run_evaluate(const EvaluateArguments& arguments) {
  const Fabric fabric = find_fabric(arguments.fabric);
  const Capture capture = read_capture(arguments.capture);
  const auto trial =
      arguments.trial.prepare_for(fabric, capture, TrialArguments::Frames::from_fit_to_end);
  const CaptureEvaluation evaluation =
      evaluate_capture(*trial, fabric, TruthDistance::included, arguments.trial.threads());
  if (arguments.json) {
    fmt::print("{}\n", to_json(evaluation).dump(2));
    return;
  }
  print_part("fit", evaluation.fit);
  if (evaluation.validation) print_part("validation", *evaluation.validation);
  if (evaluation.diverged) fmt::print("diverged: {}\n", evaluation.divergence);
}

}  // namespace

void add_evaluate(CLI::App& app) {
  auto* command = add_command(app, "evaluate",
                              "how well a fabric explains a capture: fit frames and later "
                              "ones of a video apart; forces and "
                              "shapes of a mechanical test or a scan");
  auto arguments = std::make_shared<EvaluateArguments>();
  command->add_option("capture", arguments->capture, "capture folder")->required();
  command->add_option("--fabric", arguments->fabric, "preset or fabric.toml")->required();
  command->add_option("--strip", arguments->strip,
                      "of an overhang test: picture of the computed strip and the inclined plane, "
                      ".svg, with its numbers as .csv beside it");
  command->add_flag("--json", arguments->json, "print one JSON object");
  arguments->trial.add_to(*command);
  arguments->trial.add_start_to(*command);
  arguments->mechanical.add_to(*command);
  arguments->scan.add_to(*command);
  command->footer(
      "Example:\n  weft evaluate data/captures/cotton_waving_A --fabric out/fabric.toml --json");
  command->callback([arguments, command] {
    const CaptureKind kind = capture_kind(arguments->capture);
    if (kind != CaptureKind::mechanical)
      refuse_options(*command, {"--strip"}, "anything but an overhang test");
    if (kind == CaptureKind::scan) {
      refuse_options(*command, video_option_names(), "a scan");
      const ScanCapture capture = read_scan_capture(arguments->capture);
      check_registered_cells(*command, {capture});
      evaluate_scan(capture, arguments->fabric,
                    arguments->scan.options(*command, arguments->trial.threads()),
                    *arguments->scan.solver(), arguments->json, arguments->trial.threads());
      return;
    }
    refuse_options(*command, ScanArguments::names(), "anything but a scan");
    if (kind == CaptureKind::mechanical) {
      refuse_options(*command, video_option_names(), "a mechanical capture");
      run_mechanical(*arguments);
    } else {
      refuse_options(*command, MechanicalArguments::names(), "a video");
      run_evaluate(*arguments);
    }
  });
}

}  // namespace weft::app
