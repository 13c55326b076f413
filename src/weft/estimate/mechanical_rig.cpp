#include "weft/estimate/mechanical_rig.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "weft/base/error.h"
#include "weft/base/random.h"
#include "weft/capture/mechanical_writer.h"
#include "weft/dynamics/clip_poses.h"

namespace weft {
namespace {

constexpr double kBarDepth = 5e-3;      // m
constexpr double kCornerSide = 1e-2;    // m
constexpr double kFreeCorner = 0.1;     // of the side, between a corner and a bar of the shear test
constexpr double kCornerStrain = 0.05;  // elongation of the diagonal, at most
constexpr double kTension = 1.2;        // of the shear test, of its largest shear stress
constexpr int kTensionFrames = 2;       // from rest to that tension
constexpr double kPulleyDistance = 0.5;    // m, from a loaded bar at no load
constexpr double kBarMass = 2e-3;          // kg, of a loaded bar
constexpr double kLargestResidual = 1e-5;  // N, as of a fit
constexpr double kLeastWay = 1e-9;         // m, of a clip that counts as moving

struct TestName {
  RigTest test;
  std::string_view name;
};
constexpr std::array<TestName, 7> kNames{{{RigTest::weft_stretch, "stretch_weft"},
                                          {RigTest::warp_stretch, "stretch_warp"},
                                          {RigTest::shear, "shear"},
                                          {RigTest::weft_bend, "bend_weft"},
                                          {RigTest::warp_bend, "bend_warp"},
                                          {RigTest::complex_shear, "complex_shear"},
                                          {RigTest::corner_pull, "corner_pull"}}};
constexpr std::array<RigTest, 7> kTests{
    RigTest::weft_stretch, RigTest::warp_stretch,  RigTest::shear,      RigTest::weft_bend,
    RigTest::warp_bend,    RigTest::complex_shear, RigTest::corner_pull};

void check(const RigOptions& o) {
  const auto require = [](bool valid, std::string_view what, double value, std::string_view range) {
    if (!valid) throw Error(fmt::format("rig: {} is {:g}, must be {}", what, value, range));
  };
  require(o.side >= 0.05 && o.side <= 1, "side", o.side, "in [0.05, 1] m");
  require(o.largest_force > 0 && std::isfinite(o.largest_force), "largest force", o.largest_force,
          "above 0 N");
  require(o.largest_strain > 0 && o.largest_strain <= 1, "largest strain", o.largest_strain,
          "in (0, 1]");
  require(o.largest_shear > 0 && o.largest_shear <= 0.5, "largest shear", o.largest_shear,
          "in (0, 0.5] rad");
  require(o.least_overhang > 0, "least overhang", o.least_overhang, "above 0 m");
  require(
      o.largest_overhang > o.least_overhang && o.largest_overhang <= o.side - kBarDepth + kLeastWay,
      "largest overhang", o.largest_overhang,
      fmt::format("in ({:g}, {:g}] m", o.least_overhang, o.side - kBarDepth));
  require(o.steps >= 1 && o.steps <= 1000, "steps", o.steps, "in [1, 1000]");
  require(o.loops >= 1 && o.loops <= 100, "loops", o.loops, "in [1, 100]");
  require(o.point_lines >= 2 && o.point_lines <= 400, "point lines", o.point_lines, "in [2, 400]");
  for (const double noise : {o.noise.points, o.noise.clips, o.noise.forces, o.noise.cord_friction})
    require(noise >= 0 && std::isfinite(noise), "noise", noise, "0 or more");
  require(o.noise.clips <= most_clip_noise, "noise of clips", o.noise.clips, "0.01 m or less");
}

/// Stiffness of the fabric along its threads and in shear, whatever its model calls them.
struct Threads {
  StiffnessCurve weft, warp, shear;
};

Threads threads_of(const Fabric& fabric) {
  if (fabric.model == "stvk")
    return {StiffnessCurve(fabric.value("membrane_uu")),
            StiffnessCurve(fabric.value("membrane_vv")),
            StiffnessCurve(fabric.value("membrane_shear"))};
  try {
    return {fabric.curve("weft_stretch"), fabric.curve("warp_stretch"), fabric.curve("shear")};
  } catch (const Error&) {
    throw Error(fmt::format(
        "rig: model \"{}\" has no stiffness along weft and warp to plan the tests by; use stvk, "
        "stvk-diagonal, soft-constraints or springs",
        fabric.model));
  }
}

/// The least strain at which the curve's stress is reached, at most `most`.
double strain_at(const StiffnessCurve& curve, double stress, double most) {
  constexpr int kParts = 1000;
  for (int i = 1; i < kParts; ++i) {
    const double strain = most * i / kParts;
    if (curve.stiffness(strain) * strain >= stress) return strain;
  }
  return most;
}

/// From 0 to 1 and back, in equal steps, the ends of the way twice but for the rest at the
/// beginning: before and after the motion has turned.
std::vector<double> loads(const RigOptions& options) {
  std::vector<double> result{0};
  for (int loop = 0; loop < options.loops; ++loop) {
    for (int i = 1; i <= options.steps; ++i)
      result.push_back(static_cast<double>(i) / options.steps);
    for (int i = options.steps; i >= 1; --i)
      result.push_back(static_cast<double>(i) / options.steps);
  }
  return result;
}

class Layout {
 public:
  Layout(RigTest test, const Fabric& fabric, const RigOptions& options)
      : options_(options), threads_(threads_of(fabric)), side_(options.side) {
    if (!fabric.areal_density)
      throw Error(fmt::format("rig: fabric \"{}\" has no areal_density", fabric.name));
    capture_.name = fmt::format("{}_{}", fabric.name, name_of(test));
    capture_.description = fmt::format("synthetic rig, seed {}", options.seed);
    capture_.width = capture_.height = side_;
    capture_.areal_density = *fabric.areal_density;
  }

