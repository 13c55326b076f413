/// Cloth that hangs and is blown by air that nobody measured, as registered to the clouds of a
/// depth camera. What holds it is one of its upper rows, which moves as registered.
#include <fmt/core.h>

#include <Eigen/Cholesky>
#include <algorithm>
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
/// Above this row of 32 the cloth is rolled over what holds it; below it hangs.
constexpr int kHeldRow = 4;
/// Frames on either side that smooth the motion of the held row: registration jitters by 2 mm from
/// frame to frame, 2 m/s^2.
constexpr int kSmoothing = 5;
constexpr double kGravity = 9.81;
constexpr double kPriorFactor = 5;
constexpr double kMostAddedMass = 15;
/// Registered points are off by some 2 mm along the normal (held-back points of the clouds) and 4
/// mm across.
const MotionNoise kNoise{2e-3, 4e-3, 3};

/// The camera's axes: x right, y down, z forward, away from it.
const Vec3 kDown = Vec3::UnitY(), kForward = Vec3::UnitZ();

struct Video {
  int grid = 0;                  // points along the width
  double width = 0, height = 0;  // m, from the held row on
  MotionTracks tracks;           // the rows below
  std::vector<Points> edge;      // a frame: the held row
  std::size_t split = 0;
};

/// Each point on the parabola through the frames about it (least squares).
std::vector<Points> smoothed(const std::vector<Points>& frames) {
  const auto count = static_cast<int>(frames.size());
  std::vector<Points> out;
  for (int k = 0; k < count; ++k) {
    const int first = std::max(0, k - kSmoothing), last = std::min(count - 1, k + kSmoothing);
    MatX powers(last - first + 1, 3);
    for (int i = first; i <= last; ++i) powers.row(i - first) << 1, i - k, (i - k) * (i - k);
    const VecX weight =
        powers * (powers.transpose() * powers).ldlt().solve(Vec3::UnitX());  // of the value at k
    out.emplace_back(Points::Zero(3, frames[0].cols()));
    for (int i = first; i <= last; ++i)
      out.back() += weight[i - first] * frames[static_cast<std::size_t>(i)];
  }
  return out;
}

Video read_video_tracks(const std::filesystem::path& path, double side, double rate) {
  const PointCache cache = read_pc2(path);
  if (cache.frames.size() < 10) throw Error(path.string() + ": fewer than 10 frames");
  Video video;
  const Eigen::Index points = cache.frames.front().cols();
  video.grid = static_cast<int>(std::lround(std::sqrt(static_cast<double>(points))));
  if (Eigen::Index{video.grid} * video.grid != points)
    throw Error(path.string() + ": not a square grid");
  const double cell = side / (video.grid - 1);
  video.width = side;
  video.height = side - kHeldRow * cell;
  const Eigen::Index above = Eigen::Index{kHeldRow + 1} * video.grid, below = points - above;
  video.tracks.uv.resize(2, below);
  for (Eigen::Index p = 0; p < below; ++p) {
    const Eigen::Index column = p % video.grid, row = p / video.grid + 1;
    video.tracks.uv.col(p) = Vec2(static_cast<double>(column) * cell,
                                  std::min(video.height, static_cast<double>(row) * cell));
  }
  for (std::size_t k = 0; k < cache.frames.size(); ++k) {
    const Points& x = cache.frames[k];
    video.tracks.times.push_back(static_cast<double>(k) / rate);
    const Points normals = grid_normals(x, VecX::Ones(points), video.grid, video.grid);
    video.tracks.normal.emplace_back(normals.rightCols(below));
    video.tracks.position.emplace_back(x.rightCols(below));
    video.tracks.weight.push_back(VecX::Ones(below));
    video.edge.emplace_back(x.middleCols(Eigen::Index{kHeldRow} * video.grid, video.grid));
  }
  video.edge = smoothed(video.edge);
  video.split = static_cast<std::size_t>(kFitShare * static_cast<double>(cache.frames.size()));
  return video;
}

