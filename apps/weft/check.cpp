#include <fmt/core.h>

#include <algorithm>
#include <memory>
#include <string>

#include "commands.h"
#include "mechanical.h"
#include "scan.h"
#include "weft/capture/capture.h"
#include "weft/vision/silhouette.h"

namespace weft::app {
namespace {

struct Arguments {
  std::string capture;
};

void print_fixtures(const Capture& capture) {
  for (const CaptureFixture& fixture : capture.fixtures) {
    const Vec3 p = fixture.motion.position(fixture.motion.start_time());
    const Vec3 pixel = capture.rig.camera.project(p);
    fmt::print(
        "fixture     {} at (u, v) = ({:g}, {:g}) m: starts at ({:.4f}, {:.4f}, {:.4f}) m, seen "
        "at ({:.1f}, {:.1f}) px\n",
        fixture.name, fixture.at.x(), fixture.at.y(), p.x(), p.y(), p.z(), pixel.x(), pixel.y());
  }
}

void run(const Arguments& arguments) {
  if (capture_kind(arguments.capture) == CaptureKind::mechanical) {
    check_mechanical(arguments.capture);
    return;
  }
  if (capture_kind(arguments.capture) == CaptureKind::scan) {
    check_scan(arguments.capture);
    return;
  }
  const Capture capture = read_capture(arguments.capture);
  fmt::print("capture     {}\n", capture.name);
  if (!capture.description.empty()) fmt::print("            {}\n", capture.description);
  fmt::print("swatch      {:g} x {:g} m, {:g} kg/m^2, {:.4g} kg\n", capture.width, capture.height,
             capture.areal_density, capture.areal_density * capture.width * capture.height);
  if (capture.hem_width > 0) fmt::print("hem         {:g} m\n", capture.hem_width);
  fmt::print("video       {}: {} frames at {:g} 1/s, fit frames {} to {}\n", capture.video.string(),
             capture.frame_count, capture.frame_rate, capture.fit_first, capture.fit_last);
  if (capture.start_surface) {
    read_start_surface(capture, make_swatch(capture.width, capture.height, 2, 2));
    fmt::print("start       {}\n", capture.start_surface->filename().string());
  }
  fmt::print("camera      {} x {} px at ({:.3f}, {:.3f}, {:.3f}) m\n", capture.rig.width,
             capture.rig.height, capture.rig.camera.center().x(), capture.rig.camera.center().y(),
             capture.rig.camera.center().z());
  fmt::print("projector   at ({:.3f}, {:.3f}, {:.3f}) m, stripe period {:g} px\n",
             capture.rig.projector.center().x(), capture.rig.projector.center().y(),
             capture.rig.projector.center().z(), capture.rig.pattern.period);
  print_fixtures(capture);
  // Reading refuses frames of another size and frames without cloth.
  const std::vector<Image> frames = read_video(capture, 0, capture.frame_count - 1);
  const SilhouetteOptions silhouette_options{.stripe_period = image_stripe_period(capture)};
  double low = 1, high = 0;
  for (const Image& frame : frames) {
    const SilhouetteResult found = find_silhouette(frame, silhouette_options);
    const double share =
        found.silhouette.cast<double>().sum() / static_cast<double>(found.silhouette.size());
    low = std::min(low, share);
    high = std::max(high, share);
  }
  fmt::print("cloth       seen in every frame, {:.1f} to {:.1f} % of the image\n", 100 * low,
             100 * high);
  fmt::print("truth       {}\n", capture.truth ? "declared; never read by a fit" : "none");
  fmt::print("ok\n");
}

}  // namespace

void add_check(CLI::App& app) {
  auto* command = app.add_subcommand("check", "read a capture folder and say what is in it");
  auto arguments = std::make_shared<Arguments>();
  command->add_option("capture", arguments->capture, "capture folder")->required();
  command->footer("Example:\n  weft check data/captures/cotton_waving_A");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace weft::app
