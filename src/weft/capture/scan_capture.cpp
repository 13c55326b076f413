#include "weft/capture/scan_capture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>
#include <set>

#include "weft/base/quantile.h"
#include "weft/base/text_file.h"
#include "weft/base/toml_reader.h"
#include "weft/capture/capture_checks.h"
#include "weft/capture/capture_file.h"
#include "weft/capture/landmark_file.h"
#include "weft/capture/material_cover.h"
#include "weft/capture/table_file.h"
#include "weft/mesh/mesh_io.h"

namespace weft {
namespace {

constexpr Range kGrainAngle{-360, 360};  // degrees
constexpr Range kForceRange{0, 1e4};     // N
constexpr Range kWeight{0, 1e3};         // kg
constexpr Range kForceNoise{1e-9, 1e3};  // N
constexpr Range kNoise{1e-9, 0.1};       // m
constexpr Range kUnit{1e-9, 1e6};        // m
constexpr Range kDirection{-1e6, 1e6};
constexpr double kCoverSlack = 0.1;  // of the swatch's longer side
constexpr double kLargestRatio = 3;  // of an edge's lengths in space and in (u, v)
constexpr double kLeastSine = 0.1;   // of the angle between the axes
constexpr std::size_t kMostVertices = 1'000'000;

class ScanReader {
 public:
  explicit ScanReader(const std::filesystem::path& folder)
      : folder_(capture_folder(folder)), file_(parse_capture_file(folder_)) {}

  ScanCapture read() {
    file_.choice("format", {"weft-capture"});
    file_.integer("version", 1, 1);
    const std::string kind = file_.choice("kind", {"video", "mechanical", "scan"});
    if (kind != "scan")
      throw error_at(file_.where("kind"),
                     fmt::format("\"{}\"; a scan capture (kind = \"scan\") is needed here", kind));
    capture_.folder = folder_;
    capture_.name = file_.optional_string("name").value_or(
        (folder_.has_filename() ? folder_ : folder_.parent_path()).filename().string());
    capture_.description = file_.optional_string("description").value_or("");
    read_swatch();
    if (const auto world = file_.optional_table("world")) {
      gravity_ = gravity_of(*world, gravity_);
      world->finish();
    }
    const std::vector<TomlTable> targets = file_.tables("target");
    if (targets.empty())
      throw error_at({file_.file(), 0, "target"}, "missing; at least one [[target]] is needed");
    for (const TomlTable& target : targets) read_target(target);
    if (const auto truth = file_.optional_table("truth")) {
      capture_.truth = folder_ / truth->string("parameters");
      truth->finish();
    }
    file_.finish();
    return std::move(capture_);
  }

 private:
  void read_swatch() {
    const TomlTable swatch = file_.table("swatch");
    capture_.width = swatch.number("width", kSwatchSide);
    capture_.height = swatch.number("height", kSwatchSide);
    capture_.areal_density = swatch.number("areal_density", kArealDensity);
    capture_.grain_angle =
        swatch.optional_number("grain_angle_deg", kGrainAngle).value_or(0) * std::numbers::pi / 180;
    capture_.hem_width = swatch.optional_number("hem_width", kHemWidth).value_or(0);
    swatch.finish();
  }

  static Vec3 gravity_of(const TomlTable& table, const Vec3& otherwise) {
    if (!table.has("gravity")) return otherwise;
    const std::vector<double> g = table.numbers("gravity", 3, kGravity);
    return {g[0], g[1], g[2]};
  }

  /// An existing file that a key names; empty without the key.
  std::filesystem::path file_named(const TomlTable& table, std::string_view key) const {
    if (!table.has(key)) return {};
    std::filesystem::path path = folder_ / table.string(key);
    check_file_exists(path, table.where(key));
    return path;
  }