  MechanicalCapture make(RigTest test) {
    switch (test) {
      case RigTest::weft_stretch:
        stretch(0, threads_.weft);
        break;
      case RigTest::warp_stretch:
        stretch(1, threads_.warp);
        break;
      case RigTest::shear:
        shear();
        break;
      case RigTest::weft_bend:
        bend(0);
        break;
      case RigTest::warp_bend:
        bend(1);
        break;
      case RigTest::complex_shear:
        complex_shear();
        break;
      case RigTest::corner_pull:
        corner_pull();
        break;
    }
    capture_.frame_count = static_cast<int>(capture_.fixtures.front().frames.size());
    return std::move(capture_);
  }

 private:
  MechanicalFixture& add(const std::string& name, const MaterialRectangle& region) {
    MechanicalFixture& fixture = capture_.fixtures.emplace_back();
    fixture.name = name;
    fixture.forces.resize(3, 0);
    regions_.push_back(region);
    return fixture;
  }
  /// One more frame of fixture `i`: shifted, and turned about z.
  void place(std::size_t i, const Vec2& shift, double angle = 0) {
    Clip clip;
    clip.region = regions_[i];
    const Vec2 center = clip.region.center() + shift;
    clip.position = Vec3(center.x(), center.y(), 0);
    clip.rotation = Eigen::AngleAxisd(angle, Vec3::UnitZ());
    capture_.fixtures[i].frames.push_back(clip);
  }
  void add_bars(int axis) {
    Vec2 inner = Vec2::Constant(side_), outer = Vec2::Zero();
    inner[axis] = kBarDepth;
    outer[axis] = side_ - kBarDepth;
    add(axis == 0 ? "left" : "bottom", {{0, 0}, inner});
    add(axis == 0 ? "right" : "top", {outer, {side_, side_}});
  }
  double largest_stress() const { return options_.largest_force / side_; }

