#include <fmt/core.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "commands.h"
#include "options.h"
#include "weft/base/error.h"
#include "weft/capture/capture.h"
#include "weft/capture/capture_checks.h"
#include "weft/mesh/mesh_io.h"
#include "weft/registration/stripe_surface.h"
#include "weft/vision/silhouette.h"

namespace weft::app {
namespace {

struct SurfaceArguments {
  std::string capture;
  std::string out = "surface.obj";
  int frame = 0;
  int grid = 41;
  bool json = false;
};

void check_mesh_name(const std::filesystem::path& path) {
  if (path.extension() == ".ply" || path.extension() == ".obj") return;
  throw Error(fmt::format("{}: the ending of a mesh file is .obj or .ply", path.string()));
}

void write_mesh(const std::filesystem::path& path, const TriangleMesh& mesh, const Points& x,
                const std::string& comment) {
  if (path.extension() == ".ply") {
    write_ply(path, mesh, x);
  } else {
    write_obj(path, mesh, x, comment);
  }
}

void run_surface(const SurfaceArguments& arguments) {
  const Capture capture = read_capture(arguments.capture);
  if (arguments.frame >= capture.frame_count) {
    throw Error(fmt::format("--frame {}: the capture has frames 0 to {}", arguments.frame,
                            capture.frame_count - 1));
  }
  const int k = arguments.frame;
  check_mesh_name(arguments.out);
  if (capture.truth)
    refuse_same_file({{"--out", arguments.out}},
                     {{"the capture's truth.rest_mesh", capture.truth->rest_mesh}});
  check_output_file(arguments.out);
  const Image frame = read_video(capture, k, k).front();
  const Scene scene = make_scene(capture, arguments.grid, arguments.grid, k, k);
  const SilhouetteOptions silhouette_options{.stripe_period = image_stripe_period(capture)};
  const Mask silhouette = find_silhouette(frame, silhouette_options).silhouette;
  const StripePoints points = decode_stripes(frame, silhouette, capture.rig, scene);
  const SurfaceFit fit = fit_surface(points, silhouette, capture.rig, scene);
  if (!fit.x.allFinite())
    throw Error(
        fmt::format("{}: frame {}: no surface was found: {} stripe points leave vertices "
                    "without a position",
                    arguments.capture, k, fit.points));
  write_mesh(arguments.out, scene.mesh, fit.x,
             fmt::format("surface of {} frame {}", capture.name, k));

  nlohmann::json result = {{"frame", k},
                           {"points", fit.points},
                           {"usable", fit.usable},
                           {"note", fit.note},
                           {"residual_median", fit.residual_median},
                           {"residual_p95", fit.residual_p95},
                           {"unsupported_vertices", (fit.support.array() == 0).count()},
                           {"mesh", arguments.out}};
  if (capture.truth) {
    const TruthSurface truth = read_truth(capture);
    const SurfaceDistance d = distance_to_truth(scene.mesh, fit.x, truth, k);
    result["distance_mean"] = d.mean;
    result["distance_rms"] = d.rms;
    result["distance_max"] = d.max;
  }
  if (arguments.json) {
    fmt::print("{}\n", result.dump(2));
    return;
  }
  fmt::print("{} stripe points, fitted to {:.2f} mm (median), {:.2f} mm (95 %)\n", fit.points,
             1e3 * fit.residual_median, 1e3 * fit.residual_p95);
  if (!fit.usable) fmt::print("not usable as a start: {}\n", fit.note);
  if (result.contains("distance_mean")) {
    fmt::print(
        "distance to the true surface at the same (u, v): mean {:.2f} mm, rms {:.2f} mm, max "
        "{:.2f} mm\n",
        1e3 * result["distance_mean"].get<double>(), 1e3 * result["distance_rms"].get<double>(),
        1e3 * result["distance_max"].get<double>());
  }
  fmt::print("mesh: {}\n", arguments.out);
}

}  // namespace

void add_surface(CLI::App& app) {
  auto* command =
      add_command(app, "surface", "the surface of one frame from its stripes, as a mesh");
  auto arguments = std::make_shared<SurfaceArguments>();
  command->add_option("capture", arguments->capture, "capture folder")->required();
  command->add_option("--frame", arguments->frame, "frame of the video, from 0")
      ->check(integer_in(0, kMaxFrames - 1))
      ->capture_default_str();
  command->add_option("--grid", arguments->grid, "vertices along each side")
      ->check(integer_in(3, 401))
      ->capture_default_str();
  command->add_option("--out", arguments->out, "mesh to write, .obj or .ply")
      ->capture_default_str();
  command->add_flag("--json", arguments->json, "print JSON");
  command->footer(
      "Example:\n  weft surface data/captures/cotton_waving_A --frame 0 --out frame0.obj");
  command->callback([arguments] { run_surface(*arguments); });
}

}  // namespace weft::app