  void read_target(const TomlTable& table) {
    ScanTarget target;
    target.name = table.string("name");
    if (!names_.insert(target.name).second)
      throw error_at(table.where("name"), fmt::format("two targets are named \"{}\"", target.name));
    target.grid = file_named(table, "grid");
    target.scan = file_named(table, "scan");
    if (target.grid.empty() && target.scan.empty())
      throw error_at(table.where(),
                     "a target needs `grid`, a registered grid, or `scan`, a raw mesh or cloud");
    for (const char* key : {"points", "frame", "weights", "start"})
      if (target.grid.empty() && table.has(key))
        throw error_at(table.where(key), "belongs to a `grid`, which this target does not have");
    if (target.grid.empty())
      read_raw(table, target);
    else
      for (const char* key : {"unit", "landmarks", "u_axis", "v_axis"})
        if (table.has(key))
          throw error_at(table.where(key), "of a raw `scan`; this target has a registered `grid`");
    target.points = file_named(table, "points");
    if (target.points.empty() && table.has("frame"))
      throw error_at(table.where("frame"), "a sample of `points`, which this target does not have");
    target.frame = table.optional_integer("frame", 0, kMaxFrames - 1).value_or(0);
    target.weights = file_named(table, "weights");
    target.start = file_named(table, "start");
    target.noise = table.optional_number("noise", kNoise).value_or(target.noise);
    target.gravity = gravity_of(table, gravity_);
    std::set<std::string> names;
    for (const TomlTable& clamp : table.tables("clamp")) read_clamp(clamp, names, target);
    if (target.clamps.empty())
      throw error_at(table.where(), "a target needs at least one [[target.clamp]]");
    table.finish();
    capture_.targets.push_back(std::move(target));
  }

  void read_raw(const TomlTable& table, ScanTarget& target) const {
    target.unit = table.optional_number("unit", kUnit).value_or(target.unit);
    target.landmarks = file_named(table, "landmarks");
    target.u_axis = direction(table, "u_axis", target.u_axis);
    target.v_axis = direction(table, "v_axis", target.v_axis);
    if (target.u_axis.cross(target.v_axis).norm() < kLeastSine)
      throw error_at(table.where(table.has("u_axis") ? "u_axis" : "v_axis"),
                     "u_axis is along v_axis; the two must be across");
  }

  static Vec3 direction(const TomlTable& table, const char* key, const Vec3& otherwise) {
    if (!table.has(key)) return otherwise;
    const std::vector<double> numbers = table.numbers(key, 3, kDirection);
    const Vec3 axis(numbers[0], numbers[1], numbers[2]);
    if (!(axis.norm() > 1e-9)) throw error_at(table.where(key), "no direction");
    return axis.normalized();
  }

  void read_clamp(const TomlTable& table, std::set<std::string>& names, ScanTarget& target) const {
    ScanClamp clamp;
    clamp.name = table.string("name");
    if (!names.insert(clamp.name).second)
      throw error_at(table.where("name"),
                     fmt::format("two clamps of \"{}\" are named \"{}\"", target.name, clamp.name));
    clamp.kind =
        table.choice("kind", {"bar", "points"}) == "bar" ? ClampKind::bar : ClampKind::points;
    if (table.has("region") == table.has("vertices"))
      throw error_at(table.where(), "a clamp needs one of `region` and `vertices`");
    if (table.has("region")) {
      const MatX region = table.matrix("region", 2, 2);
      clamp.region.lower = region.row(0);
      clamp.region.upper = region.row(1);
      check_region(table, clamp.region);
    } else {
      clamp.region = region_of_vertices(table, target);
    }
    clamp.where = table.where(table.has("region") ? "region" : "vertices");
    if (table.has("force") && table.has("weight"))
      throw error_at(table.where("weight"), "a clamp has `force` (N) or `weight` (kg), not both");
    clamp.force = table.optional_number("force", kForceRange);
    if (const auto weight = table.optional_number("weight", kWeight))
      clamp.force = *weight * target.gravity.norm();
    if (table.has("force_noise") && !clamp.force)
      throw error_at(table.where("force_noise"),
                     "belongs to a `force` or `weight`, which this clamp does not have");
    clamp.force_noise =
        table.optional_number("force_noise", kForceNoise).value_or(clamp.force_noise);
    table.finish();
    target.clamps.push_back(std::move(clamp));
  }

