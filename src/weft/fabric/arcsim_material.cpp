#include "weft/fabric/arcsim_material.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>

#include "weft/base/error.h"
#include "weft/base/json_text.h"
#include "weft/fabric/exported_terms.h"

namespace weft {
namespace {

using json = nlohmann::ordered_json;

[[noreturn]] void fail(const std::filesystem::path& path, std::string_view key,
                       std::string_view what) {
  throw error_at({path, 0, std::string(key)}, what);
}

double number(const std::filesystem::path& path, std::string_view key, const json& value) {
  if (!value.is_number() || !std::isfinite(value.get<double>()))
    fail(path, key, "expected a finite number");
  return value.get<double>();
}

const json& member(const std::filesystem::path& path, const json& file, const char* key) {
  if (!file.contains(key)) fail(path, key, "missing");
  return file.at(key);
}

template <typename Table>
void read_table(const std::filesystem::path& path, const json& file, const char* key,
                Table& values) {
  const json& table = member(path, file, key);
  if (!table.is_array() || table.size() != static_cast<std::size_t>(values.rows()))
    fail(path, key, fmt::format("expected {} rows of {} numbers", values.rows(), values.cols()));
  for (Eigen::Index r = 0; r < values.rows(); ++r) {
    const json& row = table[static_cast<std::size_t>(r)];
    const std::string name = fmt::format("{}[{}]", key, r);
    if (!row.is_array() || row.size() != static_cast<std::size_t>(values.cols()))
      fail(path, name, fmt::format("expected {} numbers", values.cols()));
    for (Eigen::Index c = 0; c < values.cols(); ++c)
      values(r, c) = number(path, name, row[static_cast<std::size_t>(c)]);
  }
}

ArcsimMaterial read_numbers(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) throw error_at({path, 0, {}}, "cannot be read");
  const std::string text((std::istreambuf_iterator<char>(in)), {});
  const json file = parse_json(text, path, JsonComments::passed_over);
  if (!file.is_object()) throw error_at({path, 0, {}}, "expected an object");
  for (const auto& [key, value] : file.items())
    if (key != "density" && key != "stretching" && key != "bending")
      fail(path, key, "not known; known: density, stretching, bending");
  ArcsimMaterial material;
  read_table(path, file, "stretching", material.stretching);
  read_table(path, file, "bending", material.bending);
  material.density = number(path, "density", member(path, file, "density"));
  if (!(material.density >= 1e-3 && material.density <= 100))
    fail(path, "density", fmt::format("{} kg/m^2 is outside [0.001, 100]", material.density));
  return material;
}

constexpr double kMembraneOfTable = 2;   // stress by strain, of a number of `stretching`
constexpr double kPlateOfHinges = 0.25;  // N m, of a number of `bending`

using RowsOfSix = Eigen::Matrix<double, 6, 4, Eigen::RowMajor>;
using RowsOfThree = Eigen::Matrix<double, 3, 5, Eigen::RowMajor>;
constexpr Eigen::Index kStretchingCount = RowsOfSix::SizeAtCompileTime;
constexpr Eigen::Index kTableCount = kStretchingCount + RowsOfThree::SizeAtCompileTime;

/// Rows of `bending` are by the edge, those of the model by the curvature, which is across it.
Eigen::Matrix<double, 3, 5> across(const Eigen::Matrix<double, 3, 5>& rows) {
  return rows.colwise().reverse();
}

/// In the order of the parameters of "piecewise-linear".
VecX parameters_of(const ArcsimMaterial& material) {
  VecX values(kTableCount);
  Eigen::Map<RowsOfSix>(values.data()) = kMembraneOfTable * material.stretching;
  Eigen::Map<RowsOfThree>(values.data() + kStretchingCount) =
      kPlateOfHinges * across(material.bending);
  return values;
}

ArcsimCloth of_table(const Fabric& fabric) {
  ArcsimCloth cloth;
  const VecX values = fabric.values.head(kTableCount);
  cloth.material.stretching = Eigen::Map<const RowsOfSix>(values.data()) / kMembraneOfTable;
  cloth.material.bending =
      across(Eigen::Map<const RowsOfThree>(values.data() + kStretchingCount)) / kPlateOfHinges;
  if (fabric.values.size() > kTableCount) cloth.lost.emplace_back("There is no internal friction.");
  const auto& bending = cloth.material.bending;
  if (((bending.colwise() - bending.col(0)).array() != 0).any())
    cloth.lost.emplace_back(
        "The table of bending holds for folds to one side; for those to the other ARCSim 0.3.1 "
        "goes on with the slope of its first two columns, below a curvature of zero.");
  return cloth;
}

/// One time for all stiffnesses.
double least_damping(const Fabric& fabric, std::vector<std::string>& lost) {
  struct Ratio {
    std::string_view of;
    double time;
  };
  std::vector<Ratio> ratios;
  for (const std::string_view of : {"stretch", "shear", "bend"})
    ratios.push_back({of, fabric.value(fmt::format("{}_damping", of)) /
                              fabric.value(fmt::format("{}_stiffness", of))});
  const double least = std::ranges::min_element(ratios, {}, &Ratio::time)->time;
  std::string others;
  for (const Ratio& ratio : ratios)
    if (ratio.time > (1 + kWorthSaying) * least)
      others += fmt::format("{}{:.3g} s of {}", others.empty() ? "" : ", ", ratio.time, ratio.of);
  if (!others.empty())
    lost.push_back(fmt::format(
        "Damping is {:.3g} s times each stiffness, the least that the fabric has; it has {}.",
        least, others));
  return least;
}

/// N s^2/m^4.
double quadratic_drag(const Fabric& fabric, double speed, std::vector<std::string>& lost) {
  const double drag = normal_drag(fabric, speed) / speed;
  if (std::abs(drag - fabric.value("drag_quadratic")) > kWorthSaying * drag)
    lost.push_back(fmt::format(
        "Drag along the normal is {:.3g} N s^2/m^4 at every speed: as the fabric's at {:g} m/s.",
        drag, speed));
  return drag;
}

double shear_of(const Fabric& fabric, std::vector<std::string>& lost) {
  const double diagonals = value_or_none(fabric, "diagonal_stiffness") / 4;
  if (diagonals > kWorthSaying * fabric.value("shear_stiffness"))
    lost.push_back(fmt::format(
        "Shear is {:.3g} N/m whatever the threads do; the fabric's diagonals act in tension only, "
        "and resist as much while one of them is slack.",
        diagonals + fabric.value("shear_stiffness")));
  return diagonals + fabric.value("shear_stiffness");
}

/// N m, of the hinges along the threads, in either direction, and on the diagonals.
struct Hinges {
  double threads, diagonals;
};

Hinges hinges_of(double bend, double twist, ArcsimMesh mesh) {
  if (mesh == ArcsimMesh::any)
    return {bend / kPlateOfHinges, 0.5 * (bend + twist) / kPlateOfHinges};
  return {(bend - twist + std::hypot(bend, twist)) / kPlateOfHinges, 2 * twist};
}

/// What a grid whose diagonals alternate is with these hinges.
struct Plate {
  double along, coupling, twist;
};
Plate plate_of(const Hinges& h) {
  const double share = h.threads / (8 * (h.threads + 2 * h.diagonals));
  return {share * (h.threads + 4 * h.diagonals), -share * h.threads, 0.5 * h.diagonals};
}

std::string what_bends(const Hinges& hinges, double bend, double twist, ArcsimMesh mesh) {
  const Plate plate = plate_of(hinges);
  if (mesh == ArcsimMesh::any)
    return fmt::format(
        "Bend depends on the mesh: {:.3g} N m of a strip with edges across it, {:.3g} along the "
        "threads of a grid whose diagonals alternate; twist is {:.3g} there, the fabric has "
        "{:.3g}.",
        bend, plate.along, plate.twist, twist);
  return fmt::format(
      "Bend is that of a grid along the threads whose diagonals alternate, other meshes bend "
      "otherwise; curvatures along weft and warp are coupled there by {:.3g} N m, at 45 degrees it "
      "is "
      "{:.3g}, the fabric has {:.3g}.",
      plate.coupling, 0.5 * (plate.along + plate.coupling + plate.twist), 0.5 * (bend + twist));
}

ArcsimCloth of_motion(const Fabric& fabric, const ArcsimClothOptions& options) {
  ArcsimCloth cloth;
  const double stretch = fabric.value("stretch_stiffness") / kMembraneOfTable;
  cloth.material.stretching.rowwise() =
      Eigen::RowVector4d(stretch, 0, stretch, shear_of(fabric, cloth.lost));
  const double bend = fabric.value("bend_stiffness"), twist = twist_of(fabric);
  const Hinges hinges = hinges_of(bend, twist, options.mesh);
  cloth.material.bending.colwise() = Vec3(hinges.threads, hinges.diagonals, hinges.threads);
  cloth.lost.push_back(what_bends(hinges, bend, twist, options.mesh));
  cloth.damping = least_damping(fabric, cloth.lost);
  cloth.wind_density = quadratic_drag(fabric, options.drag_speed, cloth.lost);
  cloth.wind_drag = fabric.value("drag_linear");
  return cloth;
}

}  // namespace

