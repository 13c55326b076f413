#include <fmt/format.h>

#include <cmath>
#include <map>
#include <set>

#include "weft/base/error.h"
#include "weft/base/toml_reader.h"
#include "weft/capture/capture.h"
#include "weft/capture/capture_checks.h"
#include "weft/capture/capture_file.h"
#include "weft/capture/motion_file.h"

namespace weft {
namespace {

constexpr Range kAnyNumber{-kInfinity, kInfinity};

/// Reads capture.toml from top to bottom into a Capture.
class CaptureReader {
 public:
  explicit CaptureReader(const std::filesystem::path& folder)
      : folder_(capture_folder(folder)), file_(parse_capture_file(folder_)) {}

  Capture read() {
    read_head();
    read_swatch();
    read_world();
    read_video();
    read_fixtures();
    read_camera();
    read_projector();
    read_truth();
    file_.finish();
    check_view(capture_, {file_.table("camera").where("projection"),
                          file_.table("projector").where("projection")});
    return std::move(capture_);
  }

 private:
  void read_head() {
    file_.choice("format", {"weft-capture"});
    file_.integer("version", 1, 1);
    const std::string kind = file_.string("kind");
    if (kind == "mechanical") {
      throw error_at(file_.where("kind"),
                     "a mechanical capture; this command needs a video, mechanical ones go to "
                     "weft check, evaluate, fit and profile");
    }
    if (kind == "scan") {
      throw error_at(file_.where("kind"),
                     "a scan; this command needs a video, scans go to weft check, evaluate, fit "
                     "and profile");
    }
    file_.choice("kind", {"video"});
    capture_.folder = folder_;
    capture_.name = file_.optional_string("name").value_or(default_name());
    capture_.description = file_.optional_string("description").value_or("");
  }

  std::string default_name() const {
    // "a/b/" has an empty last component.
    return folder_.has_filename() ? folder_.filename().string()
                                  : folder_.parent_path().filename().string();
  }

  void read_swatch() {
    const TomlTable swatch = file_.table("swatch");
    capture_.width = swatch.number("width", kSwatchSide);
    capture_.height = swatch.number("height", kSwatchSide);
    capture_.areal_density = swatch.number("areal_density", kArealDensity);
    capture_.hem_width = swatch.optional_number("hem_width", kHemWidth).value_or(0);
    swatch.finish();
  }

  void read_world() {
    const auto world = file_.optional_table("world");
    if (!world) return;
    if (world->has("gravity")) {
      const std::vector<double> gravity = world->numbers("gravity", 3, kGravity);
      capture_.gravity = Vec3(gravity[0], gravity[1], gravity[2]);
    }
    world->finish();
  }

  void read_video() {
    const TomlTable video = file_.table("video");
    capture_.video = folder_ / video.string("file");
    capture_.frame_rate = video.number("frame_rate", kFrameRate);
    capture_.frame_count = video.integer("frame_count", 1, kMaxFrames);
    const int last = capture_.frame_count - 1;
    capture_.fit_last = last;
    if (video.has("fit_frames")) {
      const std::vector<int> fit = video.integers("fit_frames", 2, 0, last);
      if (fit[0] > fit[1]) {
        throw error_at(video.where("fit_frames"),
                       fmt::format("first frame {} is after last frame {}", fit[0], fit[1]));
      }
      capture_.fit_first = fit[0];
      capture_.fit_last = fit[1];
    }
    video.optional_choice("start", {"at-rest"});
    if (video.has("start_surface")) {
      capture_.start_surface = folder_ / video.string("start_surface");
      check_file_exists(*capture_.start_surface, video.where("start_surface"));
    }
    video.finish();
    check_video_exists(capture_.video, video.where("file"));
  }

  void read_fixtures() {
    const std::vector<TomlTable> tables = file_.tables("fixture");
    if (tables.empty()) {
      throw error_at({file_.file(), 0, "fixture"}, "missing; at least one [[fixture]] is needed");
    }
    for (const TomlTable& table : tables) read_fixture(table);
    check_stretch(capture_, samples_);
  }

