/// Cloth that an arm swings by its upper edge, tracked by a camera whose stamps are late.
#include <fmt/core.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>

#include "real_motion.h"
#include "weft/base/error.h"

namespace weft::validation {
namespace {

constexpr double kSide = 0.3;                // m, of the cloth
constexpr double kDensity = 0.2;             // kg/m^2: a value, not a measurement
constexpr double kFitShare = 0.6;            // of the frames
constexpr double kLongestDelay = 0.6;        // s
constexpr double kMoved = 2e-3;              // m, by which the arm must move to count as moving
constexpr double kBefore = 0.3, kAfter = 2;  // s before it moves and after it stops
constexpr double kLeastInterval = 2e-3;      // s between poses
constexpr double kNode = 0.025;              // s between nodes
constexpr int kStepsPerNode = 2;
constexpr int kVertices = 11;         // along a side
constexpr double kEdgeScale = 0.015;  // m, where the weight of a tracked point is a quarter
constexpr double kPriorFactor = 5;
constexpr double kMostAddedMass = 4;

/// The tracker finds the corners of the cloth in each frame and lays a grid between them: points
/// slide on the cloth by centimetres where a corner was missed, and lie off it by some millimetres.
const MotionNoise kNoise{8e-3, 15e-3, 2};

Mat3 rotation_of(double x, double y, double z, double w) {
  return Eigen::Quaterniond(w, x, y, z).normalized().toRotationMatrix();
}

/// Position and axes of the arm's tool over time.
class Arm {
 public:
  explicit Arm(std::vector<std::vector<double>> rows) {
    // Some poses come twice, with the same stamp.
    const auto twice = [](const auto& a, const auto& b) { return b[0] - a[0] < kLeastInterval; };
    rows.erase(std::unique(rows.begin(), rows.end(), twice), rows.end());
    const auto n = static_cast<Eigen::Index>(rows.size());
    Points position(3, n), axes[3] = {Points(3, n), Points(3, n), Points(3, n)};
    for (Eigen::Index k = 0; k < n; ++k) {
      const std::vector<double>& r = rows[static_cast<std::size_t>(k)];
      times_.push_back(r[0]);
      position.col(k) = Vec3(r[1], r[2], r[3]);
      const Mat3 rotation = rotation_of(r[4], r[5], r[6], r[7]);
      for (int a = 0; a < 3; ++a) axes[a].col(k) = rotation.col(a);
    }
    samples_ = position;
    position_ = Motion(times_, position);
    for (int a = 0; a < 3; ++a) axes_[a] = Motion(times_, axes[a]);
  }
  Vec3 position(double t) const { return position_.position(t); }
  Mat3 rotation(double t) const {
    Mat3 r;
    for (int a = 0; a < 3; ++a) r.col(a) = axes_[a].position(t);
    return r;
  }
  /// The path of a point that the tool holds.
  Motion path(const Vec3& local) const {
    Points x(3, samples_.cols());
    for (Eigen::Index k = 0; k < x.cols(); ++k) {
      const double t = times_[static_cast<std::size_t>(k)];
      x.col(k) = samples_.col(k) + rotation(t) * local;
    }
    return {times_, x};
  }
  double first_move() const {
    Eigen::Index k = 0;
    while (k + 1 < samples_.cols() && (samples_.col(k) - samples_.col(0)).norm() < kMoved) ++k;
    return times_[static_cast<std::size_t>(k)];
  }
  double last_move() const {
    Eigen::Index k = samples_.cols() - 1;
    const Vec3 end = samples_.col(k);
    while (k > 0 && (samples_.col(k) - end).norm() < kMoved) --k;
    return times_[static_cast<std::size_t>(k)];
  }