Fabric read_arcsim_material(const std::filesystem::path& path) {
  const ArcsimMaterial material = read_numbers(path);
  Fabric fabric = Fabric::with_defaults(path.stem().string(), "piecewise-linear");
  fabric.values = parameters_of(material);
  for (int i = 0; i < fabric.values.size(); ++i) {
    const ParameterInfo info = fabric.info(i);
    if (!(fabric.values[i] >= info.lower && fabric.values[i] <= info.upper))
      fail(path, i < kStretchingCount ? "stretching" : "bending",
           fmt::format("{} of {} {} is outside [{}, {}]", info.name, fabric.values[i], info.unit,
                       info.lower, info.upper));
  }
  fabric.areal_density = material.density;
  fabric.provenance = fmt::format("ARCSim material {}", path.filename().string());
  return fabric;
}

ArcsimCloth arcsim_cloth(const Fabric& fabric, const ArcsimClothOptions& options) {
  require_positive("an areal density", options.areal_density, "kg/m^2");
  require_positive("the speed of drag", options.drag_speed, "m/s");
  const bool table = fabric.model == "piecewise-linear";
  if (!table) require_motion_model(fabric);
  if (table && options.mesh != ArcsimMesh::any)
    throw Error(fmt::format("fabric \"{}\" is a table, which is for any mesh", fabric.name));
  ArcsimCloth cloth = table ? of_table(fabric) : of_motion(fabric, options);
  cloth.material.density = options.areal_density;
  return cloth;
}