  void read_fixture(const TomlTable& table) {
    CaptureFixture fixture;
    fixture.name = table.string("name");
    if (!names_.insert(fixture.name).second) {
      throw error_at(table.where("name"),
                     fmt::format("two fixtures are named \"{}\"", fixture.name));
    }
    table.choice("kind", {"point"});
    fixture.at = read_material_point(table);
    const MotionFile& file = motion_file(table);
    const std::vector<std::string> columns = table.strings("columns", 3);
    for (const std::string& column : columns) {
      if (!file.has(column)) {
        throw error_at(table.where("columns"), fmt::format("{} has no column \"{}\"; it has {}",
                                                           file.path().filename().string(), column,
                                                           fmt::join(file.header(), ", ")));
      }
    }
    fixture.motion = Motion(file.times(), file.positions(columns));
    table.finish();
    check_covers_video(capture_, file);
    samples_.push_back(
        {table.where("motion"), table.where("columns"), file.path(), columns, file.times()});
    capture_.fixtures.push_back(std::move(fixture));
  }

  Vec2 read_material_point(const TomlTable& table) const {
    const std::vector<double> at = table.numbers("at", 2, kAnyNumber);
    const bool inside =
        at[0] >= 0 && at[0] <= capture_.width && at[1] >= 0 && at[1] <= capture_.height;
    if (!inside) {
      throw error_at(table.where("at"),
                     fmt::format("({:g}, {:g}) is off the swatch; u must be in [0, {:g}], v in "
                                 "[0, {:g}]",
                                 at[0], at[1], capture_.width, capture_.height));
    }
    return {at[0], at[1]};
  }

  const MotionFile& motion_file(const TomlTable& table) {
    const std::filesystem::path path = folder_ / table.string("motion");
    check_file_exists(path, table.where("motion"));
    return motion_files_.try_emplace(path, path).first->second;
  }

  /// Where devices are known to look: the fixtures' mean position at the first frame.
  Vec3 point_in_front() const {
    Vec3 sum = Vec3::Zero();
    for (const CaptureFixture& fixture : capture_.fixtures) sum += fixture.motion.position(0);
    return sum / static_cast<double>(capture_.fixtures.size());
  }

  Pinhole read_pinhole(const TomlTable& table, std::string_view name) const {
    const Projection projection = table.matrix("projection", 3, 4);
    return with_errors_at(table.where("projection"),
                          [&] { return Pinhole(projection, point_in_front(), name); });
  }

  void read_camera() {
    const TomlTable camera = file_.table("camera");
    capture_.rig.width = camera.integer("width", kMinImageSide, kMaxImageSide);
    capture_.rig.height = camera.integer("height", kMinImageSide, kMaxImageSide);
    capture_.rig.camera = read_pinhole(camera, "camera");
    if (camera.has("distortion")) {
      const std::vector<double> k = camera.numbers("distortion", 5, kDistortion);
      capture_.distortion = LensDistortion{k[0], k[1], k[2], k[3], k[4]};
    }
    camera.finish();
  }

  void read_projector() {
    const TomlTable projector = file_.table("projector");
    Rig& rig = capture_.rig;
    rig.projector = read_pinhole(projector, "projector");
    const bool sine = projector.choice("pattern", {"square", "sine"}) == "sine";
    rig.pattern.profile = sine ? StripePattern::Profile::sine : StripePattern::Profile::square;
    rig.pattern.period = projector.number("stripe_period", kStripePeriod);
    if (const auto gain = projector.optional_number("edge_gain", kEdgeGain)) {
      rig.pattern.edge_gain = *gain;
    }
    if (const auto level = projector.optional_number("black_level", kBlackLevel)) {
      rig.pattern.black_level = *level;
    }
    const auto width = projector.optional_number("width", kProjectorSide);
    const auto height = projector.optional_number("height", kProjectorSide);
    if (width.has_value() != height.has_value()) {
      throw error_at(projector.where(width ? "width" : "height"),
                     "width and height must be given together, or neither");
    }
    rig.projector_width = width.value_or(0);
    rig.projector_height = height.value_or(0);
    projector.finish();
  }

  void read_truth() {
    const auto truth = file_.optional_table("truth");
    if (!truth) return;
    capture_.truth =
        TruthFiles{folder_ / truth->string("rest_mesh"), folder_ / truth->string("points")};
    truth->finish();
  }

  std::filesystem::path folder_;
  TomlTable file_;
  Capture capture_;
  std::set<std::string> names_;
  std::map<std::filesystem::path, MotionFile> motion_files_;
  std::vector<FixtureSamples> samples_;
};

}  // namespace

Capture read_capture(const std::filesystem::path& folder) { return CaptureReader(folder).read(); }

}  // namespace weft
