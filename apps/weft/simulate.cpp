#include <fmt/core.h>

#include <memory>
#include <string>

#include "commands.h"
#include "options.h"
#include "weft/base/error.h"
#include "weft/base/text_file.h"
#include "weft/capture/capture.h"
#include "weft/mesh/mesh_io.h"

namespace weft::app {
namespace {

struct SimulateArguments {
  std::string capture;
  std::string fabric;
  std::string out;
  bool overwrite = false;
  TrialArguments trial;
};

std::string energy_csv(const Scene& scene, const Fabric& fabric, const Trajectory& trajectory) {
  const ClothModel model(scene.mesh, fabric, scene.areal_density, scene.gravity, scene.hem_width);
  std::string text = "time_s,kinetic_J,elastic_J,gravity_J\n";
  for (std::size_t k = 0; k < trajectory.frames.size(); ++k) {
    const Points& v = trajectory.velocities[k];
    const double kinetic =
        0.5 * v.colwise().squaredNorm().transpose().cwiseProduct(model.masses()).sum();
    text += fmt::format("{:.9g},{:.9g},{:.9g},{:.9g}\n", scene.frame_times[k], kinetic,
                        model.elastic_energy(trajectory.frames[k]),
                        model.gravity_energy(trajectory.frames[k]));
  }
  return text;
}

std::string reaction_csv(const Scene& scene, const Trajectory& trajectory) {
  std::string text = "time_s";
  for (const PointFixture& fixture : scene.fixtures) {
    text += fmt::format(",{0}_x_N,{0}_y_N,{0}_z_N", fixture.name);
  }
  text += '\n';
  for (std::size_t k = 0; k < trajectory.reactions.size(); ++k) {
    text += fmt::format("{:.9g}", scene.frame_times[k]);
    for (double force : trajectory.reactions[k].reshaped()) text += fmt::format(",{:.9g}", force);
    text += '\n';
  }
  return text;
}

void run_simulate(const SimulateArguments& arguments) {
  const Fabric fabric = find_fabric(arguments.fabric);
  require_motion_model(fabric);
  const Capture capture = read_capture(arguments.capture);
  const std::filesystem::path out = arguments.out;
  prepare_output_folder(out, {"points.pc2"},
                        arguments.overwrite ? Existing::overwrite : Existing::refuse);
  const auto trial =
      arguments.trial.prepare_for(fabric, capture, TrialArguments::Frames::from_fit_to_end);
  const Trajectory trajectory = simulate(trial->scene, fabric, trial->options.simulation);
  PointCache cache;
  cache.frames = trajectory.frames;
  write_pc2(out / "points.pc2", cache);
  write_obj(out / "start.obj", trial->scene.mesh, trial->scene.start, "where settling starts");
  write_text(out / "energy.csv", energy_csv(trial->scene, fabric, trajectory));
  write_text(out / "reactions.csv", reaction_csv(trial->scene, trajectory));
  fmt::print("{} frames, {} steps, {} factorizations, start: {}\n", trajectory.frames.size(),
             trajectory.steps, trajectory.factorizations, trial->start_name);
  fmt::print("{}\n", (out / "points.pc2").string());
  if (trajectory.diverged) throw Error("the simulation diverged: " + trajectory.divergence);
}

}  // namespace

void add_simulate(CLI::App& app) {
  auto* command = add_command(app, "simulate", "the motion of a fabric in a capture's experiment");
  auto arguments = std::make_shared<SimulateArguments>();
  command->add_option("capture", arguments->capture, "capture folder")->required();
  command->add_option("--fabric", arguments->fabric, "preset or fabric.toml")->required();
  command
      ->add_option("--out", arguments->out,
                   "folder for points.pc2, start.obj, energy.csv, reactions.csv")
      ->required();
  command->add_flag("--overwrite", arguments->overwrite, "replace an earlier result");
  arguments->trial.add_to(*command);
  arguments->trial.add_start_to(*command);
  command->footer(
      "Example:\n  weft simulate data/captures/cotton_waving_A --fabric satin --out out/satin");
  command->callback([arguments] { run_simulate(*arguments); });
}

}  // namespace weft::app