/// Air that gains speed from the first frame on: linear to the middle of the fitted frames, linear
/// to their end, linear to the last frame. At 1 m/s away from the camera, everywhere, until the
/// unknowns are applied.
AirMotion unit_air(const Video& video, const TriangleMesh& mesh) {
  const double end = video.tracks.times[video.split - 1];
  const Points one = kForward.replicate(1, mesh.vertex_count());
  return {{0, 0.5 * end, end, video.tracks.times.back()}, {0 * one, one, one, one}};
}

MotionTrial trial_of(const Video& video, const MotionTracks& tracks) {
  MotionTrial trial;
  trial.name = "video";
  Scene& scene = trial.experiment.scene;
  scene.mesh = make_swatch(video.width, video.height, kVertices, kVertices);
  scene.areal_density = kDensity;
  // Paths of the held row at the columns of the mesh; below it the sheet hangs flat.
  const double cell = video.width / (video.grid - 1);
  scene.start.resize(3, scene.mesh.vertex_count());
  for (int column = 0; column < kVertices; ++column) {
    const double place = scene.mesh.material(0, column) / cell;
    const Eigen::Index left =
        std::min(static_cast<Eigen::Index>(place + 1e-9), Eigen::Index{video.grid - 2});
    const double share = place - static_cast<double>(left);
    Points path(3, static_cast<Eigen::Index>(video.edge.size()));
    for (Eigen::Index k = 0; k < path.cols(); ++k) {
      const Points& edge = video.edge[static_cast<std::size_t>(k)];
      path.col(k) = (1 - share) * edge.col(left) + share * edge.col(left + 1);
    }
    scene.fixtures.push_back({"held row", column, Motion(video.tracks.times, path)});
    for (int row = 0; row < kVertices; ++row) {
      const int i = row * kVertices + column;
      scene.start.col(i) = path.col(0) + scene.mesh.material(1, i) * kDown;
    }
  }
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

/// Which frames tell of the air.
enum class AirFrom { fitted_frames, all_frames };

enum class Knots { one, from_one_on };

/// Of a knot of the air, or of it and all after it.
SceneUnknown speed(std::string_view name, std::size_t knot, Knots knots) {
  return unknown(name, "m/s", 0, 8, 1, [knot, knots](double s, MotionExperiment& e) {
    const std::size_t end = knots == Knots::one ? knot + 1 : e.air.velocity.size();
    for (std::size_t k = knot; k < end; ++k) e.air.velocity[k] *= s;
  });
}

/// Speeds change by this part of themselves a metre.
SceneUnknown gradient(std::string_view name, Eigen::Index axis, double side) {
  return unknown(name, "1/m", -15, 15, 0, [axis, side](double g, MotionExperiment& e) {
    const auto& uv = e.scene.mesh.material;
    for (Points& v : e.air.velocity)
      for (Eigen::Index i = 0; i < v.cols(); ++i)
        v.col(i) *= std::exp(g * (uv(axis, i) - side / 2));
  });
}

enum class AirMass { none, unknown };
/// What of the fabric is searched: nothing; what moves a hanging sheet most; all.
enum class Material { defaults, few, all };

MotionUnknowns unknowns_of(const Video& video, Material material, AirMass air_mass,
                           AirFrom air_from = AirFrom::fitted_frames) {
  MotionUnknowns unknowns;
  if (material != Material::defaults) {
    for (const ParameterInfo& p : baraff_witkin_parameters()) {
      if (material == Material::few && p.name != "bend_stiffness" && p.name != "drag_quadratic")
        continue;
      unknowns.free.emplace_back(p.name);
      unknowns.priors.push_back({std::string(p.name), p.default_value, kPriorFactor});
    }
  }
  unknowns.scene = {unknown("tilt", "rad", -0.3, 0.3, 0.07,
                            [](double a, MotionExperiment& e) {
                              const double g = e.scene.gravity.norm();
                              e.scene.gravity = g * (std::cos(a) * kDown - std::sin(a) * kForward);
                            }),
                    speed("air_speed_middle", 1, Knots::one),
                    speed("air_speed_end", 2,
                          air_from == AirFrom::fitted_frames ? Knots::from_one_on : Knots::one),
                    gradient("air_gradient_u", 0, video.width),
                    gradient("air_gradient_v", 1, video.height)};
  if (air_from == AirFrom::all_frames)
    unknowns.scene.push_back(speed("air_speed_last", 3, Knots::one));
  if (air_mass == AirMass::unknown) unknowns.scene.push_back(added_mass(kMostAddedMass));
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

std::vector<Points> simulated(const MotionProblem& problem, const VecX& scaled) {
  auto found = problem.simulate(scaled);
  if (found[0].diverged) throw Error("video: diverged: " + found[0].divergence);
  return std::move(found[0].position);
}

/// What the fitted frames say of the others, and what their fabric says where the air alone is
/// fitted to all frames: the latter is no prediction of the motion.
struct Setting {
  std::string key, name;
  Material material = Material::defaults;
  AirMass air_mass = AirMass::none;
};
const std::vector<Setting>& settings() {
  static const std::vector<Setting> kAll{
      {"air", "default fabric, air fitted", Material::defaults, AirMass::none},
      {"few", "bend, drag, air fitted", Material::few, AirMass::none},
      {"few_mass", "bend, drag, air, added mass fitted", Material::few, AirMass::unknown},
      {"all", "fabric and air fitted", Material::all, AirMass::none},
      {"all_mass", "fabric, air, added mass fitted", Material::all, AirMass::unknown}};
  return kAll;
}

void fit_and_predict(const Video& video, const Setting& setting, const std::filesystem::path& out,
                     std::vector<Prediction>& predictions) {
  const auto& [key, name, material, air_mass] = setting;
  const Fabric start = Fabric::with_defaults("defaults");
  const MotionUnknowns unknowns = unknowns_of(video, material, air_mass);
  const MotionProblem problem({trial_of(video, frames_of(video.tracks, 0, video.split))}, start,
                              unknowns, kNoise);
  const MotionFitResult fit = fit_motion(problem, problem.initial(), fit_options());
  fmt::print("{}\n", name);
  print_intervals(fit);
  const MotionProblem whole({trial_of(video, video.tracks)}, start, unknowns, kNoise);
  predictions.push_back({name, simulated(whole, fit.scaled)});
  if (material != Material::defaults) write_fabric(out / (key + "_fabric.toml"), fit.fabric);

  MotionTrial kept = trial_of(video, video.tracks);
  if (air_mass == AirMass::unknown) {
    const ParameterInfo& info = problem.infos().back();
    kept.experiment.scene.gravity /= 1 + from_scaled(info, fit.scaled[fit.scaled.size() - 1]);
  }
  const MotionProblem air(
      {kept}, fit.fabric,
      unknowns_of(video, Material::defaults, AirMass::none, AirFrom::all_frames), kNoise);
  const MotionFitResult blown = fit_motion(air, air.initial(), fit_options());
  fmt::print("{}; air of all frames\n", name);
  print_intervals(blown);
  std::fflush(stdout);
  predictions.push_back({name + "; air of all frames", simulated(air, blown.scaled)});
}

}  // namespace

void study_video(const std::filesystem::path& out, const std::filesystem::path& registered,
                 double side, double rate, const std::vector<std::string>& keys) {
  std::filesystem::create_directories(out);
  const Video video = read_video_tracks(registered, side, rate);
  std::vector<Prediction> predictions{
      {"last fitted frame held", held(video)},
      {"last 5 frames' velocity kept", extrapolated(video, 5)},
  };
  const Fabric start = Fabric::with_defaults("defaults");
  MotionTrial still = trial_of(video, video.tracks);
  still.experiment.air = {};
  MotionUnknowns tilt = unknowns_of(video, Material::defaults, AirMass::none);
  tilt.scene.resize(1);
  const MotionProblem rest({still}, start, tilt, kNoise);
  predictions.push_back({"default fabric, still air", simulated(rest, rest.initial())});
  for (const Setting& setting : settings())
    if (keys.empty() || std::find(keys.begin(), keys.end(), setting.key) != keys.end())
      fit_and_predict(video, setting, out, predictions);
  fmt::print("video: {} frames, {} fitted\n", video.tracks.times.size(), video.split);
  print_distances(video.tracks, video.split, predictions);
  write_distances(out / "video_distance.svg", "registered video", video.tracks, video.split,
                  predictions);
}

}  // namespace weft::validation