  void check_region(const TomlTable& table, const MaterialRectangle& region) const {
    if (!(region.lower.array() <= region.upper.array()).all())
      throw error_at(table.where("region"),
                     "the first corner must not be above or right of the second");
    if (region.lower.minCoeff() < -kOnSwatch || region.upper.x() > capture_.width + kOnSwatch ||
        region.upper.y() > capture_.height + kOnSwatch)
      throw error_at(table.where("region"),
                     fmt::format("({:g}, {:g}) to ({:g}, {:g}) m reaches off the swatch of {:g} x "
                                 "{:g} m",
                                 region.lower.x(), region.lower.y(), region.upper.x(),
                                 region.upper.y(), capture_.width, capture_.height));
  }

  /// The rectangle about the listed vertices of the grid, which must hold no others.
  MaterialRectangle region_of_vertices(const TomlTable& table, const ScanTarget& target) const {
    if (target.grid.empty())
      throw error_at(table.where("vertices"), "of a `grid`, which this target does not have");
    const TriangleMesh mesh = read_material_surface(target.grid).mesh;
    const std::size_t count = table.array_size("vertices", 1, kMostVertices);
    const std::vector<int> vertices = table.integers("vertices", count, 0, mesh.vertex_count() - 1);
    const std::set<int> listed(vertices.begin(), vertices.end());
    MaterialRectangle region{mesh.material.col(vertices.front()),
                             mesh.material.col(vertices.front())};
    for (const int v : vertices) {
      region.lower = region.lower.cwiseMin(mesh.material.col(v));
      region.upper = region.upper.cwiseMax(mesh.material.col(v));
    }
    for (int v = 0; v < mesh.vertex_count(); ++v)
      if (region.contains(mesh.material.col(v)) && !listed.contains(v))
        throw error_at(table.where("vertices"),
                       fmt::format("the vertices of a clamp must fill a rectangle in (u, v); "
                                   "vertex {} lies among them",
                                   v));
    return region;
  }

