#include "weft/capture/mechanical_writer.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <fstream>
#include <numbers>

#include "weft/base/error.h"
#include "weft/base/text_file.h"
#include "weft/mesh/mesh_io.h"

namespace weft {
namespace {

constexpr std::string_view kClipsFile = "clips.csv";
constexpr std::array<std::string_view, 7> kPose{"px", "py", "pz", "qw", "qx", "qy", "qz"};
constexpr std::array<std::string_view, 3> kForce{"fx", "fy", "fz"};
constexpr std::string_view kTension = "tension";
constexpr std::array<std::string_view, 4> kRegion{"u0", "v0", "u1", "v1"};

std::string rectangle(const MaterialRectangle& r) {
  return fmt::format("[[{}, {}], [{}, {}]]", r.lower.x(), r.lower.y(), r.upper.x(), r.upper.y());
}

bool region_changes(const MechanicalFixture& fixture) {
  for (const Clip& clip : fixture.frames)
    if (!(clip.region == fixture.frames.front().region)) return true;
  return false;
}

/// Names of the columns of fixture `i`; a fixture's own name need not be one.
template <std::size_t n>
std::vector<std::string> names(std::size_t i, const std::array<std::string_view, n>& what) {
  std::vector<std::string> result;
  for (const std::string_view name : what) result.push_back(fmt::format("clip{}_{}", i, name));
  return result;
}

std::string quoted(const std::vector<std::string>& names) {
  return fmt::format("[\"{}\"]", fmt::join(names, "\", \""));
}

/// Of what is measured of cord `k` of fixture `i`.
std::vector<std::string> cord_names(std::size_t i, std::size_t k, const FixtureCord& cord) {
  std::vector<std::string> result;
  if (cord.pulley) return {fmt::format("clip{}_cord{}_{}", i, k, kTension)};
  for (const std::string_view name : kForce)
    result.push_back(fmt::format("clip{}_cord{}_{}", i, k, name));
  return result;
}

std::string vector_text(const Vec3& v) { return fmt::format("[{}, {}, {}]", v.x(), v.y(), v.z()); }

std::string cord_text(const FixtureCord& cord, std::size_t i, std::size_t k) {
  std::string text = "\n[[fixture.cord]]\nat = " + vector_text(cord.at) + "  # m\n";
  const std::vector<std::string> columns = cord_names(i, k, cord);
  if (cord.pulley)
    return text + fmt::format("pulley = {}  # m\ntension = \"{}\"\n", vector_text(*cord.pulley),
                              columns.front());
  return text + "force_columns = " + quoted(columns) + "\n";
}

std::string fixture_text(const MechanicalFixture& fixture, std::size_t i) {
  std::string text = "\n[[fixture]]\nname = " + toml_string(fixture.name) + "\nkind = \"bar\"\n";
  text += "region = " + rectangle(fixture.frames.front().region) + "  # m\n";
  text += fmt::format("motion = \"{}\"\n", kClipsFile);
  text += "columns = " + quoted(names(i, kPose)) + "\n";
  if (fixture.forces.cols() > 0) text += "force_columns = " + quoted(names(i, kForce)) + "\n";
  if (region_changes(fixture)) text += "region_columns = " + quoted(names(i, kRegion)) + "\n";
  if (fixture.mass > 0) text += fmt::format("mass = {}  # kg\n", fixture.mass);
  for (std::size_t k = 0; k < fixture.cords.size(); ++k) text += cord_text(fixture.cords[k], i, k);
  return text;
}

std::string head_text(const MechanicalCapture& capture) {
  std::string text = "format = \"weft-capture\"\nversion = 1\nkind = \"mechanical\"\n";
  text += "name = " + toml_string(capture.name) + "\n";
  text += "description = " + toml_string(capture.description) + "\n";
  if (capture.drive == ClipDrive::cords) text += "drive = \"cords\"\n";
  if (capture.clip_noise > 0) text += fmt::format("clip_noise = {}  # m\n", capture.clip_noise);
  text +=
      fmt::format("\n[swatch]\nwidth = {}  # m\nheight = {}  # m\n", capture.width, capture.height);
  text += fmt::format("areal_density = {}  # kg/m^2\n", capture.areal_density);
  text += fmt::format("grain_angle_deg = {}\n", capture.grain_angle * 180 / std::numbers::pi);
  text += fmt::format("\n[world]\ngravity = [{}, {}, {}]  # m/s^2\n", capture.gravity.x(),
                      capture.gravity.y(), capture.gravity.z());
  return text + fmt::format("\n[frames]\ncount = {}\n", capture.frame_count);
}

std::string cord_values(const FixtureCord& cord, int frame) {
  if (cord.pulley) return fmt::format(",{}", cord.tensions[frame]);
  const Vec3 f = cord.forces.col(frame);
  return fmt::format(",{},{},{}", f.x(), f.y(), f.z());
}

std::string table_text(const MechanicalCapture& capture) {
  std::vector<std::string> header{"frame"};
  const auto add = [&](const std::vector<std::string>& more) {
    header.insert(header.end(), more.begin(), more.end());
  };
  for (std::size_t i = 0; i < capture.fixtures.size(); ++i) {
    add(names(i, kPose));
    if (capture.fixtures[i].forces.cols() > 0) add(names(i, kForce));
    if (region_changes(capture.fixtures[i])) add(names(i, kRegion));
    for (std::size_t k = 0; k < capture.fixtures[i].cords.size(); ++k)
      add(cord_names(i, k, capture.fixtures[i].cords[k]));
  }
  std::string text = fmt::format("{}\n", fmt::join(header, ","));
  for (int frame = 0; frame < capture.frame_count; ++frame) {
    text += fmt::format("{}", frame);
    for (const MechanicalFixture& fixture : capture.fixtures) {
      const Clip& clip = fixture.frames[at(frame)];
      const Vec3& p = clip.position;
      const Eigen::Quaterniond& q = clip.rotation;
      text += fmt::format(",{},{},{},{},{},{},{}", p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z());
      if (fixture.forces.cols() > 0) {
        const Vec3 f = fixture.forces.col(frame);
        text += fmt::format(",{},{},{}", f.x(), f.y(), f.z());
      }
      if (region_changes(fixture)) {
        const MaterialRectangle& r = clip.region;
        text += fmt::format(",{},{},{},{}", r.lower.x(), r.lower.y(), r.upper.x(), r.upper.y());
      }
      for (const FixtureCord& cord : fixture.cords) text += cord_values(cord, frame);
    }
    text += "\n";
  }
  return text;
}

std::string write_geometry(const std::filesystem::path& folder, const MeasuredGeometry& geometry) {
  Points flat = Points::Zero(3, geometry.mesh.vertex_count());
  flat.topRows<2>() = geometry.mesh.material;
  write_obj(folder / "rest.obj", geometry.mesh, flat, "measured points; vt = (u, v) in m");
  write_pc2(folder / "points.pc2", {.frames = geometry.frames});
  return "\n[geometry]\nrest_mesh = \"rest.obj\"\npoints = \"points.pc2\"\n";
}

void check(const std::filesystem::path& folder, const MechanicalCapture& capture,
           const MechanicalFiles& files) {
  const auto refuse = [&](const std::string& what) { throw error_at({folder, 0, {}}, what); };
  if (capture.picture_frame) refuse("a picture frame has no general form to write");
  if (capture.overhang) refuse("an overhang test has no general form to write");
  for (const MechanicalFixture& fixture : capture.fixtures) {
    if (fixture.frames.size() != at(capture.frame_count))
      refuse(fmt::format("fixture \"{}\" has {} frames; the capture has {}", fixture.name,
                         fixture.frames.size(), capture.frame_count));
    if (fixture.forces.cols() > 0 && fixture.forces.cols() != capture.frame_count)
      refuse(fmt::format("fixture \"{}\" has forces at {} frames; the capture has {}", fixture.name,
                         fixture.forces.cols(), capture.frame_count));
    if (!fixture.forces.allFinite())
      refuse(fmt::format("fixture \"{}\": a force component is not finite", fixture.name));
    if (fixture.loaded() && (fixture.forces.cols() > 0 || region_changes(fixture)))
      refuse(
          fmt::format("fixture \"{}\" has cords or a mass and cannot have measured forces or "
                      "several regions",
                      fixture.name));
    for (const FixtureCord& cord : fixture.cords)
      if ((cord.pulley ? cord.tensions.size() : cord.forces.cols()) != capture.frame_count)
        refuse(fmt::format("fixture \"{}\" has a cord without a force at each of {} frames",
                           fixture.name, capture.frame_count));
  }
  if (files.geometry && files.geometry->frames.size() != at(capture.frame_count))
    refuse(
        fmt::format("{} shapes for {} frames", files.geometry->frames.size(), capture.frame_count));
}

}  // namespace

void write_mechanical_capture(const std::filesystem::path& folder, const MechanicalCapture& capture,
                              const MechanicalFiles& files) {
  check(folder, capture, files);
  make_folder(folder);
  std::string text = head_text(capture);
  for (std::size_t i = 0; i < capture.fixtures.size(); ++i)
    text += fixture_text(capture.fixtures[i], i);
  if (files.geometry) text += write_geometry(folder, *files.geometry);
  if (!files.truth.empty()) {
    make_folder(folder / "truth");
    write_text(folder / "truth/parameters.toml", files.truth);
    text += "\n[truth]\nparameters = \"truth/parameters.toml\"\n";
  }
  write_text(folder / kClipsFile, table_text(capture));
  // Last: a folder with a capture.toml is a whole capture.
  write_text(folder / "capture.toml", text);
}

}  // namespace weft
