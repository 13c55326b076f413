#include "weft/capture/mechanical_capture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "weft/base/toml_reader.h"
#include "weft/capture/capture_checks.h"
#include "weft/capture/capture_file.h"
#include "weft/capture/material_cover.h"
#include "weft/capture/standard_test.h"
#include "weft/capture/table_file.h"
#include "weft/mesh/mesh_io.h"

namespace weft {
namespace {

constexpr double kSamePoint = 1e-9;    // m
constexpr double kUnitLength = 1e-3;   // of a quaternion
constexpr double kLeastCord = 1e-3;    // m, from a clip to the pulley
constexpr Range kCordPlace{-10, 10};   // m, on a clip
constexpr Range kPulley{-1000, 1000};  // m
constexpr Range kClipMass{0, 1000};    // kg
/// Of a strip's length, by which its tip and the clamp's angle may be off.
constexpr double kStraight = 0.02;

const std::vector<std::string> kTests{"strip", "bias-extension", "picture-frame", "cantilever",
                                      "overhang"};
/// Names of a unit and what one is in SI; the first is what counts unless stated.
using Units = std::vector<std::pair<std::string, double>>;
const Units kAngleUnits{{"rad", 1}, {"deg", kDegree}};
const Units kForceUnits{{"N", 1}, {"mN", 1e-3}, {"cN", 1e-2}, {"gf", 9.80665e-3}};

bool overlap(const MaterialRectangle& a, const MaterialRectangle& b) {
  return (a.lower.array() < b.upper.array()).all() && (b.lower.array() < a.upper.array()).all();
}

/// Where the tables of a capture are asked for, for errors about several of their values.
struct FixtureSource {
  SourceLocation region, motion;
  // Of the poses; none in the short form.
  SourceLocation columns_where;
  std::filesystem::path file;
  std::vector<std::string> columns;
};

/// The line of a cantilevered strip, from the clamp to the tip.
struct Profile {
  MaterialPoints at;  ///< x horizontal, y up, m
  VecX arc;           ///< m from the clamp
};
Profile read_profile(const std::filesystem::path& path) {
  const TableFile file(path);
  Profile profile;
  const VecX x = file.numbers("x"), y = file.numbers("y");
  if (x.size() < kLeastProfile)
    throw error_at({path, 0, {}},
                   fmt::format("{} points; a profile has {} or more", x.size(), kLeastProfile));
  profile.at.resize(2, x.size());
  profile.at << x.transpose(), y.transpose();
  profile.arc = VecX::Zero(x.size());
  for (Eigen::Index i = 1; i < x.size(); ++i) {
    const double part = (profile.at.col(i) - profile.at.col(i - 1)).norm();
    if (!(part > kSamePoint))
      throw file.fail(static_cast<std::size_t>(i), "x", "the same point as the one before");
    profile.arc[i] = profile.arc[i - 1] + part;
  }
  if (profile.arc[x.size() - 1] > kSwatchSide.upper)
    throw error_at({path, 0, {}},
                   fmt::format("a strip of {:g} m, must be at most {:g}; x and y are in m",
                               profile.arc[x.size() - 1], kSwatchSide.upper));
  return profile;
}

/// A strip under gravity turns down from the clamp, which points `clamp_angle` (rad) below the
/// horizontal.
void check_orientation(const Profile& profile, double clamp_angle,
                       const std::filesystem::path& path) {
  constexpr const char* kMeaning =
      "x is away from the clamp, y is up, the first point at the clamp";
  const Vec2 tip = profile.at.col(profile.at.cols() - 1) - profile.at.col(0);
  if (!(tip.x() > 0))
    throw error_at({path, 0, {}},
                   fmt::format("the tip's x is {:g} m from the clamp's, must be above 0; {}",
                               tip.x(), kMeaning));
  const double above = std::cos(clamp_angle) * tip.y() + std::sin(clamp_angle) * tip.x();
  if (above > kStraight * profile.arc[profile.arc.size() - 1])
    throw error_at(
        {path, 0, {}},
        fmt::format("the tip is {:.3g} m above the line of the clamp, {:g} degrees below "
                    "the horizontal, must be below; {}",
                    above, clamp_angle / kDegree, kMeaning));
}

MeasuredGeometry profile_geometry(const MechanicalCapture& capture) {
  const Profile profile = read_profile(capture.geometry->points);
  return cantilever_geometry(capture, profile.arc, profile.at);
}

class MechanicalReader {
 public:
  explicit MechanicalReader(const std::filesystem::path& folder)
      : folder_(capture_folder(folder)), file_(parse_capture_file(folder_)) {}

