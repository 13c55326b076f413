#include "weft/fabric/fabric.h"

#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <limits>

#include "weft/base/error.h"
#include "weft/base/toml_reader.h"
#include "weft/fabric/presets.h"

namespace weft {
namespace {

constexpr const char* kFormat = "weft-fabric";
constexpr int kVersion = 1;
constexpr Range kArealDensity{1e-3, 100};  // kg/m^2
constexpr double kHuge = 1e12;             // of any unit: catches typing errors only

/// `text` as a basic string of TOML, with its quotes.
std::string toml_string(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\')
      (out += '\\') += c;
    else if (c == '\n')
      out += "\\n";
    else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f)
      out += fmt::format("\\u{:04X}", static_cast<unsigned>(c));
    else
      out += c;
  }
  return out + "\"";
}

/// One parameter: value, unit, and the range that it may have of its own.
void read_parameter(const TomlTable& table, int index, Fabric& fabric) {
  const ParameterInfo info = fabric.info(index);
  table.choice("unit", {std::string(info.unit)});
  const double least = info.scale == Scale::logarithmic ? std::numeric_limits<double>::min() : 0.0;
  const double lower = table.optional_number("lower", {least, kHuge}).value_or(info.lower);
  const double upper = table.optional_number("upper", {least, kHuge}).value_or(info.upper);
  if (!(lower < upper))
    throw error_at(table.where("lower"),
                   fmt::format("{} is not below the upper end of the range, {}", lower, upper));
  fabric.lower[index] = lower;
  fabric.upper[index] = upper;
  fabric.values[index] = table.number("value", {lower, upper});
  table.finish();
}

Fabric from_table(const TomlTable& file) {
  file.choice("format", {kFormat});
  file.integer("version", kVersion, kVersion);
  const std::string name = file.string("name");
  const std::string model = file.string("model");
  Fabric fabric;
  try {
    fabric = Fabric::with_defaults(name, model);
  } catch (const Error& error) {
    throw error_at(file.where("model"), error.what());
  }
  fabric.areal_density = file.optional_number("areal_density", kArealDensity);
  fabric.provenance = file.optional_string("provenance").value_or("");
  const auto infos = model_parameters(model);
  fabric.lower.resize(fabric.values.size());
  fabric.upper.resize(fabric.values.size());
  for (std::size_t i = 0; i < infos.size(); ++i) {
    fabric.lower[static_cast<Eigen::Index>(i)] = infos[i].lower;
    fabric.upper[static_cast<Eigen::Index>(i)] = infos[i].upper;
  }
  const TomlTable parameters = file.table("parameters");
  for (std::size_t i = 0; i < infos.size(); ++i)
    read_parameter(parameters.table(infos[i].name), static_cast<int>(i), fabric);
  parameters.finish();
  file.finish();
  try {
    validate(fabric);
  } catch (const Error& error) {
    throw error_at(file.where("parameters"), error.what());
  }
  return fabric;
}

/// Throws unless [[uu, uv], [uv, vv]] is positive definite.
void check_coupling(const Fabric& fabric, const std::string& group) {
  const double uu = fabric.value(group + "_uu"), uv = fabric.value(group + "_uv"),
               vv = fabric.value(group + "_vv");
  if (uu > 0 && vv > 0 && uv * uv < uu * vv) return;
  throw Error(fmt::format(
      "{0}_uu = {1}, {0}_uv = {2}, {0}_vv = {3} are no stable fabric: {0}_uv must be below "
      "sqrt({0}_uu {0}_vv) = {4:.6g}",
      group, uu, uv, vv, std::sqrt(uu * vv)));
}

std::string preset_names() {
  std::string names;
  for (const Fabric& preset : fabric_presets()) names += (names.empty() ? "" : ", ") + preset.name;
  return names;
}

}  // namespace