std::vector<std::pair<std::string, double>> settings_of(const ArcsimCloth& cloth) {
  return {{"damping", cloth.damping},
          {"wind_density", cloth.wind_density},
          {"wind_drag", cloth.wind_drag}};
}

std::string arcsim_text(const Fabric& fabric, const ArcsimCloth& cloth) {
  const auto table = [](const auto& values) {
    std::string rows;
    for (const auto& row : values.rowwise()) {
      std::string numbers;
      for (const double value : row)
        numbers += fmt::format("{}{:.9g}", numbers.empty() ? "" : ", ", value);
      rows += fmt::format("{}        [{}]", rows.empty() ? "" : ",\n", numbers);
    }
    return rows;
  };
  std::string lost = cloth.lost.empty() ? "" : "//\n// What ARCSim cannot express:\n";
  for (const std::string& sentence : cloth.lost) lost += fmt::format("// - {}\n", sentence);
  return fmt::format(
      R"json(// Material of ARCSim (0.3.1) for {name}, a fabric that weft estimated. Beside it the scene has
//   "cloths": [{{..., "remeshing": {{"size": [0.001, 1]}}, "materials": [{{"data": THIS FILE, "damping": {damping:.9g}}}]}}],
//   "wind": {{"density": {wind:.9g}, "drag": {drag:.9g}}}
// Without a size of "remeshing" above 0 ARCSim gives its elements no stiffness.
{lost}{{
    "density": {density:.9g},
    "stretching": [
{stretching}
    ],
    "bending": [
{bending}
    ]
}}
)json",
      fmt::arg("name", json(fabric.name).dump()), fmt::arg("damping", cloth.damping),
      fmt::arg("wind", cloth.wind_density), fmt::arg("drag", cloth.wind_drag),
      fmt::arg("lost", lost), fmt::arg("density", cloth.material.density),
      fmt::arg("stretching", table(cloth.material.stretching)),
      fmt::arg("bending", table(cloth.material.bending)));
}

}  // namespace weft