  MechanicalCapture read() {
    read_head();
    if (file_.has("test"))
      read_standard_test();
    else
      read_general();
    file_.finish();
    check_clips();
    return std::move(capture_);
  }

 private:
  void read_head() {
    file_.choice("format", {"weft-capture"});
    file_.integer("version", 1, 1);
    if (file_.string("kind") == "video") {
      throw error_at(file_.where("kind"),
                     "a video; a mechanical capture (kind = \"mechanical\") is needed here");
    }
    file_.choice("kind", {"mechanical"});
    capture_.folder = folder_;
    capture_.name = file_.optional_string("name").value_or(
        (folder_.has_filename() ? folder_ : folder_.parent_path()).filename().string());
    capture_.description = file_.optional_string("description").value_or("");
    capture_.clip_noise = file_.optional_number("clip_noise", kClipNoise).value_or(0);
  }

  // The general form.

  void read_general() {
    const TomlTable swatch = file_.table("swatch");
    capture_.width = swatch.number("width", kSwatchSide);
    capture_.height = swatch.number("height", kSwatchSide);
    capture_.areal_density = swatch.number("areal_density", kArealDensity);
    capture_.grain_angle = read_grain_angle(swatch, 0);
    swatch.finish();
    if (const auto world = file_.optional_table("world")) {
      if (world->has("gravity")) {
        const std::vector<double> gravity = world->numbers("gravity", 3, kGravity);
        capture_.gravity = Vec3(gravity[0], gravity[1], gravity[2]);
      }
      world->finish();
    }
    const TomlTable frames = file_.table("frames");
    capture_.frame_count = frames.integer("count", 1, kMaxFrames);
    frames.finish();
    if (file_.optional_choice("drive", {"rigid", "cords"}).value_or("rigid") == "cords")
      capture_.drive = ClipDrive::cords;
    const std::vector<TomlTable> fixtures = file_.tables("fixture");
    if (fixtures.empty()) {
      throw error_at({file_.file(), 0, "fixture"}, "missing; at least one [[fixture]] is needed");
    }
    for (const TomlTable& table : fixtures) read_fixture(table);
    check_one_is_held();
    check_columns_differ();
    read_geometry_files();
    if (const auto truth = file_.optional_table("truth")) {
      capture_.truth = folder_ / truth->string("parameters");
      truth->finish();
    }
  }

  /// rad; `otherwise` in degrees.
  static double read_grain_angle(const TomlTable& table, double otherwise) {
    const double degrees =
        table.optional_number("grain_angle_deg", kGrainAngle).value_or(otherwise);
    return degrees * kDegree;
  }

  void read_fixture(const TomlTable& table) {
    MechanicalFixture fixture;
    fixture.name = table.string("name");
    if (!names_.insert(fixture.name).second) {
      throw error_at(table.where("name"),
                     fmt::format("two fixtures are named \"{}\"", fixture.name));
    }
    table.choice("kind", {"bar"});
    const MatX region = table.matrix("region", 2, 2);
    fixture.mass = table.optional_number("mass", kClipMass).value_or(0);
    const std::vector<TomlTable> cords = table.tables("cord");
    refuse_of_loaded(table, cords, fixture.mass);
    const TableFile& motion = table_file(table, "motion");
    const MatX poses = columns(table, "columns", 7, motion);
    MatX regions;
    if (table.has("region_columns")) regions = columns(table, "region_columns", 4, motion);
    if (table.has("force_columns"))
      fixture.forces = columns(table, "force_columns", 3, motion).transpose();
    for (int frame = 0; frame < capture_.frame_count; ++frame) {
      Clip clip;
      clip.region.lower = region.row(0);
      clip.region.upper = region.row(1);
      if (const std::string problem = region_problem(clip.region); !problem.empty())
        throw error_at(table.where("region"), problem);
      if (regions.size() > 0) {
        clip.region.lower = regions.row(frame).head<2>();
        clip.region.upper = regions.row(frame).tail<2>();
        if (const std::string problem = region_problem(clip.region); !problem.empty())
          throw motion.fail(static_cast<std::size_t>(frame), table.strings("region_columns", 4)[0],
                            problem);
      }
      const VecX pose = poses.row(frame);
      clip.position = pose.head<3>();
      const Eigen::Quaterniond rotation(pose[3], pose[4], pose[5], pose[6]);
      if (std::abs(rotation.norm() - 1) > kUnitLength) {
        throw motion.fail(static_cast<std::size_t>(frame), table.strings("columns", 7)[3],
                          fmt::format("quaternion of length {:g}; must be 1, as qw, qx, qy, qz",
                                      rotation.norm()));
      }
      clip.rotation = rotation.normalized();
      fixture.frames.push_back(clip);
    }
    for (const TomlTable& cord : cords) read_cord(cord, motion, fixture);
    table.finish();
    sources_.push_back({table.where("region"), table.where("motion"), table.where("columns"),
                        motion.path(), table.strings("columns", 7)});
    capture_.fixtures.push_back(std::move(fixture));
  }

