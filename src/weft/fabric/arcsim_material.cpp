#include "weft/fabric/arcsim_material.h"

#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <iterator>

#include "weft/base/error.h"
#include "weft/base/json_text.h"

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

/// Appends the rows of a table to `values`.
void read_table(const std::filesystem::path& path, const json& file, const char* key,
                std::size_t rows, std::size_t columns, std::vector<double>& values) {
  const json& table = member(path, file, key);
  if (!table.is_array() || table.size() != rows)
    fail(path, key, fmt::format("expected {} rows of {} numbers", rows, columns));
  for (std::size_t r = 0; r < rows; ++r) {
    const std::string name = fmt::format("{}[{}]", key, r);
    if (!table[r].is_array() || table[r].size() != columns)
      fail(path, name, fmt::format("expected {} numbers", columns));
    for (const json& value : table[r]) values.push_back(number(path, name, value));
  }
}

}  // namespace

Fabric read_arcsim_material(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) throw error_at({path, 0, {}}, "cannot be read");
  const std::string text((std::istreambuf_iterator<char>(in)), {});
  const json file = parse_json(text, path, JsonComments::passed_over);
  if (!file.is_object()) throw error_at({path, 0, {}}, "expected an object");
  for (const auto& [key, value] : file.items())
    if (key != "density" && key != "stretching" && key != "bending")
      fail(path, key, "not known; known: density, stretching, bending");
  std::vector<double> values;
  read_table(path, file, "stretching", 6, 4, values);
  read_table(path, file, "bending", 3, 5, values);
  Fabric fabric = Fabric::with_defaults(path.stem().string(), "piecewise-linear");
  fabric.values = Eigen::Map<const VecX>(values.data(), static_cast<Eigen::Index>(values.size()));
  for (int i = 0; i < fabric.values.size(); ++i) {
    const ParameterInfo info = fabric.info(i);
    if (!(fabric.values[i] >= info.lower && fabric.values[i] <= info.upper))
      fail(path, i < 24 ? "stretching" : "bending",
           fmt::format("{} {} is outside [{}, {}]", fabric.values[i], info.unit, info.lower,
                       info.upper));
  }
  const double density = number(path, "density", member(path, file, "density"));
  if (!(density >= 1e-3 && density <= 100))
    fail(path, "density", fmt::format("{} kg/m^2 is outside [0.001, 100]", density));
  fabric.areal_density = density;
  fabric.provenance = fmt::format("ARCSim material {}", path.filename().string());
  return fabric;
}

}  // namespace weft