Fabric Fabric::with_defaults(std::string name, const std::string& model) {
  Fabric fabric;
  fabric.name = std::move(name);
  fabric.model = model;
  const auto infos = model_parameters(model);
  fabric.values.resize(static_cast<Eigen::Index>(infos.size()));
  for (std::size_t i = 0; i < infos.size(); ++i)
    fabric.values[static_cast<Eigen::Index>(i)] = infos[i].default_value;
  return fabric;
}

double Fabric::value(std::string_view parameter) const {
  return values[parameter_index(model, parameter)];
}

void Fabric::set(std::string_view parameter, double value) {
  const int index = parameter_index(model, parameter);
  const ParameterInfo row = info(index);
  if (!(value >= row.lower && value <= row.upper))  // also refuses NaN
    throw Error(fmt::format("{} = {} {} is outside its range [{}, {}]", parameter, value, row.unit,
                            row.lower, row.upper));
  values[index] = value;
}

ParameterInfo Fabric::info(int index) const {
  ParameterInfo row = model_parameters(model)[static_cast<std::size_t>(index)];
  if (lower.size() > 0) row.lower = lower[index];
  if (upper.size() > 0) row.upper = upper[index];
  return row;
}

void validate(const Fabric& fabric) {
  const auto infos = model_parameters(fabric.model);
  if (fabric.values.size() != static_cast<Eigen::Index>(infos.size()))
    throw Error(fmt::format("fabric \"{}\" has {} values, its model {}", fabric.name,
                            fabric.values.size(), infos.size()));
  for (Eigen::Index i = 0; i < fabric.values.size(); ++i)
    if (!(fabric.values[i] >= 0 && std::isfinite(fabric.values[i])))
      throw Error(fmt::format("fabric \"{}\": {} = {} is not a finite number >= 0", fabric.name,
                              infos[static_cast<std::size_t>(i)].name, fabric.values[i]));
  if (fabric.model == "stvk") {
    check_coupling(fabric, "membrane");
    check_coupling(fabric, "bend");
  }
}

std::string fabric_to_toml(const Fabric& fabric) {
  std::string text =
      fmt::format("format = {}\nversion = {}\nname = {}\nmodel = {}\n", toml_string(kFormat),
                  kVersion, toml_string(fabric.name), toml_string(fabric.model));
  if (fabric.areal_density)
    text += fmt::format("areal_density = {}  # kg/m^2\n", *fabric.areal_density);
  if (!fabric.provenance.empty())
    text += fmt::format("provenance = {}\n", toml_string(fabric.provenance));
  text += "\n[parameters]\n";
  for (int i = 0; i < fabric.values.size(); ++i) {
    const ParameterInfo info = fabric.info(i);
    text += fmt::format("{} = {{ value = {}, unit = {}, lower = {}, upper = {} }}\n", info.name,
                        fabric.values[i], toml_string(info.unit), info.lower, info.upper);
  }
  return text;
}

Fabric fabric_from_toml(std::string_view text, const std::filesystem::path& name) {
  return from_table(TomlTable::parse_string(text, name));
}

Fabric read_fabric(const std::filesystem::path& path) {
  return from_table(TomlTable::parse_file(path));
}

void write_fabric(const std::filesystem::path& path, const Fabric& fabric) {
  std::ofstream out(path, std::ios::binary);
  out << fabric_to_toml(fabric);
  out.close();
  if (!out) throw Error(fmt::format("{}: cannot be written", path.string()));
}

const std::vector<Fabric>& fabric_presets() {
  static const std::vector<Fabric> presets = detail::make_presets();
  return presets;
}

Fabric find_fabric(const std::string& name_or_path) {
  for (const Fabric& preset : fabric_presets())
    if (preset.name == name_or_path || preset.name == name_or_path + "-waving") return preset;
  std::error_code ignored;
  if (std::filesystem::is_regular_file(name_or_path, ignored)) return read_fabric(name_or_path);
  throw Error(fmt::format("fabric \"{}\" is neither a file nor a preset; presets: {}", name_or_path,
                          preset_names()));
}

}  // namespace weft