  // Loaded clips.

  static void refuse_of_loaded(const TomlTable& table, const std::vector<TomlTable>& cords,
                               double mass) {
    if (table.has("mass") && cords.empty() && !(mass > 0))
      throw error_at(table.where("mass"),
                     "0, must be above 0 for a clip without a [[fixture.cord]]; a clip that is "
                     "held has no mass");
    if (cords.empty() && !(mass > 0)) return;
    if (table.has("force_columns"))
      throw error_at(table.where("force_columns"),
                     "not valid for a clip with cords or a mass: what pulls it is known");
    if (table.has("region_columns"))
      throw error_at(table.where("region_columns"),
                     "not valid for a clip with cords or a mass, which holds one region");
  }

  void read_cord(const TomlTable& table, const TableFile& motion,
                 MechanicalFixture& fixture) const {
    FixtureCord cord;
    const std::vector<double> place = table.numbers("at", 3, kCordPlace);
    cord.at = Vec3(place[0], place[1], place[2]);
    if (table.has("pulley") == table.has("force_columns"))
      throw error_at(table.where(), "either pulley, with tension, or force_columns is needed");
    if (table.has("pulley")) {
      const std::vector<double> pulley = table.numbers("pulley", 3, kPulley);
      cord.pulley = Vec3(pulley[0], pulley[1], pulley[2]);
      cord.tensions = tension_column(table, motion);
      check_pulley(table, fixture, cord);
    } else {
      cord.forces = columns(table, "force_columns", 3, motion).transpose();
    }
    table.finish();
    fixture.cords.push_back(std::move(cord));
  }

  VecX tension_column(const TomlTable& table, const TableFile& motion) const {
    const std::string name = table.string("tension");
    if (!motion.has(name)) throw error_at(table.where("tension"), motion.missing(name));
    VecX tensions = motion.numbers(name);
    for (Eigen::Index i = 0; i < tensions.size(); ++i)
      if (!(tensions[i] >= 0))
        throw motion.fail(static_cast<std::size_t>(i), name,
                          fmt::format("{:g} N, must be 0 or more: a cord only pulls", tensions[i]));
    return tensions;
  }

  static void check_pulley(const TomlTable& table, const MechanicalFixture& fixture,
                           const FixtureCord& cord) {
    for (std::size_t frame = 0; frame < fixture.frames.size(); ++frame) {
      const Clip& clip = fixture.frames[frame];
      const double length = (clip.position + clip.rotation * cord.at - *cord.pulley).norm();
      if (!(length > kLeastCord))
        throw error_at(table.where("pulley"),
                       fmt::format("{:g} m from where the cord is tied at frame {}, must be above "
                                   "{:g} m",
                                   length, frame, kLeastCord));
    }
  }

  void check_one_is_held() const {
    for (const MechanicalFixture& fixture : capture_.fixtures)
      if (!fixture.loaded()) return;
    throw error_at({file_.file(), 0, "fixture"},
                   "all have cords or a mass; at least one must be held, without either");
  }

