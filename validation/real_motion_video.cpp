/// Cloth that hangs from its upper edge and is blown by air that nobody measured, as registered to
/// the clouds of a depth camera.
#include <fmt/core.h>

#include <cmath>
#include <cstdio>

#include "real_motion.h"
#include "weft/base/error.h"
#include "weft/mesh/mesh_io.h"

namespace weft::validation {
namespace {

constexpr double kDensity = 0.2;  // kg/m^2: a value, not a measurement
constexpr double kFitShare = 0.6;
constexpr int kVertices = 17;  // along a side, of the simulation
constexpr int kStepsPerFrame = 4;
constexpr double kGravity = 9.81;
constexpr double kPriorFactor = 5;
/// Registered points are off by some 2 mm along the normal (held-back points of the clouds) and 4
/// mm across.
const MotionNoise kNoise{2e-3, 4e-3, 3};

/// The camera's axes: x right, y down, z forward, away from it.
const Vec3 kDown = Vec3::UnitY(), kForward = Vec3::UnitZ();

struct Video {
  int grid = 0;  // points along a side
  double side = 0;
  MotionTracks tracks;
  std::size_t split = 0;
};

Video read_video_tracks(const std::filesystem::path& path, double side, double rate) {
  const PointCache cache = read_pc2(path);
  if (cache.frames.size() < 10) throw Error(path.string() + ": fewer than 10 frames");
  Video video;
  const Eigen::Index points = cache.frames.front().cols();
  video.grid = static_cast<int>(std::lround(std::sqrt(static_cast<double>(points))));
  if (Eigen::Index{video.grid} * video.grid != points)
    throw Error(path.string() + ": not a square grid");
  video.side = side;
  video.tracks.uv = make_swatch(side, side, video.grid, video.grid).material;
  for (std::size_t k = 0; k < cache.frames.size(); ++k) {
    const VecX seen = VecX::Ones(points);
    video.tracks.times.push_back(static_cast<double>(k) / rate);
    video.tracks.normal.push_back(grid_normals(cache.frames[k], seen, video.grid, video.grid));
    video.tracks.position.push_back(cache.frames[k]);
    video.tracks.weight.push_back(seen);
  }
  video.split = static_cast<std::size_t>(kFitShare * static_cast<double>(cache.frames.size()));
  return video;
}

/// Air that gains speed from the first frame on: linear to the middle of the fitted frames, linear
/// to their end, constant from there. At 1 m/s away from the camera, everywhere, until the unknowns
/// are applied.
AirMotion unit_air(const Video& video, const TriangleMesh& mesh) {
  const double end = video.tracks.times[video.split - 1];
  const Points one = kForward.replicate(1, mesh.vertex_count());
  return {{0, 0.5 * end, end}, {0 * one, one, one}};
}

/// Mean places of the upper edge over the fitted frames, at the vertices of `mesh`.
Points mean_shape(const Video& video, const TriangleMesh& mesh, std::size_t frames) {
  const TriangleMesh grid = make_swatch(video.side, video.side, video.grid, video.grid);
  Points mean = Points::Zero(3, video.tracks.uv.cols());
  for (std::size_t k = 0; k < frames; ++k)
    mean += video.tracks.position[k] / static_cast<double>(frames);
  return interpolate(grid, MaterialLocator(grid), mean, mesh.material);
}

MotionTrial trial_of(const Video& video, const MotionTracks& tracks) {
  MotionTrial trial;
  trial.name = "video";
  Scene& scene = trial.experiment.scene;
  scene.mesh = make_swatch(video.side, video.side, kVertices, kVertices);
  scene.areal_density = kDensity;
  scene.start = mean_shape(video, scene.mesh, 1);
  const Points held = mean_shape(video, scene.mesh, video.split);
  for (int column = 0; column < kVertices; ++column)
    scene.fixtures.push_back({"upper edge", column, Motion::fixed(held.col(column))});
  scene.frame_times = tracks.times;
  scene.gravity = kGravity * kDown;
  trial.experiment.air = unit_air(video, scene.mesh);
  trial.simulation.steps_per_frame = kStepsPerFrame;
  trial.simulation.newton_tolerance = 1e-7;
  trial.tracks = tracks;
  return trial;
}

SceneUnknown unknown(std::string_view name, std::string_view unit, double lower, double upper,
                     double initial, std::function<void(double, MotionExperiment&)> apply) {
  SceneUnknown u;
  u.info = {name, unit, lower, upper, initial, Scale::linear, "", ""};
  u.initial = initial;
  u.apply = std::move(apply);
  u.step = 0.01;
  return u;
}

SceneUnknown speed(std::string_view name, std::size_t knot) {
  return unknown(name, "m/s", 0, 8, 1,
                 [knot](double s, MotionExperiment& e) { e.air.velocity[knot] *= s; });
}

SceneUnknown gradient(std::string_view name, Eigen::Index axis, double side) {
  return unknown(name, "1/m", -3, 3, 0, [axis, side](double g, MotionExperiment& e) {
    const auto& uv = e.scene.mesh.material;
    for (Points& v : e.air.velocity)
      for (Eigen::Index i = 0; i < v.cols(); ++i) v.col(i) *= 1 + g * (uv(axis, i) - side / 2);
  });
}

enum class Gravity { known, unknown };
enum class Material { defaults, unknown };

MotionUnknowns unknowns_of(const Video& video, Material material, Gravity gravity) {
  MotionUnknowns unknowns;
  if (material == Material::unknown) {
    for (const ParameterInfo& p : baraff_witkin_parameters()) {
      unknowns.free.emplace_back(p.name);
      unknowns.priors.push_back({std::string(p.name), p.default_value, kPriorFactor});
    }
  }
  unknowns.scene = {unknown("tilt", "rad", -0.3, 0.3, 0.07,
                            [](double a, MotionExperiment& e) {
                              const double g = e.scene.gravity.norm();
                              e.scene.gravity = g * (std::cos(a) * kDown - std::sin(a) * kForward);
                            }),
                    speed("air_speed_middle", 1), speed("air_speed_end", 2),
                    gradient("air_gradient_u", 0, video.side),
                    gradient("air_gradient_v", 1, video.side)};
  if (gravity == Gravity::unknown)
    unknowns.scene.push_back(unknown(
        "gravity", "m/s^2", 1, 25, kGravity,
        [](double g, MotionExperiment& e) { e.scene.gravity *= g / e.scene.gravity.norm(); }));
  return unknowns;
}

std::vector<Points> held(const Video& video) {
  std::vector<Points> out = video.tracks.position;
  for (std::size_t k = video.split; k < out.size(); ++k) out[k] = out[video.split - 1];
  return out;
}

/// On at the velocity of the last `frames` fitted frames (a line through each point).
std::vector<Points> extrapolated(const Video& video, int frames) {
  std::vector<Points> out = video.tracks.position;
  const std::size_t last = video.split - 1;
  const double middle = static_cast<double>(last) - 0.5 * (frames - 1);
  Points mean = 0 * out[0], slope = 0 * out[0];
  double square = 0;
  for (int i = 0; i < frames; ++i) {
    const std::size_t k = last - static_cast<std::size_t>(i);
    const double t = static_cast<double>(k) - middle;
    mean += out[k] / frames;
    slope += t * out[k];
    square += t * t;
  }
  for (std::size_t k = video.split; k < out.size(); ++k)
    out[k] = mean + (static_cast<double>(k) - middle) / square * slope;
  return out;
}

Prediction fit_and_predict(const Video& video, const std::string& name, Material material,
                           Gravity gravity, const std::filesystem::path& out) {
  const Fabric start = Fabric::with_defaults("defaults");
  const MotionUnknowns unknowns = unknowns_of(video, material, gravity);
  const MotionProblem problem({trial_of(video, frames_of(video.tracks, 0, video.split))}, start,
                              unknowns, kNoise);
  const MotionFitResult fit = fit_motion(problem, problem.initial());
  fmt::print("{}\n", name);
  print_intervals(fit);
  std::fflush(stdout);
  const MotionProblem whole({trial_of(video, video.tracks)}, start, unknowns, kNoise);
  const auto found = whole.simulate(fit.scaled);
  if (found[0].diverged) throw Error(name + ": diverged: " + found[0].divergence);
  if (material == Material::unknown) write_fabric(out / "fabric.toml", fit.fabric);
  return {name, found[0].position};
}

}  // namespace

void study_video(const std::filesystem::path& out, const std::filesystem::path& registered,
                 double side, double rate) {
  std::filesystem::create_directories(out);
  const Video video = read_video_tracks(registered, side, rate);
  std::vector<Prediction> predictions{
      {"last fitted frame held", held(video)},
      {"last 5 frames' velocity kept", extrapolated(video, 5)},
  };
  const Fabric start = Fabric::with_defaults("defaults");
  MotionTrial still = trial_of(video, video.tracks);
  still.experiment.air = {};
  MotionUnknowns tilt = unknowns_of(video, Material::defaults, Gravity::known);
  tilt.scene.resize(1);
  const MotionProblem rest({still}, start, tilt, kNoise);
  predictions.push_back({"defaults, still air", rest.simulate(rest.initial())[0].position});
  predictions.push_back(fit_and_predict(video, "air fitted, default fabric", Material::defaults,
                                        Gravity::known, out));
  predictions.push_back(
      fit_and_predict(video, "air and fabric fitted", Material::unknown, Gravity::known, out));
  predictions.push_back(fit_and_predict(video, "air, fabric and gravity fitted", Material::unknown,
                                        Gravity::unknown, out));
  fmt::print("video: {} frames, {} fitted\n", video.tracks.times.size(), video.split);
  print_distances(video.tracks, video.split, predictions);
  write_distances(out / "video_distance.svg", "registered video", video.tracks, video.split,
                  predictions);
}

}  // namespace weft::validation