  std::filesystem::path folder_;
  TomlTable file_;
  ScanCapture capture_;
  Vec3 gravity_{0, 0, -9.81};
  std::set<std::string> names_;
};

/// Rows of one frame, where the table has several, as `weft register` writes them.
std::vector<std::size_t> rows_of_frame(const TableFile& file, int frame) {
  std::vector<std::size_t> rows;
  const bool several = file.has("frame");
  for (std::size_t row = 0; row < file.row_count(); ++row)
    if (!several || file.number(row, file.column_index("frame")) == frame) rows.push_back(row);
  return rows;
}

VecX read_weights(const std::filesystem::path& path, int frame, int vertices) {
  const TableFile file(path);
  const std::vector<std::size_t> rows = rows_of_frame(file, frame);
  if (rows.size() != static_cast<std::size_t>(vertices))
    throw error_at({path, 0, {}},
                   fmt::format("{} rows; the grid has {} vertices", rows.size(), vertices));
  const std::size_t column = file.column_index("weight");
  VecX weights(vertices);
  for (Eigen::Index i = 0; i < vertices; ++i) {
    const std::size_t row = rows[static_cast<std::size_t>(i)];
    weights[i] = file.number(row, column);
    if (!(weights[i] >= 0 && weights[i] <= 1))
      throw file.fail(row, "weight", fmt::format("{:g}; must be within [0, 1]", weights[i]));
  }
  return weights;
}

Points read_frame(const ScanTarget& target, int vertices) {
  const std::vector<Points> frames = read_pc2(target.points).frames;
  if (static_cast<std::size_t>(target.frame) >= frames.size())
    throw error_at({target.points, 0, {}},
                   fmt::format("{} samples; target \"{}\" asks for sample {}", frames.size(),
                               target.name, target.frame));
  const Points& x = frames[static_cast<std::size_t>(target.frame)];
  if (x.cols() != vertices)
    throw error_at({target.points, 0, {}}, fmt::format("{} points; {} has {} vertices", x.cols(),
                                                       target.grid.filename().string(), vertices));
  return x;
}

/// Whatever the fabric, cloth at rest is not three times as long as it is flat: a unit, or other
/// vertices. Where nothing was measured a grid may be anything.
void check_edges(const ScanShape& shape, const std::filesystem::path& path) {
  std::vector<double> ratios;
  for (const auto& triangle : shape.mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const int a = triangle[k], b = triangle[(k + 1) % 3];
      if (!counts_as_measured(shape.weights[a]) || !counts_as_measured(shape.weights[b])) continue;
      const double flat = (shape.mesh.material.col(a) - shape.mesh.material.col(b)).norm();
      ratios.push_back((shape.x.col(a) - shape.x.col(b)).norm() / flat);
    }
  }
  if (ratios.empty()) return;
  const double ratio = quantile(std::move(ratios), 0.5);
  if (ratio <= kLargestRatio && ratio >= 1 / kLargestRatio) return;
  throw error_at({path, 0, {}},
                 fmt::format("edges between measured vertices are {:.3g} times as long as in (u, "
                             "v) (median); valid: 1/{:g} to {:g}, positions and (u, v) in m",
                             ratio, kLargestRatio, kLargestRatio));
}

/// Something must be compared.
void check_measured(const ScanShape& shape, const ScanTarget& target) {
  const bool pulls = std::any_of(target.clamps.begin(), target.clamps.end(),
                                 [](const ScanClamp& clamp) { return clamp.force.has_value(); });
  if (pulls || (shape.weights.array() > 0).any()) return;
  throw error_at({target.weights, 0, "weight"},
                 fmt::format("0 for all vertices, and no clamp of target \"{}\" has a force: "
                             "nothing of it was measured",
                             target.name));
}

std::string clamp_text(const ScanClamp& clamp) {
  std::string text = fmt::format(
      "\n  [[target.clamp]]\n  name = {}\n  kind = \"{}\"\n  region = [[{}, {}], [{}, {}]]\n",
      toml_string(clamp.name), clamp.kind == ClampKind::bar ? "bar" : "points",
      clamp.region.lower.x(), clamp.region.lower.y(), clamp.region.upper.x(),
      clamp.region.upper.y());
  if (clamp.force)
    text += fmt::format("  force = {}\n  force_noise = {}\n", *clamp.force, clamp.force_noise);
  return text;
}

/// Writes the files of a registered target; returns the keys that name them.
std::string write_shape(const std::filesystem::path& folder, const std::string& stem,
                        const ScanShape& shape, const ScanTarget& target) {
  write_obj(folder / (stem + ".obj"), shape.mesh, shape.x, target.name);
  std::string text = fmt::format("grid = \"{}.obj\"\n", stem);
  if (shape.start) {
    write_obj(folder / (stem + "_start.obj"), shape.mesh, *shape.start, target.name);
    text += fmt::format("start = \"{}_start.obj\"\n", stem);
  }
  if (shape.weights.size() > 0 && (shape.weights.array() != 1).any()) {
    std::string weights = "weight\n";
    for (const double w : shape.weights) weights += fmt::format("{}\n", w);
    write_text(folder / (stem + "_weights.csv"), weights);
    text += fmt::format("weights = \"{}_weights.csv\"\n", stem);
  }
  return text;
}

/// The same of a raw one.
std::string write_raw(const std::filesystem::path& folder, const std::string& stem,
                      const RawScan& raw, const ScanTarget& target) {
  std::string points;
  for (const auto& p : raw.scan.position.colwise())
    points += fmt::format("{:.9g} {:.9g} {:.9g}\n", p.x(), p.y(), p.z());
  write_text(folder / (stem + ".xyz"), points);
  const auto axis = [](const Vec3& a) { return fmt::format("[{}, {}, {}]", a.x(), a.y(), a.z()); };
  std::string text = fmt::format("scan = \"{}.xyz\"\nu_axis = {}\nv_axis = {}\n", stem,
                                 axis(target.u_axis), axis(target.v_axis));
  if (raw.landmarks.empty()) return text;
  write_landmarks(folder / (stem + "_landmarks.csv"), raw.landmarks);
  return text + fmt::format("landmarks = \"{}_landmarks.csv\"\n", stem);
}

}  // namespace