  /// Two clips cannot be in one place.
  void check_columns_differ() const {
    for (std::size_t j = 0; j < sources_.size(); ++j)
      for (std::size_t i = 0; i < j; ++i) {
        const FixtureSource &a = sources_[i], &b = sources_[j];
        if (a.file != b.file || a.columns != b.columns) continue;
        throw error_at(
            b.columns_where,
            fmt::format("\"{}\" and \"{}\" have the same columns of {}", capture_.fixtures[i].name,
                        capture_.fixtures[j].name, b.file.filename().string()));
      }
  }

  const TableFile& table_file(const TomlTable& table, std::string_view key) {
    const std::filesystem::path path = folder_ / table.string(key);
    check_file_exists(path, table.where(key));
    return tables_.try_emplace(path, path).first->second;
  }

  /// The columns that `key` names: frames x count.
  MatX columns(const TomlTable& table, std::string_view key, std::size_t count,
               const TableFile& file) const {
    if (file.row_count() != static_cast<std::size_t>(capture_.frame_count)) {
      throw error_at({file.path(), 0, {}}, fmt::format("{} rows; the capture has {} frames",
                                                       file.row_count(), capture_.frame_count));
    }
    MatX values(capture_.frame_count, static_cast<Eigen::Index>(count));
    Eigen::Index column = 0;
    std::set<std::string> known;
    for (const std::string& name : table.strings(key, count)) {
      if (!file.has(name)) throw error_at(table.where(key), file.missing(name));
      const VecX numbers = file.numbers(name);
      // What stays the same, a zero, may stand for several.
      if (!known.insert(name).second && numbers.minCoeff() < numbers.maxCoeff())
        throw error_at(table.where(key), fmt::format("\"{}\" is named twice", name));
      values.col(column++) = numbers;
    }
    return values;
  }

  /// Empty for a valid region.
  std::string region_problem(const MaterialRectangle& region) const {
    if (!(region.lower.array() < region.upper.array()).all())
      return "the first corner must be below and left of the second";
    const bool inside = region.lower.minCoeff() >= -kOnSwatch &&
                        region.upper.x() <= capture_.width + kOnSwatch &&
                        region.upper.y() <= capture_.height + kOnSwatch;
    if (inside) return {};
    return fmt::format("({:g}, {:g}) to ({:g}, {:g}) m reaches off the swatch of {:g} x {:g} m",
                       region.lower.x(), region.lower.y(), region.upper.x(), region.upper.y(),
                       capture_.width, capture_.height);
  }

  void read_geometry_files() {
    const auto geometry = file_.optional_table("geometry");
    if (!geometry) return;
    GeometryFiles files;
    files.rest_mesh = folder_ / geometry->string("rest_mesh");
    files.points = folder_ / geometry->string("points");
    geometry->finish();
    for (const auto& [key, path] :
         {std::pair{"rest_mesh", files.rest_mesh}, std::pair{"points", files.points}})
      check_file_exists(path, geometry->where(key));
    capture_.geometry = files;
  }

  // The short form: a curve and the size of the specimen.

  void read_standard_test() {
    const std::string test = file_.choice("test", kTests);
    if (test == "cantilever") {
      read_cantilever();
      return;
    }
    if (test == "overhang") {
      read_overhang();
      return;
    }
    if (test == "picture-frame") {
      read_picture_frame();
      return;
    }
    const TomlTable specimen = file_.table("specimen");
    const double free_length = specimen.number("free_length", kSwatchSide);
    const Specimen size = read_specimen(specimen, free_length, test == "bias-extension" ? 45 : 0);
    const TomlTable curve = file_.table("curve");
    const TableFile& file = table_file(curve, "file");
    const VecX displacement =
        curve_column(curve, "displacement", file) * length_factor(curve, "displacement_unit");
    check_jaws(curve, file, displacement, free_length);
    const VecX force = force_column(curve, "displacement", file);
    curve.finish();
    check_has_rows(file);
    take(strip_capture(size, displacement, force));
    sources_.assign(2, {curve.where("displacement"), curve.where("displacement"), {}, {}, {}});
  }

  static void check_has_rows(const TableFile& file) {
    if (file.row_count() == 0) throw error_at({file.path(), 0, {}}, "no rows below the header");
  }