  void stretch(int axis, const StiffnessCurve& curve) {
    add_bars(axis);
    if (options_.stretch_drive == StretchDrive::known_forces) {
      pull(axis, curve);
      return;
    }
    const double way =
        strain_at(curve, largest_stress(), options_.largest_strain) * (side_ - 2 * kBarDepth);
    for (const double load : loads(options_)) {
      Vec2 shift = Vec2::Zero();
      shift[axis] = 0.5 * load * way;
      place(0, -shift);
      place(1, shift);
    }
  }

  /// The second bar by cords at its ends, in steps of the force.
  void pull(int axis, const StiffnessCurve& curve) {
    const double free = side_ - 2 * kBarDepth;
    const double strain = strain_at(curve, largest_stress(), options_.largest_strain);
    const double most = curve.stiffness(strain) * strain * side_;
    std::vector<double> schedule = loads(options_);
    std::erase(schedule, 0.0);
    MechanicalFixture& bar = capture_.fixtures[1];
    bar.mass = kBarMass;
    const Vec2 center = regions_[1].center();
    for (const double end : {-0.5, 0.5}) {
      FixtureCord& cord = bar.cords.emplace_back();
      cord.at[1 - axis] = end * side_;
      cord.pulley = Vec3(center.x(), center.y(), 0) + cord.at;
      (*cord.pulley)[axis] += kPulleyDistance;
      cord.tensions = 0.5 * most * VecX::Map(schedule.data(), std::ssize(schedule));
    }
    for (const double load : schedule) {
      Vec2 shift = Vec2::Zero();
      shift[axis] = strain_at(curve, load * most / side_, options_.largest_strain) * free;
      place(0, Vec2::Zero());
      place(1, shift);
    }
  }

  void shear() {
    const double a = kFreeCorner * side_, b = side_ - a, c = side_ - kBarDepth;
    add("bottom", {{a, 0}, {b, kBarDepth}});
    add("top", {{a, c}, {b, side_}});
    add("left", {{0, a}, {kBarDepth, b}});
    add("right", {{c, a}, {side_, b}});
    const double angle = strain_at(threads_.shear, largest_stress(), options_.largest_shear);
    const double tension = kTension * threads_.shear.stiffness(angle) * angle;
    const Vec2 pull(strain_at(threads_.weft, tension, options_.largest_strain),
                    strain_at(threads_.warp, tension, options_.largest_strain));
    for (int i = 0; i < kTensionFrames; ++i) linkage(pull * i / kTensionFrames, 0);
    for (const double load : loads(options_)) linkage(pull, load * angle);
  }
  /// Bars on a frame whose sides are longer by `pull` and have turned towards each other.
  void linkage(const Vec2& pull, double angle) {
    const double half = 0.5 * angle;
    const Vec2 along_u(std::cos(half), std::sin(half)), along_v(std::sin(half), std::cos(half));
    const Vec2 middle = Vec2::Constant(0.5 * side_);
    for (std::size_t i = 0; i < 4; ++i) {
      const Vec2 from = regions_[i].center() - middle;
      const Vec2 to = (1 + pull.x()) * from.x() * along_u + (1 + pull.y()) * from.y() * along_v;
      place(i, to - from, i < 2 ? half : -half);
    }
  }

  void bend(int axis) {
    add("table", {{0, 0}, {side_, side_}});
    const int last = std::max(1, options_.steps - 1);
    for (int i = 0; i < options_.steps; ++i) {
      const double overhang = options_.least_overhang +
                              (options_.largest_overhang - options_.least_overhang) * i / last;
      regions_[0].upper[axis] = side_ - overhang;
      place(0, Vec2::Zero());
    }
  }

  void complex_shear() {
    add_bars(0);
    const double way = strain_at(threads_.shear, largest_stress(), options_.largest_shear) *
                       (side_ - 2 * kBarDepth);
    for (const double load : loads(options_)) {
      place(0, Vec2(0, -0.5 * load * way));
      place(1, Vec2(0, 0.5 * load * way));
    }
  }

