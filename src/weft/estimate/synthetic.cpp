#include "weft/estimate/synthetic.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "weft/base/error.h"
#include "weft/base/parallel.h"
#include "weft/estimate/extract_features.h"
#include "weft/registration/stripe_surface.h"

namespace weft {
namespace {

/// A device at `eye` that looks at `target`, y down in the image, square pixels of focal length
/// `focal`.
Pinhole look_at_point(const Vec3& eye, const Vec3& target, double focal, double width,
                      double height, std::string_view name) {
  const Vec3 forward = (target - eye).normalized();
  const Vec3 right = forward.cross(Vec3::UnitZ()).normalized();
  const Vec3 down = forward.cross(right);
  Eigen::Matrix<double, 3, 4> device_from_world;
  Mat3 axes;
  axes.row(0) = right.transpose();
  axes.row(1) = down.transpose();
  axes.row(2) = forward.transpose();
  device_from_world.leftCols<3>() = axes;
  device_from_world.col(3) = -axes * eye;
  Mat3 intrinsics;
  intrinsics << focal, 0, 0.5 * width, 0, focal, 0.5 * height, 0, 0, 1;
  return Pinhole(intrinsics * device_from_world, target, name);
}

/// A cosine's way there and back that starts and ends without a jump of the acceleration: the
/// amplitude grows over the first half period.
Motion waving(const Vec3& rest, const LayoutOptions& options) {
  const int per_frame = 4;
  const int count = per_frame * (options.frame_count - 1) + 2;
  std::vector<double> times;
  Points positions(3, count);
  for (int i = 0; i < count; ++i) {
    const double time = i / (per_frame * options.frame_rate);
    const double phase = 2 * std::numbers::pi * options.wave_frequency * time;
    const double ramp = std::min(1.0, phase / std::numbers::pi);
    const double smooth = ramp * ramp * (3 - 2 * ramp);
    times.push_back(time);
    positions.col(i) = rest + options.wave_amplitude * smooth *
                                  Vec3(-0.5 * (1 - std::cos(phase)), -std::sin(phase), 0);
  }
  return Motion(std::move(times), std::move(positions));
}

void check(const LayoutOptions& options) {
  const auto require = [](bool valid, const char* text) {
    if (!valid) throw Error(fmt::format("layout: {}", text));
  };
  require(options.width > 0 && options.height > 0, "the swatch must have a size");
  require(options.areal_density > 0, "areal_density must be positive");
  require(options.separation > 0.1 && options.separation <= 1, "separation must be in (0.1, 1]");
  require(options.image_width >= 32 && options.image_height >= 32,
          "the image must be at least 32 x 32 px");
  require(options.stripe_period > 0 && options.frame_rate > 0, "periods and rates are positive");
  require(options.frame_count >= 1, "frame_count must be at least 1");
  require(options.fit_frames >= 1 && options.fit_frames <= options.frame_count,
          "fit_frames must be 1 to frame_count");
}

Rig make_rig(const LayoutOptions& options) {
  const double size = std::max(options.width, options.height);
  const Vec3 middle(0, 0, 1 - 0.5 * options.height);
  const double distance = 3 * size;
  // The swatch and a quarter of its size around it fill the smaller side of the image.
  const double focal =
      std::min(options.image_width, options.image_height) * distance / (1.5 * size);
  Rig rig;
  rig.width = options.image_width;
  rig.height = options.image_height;
  rig.camera = look_at_point(middle + distance * Vec3(0.25, -0.95, 0.1), middle, focal,
                             options.image_width, options.image_height, "camera");
  const Vec3 projector_at = middle + distance * Vec3(-0.2, -0.95, 0.45);
  const double projector_focal = 1200;
  rig.projector = look_at_point(projector_at, middle, projector_focal, 1024, 768, "projector");
  // Rows of the projector that a length straight down the swatch covers.
  const double rows_per_metre = std::abs(rig.projector.project(middle + Vec3(0, 0, -1e-3)).y() -
                                         rig.projector.project(middle).y()) *
                                1e3;
  rig.pattern.period = options.stripe_period * rows_per_metre;
  return rig;
}

/// The first `frames` frames.
Scene true_scene(const Capture& layout, const SyntheticOptions& options, int frames) {
  Scene scene = make_scene(layout, options.columns, options.rows, 0, frames - 1);
  scene.mesh =
      make_swatch(layout.width, layout.height, options.columns, options.rows, options.pattern);
  const std::vector<StartShape> starts = generic_starts(scene);
  if (options.start_shape < 0 || options.start_shape >= static_cast<int>(starts.size()))
    throw Error(
        fmt::format("start_shape = {}, valid: 0 to {}", options.start_shape, starts.size() - 1));
  scene.start = starts[static_cast<std::size_t>(options.start_shape)].x;
  return scene;
}

Trajectory true_motion(const Scene& scene, const Fabric& fabric, const SyntheticOptions& options) {
  Trajectory motion = simulate(scene, fabric, options.simulation);
  if (motion.diverged)
    throw Error(fmt::format("the simulation of {} diverged: {}", fabric.name, motion.divergence));
  return motion;
}

std::vector<Image> film(const Rig& rig, const TriangleMesh& mesh, const std::vector<Points>& motion,
                        const SyntheticOptions& options) {
  std::vector<Image> frames(motion.size());
  const auto workers = static_cast<std::size_t>(
      std::min(all_threads(options.threads), static_cast<int>(motion.size())));
  parallel_for(workers, options.threads, [&](std::size_t worker) {
    Renderer renderer(rig, mesh, options.render);
    for (std::size_t i = worker; i < motion.size(); i += workers) {
      frames[i] = renderer.render(motion[i]).intensity;
      if (options.with_noise)
        add_sensor_noise(frames[i], options.noise, options.seed, static_cast<int>(i));
    }
  });
  return frames;
}

}  // namespace

Capture make_layout(const LayoutOptions& options) {
  check(options);
  Capture capture;
  capture.name = options.wave_amplitude > 0 ? "synthetic-waving" : "synthetic-static";
  capture.description = "simulated and rendered by weft";
  capture.width = options.width;
  capture.height = options.height;
  capture.areal_density = options.areal_density;
  capture.frame_rate = options.frame_rate;
  capture.frame_count = options.frame_count;
  capture.fit_first = 0;
  capture.fit_last = options.fit_frames - 1;
  capture.rig = make_rig(options);
  const double half = 0.5 * options.separation * options.width;
  const Vec3 left(-half, 0, 1), right(half, 0, 1);
  // Both paths are sampled, so that they are written as measured paths.
  LayoutOptions still = options;
  still.wave_amplitude = 0;
  capture.fixtures = {{"left corner", Vec2(0, 0), waving(left, still)},
                      {"right corner", Vec2(options.width, 0), waving(right, options)}};
  return capture;
}

Capture make_synthetic_capture(const std::filesystem::path& folder, const Capture& layout,
                               const Fabric& fabric, const SyntheticOptions& options) {
  const Scene scene = true_scene(layout, options, layout.frame_count);
  Trajectory motion = true_motion(scene, fabric, options);
  CaptureFiles files;
  files.frames = film(layout.rig, scene.mesh, motion.frames, options);
  files.as_images = options.as_images;
  files.truth = TruthSurface{scene.mesh, std::move(motion.frames)};
  Capture capture = layout;
  capture.distortion.reset();
  capture.truth.reset();
  write_capture(folder, capture, files);
  return read_capture(folder);
}

std::shared_ptr<const Trial> simulate_trial(const Capture& layout, const Fabric& fabric,
                                            const TrialOptions& options,
                                            const SyntheticOptions& truth) {
  const int frames = layout.fit_last + 1;
  const Scene scene = true_scene(layout, truth, frames);
  const Trajectory motion = true_motion(scene, fabric, truth);
  auto trial = std::make_shared<Trial>();
  trial->capture = layout;
  trial->options = options;
  trial->first_frame = layout.fit_first;
  trial->scene = make_scene(layout, options.columns, options.rows, 0, frames - 1);
  const MaterialLocator locator(scene.mesh);
  trial->scene.start =
      interpolate(scene.mesh, locator, motion.frames.front(), trial->scene.mesh.material);
  trial->start_name = "true surface";
  const std::vector<Points> compared(motion.frames.begin() + layout.fit_first, motion.frames.end());
  trial->features = extract_features(film(layout.rig, scene.mesh, compared, truth), layout,
                                     options.angle_map, truth.threads);
  return trial;
}

}  // namespace weft
