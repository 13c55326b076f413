#include "weft/fabric/fabric.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>

#include "weft/base/error.h"
#include "weft/base/text_file.h"
#include "weft/base/toml_reader.h"
#include "weft/fabric/arcsim_material.h"
#include "weft/fabric/kes_fabric.h"
#include "weft/fabric/orthotropic.h"
#include "weft/fabric/presets.h"
#include "weft/fabric/prior.h"

namespace weft {
namespace {

constexpr const char* kFormat = "weft-fabric";
constexpr int kVersion = 1;
constexpr Range kArealDensity{1e-3, 100};  // kg/m^2
constexpr Range kPriorFactor{least_prior_factor, most_prior_factor};
constexpr double kHuge = 1e12;  // of any unit: catches typing errors only

/// `key`: a number for all control values, or an array with one for each.
VecX read_range(const TomlTable& table, std::string_view key, Range valid, double standard,
                Eigen::Index count) {
  if (!table.has(key)) return VecX::Constant(count, standard);
  if (!table.is_array(key)) return VecX::Constant(count, table.number(key, valid));
  const auto numbers = table.numbers(key, static_cast<std::size_t>(count), valid);
  return Eigen::Map<const VecX>(numbers.data(), count);
}

/// What [parameters] holds, row by row of the model's table.
struct RowReader {
  Fabric& fabric;
  std::vector<ParameterPrior>& priors;
  std::vector<double> values, lower, upper;

  /// One row: value or values, unit, and the range that it may have of its own.
  void read(const TomlTable& table, const ParameterInfo& info, ParameterForm& form) {
    table.choice("unit", {std::string(info.unit)});
    const double least = info.scale == Scale::linear        ? -kHuge
                         : info.scale == Scale::logarithmic ? std::numeric_limits<double>::min()
                                                            : 0.0;
    Eigen::Index count = 1;
    if (!info.curve_over.empty() && table.has("strain")) {
      count = static_cast<Eigen::Index>(
          table.array_size("strain", 1, static_cast<std::size_t>(StiffnessCurve::kMostKnots)));
      const auto knots = table.numbers("strain", static_cast<std::size_t>(count), {-kHuge, kHuge});
      form.knots = Eigen::Map<const VecX>(knots.data(), count);
      for (Eigen::Index i = 1; i < count; ++i)
        if (!(form.knots[i] > form.knots[i - 1]))
          throw error_at(table.where("strain"), fmt::format("{} follows {}; must increase",
                                                            form.knots[i], form.knots[i - 1]));
    }
    const bool curve = form.knots.size() > 0;
    const VecX low = read_range(table, "lower", {least, kHuge}, info.lower, count);
    const VecX high = read_range(table, "upper", {least, kHuge}, info.upper, count);
    const std::vector<double> read =
        curve ? table.numbers("value", static_cast<std::size_t>(count), {least, kHuge})
              : std::vector<double>{};
    for (Eigen::Index i = 0; i < count; ++i) {
      if (!(low[i] < high[i]))
        throw error_at(
            table.where("lower"),
            fmt::format("{} is not below the upper end of the range, {}", low[i], high[i]));
      const double value =
          curve ? read[static_cast<std::size_t>(i)] : table.number("value", {low[i], high[i]});
      if (!(value >= low[i] && value <= high[i]))
        throw error_at(table.where("value"),
                       fmt::format("{} is outside [{}, {}]", value, low[i], high[i]));
      values.push_back(value);
      lower.push_back(low[i]);
      upper.push_back(high[i]);
    }
    if (!curve) read_prior(table, info, {low[0], high[0]});
    table.finish();
  }

  /// Of a parameter that is searched on a logarithmic scale.
  void read_prior(const TomlTable& table, const ParameterInfo& info, Range range) {
    if (info.scale == Scale::linear) return;
    const auto prior = table.optional_table("prior");
    if (!prior) return;
    priors.push_back({std::string(info.name), prior->number("median", range),
                      prior->number("factor", kPriorFactor)});
    prior->finish();
  }