  void corner_pull() {
    const double a = kCornerSide, b = side_ - kCornerSide;
    add("corner 00", {{0, 0}, {a, a}});
    add("corner 11", {{b, b}, {side_, side_}});
    add("corner 10", {{b, 0}, {side_, a}});
    add("corner 01", {{0, b}, {a, side_}});
    const double span = std::sqrt(2.0) * (side_ - kCornerSide);
    const double way = diagonal_strain() * span;
    const Vec2 diagonals[] = {Vec2(1, 1).normalized(), Vec2(-1, 1).normalized()};
    for (int pair = 0; pair < 2; ++pair) {
      const auto first = static_cast<std::size_t>(2 * pair);
      std::vector<double> schedule = loads(options_);
      if (pair == 1) schedule.erase(schedule.begin());  // the rest
      for (const double load : schedule) {
        const Vec2 shift = 0.5 * load * way * diagonals[pair];
        place(first, -shift);
        place(first + 1, shift);
        place(2 - first, Vec2::Zero());
        place(3 - first, Vec2::Zero());
      }
    }
  }
  /// Elongation at which a strip at 45 degrees, as wide as the corners' diagonal, pulls with half
  /// of the largest force, by the stiffness of the fabric at no strain.
  double diagonal_strain() const {
    const double compliance =
        0.25 * (1 / threads_.weft.stiffness(0) + 1 / threads_.warp.stiffness(0) +
                1 / threads_.shear.stiffness(0));
    const double stress = 0.5 * options_.largest_force / (std::sqrt(2.0) * kCornerSide);
    return std::min({stress * compliance, kCornerStrain, options_.largest_strain});
  }

  const RigOptions& options_;
  Threads threads_;
  double side_;
  MechanicalCapture capture_;
  std::vector<MaterialRectangle> regions_;
};

bool has_internal_friction(const Fabric& fabric) {
  for (const ParameterInfo& info : model_parameters(fabric.model))
    if (info.name.ends_with("_friction") && fabric.value_count(info.name) > 0) return true;
  return false;
}

bool same_loads(const std::vector<std::optional<ClipLoad>>& a,
                const std::vector<std::optional<ClipLoad>>& b) {
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!a[i]) continue;
    for (std::size_t k = 0; k < a[i]->cords.size(); ++k) {
      const Cord &first = a[i]->cords[k], &second = b[i]->cords[k];
      if (first.tension != second.tension || first.force != second.force) return false;
    }
  }
  return true;
}

bool same_clips(const std::vector<Clip>& a, const std::vector<Clip>& b) {
  for (std::size_t i = 0; i < a.size(); ++i) {
    const bool same = a[i].region == b[i].region && a[i].position == b[i].position &&
                      a[i].rotation.coeffs() == b[i].rotation.coeffs();
    if (!same) return false;
  }
  return true;
}

/// Which of `kept` frames each frame of the capture equals.
std::vector<std::size_t> repeated_frames(const MechanicalCapture& capture, bool repeat,
                                         std::vector<int>& kept) {
  std::vector<std::size_t> result;
  for (int frame = 0; frame < capture.frame_count; ++frame) {
    std::size_t i = 0;
    while (i < kept.size() &&
           (repeat || !same_clips(capture.clips(frame), capture.clips(kept[i])) ||
            !same_loads(capture.loads(frame), capture.loads(kept[i]))))
      ++i;
    if (i == kept.size()) kept.push_back(frame);
    result.push_back(i);
  }
  return result;
}

MechanicalCapture with_frames(const MechanicalCapture& capture, const std::vector<int>& frames) {
  MechanicalCapture result = capture;
  result.frame_count = static_cast<int>(frames.size());
  for (MechanicalFixture& fixture : result.fixtures) {
    const std::vector<Clip> all = fixture.frames;
    fixture.frames.clear();
    for (const int frame : frames) fixture.frames.push_back(all[at(frame)]);
    for (FixtureCord& cord : fixture.cords) {
      if (cord.pulley)
        cord.tensions = VecX(cord.tensions(frames));
      else
        cord.forces = Points(cord.forces(Eigen::all, frames));
    }
  }
  return result;
}