ScanCapture read_scan_capture(const std::filesystem::path& folder) {
  return ScanReader(folder).read();
}

ScanShape read_scan_shape(const ScanCapture& capture, const ScanTarget& target) {
  if (target.grid.empty())
    throw Error(fmt::format("{}: target \"{}\" is a raw scan without a registered grid",
                            capture.folder.string(), target.name));
  MaterialSurface grid = read_material_surface(target.grid);
  ScanShape shape;
  shape.x = std::move(grid.x);
  shape.mesh = std::move(grid.mesh);
  check_on_swatch(shape.mesh, capture.width, capture.height, target.grid);
  const int vertices = shape.mesh.vertex_count();
  if (!target.points.empty()) shape.x = read_frame(target, vertices);
  shape.weights = target.weights.empty() ? VecX::Ones(vertices)
                                         : read_weights(target.weights, target.frame, vertices);
  check_covers_swatch(shape.mesh, capture.width, capture.height, target.grid, kCoverSlack);
  check_edges(shape, target.points.empty() ? target.grid : target.points);
  check_measured(shape, target);
  if (!target.start.empty()) {
    shape.start = read_obj(target.start).positions;
    if (shape.start->cols() != vertices)
      throw error_at({target.start, 0, {}},
                     fmt::format("{} vertices; {} has {}", shape.start->cols(),
                                 target.grid.filename().string(), vertices));
  }
  return shape;
}

void write_scan_capture(const std::filesystem::path& folder, const ScanCapture& capture,
                        const std::vector<ScanShape>& shapes, const std::vector<RawScan>& raw) {
  if (shapes.size() != capture.targets.size())
    throw Error(fmt::format("{} shapes for {} targets", shapes.size(), capture.targets.size()));
  if (!raw.empty() && raw.size() != shapes.size())
    throw Error(fmt::format("{} raw scans for {} targets", raw.size(), shapes.size()));
  make_folder(folder);
  std::string text = fmt::format(
      "format = \"weft-capture\"\nversion = 1\nkind = \"scan\"\nname = {}\ndescription = {}\n\n"
      "[swatch]\nwidth = {}\nheight = {}\nareal_density = {}\ngrain_angle_deg = {}\nhem_width = "
      "{}\n",
      toml_string(capture.name), toml_string(capture.description), capture.width, capture.height,
      capture.areal_density, capture.grain_angle * 180 / std::numbers::pi, capture.hem_width);
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    const ScanTarget& target = capture.targets[i];
    const std::string stem = fmt::format("target_{}", i + 1);
    text += fmt::format("\n[[target]]\nname = {}\nnoise = {}\ngravity = [{}, {}, {}]\n",
                        toml_string(target.name), target.noise, target.gravity.x(),
                        target.gravity.y(), target.gravity.z());
    text += !raw.empty() && raw[i].scan.size() > 0 ? write_raw(folder, stem, raw[i], target)
                                                   : write_shape(folder, stem, shapes[i], target);
    for (const ScanClamp& clamp : target.clamps) text += clamp_text(clamp);
  }
  if (capture.truth)
    text +=
        fmt::format("\n[truth]\nparameters = {}\n", toml_string(capture.truth->generic_string()));
  write_text(folder / "capture.toml", text);
}

}  // namespace weft
