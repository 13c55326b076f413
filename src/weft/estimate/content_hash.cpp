#include "weft/estimate/content_hash.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <vector>

#include "weft/base/error.h"
#include "weft/base/files.h"

namespace weft {
namespace {

/// To be raised when the same trial and fabric give another error than before, or features are made
/// in another way: stored evaluations and cached features of older programs are then not used.
constexpr int kEvaluationVersion = 7;
/// The same of mechanical captures.
constexpr int kMechanicalVersion = 2;

void add_mesh(ContentHash& hash, const TriangleMesh& mesh) {
  hash.add(mesh.material);
  for (const auto& triangle : mesh.triangles)
    for (const int vertex : triangle) hash.add(vertex);
}

void add_options(ContentHash& hash, const TrialOptions& options) {
  hash.add(options.columns);
  hash.add(options.rows);
  hash.add(options.alpha);
  const AngleMapOptions& angles = options.angle_map;
  for (const double value : {angles.kernel_radius, angles.blur_sigma, angles.mask_threshold,
                             angles.energy_threshold, angles.coherence_threshold})
    hash.add(value);
  const SimulationOptions& simulation = options.simulation;
  hash.add(simulation.integrator);
  hash.add(simulation.steps_per_frame);
  hash.add(simulation.max_newton_iterations);
  hash.add(simulation.max_force_evaluations);
  hash.add(simulation.settle);
  hash.add(simulation.static_options.max_iterations);
  for (const double value :
       {simulation.newton_tolerance, simulation.relative_tolerance, simulation.absolute_tolerance,
        simulation.static_options.force_tolerance})
    hash.add(value);
  const RenderOptions& render = options.render;
  hash.add(render.supersampling);
  hash.add(render.subdivision);
  hash.add(render.filter_stripes);
  hash.add(render.shadows);
  for (const double value :
       {render.ambient, render.albedo, render.background, render.shadow_bias, render.shadow_scale})
    hash.add(value);
}

void add_rig(ContentHash& hash, const Rig& rig) {
  hash.add(rig.width);
  hash.add(rig.height);
  hash.add(rig.camera.projection());
  hash.add(rig.projector.projection());
  hash.add(rig.pattern.profile);
  for (const double value : {rig.pattern.period, rig.pattern.edge_gain, rig.pattern.black_level,
                             rig.projector_width, rig.projector_height})
    hash.add(value);
}

/// A path by where it leads at the times of the frames and halfway between.
void add_motion(ContentHash& hash, const Motion& motion, const std::vector<double>& times) {
  for (std::size_t i = 0; i < times.size(); ++i) {
    hash.add(motion.position(times[i]));
    if (i > 0) hash.add(motion.position(0.5 * (times[i - 1] + times[i])));
  }
}

void add_file(ContentHash& hash, const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) throw Error(fmt::format("{}: cannot be read", path.string()));
  hash.add(path.filename().string());
  std::vector<char> block(1 << 20);
  while (in) {
    in.read(block.data(), static_cast<std::streamsize>(block.size()));
    hash.add_bytes(block.data(), static_cast<std::size_t>(in.gcount()));
  }
}

/// The video file, or all files next to a pattern of numbered images that end as it does.
void add_video(ContentHash& hash, const std::filesystem::path& video) {
  if (is_file(video)) return add_file(hash, video);
  std::vector<std::filesystem::path> images;
  for (const auto& entry : entries_of(video.parent_path()))
    if (entry.extension() == video.extension() && is_file(entry)) images.push_back(entry);
  if (images.empty()) throw Error(fmt::format("{}: no such video", video.string()));
  std::sort(images.begin(), images.end());
  hash.add(video.filename().string());
  for (const auto& image : images) add_file(hash, image);
}

}  // namespace

void ContentHash::add_bytes(const void* data, std::size_t size) {
  const char* bytes = static_cast<const char*>(data);
  const auto mix = [this](std::uint64_t word) {
    state_ = (state_ ^ word) * 0xd6e8feb86659fd93u;
    state_ ^= state_ >> 32;
  };
  mix(size);
  for (; size >= 8; bytes += 8, size -= 8) {
    std::uint64_t word;
    std::memcpy(&word, bytes, 8);
    mix(word);
  }
  if (size > 0) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes, size);
    mix(word);
  }
}

void ContentHash::add(std::string_view text) { add_bytes(text.data(), text.size()); }

std::string ContentHash::hex() const { return fmt::format("{:016x}", state_); }