  /// A square that a frame of bars shears; the force is that of the crosshead.
  void read_picture_frame() {
    if (file_.has("clip_noise"))
      throw error_at(file_.where("clip_noise"),
                     "not valid for a picture frame, whose bars are joined by hinges");
    const TomlTable table = file_.table("specimen");
    Specimen size;
    size.width = size.free_length = table.number("side", kSwatchSide);
    PictureFrame frame;
    frame.side = table.number("frame_side", {size.width, kSwatchSide.upper});
    size.areal_density = table.number("areal_density", kArealDensity);
    size.grain_angle = read_grain_angle(table, 0);
    table.finish();
    const TomlTable curve = file_.table("curve");
    const TableFile& file = table_file(curve, "file");
    frame.shear = shear_of_frame(curve, file, frame.side);
    const VecX force =
        force_column(curve, curve.has("shear_angle") ? "shear_angle" : "displacement", file);
    curve.finish();
    check_has_rows(file);
    take(picture_frame_capture(size, std::move(frame), force));
  }

  /// From the column of one or the other, rad.
  static VecX shear_of_frame(const TomlTable& curve, const TableFile& file, double side) {
    if (curve.has("displacement") == curve.has("shear_angle"))
      throw error_at(curve.where(), "either displacement or shear_angle is needed");
    const bool angles = curve.has("shear_angle");
    const std::string_view key = angles ? "shear_angle" : "displacement";
    const double unit = angles ? unit_factor(curve, "shear_angle_unit", kAngleUnits)
                               : length_factor(curve, "displacement_unit");
    VecX values = curve_column(curve, key, file) * unit;
    const double most = angles ? most_frame_shear : frame_displacement(side, most_frame_shear);
    const double least = angles ? -most : frame_displacement(side, -most_frame_shear);
    for (Eigen::Index i = 0; i < values.size(); ++i) {
      if (values[i] >= least && values[i] <= most) {
        if (!angles) values[i] = frame_shear(side, values[i]);
        continue;
      }
      throw file.fail(static_cast<std::size_t>(i), curve.string(key),
                      fmt::format("{:g} {} is out of range; must be in [{:g}, {:g}], a shear of "
                                  "-80 to 80 degrees",
                                  values[i], angles ? "rad" : "m", least, most));
    }
    return values;
  }

  /// A strip in a clip, with the profile of its line as the measured shape.
  void read_cantilever() {
    const TomlTable specimen = file_.table("specimen");
    Specimen size = read_specimen(specimen, 0, 0);
    const TomlTable table = file_.table("profile");
    const TableFile& file = table_file(table, "file");
    for (const char* column : {"x", "y"})
      if (!file.has(column)) throw error_at(table.where("file"), file.missing(column));
    const double degrees = table.optional_number("clamp_angle_deg", kClampAngle).value_or(0);
    table.finish();
    const Profile profile = read_profile(file.path());
    check_orientation(profile, degrees * kDegree, file.path());
    size.free_length = profile.arc[profile.arc.size() - 1];
    take(cantilever_capture(size, degrees * kDegree, profile.at.col(0)));
    sources_.assign(1, {table.where("file"), table.where("file"), {}, {}, {}});
    capture_.geometry = GeometryFiles{file.path(), file.path()};
  }

  /// A strip that is pushed over an edge: what is read is how far it overhangs.
  void read_overhang() {
    if (file_.has("clip_noise"))
      throw error_at(file_.where("clip_noise"),
                     "not valid for an overhang; overhang.deviation is the noise of a reading");
    const Specimen size = read_specimen(file_.table("specimen"), 0, 0);
    const TomlTable table = file_.table("overhang");
    OverhangTest test;
    const double unit = length_factor(table, "length_unit");
    test.lengths = overhang_readings(table, unit) * unit;
    test.angle =
        table.optional_number("angle_deg", kOverhangAngle).value_or(test.angle / kDegree) * kDegree;
    const Range valid{kOverhangDeviation.lower / unit, kOverhangDeviation.upper / unit};
    const auto deviation = table.optional_number("deviation", valid);
    test.deviation = deviation ? *deviation * unit : overhang_deviation(test.lengths);
    table.finish();
    take(overhang_capture(size, std::move(test)));
    sources_.assign(1, {table.where(), table.where(), {}, {}, {}});
  }