/// The equilibria of all frames, on the truth's own mesh.
struct Truth {
  std::shared_ptr<const MechanicalTrial> trial;
  std::vector<MechanicalFrame> frames;  ///< that were computed
  std::vector<std::size_t> frame_of;    ///< for each frame of the capture
};

/// Splits the quads of a grid along their other diagonals.
void split_the_other_way(TriangleMesh& mesh) {
  for (std::size_t t = 0; t + 1 < mesh.triangles.size(); t += 2) {
    auto &first = mesh.triangles[t], &second = mesh.triangles[t + 1];
    const auto is_in = [](const std::array<int, 3>& triangle, int vertex) {
      return std::find(triangle.begin(), triangle.end(), vertex) != triangle.end();
    };
    std::vector<int> shared;
    int alone = 0, other = 0;
    for (const int vertex : first) {
      if (is_in(second, vertex))
        shared.push_back(vertex);
      else
        alone = vertex;
    }
    for (const int vertex : second)
      if (!is_in(first, vertex)) other = vertex;
    first = {alone, other, shared[0]};
    second = {alone, other, shared[1]};
    for (const std::size_t k : {t, t + 1})
      if (material_area(mesh, static_cast<int>(k)) < 0)
        std::swap(mesh.triangles[k][0], mesh.triangles[k][1]);
  }
}

Truth compute(const MechanicalCapture& layout, const Fabric& fabric, const RigOptions& options) {
  Truth truth;
  std::vector<int> kept;
  truth.frame_of = repeated_frames(layout, has_internal_friction(fabric), kept);
  auto trial = std::make_shared<MechanicalTrial>(
      *prepare_mechanical(with_frames(layout, kept), options.mesh));
  for (MechanicalStage& stage : trial->stages) split_the_other_way(stage.mesh);
  truth.trial = trial;
  truth.frames = std::move(
      simulate_mechanical({truth.trial}, fabric, MechanicalDerivatives::none, options.threads)[0]);
  for (const MechanicalFrame& frame : truth.frames)
    if (!(frame.residual <= kLargestResidual))
      throw Error(fmt::format("{}: no equilibrium at frame {}: a net force of {:.2g} N is left",
                              layout.name, kept[at(frame.frame)], frame.residual));
  return truth;
}

TriangleMesh point_mesh(const RigOptions& options) {
  return make_swatch(options.side, options.side, options.point_lines, options.point_lines);
}

/// The way of a clip into this frame, unit length; where it stood still, the way out of it: the
/// motion has turned. Zero at rest, and where it does not move at all.
Vec3 direction_of_motion(const MechanicalFixture& fixture, int frame) {
  if (frame == 0) return Vec3::Zero();
  const Vec3 here = fixture.frames[at(frame)].position;
  const Vec3 into = here - fixture.frames[at(frame - 1)].position;
  if (into.norm() > kLeastWay) return into.normalized();
  if (at(frame + 1) == fixture.frames.size()) return Vec3::Zero();
  const Vec3 out = fixture.frames[at(frame + 1)].position - here;
  return out.norm() > kLeastWay ? Vec3(out.normalized()) : Vec3::Zero();
}

Vec3 normal3(Rng& rng, double deviation) {
  Vec3 result;
  for (double& x : result) x = deviation * rng.normal();
  return result;
}

void add_clip_noise(Clip& clip, double deviation, Rng& rng) {
  clip.position += normal3(rng, deviation);
  const Vec3 turn = normal3(rng, deviation / half_length(clip));
  if (turn.norm() > 0)
    clip.rotation = Eigen::AngleAxisd(turn.norm(), turn.normalized()) * clip.rotation;
  clip.rotation.normalize();
}

}  // namespace

