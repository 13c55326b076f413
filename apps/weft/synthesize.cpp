#include <fmt/core.h>

#include <algorithm>
#include <memory>
#include <string>

#include "commands.h"
#include "options.h"
#include "synthesize_rig.h"
#include "synthesize_scan.h"
#include "weft/base/error.h"
#include "weft/estimate/synthetic.h"

namespace weft::app {
namespace {

struct SynthesizeArguments {
  std::string fabric;
  std::string out;
  std::string layout;
  LayoutOptions design;
  SyntheticOptions options;
  int grid = 37;
  bool overwrite = false;
  RigArguments rig;
  SynthesizeScanArguments scan;
};

const std::vector<std::string> kVideoOptions{"--like", "--frames", "--grid", "--steps-per-frame",
                                             "--start-shape"};

/// The fabric, with the areal density of the command where it is given or the fabric has none.
Fabric fabric_with_density(const SynthesizeArguments& arguments, const CLI::App& command) {
  Fabric fabric = find_fabric(arguments.fabric);
  if (command.count("--areal-density") > 0 || !fabric.areal_density)
    fabric.areal_density = arguments.design.areal_density;
  return fabric;
}

void run_rig(const SynthesizeArguments& arguments, const CLI::App& command) {
  refuse_options(command, kVideoOptions, "--rig");
  refuse_options(command, SynthesizeScanArguments::names(), "--rig");
  const Fabric fabric = fabric_with_density(arguments, command);
  arguments.rig.run(fabric, arguments.out, arguments.options.with_noise, arguments.options.seed,
                    arguments.overwrite ? Existing::overwrite : Existing::refuse);
}

void run_scan(const SynthesizeArguments& arguments, const CLI::App& command) {
  refuse_options(command, kVideoOptions, "--scan");
  refuse_options(command, RigArguments::names(), "--scan");
  refuse_without(command, "--clouds", {"--points", "--outliers", "--hole"});
  refuse_beside(command, "--no-noise", {"--noise", "--force-noise"});
  arguments.scan.run(fabric_with_density(arguments, command), arguments.out,
                     arguments.options.with_noise, arguments.options.seed,
                     arguments.overwrite ? Existing::overwrite : Existing::refuse);
}

void run_synthesize(SynthesizeArguments arguments) {
  const Fabric fabric = find_fabric(arguments.fabric);
  prepare_output_folder(arguments.out, {"capture.toml"},
                        arguments.overwrite ? Existing::overwrite : Existing::refuse);
  // The first 50 are for fitting, of a longer capture; all, of a shorter one.
  arguments.design.fit_frames = std::min(arguments.design.fit_frames, arguments.design.frame_count);
  Capture layout =
      arguments.layout.empty() ? make_layout(arguments.design) : read_capture(arguments.layout);
  arguments.options.columns = arguments.options.rows = arguments.grid;
  const Capture made = make_synthetic_capture(arguments.out, layout, fabric, arguments.options);
  fmt::print("{}: {} frames of {}\n", made.folder.string(), made.frame_count, fabric.name);
}

}  // namespace

void add_synthesize(CLI::App& app) {
  auto* command = add_command(
      app, "synthesize", "a capture with known truth: another mesh, finer steps, sensor noise");
  auto arguments = std::make_shared<SynthesizeArguments>();
  command->add_option("--fabric", arguments->fabric, "preset or fabric.toml")->required();
  command->add_option("--out", arguments->out, "capture folder to write")->required();
  command->add_option("--like", arguments->layout,
                      "take rig, swatch and motion from this capture (default: a rig of its own)");
  command
      ->add_option("--areal-density", arguments->design.areal_density,
                   "kg/m^2, without --like; with --rig and --scan the fabric's own unless given")
      ->check(number_in(1e-3, 10))
      ->capture_default_str();
  command->add_option("--frames", arguments->design.frame_count, "without --like")
      ->check(integer_in(1, 100000))
      ->capture_default_str();
  command->add_option("--grid", arguments->grid, "vertices along each side of the truth")
      ->check(integer_in(3, 401))
      ->capture_default_str();
  command->add_option("--steps-per-frame", arguments->options.simulation.steps_per_frame)
      ->check(integer_in(1, 10000))
      ->capture_default_str();
  command
      ->add_option("--start-shape", arguments->options.start_shape,
                   "which of the generic start shapes settles")
      ->capture_default_str();
  command->add_option("--seed", arguments->options.seed, "of the noise")
      ->check(unsigned_integer())
      ->capture_default_str();
  command->add_flag("--no-noise{false}", arguments->options.with_noise, "a perfect sensor");
  command->add_flag("--overwrite", arguments->overwrite, "replace an earlier result");
  arguments->rig.add_to(*command);
  arguments->scan.add_to(*command);
  command->footer(
      "Examples:\n  weft synthesize --fabric satin --out out/satin_capture\n"
      "  weft synthesize --rig --fabric validation/fabrics/rig_denim.toml --out out/denim_rig\n"
      "  weft synthesize --scan --fabric larionov-cotton --clouds --experiments frame:12 "
      "ledge-u:0.05 --out out/cotton_scans");
  command->callback([arguments, command] {
    if (arguments->rig.wanted() && arguments->scan.wanted())
      throw Error("--rig and --scan exclude each other");
    if (arguments->scan.wanted()) {
      run_scan(*arguments, *command);
      return;
    }
    if (arguments->rig.wanted()) {
      run_rig(*arguments, *command);
      return;
    }
    refuse_without(*command, "--rig", RigArguments::names());
    refuse_without(*command, "--scan", SynthesizeScanArguments::names());
    refuse_beside(*command, "--like", {"--frames", "--areal-density"});
    run_synthesize(*arguments);
  });
}

}  // namespace weft::app