  /// In the table's unit of `unit` m.
  VecX overhang_readings(const TomlTable& table, double unit) {
    if (table.has("lengths") == table.has("file"))
      throw error_at(table.where(), "either lengths or file is needed");
    const Range valid{kOverhang.lower / unit, kOverhang.upper / unit};
    if (table.has("lengths")) {
      const std::vector<double> lengths =
          table.numbers("lengths", table.array_size("lengths", 1, kMostOverhangs), valid);
      return VecX::Map(lengths.data(), static_cast<Eigen::Index>(lengths.size()));
    }
    const TableFile& file = table_file(table, "file");
    const VecX lengths = curve_column(table, "column", file);
    check_has_rows(file);
    if (lengths.size() > kMostOverhangs)
      throw error_at({file.path(), 0, {}}, fmt::format("{} readings; at most {} are valid",
                                                       lengths.size(), kMostOverhangs));
    for (Eigen::Index i = 0; i < lengths.size(); ++i)
      if (!(lengths[i] >= valid.lower && lengths[i] <= valid.upper))
        throw file.fail(static_cast<std::size_t>(i), table.string("column"),
                        fmt::format("{:g} is out of range; must be in [{:g}, {:g}]; is length_unit "
                                    "right?",
                                    lengths[i], valid.lower, valid.upper));
    return lengths;
  }

  /// `grain_angle`: degrees, where the table states none.
  static Specimen read_specimen(const TomlTable& table, double free_length, double grain_angle) {
    Specimen specimen{free_length};
    specimen.width = table.number("width", kSwatchSide);
    specimen.areal_density = table.number("areal_density", kArealDensity);
    specimen.grain_angle = read_grain_angle(table, grain_angle);
    table.finish();
    return specimen;
  }

  /// Specimen and clips of `test`; what the head says stays.
  void take(MechanicalCapture test) {
    test.folder = capture_.folder;
    test.name = capture_.name;
    test.description = capture_.description;
    test.clip_noise = capture_.clip_noise;
    capture_ = std::move(test);
  }

  static VecX curve_column(const TomlTable& curve, std::string_view key, const TableFile& file) {
    const std::string name = curve.string(key);
    if (!file.has(name)) throw error_at(curve.where(key), file.missing(name));
    return file.numbers(name);
  }

  /// N, of the curve whose other column `motion` names.
  static VecX force_column(const TomlTable& curve, std::string_view motion, const TableFile& file) {
    const std::string name = curve.string("force");
    if (name == curve.string(motion))
      throw error_at(curve.where("force"),
                     fmt::format("\"{}\" is the column of {}, too", name, motion));
    return curve_column(curve, "force", file) * unit_factor(curve, "force_unit", kForceUnits);
  }

  /// `displacement`: m, of jaws `free_length` m apart, which cannot pass through each other.
  static void check_jaws(const TomlTable& curve, const TableFile& file, const VecX& displacement,
                         double free_length) {
    const double most = (kMaxClipStretch - 1) * free_length;
    for (Eigen::Index i = 0; i < displacement.size(); ++i) {
      if (displacement[i] > -free_length && displacement[i] <= most) continue;
      throw file.fail(static_cast<std::size_t>(i), curve.string("displacement"),
                      fmt::format("{:g} m is out of range; must be above {:g} and at most {:g}, of "
                                  "a free length of {:g} m; is displacement_unit right?",
                                  displacement[i], -free_length, most, free_length));
    }
  }

  // Of all clips together.

  void check_clips() const {
    for (int frame = 0; frame < capture_.frame_count; ++frame) {
      const std::vector<Clip> clips = capture_.clips(frame);
      for (std::size_t j = 0; j < clips.size(); ++j)
        for (std::size_t i = 0; i < j; ++i) check_pair(frame, i, clips[i], j, clips[j]);
    }
  }