std::string_view name_of(RigTest test) {
  for (const TestName& row : kNames)
    if (row.test == test) return row.name;
  return {};
}

RigTest rig_test_from_name(std::string_view name) {
  std::string known;
  for (const TestName& row : kNames) {
    if (row.name == name) return row.test;
    known += fmt::format("{}{}", known.empty() ? "" : ", ", row.name);
  }
  throw Error(fmt::format("rig test \"{}\" is not known; known: {}", name, known));
}

std::span<const RigTest> rig_tests() { return kTests; }
std::span<const RigTest> rig_fit_tests() { return std::span(kTests).first(5); }

MechanicalCapture rig_layout(RigTest test, const Fabric& fabric, const RigOptions& options) {
  check(options);
  return Layout(test, fabric, options).make(test);
}

RigMeasurement simulate_rig(RigTest test, const Fabric& fabric, const RigOptions& options) {
  RigMeasurement result;
  result.capture = rig_layout(test, fabric, options);
  const Truth truth = compute(result.capture, fabric, options);
  result.geometry.mesh = point_mesh(options);
  // Streams of their own, so that the noise of one test does not depend on another's size.
  const auto stream = static_cast<std::uint64_t>(test);
  Rng point_rng(options.seed, 3 * stream), clip_rng(options.seed, 3 * stream + 1),
      force_rng(options.seed, 3 * stream + 2);
  std::map<std::size_t, MaterialLocator> locators;  // one a stage
  for (const std::size_t k : truth.frame_of) {
    const auto stage_index = at(truth.trial->stage_of_frame[k]);
    const TriangleMesh& mesh = truth.trial->stages[stage_index].mesh;
    const auto& locator = locators.try_emplace(stage_index, mesh).first->second;
    Points points = interpolate(mesh, locator, truth.frames[k].x, result.geometry.mesh.material);
    for (double& x : points.reshaped()) x += options.noise.points * point_rng.normal();
    result.geometry.frames.push_back(std::move(points));
  }
  result.capture.clip_noise = options.noise.clips;
  const bool measured = result.capture.fixtures.size() > 1 && !result.capture.has_loaded();
  if (measured && options.noise.cord_friction > 0) result.capture.drive = ClipDrive::cords;
  result.true_clips.resize(result.capture.fixtures.size());
  for (std::size_t i = 0; i < result.capture.fixtures.size(); ++i) {
    MechanicalFixture& fixture = result.capture.fixtures[i];
    Points& forces = result.true_forces.emplace_back(3, result.capture.frame_count);
    for (int frame = 0; frame < result.capture.frame_count; ++frame)
      forces.col(frame) =
          truth.frames[truth.frame_of[at(frame)]].forces.col(static_cast<Eigen::Index>(i));
    if (measured) {
      fixture.forces = forces;
      for (int frame = 0; frame < result.capture.frame_count; ++frame)
        fixture.forces.col(frame) +=
            0.5 * options.noise.cord_friction * direction_of_motion(fixture, frame) +
            normal3(force_rng, options.noise.forces);
    }
    for (int frame = 0; frame < result.capture.frame_count; ++frame) {
      Clip& clip = fixture.frames[at(frame)];
      clip = truth.frames[truth.frame_of[at(frame)]].clips[i];
      result.true_clips[i].push_back(clip);
      add_clip_noise(clip, options.noise.clips, clip_rng);
    }
  }
  return result;
}

MechanicalCapture make_rig_capture(const std::filesystem::path& folder, RigTest test,
                                   const Fabric& fabric, const RigOptions& options) {
  RigMeasurement made = simulate_rig(test, fabric, options);
  write_mechanical_capture(folder, made.capture,
                           {std::move(made.geometry), fabric_to_toml(fabric)});
  return read_mechanical_capture(folder);
}

}  // namespace weft
