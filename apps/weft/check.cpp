#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>

#include "commands.h"
#include "mechanical.h"
#include "scan.h"
#include "weft/base/error.h"
#include "weft/capture/capture.h"
#include "weft/capture/capture_checks.h"
#include "weft/registration/stripe_surface.h"
#include "weft/vision/silhouette.h"
#include "weft/vision/video.h"

namespace weft::app {
namespace {

struct CheckArguments {
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

/// Times that do not fit together, a line each.
void warn_of_times(const Capture& capture) {
  constexpr double another_rate = 0.01, sparse = 2;  // relative; frames
  const auto stated = stated_frame_rate(capture.video);
  if (stated && std::abs(*stated / capture.frame_rate - 1) > another_rate)
    fmt::print("warning: {} states {:.4g} frames/s; capture.toml has frame_rate = {:g}\n",
               capture.video.filename().string(), *stated, capture.frame_rate);
  const double frames = motion_sample_interval(capture) * capture.frame_rate;
  if (frames > sparse)
    fmt::print(
        "warning: the motion of the fixtures has a sample every {:.3g} frames (median); "
        "between them it is taken to be smooth\n",
        frames);
}

/// What a fit without a start_surface begins with, as weft surface shows it.
void warn_of_start(const Capture& capture, const Image& frame, const Mask& silhouette) {
  constexpr int grid = 25;
  try {
    const Scene scene = make_scene(capture, grid, grid, 0, 0);
    const StripePoints points = decode_stripes(frame, silhouette, capture.rig, scene);
    const SurfaceFit fit = fit_surface(points, silhouette, capture.rig, scene);
    if (!fit.usable)
      fmt::print("warning: frame 0 is not usable as a start: {}; weft surface shows it\n",
                 fit.note);
  } catch (const Error& error) {  // a fixture between the vertices of this grid
    fmt::print("warning: the stripes of frame 0 were not looked at: {}\n", error.what());
  }
}

void run_check(const CheckArguments& arguments) {
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
    if (&frame == &frames.front() && !capture.start_surface)
      warn_of_start(capture, frame, found.silhouette);
  }
  fmt::print("cloth       seen in every frame, {:.1f} to {:.1f} % of the image\n", 100 * low,
             100 * high);
  warn_of_times(capture);
  const StripePattern& pattern = capture.rig.pattern;
  if (pattern.profile == StripePattern::Profile::sine &&
      pattern.edge_gain != StripePattern().edge_gain)
    fmt::print("warning: edge_gain means nothing with pattern = \"sine\", which has no edges\n");
  fmt::print("truth       {}\n", capture.truth ? "declared; never read by a fit" : "none");
  fmt::print("ok\n");
}

}  // namespace

void add_check(CLI::App& app) {
  auto* command = add_command(app, "check", "read a capture folder and say what is in it");
  auto arguments = std::make_shared<CheckArguments>();
  command->add_option("capture", arguments->capture, "capture folder")->required();
  command->footer("Example:\n  weft check data/captures/cotton_waving_A");
  command->callback([arguments] { run_check(*arguments); });
}

}  // namespace weft::app