 private:
  std::vector<double> times_;
  Points samples_;
  Motion position_, axes_[3];
};

/// The upper edge as a straight bar in the tool's frame, and the delay with which it is seen.
struct Bar {
  Vec3 centre = Vec3::Zero(), direction = Vec3::UnitY();
  double delay = 0, cost = 0;
  double rms = 0;  ///< m, of the points' distances
  Vec3 at(double u) const { return centre + (u - kSide / 2) * direction; }
};

struct Recording {
  std::string name;
  std::optional<Arm> arm;
  MotionTracks tracks;    // world; the frames that are looked at
  std::size_t split = 0;  // frames before it are fitted
  int grid = 0;
  double begin = 0, end = 0;  // s, of the simulation
};

Recording read_recording(const std::filesystem::path& folder, const std::string& name) {
  const auto camera = read_numbers(folder / "campose.csv").front();
  const Mat3 world_from_camera = rotation_of(camera[4], camera[5], camera[6], camera[7]);
  const Vec3 centre(camera[1], camera[2], camera[3]);
  Recording r;
  r.name = name;
  r.arm.emplace(read_numbers(folder / (name + "_tcp.csv")));
  const auto rows = read_numbers(folder / (name + "_mesh.csv"));
  const auto points = static_cast<Eigen::Index>((rows.front().size() - 1) / 3);
  r.grid = static_cast<int>(std::lround(std::sqrt(static_cast<double>(points))));
  r.tracks.uv.resize(2, points);
  for (int p = 0; p < points; ++p)
    r.tracks.uv.col(p) = Vec2(p / r.grid, p % r.grid) * (kSide / (r.grid - 1));
  const double first = r.arm->first_move() - 0.1, last = r.arm->last_move() + kAfter;
  for (const std::vector<double>& row : rows) {
    if (row[0] < first || row[0] > last) continue;
    Points x(3, points);
    VecX weight = VecX::Ones(points);
    for (Eigen::Index p = 0; p < points; ++p) {
      for (Eigen::Index a = 0; a < 3; ++a)
        x(a, p) = row[static_cast<std::size_t>(1 + a * points + p)];
      if (!x.col(p).allFinite()) weight[p] = 0;
    }
    x = (world_from_camera * x).colwise() + centre;
    r.tracks.times.push_back(row[0]);
    r.tracks.normal.push_back(grid_normals(x, weight, r.grid, r.grid));
    r.tracks.position.push_back(x);
    r.tracks.weight.push_back(weight);
  }
  if (r.tracks.times.size() < 10) throw Error(name + ": fewer than 10 frames in motion");
  r.split = static_cast<std::size_t>(kFitShare * static_cast<double>(r.tracks.times.size()));
  r.begin = r.arm->first_move() - kBefore;
  r.end = r.tracks.times.back();
  return r;
}

/// The bar for a delay: a line through the upper edges in the tool's frame, by iteratively
/// reweighted least squares (Geman and McClure). `leave`: frames to leave out.
Bar bar_with_delay(const Recording& r, double delay, std::size_t leave_first = 0,
                   std::size_t leave_last = 0) {
  std::vector<Vec3> local;
  std::vector<double> along;
  for (std::size_t k = 0; k < r.split; ++k) {
    if (k >= leave_first && k < leave_last) continue;
    const double t = r.tracks.times[k] - delay;
    const Mat3 tool_from_world = r.arm->rotation(t).transpose();
    const Vec3 tool = r.arm->position(t);
    for (int i = 0; i < r.grid; ++i) {
      const int p = i * r.grid;
      if (!(r.tracks.weight[k][p] > 0)) continue;
      local.emplace_back(tool_from_world * (r.tracks.position[k].col(p) - tool));
      along.push_back(r.tracks.uv(0, p) - kSide / 2);
    }
  }
  Bar bar;
  bar.delay = delay;
  VecX weight = VecX::Ones(static_cast<Eigen::Index>(local.size()));
  for (int iteration = 0; iteration < 15; ++iteration) {
    double w = 0, ws = 0, wss = 0;
    Vec3 wx = Vec3::Zero(), wsx = Vec3::Zero();
    for (std::size_t i = 0; i < local.size(); ++i) {
      const double g = weight[static_cast<Eigen::Index>(i)];
      w += g;
      ws += g * along[i];
      wss += g * along[i] * along[i];
      wx += g * local[i];
      wsx += g * along[i] * local[i];
    }
    bar.direction = (wsx - ws / w * wx) / (wss - ws * ws / w);
    bar.centre = (wx - ws * bar.direction) / w;
    bar.direction.normalize();
    bar.cost = bar.rms = 0;
    for (std::size_t i = 0; i < local.size(); ++i) {
      const double square = (local[i] - bar.at(along[i] + kSide / 2)).squaredNorm();
      const double ratio = 1 + square / (kEdgeScale * kEdgeScale);
      weight[static_cast<Eigen::Index>(i)] = 1 / (ratio * ratio);
      bar.cost += square / ratio / static_cast<double>(local.size());
      bar.rms += square / static_cast<double>(local.size());
    }
    bar.rms = std::sqrt(bar.rms);
  }
  return bar;
}

Bar best_bar(const Recording& r, std::size_t leave_first = 0, std::size_t leave_last = 0) {
  constexpr double step = 0.01;
  const auto cost = [&](double d) { return bar_with_delay(r, d, leave_first, leave_last).cost; };
  double best = 0, least = kInfinity;
  for (double d = 0; d <= kLongestDelay; d += step)
    if (const double c = cost(d); c < least) {
      least = c;
      best = d;
    }
  const double before = cost(best - step), after = cost(best + step);
  best += 0.5 * step * (before - after) / (before - 2 * least + after);
  return bar_with_delay(r, best, leave_first, leave_last);
}

/// Half of a 90 % interval of the bar's delay: the jackknife over blocks of 5 frames.
double half_width(const Recording& r) {
  constexpr std::size_t block = 5;
  std::vector<double> delays;
  for (std::size_t k = 0; k < r.split; k += block)
    delays.push_back(best_bar(r, k, k + block).delay);
  const auto n = static_cast<double>(delays.size());
  double mean = 0, square = 0;
  for (const double d : delays) mean += d / n;
  for (const double d : delays) square += (d - mean) * (d - mean);
  return student_quantile(0.95, n - 1) * std::sqrt((n - 1) / n * square);
}

MotionTrial trial_of(const Recording& r, const Bar& bar, const MotionTracks& tracks) {
  MotionTrial trial;
  trial.name = r.name;
  Scene& scene = trial.experiment.scene;
  scene.mesh = make_swatch(kSide, kSide, kVertices, kVertices);
  scene.areal_density = kDensity;
  scene.start.resize(3, scene.mesh.vertex_count());
  const Mat3 rotation = r.arm->rotation(r.begin);
  for (int i = 0; i < scene.mesh.vertex_count(); ++i) {
    const Vec2 uv = scene.mesh.material.col(i);
    scene.start.col(i) =
        r.arm->position(r.begin) + rotation * bar.at(uv[0]) - uv[1] * Vec3::UnitZ();
  }
  for (int column = 0; column < kVertices; ++column)
    scene.fixtures.push_back({"bar", column, r.arm->path(bar.at(scene.mesh.material(0, column)))});
  for (double t = r.begin; t < r.end + kNode; t += kNode) scene.frame_times.push_back(t);
  trial.simulation.steps_per_frame = kStepsPerNode;
  trial.simulation.newton_tolerance = 1e-6;
  trial.tracks = tracks;
  return trial;
}

/// Whether air that moves with the cloth may add to its inertia.
enum class AirMass { none, unknown };

MotionUnknowns unknowns_of(double delay, AirMass air_mass) {
  MotionUnknowns unknowns;
  for (const ParameterInfo& p : baraff_witkin_parameters()) {
    unknowns.free.emplace_back(p.name);
    unknowns.priors.push_back({std::string(p.name), p.default_value, kPriorFactor});
  }
  unknowns.delay = true;
  unknowns.delay_lower = 0;
  unknowns.delay_upper = kLongestDelay;
  unknowns.delay_initial = delay;
  if (air_mass == AirMass::unknown) unknowns.scene = {added_mass(kMostAddedMass)};
  return unknowns;
}

Fabric default_fabric() { return Fabric::with_defaults("defaults"); }

/// The cloth as it hangs at first, moved with the tool.
std::vector<Points> carried(const Recording& r, const MotionTrial& trial, const Bar& bar) {
  const MaterialLocator locator(trial.experiment.scene.mesh);
  const Points rest =
      interpolate(trial.experiment.scene.mesh, locator, trial.experiment.scene.start, r.tracks.uv);
  const Points local =
      r.arm->rotation(r.begin).inverse() * (rest.colwise() - r.arm->position(r.begin));
  std::vector<Points> out;
  for (const double time : r.tracks.times) {
    const double t = time - bar.delay;
    out.emplace_back((r.arm->rotation(t) * local).colwise() + r.arm->position(t));
  }
  return out;
}

struct Subject {
  Recording recording;
  Bar bar;
  MotionTrial all;  // with every frame
};

MotionProblem problem_of(std::vector<MotionTrial> trials, double delay, AirMass air_mass) {
  return {std::move(trials), default_fabric(), unknowns_of(delay, air_mass), kNoise};
}

std::vector<Points> predict(const Subject& s, const MotionProblem& problem, const VecX& scaled) {
  const auto found = problem.simulate(scaled);
  if (found[0].diverged) throw Error(s.recording.name + ": diverged: " + found[0].divergence);
  return found[0].position;
}

struct Found {
  std::string key, name;
  AirMass air_mass = AirMass::none;
  MotionFitResult fit;
};

Found fit(const std::string& name, const std::vector<const Subject*>& subjects, AirMass air_mass) {
  std::vector<MotionTrial> trials;
  double delay = 0;
  for (const Subject* s : subjects) {
    trials.push_back(s->all);
    trials.back().tracks = frames_of(s->recording.tracks, 0, s->recording.split);
    delay += s->bar.delay / static_cast<double>(subjects.size());
  }
  const MotionProblem problem = problem_of(std::move(trials), delay, air_mass);
  const bool still = air_mass == AirMass::none;
  Found found{still ? name : name + "_added_mass", still ? name : name + ", added mass", air_mass,
              fit_motion(problem, problem.initial(), fit_options())};
  fmt::print("fitted to {}\n", found.name);
  print_intervals(found.fit);
  std::fflush(stdout);
  return found;
}

/// Mean of the lower edge along the swing (world y) against time.
void write_swing(const std::filesystem::path& path, const Subject& s,
                 const std::vector<Prediction>& predictions) {
  LinePlot plot;
  plot.title = s.recording.name + ": lower edge along the swing";
  plot.x.label = "time";
  plot.x.unit = "s";
  plot.y.label = "position";
  plot.y.unit = "m";
  const MotionTracks& tracks = s.recording.tracks;
  const auto add = [&](const std::string& name, const std::vector<Points>& x,
                       PlotSeries::Mark mark) {
    PlotSeries series;
    series.name = name;
    series.mark = mark;
    for (std::size_t k = 0; k < tracks.times.size(); ++k) {
      double sum = 0, seen = 0;
      for (int p = s.recording.grid - 1; p < x[k].cols(); p += s.recording.grid) {
        if (!(tracks.weight[k][p] > 0)) continue;
        sum += x[k](1, p);
        seen += 1;
      }
      series.x.push_back(tracks.times[k] - tracks.times.front());
      series.y.push_back(sum / seen);
    }
    plot.series.push_back(std::move(series));
  };
  add("tracked", tracks.position, PlotSeries::Mark::points);
  plot.series.back().colour = 0;
  for (const Prediction& p : predictions) add(p.name, p.position, PlotSeries::Mark::line);
  const auto& x = plot.series.front().x;
  const std::size_t split = s.recording.split;
  plot.regions = {{0.5 * (x[split - 1] + x[split]), x.back(), "predicted"}};
  write_plot(path, plot);
}

void compare(const std::filesystem::path& out, const Subject& s, const std::vector<Found>& fits) {
  const Recording& r = s.recording;
  std::vector<Prediction> predictions{{"carried rigidly by the arm", carried(r, s.all, s.bar)},
                                      {"default parameters", {}}};
  const MotionProblem still = problem_of({s.all}, s.bar.delay, AirMass::none);
  predictions.back().position = predict(s, still, still.initial());
  for (const Found& f : fits)
    predictions.push_back({"fitted to " + f.name,
                           predict(s, problem_of({s.all}, s.bar.delay, f.air_mass), f.fit.scaled)});
  fmt::print("{}: {} frames, {} fitted\n", r.name, r.tracks.times.size(), r.split);
  print_distances(r.tracks, r.split, predictions);
  // Pictures with its own fit alone.
  std::vector<Prediction> own{predictions[0], predictions[1]};
  for (const Prediction& p : predictions)
    if (p.name.starts_with("fitted to " + r.name)) own.push_back(p);
  write_distances(out / (r.name + "_distance.svg"), r.name, r.tracks, r.split, own);
  write_swing(out / (r.name + "_swing.svg"), s, own);
}

}  // namespace

void study_arm(const std::filesystem::path& out, const std::filesystem::path& folder,
               const std::vector<std::string>& names) {
  std::filesystem::create_directories(out);
  std::vector<Subject> subjects;
  for (const std::string& name : names) {
    Subject s{read_recording(folder, name), {}, {}};
    s.bar = best_bar(s.recording);
    s.all = trial_of(s.recording, s.bar, s.recording.tracks);
    fmt::print(
        "{}: rigid fit of the upper edge: {:.1f} mm rms, delay {:.3f} s, 90 %: +- {:.3f} s\n", name,
        1e3 * s.bar.rms, s.bar.delay, half_width(s.recording));
    subjects.push_back(std::move(s));
  }
  std::vector<Found> fits;
  std::vector<const Subject*> all;
  for (const Subject& s : subjects) all.push_back(&s);
  for (const AirMass air_mass : {AirMass::none, AirMass::unknown}) {
    for (const Subject* s : all) fits.push_back(fit(s->recording.name, {s}, air_mass));
    if (all.size() > 1) fits.push_back(fit("all", all, air_mass));
  }
  for (const Found& f : fits) write_fabric(out / (f.key + "_fabric.toml"), f.fit.fabric);
  for (const Subject& s : subjects) compare(out, s, fits);
}

}  // namespace weft::validation
