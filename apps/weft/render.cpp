#include <fmt/core.h>

#include <memory>
#include <string>

#include "commands.h"
#include "mechanical.h"
#include "options.h"
#include "weft/base/error.h"
#include "weft/base/interrupt.h"
#include "weft/base/parallel.h"
#include "weft/base/progress.h"
#include "weft/capture/capture.h"
#include "weft/mesh/mesh_io.h"
#include "weft/vision/video.h"

namespace weft::app {
namespace {

struct RenderArguments {
  std::string capture;
  std::string fabric;
  std::string points;
  std::string mesh;
  std::string out;
  bool overwrite = false;
  TrialArguments trial;
};

/// Mesh and frames to render: simulated, or read from files.
struct Motion3d {
  TriangleMesh mesh;
  std::vector<Points> frames;
};

Motion3d read_motion(const RenderArguments& arguments) {
  Motion3d motion{read_material_surface(arguments.mesh).mesh, read_pc2(arguments.points).frames};
  if (motion.frames.front().cols() != motion.mesh.vertex_count()) {
    throw Error(fmt::format("{}: has {} points, {} has {} vertices", arguments.points,
                            motion.frames.front().cols(), arguments.mesh,
                            motion.mesh.vertex_count()));
  }
  return motion;
}

Motion3d simulate_motion(const RenderArguments& arguments, const Capture& capture) {
  const Fabric fabric = find_fabric(arguments.fabric);
  require_motion_model(fabric);
  const auto trial =
      arguments.trial.prepare_for(fabric, capture, TrialArguments::Frames::from_fit_to_end);
  Trajectory trajectory = simulate(trial->scene, fabric, trial->options.simulation);
  if (trajectory.diverged) throw Error("the simulation diverged: " + trajectory.divergence);
  return {trial->scene.mesh, std::move(trajectory.frames)};
}

void run_render(const RenderArguments& arguments) {
  const InterruptGuard guard;
  if (arguments.fabric.empty() == arguments.points.empty()) {
    throw Error("give either --fabric, to simulate, or --points with --mesh");
  }
  const Capture capture = read_capture(arguments.capture);
  const std::filesystem::path out = arguments.out;
  prepare_output_folder(out, {"frame_0000.png"},
                        arguments.overwrite ? Existing::overwrite : Existing::refuse);
  const Motion3d motion =
      arguments.fabric.empty() ? read_motion(arguments) : simulate_motion(arguments, capture);
  Renderer renderer(capture.rig, motion.mesh, arguments.trial.options().render);
  if (arguments.overwrite) remove_results(out, R"(frame_\d{4,}\.png)");
  Progress progress("render", motion.frames.size());
  std::size_t k = 0;
  for (; k < motion.frames.size() && !interrupted(); ++k) {
    write_png(out / fmt::format("frame_{:04d}.png", k),
              renderer.render(motion.frames[k]).intensity);
    progress.update(k + 1);
  }
  progress.finish();
  end_if_stopped(k < motion.frames.size(),
                 fmt::format("{} of {} frames were rendered", k, motion.frames.size()));
  fmt::print("{}\n", (out / "frame_0000.png").string());
}

}  // namespace

void add_render(CLI::App& app) {
  auto* command =
      add_command(app, "render", "what the capture's camera sees of a simulated or given motion");
  auto arguments = std::make_shared<RenderArguments>();
  command->add_option("capture", arguments->capture, "capture folder")->required();
  command->add_option("--fabric", arguments->fabric, "simulate this fabric: preset or fabric.toml");
  auto* points = command->add_option("--points", arguments->points, "render this motion (PC2)");
  auto* mesh = command->add_option("--mesh", arguments->mesh,
                                   "OBJ with the motion's triangles and vt = (u, v)");
  points->needs(mesh);
  mesh->needs(points);
  command->add_option("--out", arguments->out, "folder for frame_0000.png ...")->required();
  command->add_flag("--overwrite", arguments->overwrite, "replace an earlier result");
  arguments->trial.add_to(*command);
  arguments->trial.add_start_to(*command);
  command->footer(
      "Example:\n  weft render data/captures/cotton_waving_A --fabric satin --out out/frames");
  command->callback([arguments, command] {
    refuse_beside(*command, "--points", video_option_names());
    refuse_beside(*command, "--points", {"--threads"});
    run_render(*arguments);
  });
}

}  // namespace weft::app