  void finish() {
    const auto vector = [](const std::vector<double>& numbers) {
      return VecX(
          Eigen::Map<const VecX>(numbers.data(), static_cast<Eigen::Index>(numbers.size())));
    };
    fabric.values = vector(values);
    fabric.lower = vector(lower);
    fabric.upper = vector(upper);
  }
};

struct FabricFile {
  Fabric fabric;
  std::vector<ParameterPrior> priors;
};

FabricFile from_table(const TomlTable& file) {
  std::vector<ParameterPrior> priors;
  file.choice("format", {kFormat});
  file.integer("version", kVersion, kVersion);
  const std::string name = file.string("name");
  const std::string model = file.string("model");
  Fabric fabric =
      with_errors_at(file.where("model"), [&] { return Fabric::with_defaults(name, model); });
  fabric.areal_density = file.optional_number("areal_density", kArealDensity);
  fabric.provenance = file.optional_string("provenance").value_or("");
  const auto infos = model_parameters(model);
  const TomlTable parameters = file.table("parameters");
  RowReader rows{fabric, priors, {}, {}, {}};
  fabric.forms.resize(infos.size());
  for (std::size_t i = 0; i < infos.size(); ++i) {
    ParameterForm& form = fabric.forms[i];
    form.present = infos[i].presence == Presence::required || parameters.has(infos[i].name);
    if (form.present) rows.read(parameters.table(infos[i].name), infos[i], form);
  }
  rows.finish();
  parameters.finish();
  file.finish();
  with_errors_at(file.where("parameters"), [&] { validate(fabric); });
  return {fabric, priors};
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

/// Throws unless the two stretch components stay positive definite with their coupling.
void check_stretch_coupling(const Fabric& fabric) {
  if (fabric.value_count("stretch_coupling") == 0) return;
  const double weft = fabric.curve("weft_stretch").values().minCoeff(),
               warp = fabric.curve("warp_stretch").values().minCoeff(),
               coupling = fabric.value("stretch_coupling");
  if (!(coupling * coupling < weft * warp))
    throw Error(
        fmt::format("stretch_coupling = {} is no stable fabric; it must be below {:.6g}, "
                    "the geometric mean of the least weft_stretch and warp_stretch",
                    coupling, std::sqrt(weft * warp)));
}

/// Throws unless friction has both of its parameters, and a scale above zero.
void check_friction(const Fabric& fabric) {
  for (const ParameterInfo& info : model_parameters(fabric.model)) {
    if (!info.name.ends_with("_friction")) continue;
    const std::string scale = std::string(info.name) + "_scale";
    if (fabric.value_count(info.name) != fabric.value_count(scale))
      throw Error(
          fmt::format("\"{}\" and \"{}\" go together: one of them is missing", info.name, scale));
    if (fabric.value_count(scale) > 0 && !(fabric.value(scale) > 0))
      throw Error(fmt::format("{} = {} must be above 0", scale, fabric.value(scale)));
  }
}

/// A number, or an array where there are several.
enum class Numbers { one, array };
std::string toml_numbers(const Eigen::Ref<const VecX>& numbers, Numbers form) {
  if (form == Numbers::one) return fmt::format("{}", numbers[0]);
  std::string text = "[";
  for (Eigen::Index i = 0; i < numbers.size(); ++i)
    text += fmt::format("{}{}", i > 0 ? ", " : "", numbers[i]);
  return text + "]";
}

/// One row of [parameters], with the prior of that name.
std::string row_text(const Fabric& fabric, int row, const std::vector<ParameterPrior>& priors) {
  const ParameterInfo info = model_parameters(fabric.model)[at(row)];
  const int first = fabric.first_value(row), count = fabric.value_count(row);
  if (count == 0) return {};
  VecX lower(count), upper(count);
  for (int k = 0; k < count; ++k) {
    lower[k] = fabric.info(first + k).lower;
    upper[k] = fabric.info(first + k).upper;
  }
  const bool same = (lower.array() == lower[0]).all() && (upper.array() == upper[0]).all();
  const Numbers range = same ? Numbers::one : Numbers::array;
  std::string text = fmt::format("{} = {{ ", info.name);
  if (count > 1)
    text += fmt::format("strain = {}, ", toml_numbers(fabric.forms[at(row)].knots, Numbers::array));
  text += fmt::format(
      "value = {}, unit = {}, lower = {}, upper = {}",
      toml_numbers(fabric.values.segment(first, count), count > 1 ? Numbers::array : Numbers::one),
      toml_string(info.unit), toml_numbers(lower, range), toml_numbers(upper, range));
  for (const ParameterPrior& prior : priors)
    if (prior.parameter == info.name) text += ", " + prior_to_toml(prior);
  return text + " }\n";
}

std::string preset_names() {
  std::string names;
  for (const Fabric& preset : fabric_presets()) names += (names.empty() ? "" : ", ") + preset.name;
  for (const Fabric& preset : orthotropic_presets()) names += ", " + preset.name;
  return names;
}

}  // namespace

Fabric Fabric::with_defaults(std::string name, const std::string& model) {
  Fabric fabric;
  fabric.name = std::move(name);
  fabric.model = model;
  std::vector<double> values;
  for (const ParameterInfo& info : model_parameters(model))
    if (info.presence == Presence::required) values.push_back(info.default_value);
  fabric.values = Eigen::Map<const VecX>(values.data(), static_cast<Eigen::Index>(values.size()));
  return fabric;
}

int Fabric::value_count(int row) const {
  if (forms.empty()) return model_parameters(model)[at(row)].presence == Presence::required ? 1 : 0;
  const ParameterForm& form = forms[at(row)];
  return form.present ? std::max(1, static_cast<int>(form.knots.size())) : 0;
}

int Fabric::first_value(int row) const {
  int first = 0;
  for (int i = 0; i < row; ++i) first += value_count(i);
  return first;
}

int Fabric::value_count(std::string_view row) const {
  return value_count(parameter_index(model, row));
}

int Fabric::first_value(std::string_view row) const {
  return first_value(parameter_index(model, row));
}

int Fabric::value_index(std::string_view parameter) const {
  const auto infos = model_parameters(model);
  int index = 0;
  for (std::size_t row = 0; row < infos.size(); ++row) {
    const int count = value_count(static_cast<int>(row));
    if (count == 1 && infos[row].name == parameter) return index;
    for (int k = 0; count > 1 && k < count; ++k)
      if (curve_value_name(model, infos[row].name, k) == parameter) return index + k;
    index += count;
  }
  std::string known;
  for (int i = 0; i < index; ++i) known += fmt::format("{}{}", i > 0 ? ", " : "", info(i).name);
  throw Error(fmt::format("parameter \"{}\" of model \"{}\" is not known; known: {}", parameter,
                          model, known));
}

double Fabric::value(std::string_view parameter) const { return values[value_index(parameter)]; }

void Fabric::set(std::string_view parameter, double value) {
  const int index = value_index(parameter);
  const ParameterInfo row = info(index);
  if (!(value >= row.lower && value <= row.upper))  // also refuses NaN
    throw Error(fmt::format("{} = {} {} is outside its range [{}, {}]", parameter, value, row.unit,
                            row.lower, row.upper));
  values[index] = value;
}

ParameterInfo Fabric::info(int index) const {
  const auto infos = model_parameters(model);
  int row = 0, first = 0;
  while (first + value_count(row) <= index) first += value_count(row++);
  ParameterInfo out = infos[at(row)];
  if (value_count(row) > 1) out.name = curve_value_name(model, out.name, index - first);
  if (lower.size() > 0) out.lower = lower[index];
  if (upper.size() > 0) out.upper = upper[index];
  return out;
}

StiffnessCurve Fabric::curve(std::string_view row) const {
  const int index = parameter_index(model, row), count = value_count(index);
  if (count == 0 || model_parameters(model)[at(index)].curve_over.empty())
    throw Error(fmt::format("\"{}\" of fabric \"{}\" is no stiffness curve", row, name));
  const int first = first_value(index);
  if (count == 1) return StiffnessCurve(values[first]);
  return {forms[at(index)].knots, values.segment(first, count)};
}

void Fabric::set_curve(std::string_view row, const StiffnessCurve& curve) {
  const int index = parameter_index(model, row);
  if (model_parameters(model)[at(index)].curve_over.empty())
    throw Error(fmt::format("\"{}\" of model \"{}\" is one number, not a curve", row, model));
  resize_row(index, {curve.size() > 1 ? curve.knots() : VecX(), true}, curve.values());
}

std::vector<std::string> Fabric::value_names() const {
  std::vector<std::string> names;
  for (int i = 0; i < values.size(); ++i) names.emplace_back(info(i).name);
  return names;
}

void Fabric::include(std::string_view row) {
  const int index = parameter_index(model, row);
  if (value_count(index) > 0) return;
  const ParameterInfo& info = model_parameters(model)[at(index)];
  if (info.left_out_as.empty()) return resize_row(index, {}, VecX::Constant(1, info.default_value));
  const std::string_view like = info.left_out_as;
  resize_row(index, {}, VecX::Constant(1, value(like)));
  const int from = value_index(like), to = first_value(index);
  if (lower.size() > 0) lower[to] = lower[from];
  if (upper.size() > 0) upper[to] = upper[from];
}

void Fabric::leave_out(std::string_view row) {
  const int index = parameter_index(model, row);
  if (model_parameters(model)[at(index)].presence == Presence::required)
    throw Error(fmt::format("model \"{}\" cannot do without \"{}\"", model, row));
  resize_row(index, {VecX(), false}, VecX());
}

void Fabric::resize_row(int row, const ParameterForm& form, const VecX& row_values) {
  const auto infos = model_parameters(model);
  const ParameterInfo& own = infos[at(row)];
  const int first = first_value(row), count = value_count(row);
  const Eigen::Index tail = values.size() - first - count;
  const auto spliced = [&](const VecX& all, const VecX& part) {
    VecX out(first + part.size() + tail);
    out << all.head(first), part, all.tail(tail);
    return out;
  };
  if (lower.size() > 0)
    lower = spliced(lower, VecX::Constant(row_values.size(), count > 0 ? lower[first] : own.lower));
  if (upper.size() > 0)
    upper = spliced(upper, VecX::Constant(row_values.size(), count > 0 ? upper[first] : own.upper));
  values = spliced(values, row_values);
  if (forms.empty())
    for (const ParameterInfo& info : infos)
      forms.push_back({VecX(), info.presence == Presence::required});
  forms[at(row)] = form;
}

void require_model(const Fabric& fabric, std::string_view model) {
  if (fabric.model != model)
    throw Error(fmt::format("fabric \"{}\" is of model \"{}\"; \"{}\" is needed", fabric.name,
                            fabric.model, model));
}

void require_motion_model(const Fabric& fabric) {
  if (!fabric.model.starts_with("baraff-witkin"))
    throw Error(
        fmt::format("fabric \"{}\" is of model \"{}\"; \"baraff-witkin\", "
                    "\"baraff-witkin-diagonals\" or \"baraff-witkin-hinges\" is needed",
                    fabric.name, fabric.model));
}

void validate(const Fabric& fabric) {
  const auto infos = model_parameters(fabric.model);
  const int rows = static_cast<int>(infos.size());
  if (!fabric.forms.empty() && fabric.forms.size() != infos.size())
    throw Error(fmt::format("fabric \"{}\" has {} rows, its model {}", fabric.name,
                            fabric.forms.size(), rows));
  const int count = fabric.first_value(rows);
  if (fabric.values.size() != count)
    throw Error(fmt::format("fabric \"{}\" has {} values, its model {}", fabric.name,
                            fabric.values.size(), count));
  for (int i = 0; i < count; ++i) {
    const bool is_signed = fabric.info(i).scale == Scale::linear;
    if (!(std::isfinite(fabric.values[i]) && (is_signed || fabric.values[i] >= 0)))
      throw Error(fmt::format("fabric \"{}\": {} = {} is not a finite number{}", fabric.name,
                              fabric.info(i).name, fabric.values[i], is_signed ? "" : " >= 0"));
  }
  for (int row = 0; row < rows; ++row)
    if (fabric.value_count(row) > 1) fabric.curve(infos[at(row)].name);
  if (fabric.model == "stvk") {
    check_coupling(fabric, "membrane");
    check_coupling(fabric, "bend");
  }
  check_friction(fabric);
  if (fabric.model == "soft-constraints" || fabric.model == "stvk-diagonal")
    check_stretch_coupling(fabric);
}

std::string prior_to_toml(const ParameterPrior& prior) {
  return fmt::format("prior = {{ median = {}, factor = {} }}", prior.median, prior.factor);
}

std::string fabric_to_toml(const Fabric& fabric) { return fabric_to_toml(fabric, {}); }

std::string fabric_to_toml(const Fabric& fabric, const std::vector<ParameterPrior>& priors) {
  for (const ParameterPrior& prior : priors)
    if (fabric.value_count(prior.parameter) != 1)
      throw Error(fmt::format("prior of \"{}\": not one number of fabric \"{}\"", prior.parameter,
                              fabric.name));
  std::string text =
      fmt::format("format = {}\nversion = {}\nname = {}\nmodel = {}\n", toml_string(kFormat),
                  kVersion, toml_string(fabric.name), toml_string(fabric.model));
  if (fabric.areal_density)
    text += fmt::format("areal_density = {}  # kg/m^2\n", *fabric.areal_density);
  if (!fabric.provenance.empty())
    text += fmt::format("provenance = {}\n", toml_string(fabric.provenance));
  text += "\n[parameters]\n";
  const int rows = static_cast<int>(model_parameters(fabric.model).size());
  for (int row = 0; row < rows; ++row) text += row_text(fabric, row, priors);
  return text;
}

Fabric fabric_from_toml(std::string_view text, const std::filesystem::path& name) {
  return from_table(TomlTable::parse_string(text, name)).fabric;
}

Fabric read_fabric(const std::filesystem::path& path) {
  return from_table(TomlTable::parse_file(path)).fabric;
}

std::vector<ParameterPrior> read_priors(const std::filesystem::path& path) {
  return from_table(TomlTable::parse_file(path)).priors;
}

namespace {

enum class FileKind { arcsim, kes, weft };
FileKind kind_of_file(const std::filesystem::path& path) {
  if (path.extension() == ".json") return FileKind::arcsim;
  const TomlTable file = TomlTable::parse_file(path);
  return file.has("format") && file.string("format") == "weft-kes" ? FileKind::kes : FileKind::weft;
}

}  // namespace

std::vector<ParameterPrior> find_priors(const std::string& name_or_path) {
  for (const Fabric& preset : fabric_presets())
    if (preset.name == name_or_path || preset.name == name_or_path + "-waving") return {};
  for (const Fabric& preset : orthotropic_presets())
    if (preset.name == name_or_path) return {};
  const bool own = kind_of_file(name_or_path) == FileKind::weft;
  return own ? read_priors(name_or_path) : std::vector<ParameterPrior>();
}

ScaledPrior scaled_prior(const ParameterInfo& info, const ParameterPrior& prior) {
  // Both scales are logarithms, the second one of 0.1 more than the value, over the range's length.
  const double shift = info.scale == Scale::shifted_log ? 0.1 : 0;
  const double length = std::log((info.upper + shift) / (info.lower + shift));
  return {to_scaled(info, prior.median), std::log(prior.factor) / length};
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
  for (const Fabric& preset : orthotropic_presets())
    if (preset.name == name_or_path) return preset;
  std::error_code ignored;
  if (std::filesystem::is_regular_file(name_or_path, ignored)) {
    const std::filesystem::path path = name_or_path;
    switch (kind_of_file(path)) {
      case FileKind::arcsim:
        return read_arcsim_material(path);
      case FileKind::kes:
        return read_kes_fabric(path);
      case FileKind::weft:
        return read_fabric(path);
    }
  }
  throw Error(fmt::format("fabric \"{}\" is neither a file nor a preset; presets: {}", name_or_path,
                          preset_names()));
}

}  // namespace weft