  void check_pair(int frame, std::size_t i, const Clip& a, std::size_t j, const Clip& b) const {
    const std::string names =
        fmt::format("\"{}\" and \"{}\"", capture_.fixtures[i].name, capture_.fixtures[j].name);
    if (overlap(a.region, b.region)) {
      throw error_at(sources_[j].region,
                     fmt::format("regions of {} overlap at frame {}", names, frame));
    }
    const double now = (a.position - b.position).norm();
    // How near clips may come is the test's; of one that is not held its place is a start.
    const bool held = !capture_.fixtures[i].loaded() && !capture_.fixtures[j].loaded();
    if (held && now < kSamePoint)
      throw error_at(sources_[j].motion,
                     fmt::format("{} are in one place at frame {}", names, frame));
    const double flat = (a.region.center() - b.region.center()).norm();
    if (now > kMaxClipStretch * flat) {
      throw error_at(
          sources_[j].motion,
          fmt::format("{} are {:g} m apart at frame {}, {:g} m on the undeformed swatch; at most "
                      "{:g} times that is valid",
                      names, now, frame, flat, kMaxClipStretch));
    }
  }

  std::filesystem::path folder_;
  TomlTable file_;
  MechanicalCapture capture_;
  std::set<std::string> names_;
  std::map<std::filesystem::path, TableFile> tables_;
  std::vector<FixtureSource> sources_;
};

}  // namespace

CaptureKind capture_kind(const std::filesystem::path& folder) {
  const TomlTable file = parse_capture_file(folder);
  file.choice("format", {"weft-capture"});
  const std::string kind = file.choice("kind", {"video", "mechanical", "scan"});
  if (kind == "video") return CaptureKind::video;
  return kind == "mechanical" ? CaptureKind::mechanical : CaptureKind::scan;
}

std::vector<Clip> MechanicalCapture::clips(int frame) const {
  std::vector<Clip> result;
  for (const MechanicalFixture& fixture : fixtures)
    result.push_back(fixture.frames[static_cast<std::size_t>(frame)]);
  return result;
}

std::optional<ClipLoad> MechanicalFixture::load(int frame) const {
  if (!loaded()) return std::nullopt;
  ClipLoad load;
  load.mass = mass;
  for (const FixtureCord& cord : cords) {
    Cord& pull = load.cords.emplace_back();
    pull.at = cord.at;
    pull.pulley = cord.pulley;
    if (cord.pulley)
      pull.tension = cord.tensions[frame];
    else
      pull.force = cord.forces.col(frame);
  }
  return load;
}

std::vector<std::optional<ClipLoad>> MechanicalCapture::loads(int frame) const {
  std::vector<std::optional<ClipLoad>> result;
  for (const MechanicalFixture& fixture : fixtures) result.push_back(fixture.load(frame));
  return result;
}

bool MechanicalCapture::has_loaded() const {
  return std::ranges::any_of(fixtures, &MechanicalFixture::loaded);
}

Vec2 MechanicalCapture::pose_deviations(const Clip& clip, double otherwise) const {
  const double deviation = clip_noise > 0 ? clip_noise : otherwise;
  return {deviation, deviation / half_length(clip)};
}

MechanicalCapture read_mechanical_capture(const std::filesystem::path& folder) {
  return MechanicalReader(folder).read();
}

MeasuredGeometry read_geometry(const MechanicalCapture& capture) {
  if (!capture.geometry) throw Error(fmt::format("capture \"{}\" has no [geometry]", capture.name));
  if (capture.geometry->points == capture.geometry->rest_mesh) return profile_geometry(capture);
  const std::filesystem::path& mesh_path = capture.geometry->rest_mesh;
  MeasuredGeometry geometry;
  geometry.mesh = read_material_surface(mesh_path).mesh;
  check_on_swatch(geometry.mesh, capture.width, capture.height, mesh_path);
  const std::filesystem::path& path = capture.geometry->points;
  geometry.frames = read_pc2(path).frames;
  if (geometry.frames.front().cols() != geometry.mesh.vertex_count()) {
    throw error_at({path, 0, {}},
                   fmt::format("{} points; {} has {} vertices", geometry.frames.front().cols(),
                               mesh_path.filename().string(), geometry.mesh.vertex_count()));
  }
  if (geometry.frames.size() != static_cast<std::size_t>(capture.frame_count)) {
    throw error_at({path, 0, {}}, fmt::format("{} samples; the capture has {} frames",
                                              geometry.frames.size(), capture.frame_count));
  }
  return geometry;
}

}  // namespace weft