void add_trial(ContentHash& hash, const Trial& trial) {
  hash.add(kEvaluationVersion);
  add_options(hash, trial.options);
  add_rig(hash, trial.capture.rig);
  const Scene& scene = trial.scene;
  add_mesh(hash, scene.mesh);
  hash.add(scene.areal_density);
  hash.add(scene.hem_width);
  hash.add(scene.gravity);
  hash.add(scene.start);
  for (const double time : scene.frame_times) hash.add(time);
  for (const PointFixture& fixture : scene.fixtures) {
    hash.add(fixture.vertex);
    add_motion(hash, fixture.motion, scene.frame_times);
  }
  hash.add(trial.first_frame);
  for (const FrameFeatures& features : trial.features) {
    hash.add(features.angles.angle);
    hash.add(features.angles.valid);
    hash.add(features.fold_mask);
    hash.add(features.silhouette);
  }
}

namespace {

void add_load(ContentHash& hash, const MechanicalFixture& fixture) {
  hash.add(fixture.mass);
  for (const FixtureCord& cord : fixture.cords) {
    hash.add(cord.at);
    hash.add(cord.pulley.has_value());
    if (cord.pulley) hash.add(*cord.pulley);
    hash.add(cord.tensions);
    hash.add(cord.forces);
  }
}

}  // namespace

void add_trial(ContentHash& hash, const MechanicalTrial& trial) {
  hash.add(kMechanicalVersion);
  const MechanicalCapture& capture = trial.capture;
  for (const double value :
       {capture.width, capture.height, capture.areal_density, capture.grain_angle})
    hash.add(value);
  hash.add(capture.gravity);
  hash.add(capture.frame_count);
  if (capture.clip_noise > 0) hash.add(capture.clip_noise);
  if (capture.picture_frame) {
    hash.add(capture.picture_frame->side);
    hash.add(capture.picture_frame->shear);
  }
  if (capture.overhang) {
    hash.add(capture.overhang->lengths);
    hash.add(capture.overhang->angle);
    hash.add(capture.overhang->deviation);
  }
  hash.add(capture.fixtures.size());
  for (const MechanicalFixture& fixture : capture.fixtures) {
    for (const Clip& clip : fixture.frames) {
      hash.add(clip.region.lower);
      hash.add(clip.region.upper);
      hash.add(clip.position);
      hash.add(clip.rotation.coeffs());
    }
    hash.add(fixture.forces);
    if (fixture.loaded()) add_load(hash, fixture);
  }
  hash.add(trial.options.statics.force_tolerance);
  hash.add(trial.options.statics.max_iterations);
  // What cells and pattern come to.
  for (const MechanicalStage& stage : trial.stages) add_mesh(hash, stage.mesh);
  hash.add(trial.geometry.has_value());
  if (!trial.geometry) return;
  add_mesh(hash, trial.geometry->mesh);
  for (const Points& points : trial.geometry->frames) hash.add(points);
}

void add_fabric(ContentHash& hash, const Fabric& fabric) {
  hash.add(std::string_view(fabric.model));
  hash.add(fabric.values);
  for (int i = 0; i < fabric.values.size(); ++i) {
    const ParameterInfo info = fabric.info(i);
    hash.add(info.name);
    hash.add(info.lower);
    hash.add(info.upper);
  }
  for (const ParameterForm& form : fabric.forms) {
    hash.add(form.present);
    hash.add(form.knots);
  }
}

std::string preparation_key(const Capture& capture, int first, int last,
                            const TrialOptions& options) {
  ContentHash hash;
  hash.add(kEvaluationVersion);
  hash.add(first);
  hash.add(last);
  add_options(hash, options);
  add_rig(hash, capture.rig);
  if (capture.distortion) {
    const LensDistortion& lens = *capture.distortion;
    for (const double value : {lens.k1, lens.k2, lens.p1, lens.p2, lens.k3}) hash.add(value);
  }
  for (const double value : {capture.width, capture.height, capture.areal_density,
                             capture.hem_width, capture.frame_rate})
    hash.add(value);
  hash.add(capture.gravity);
  std::vector<double> times;
  for (int frame = 0; frame <= last; ++frame) times.push_back(frame / capture.frame_rate);
  for (const CaptureFixture& fixture : capture.fixtures) {
    hash.add(fixture.at);
    add_motion(hash, fixture.motion, times);
  }
  add_video(hash, capture.video);
  if (capture.start_surface) add_file(hash, *capture.start_surface);
  return hash.hex();
}

}  // namespace weft
