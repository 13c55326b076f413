#include <fmt/core.h>

#include <nlohmann/json.hpp>
#include <string>

#include "commands.h"
#include "options.h"
#include "weft/base/error.h"
#include "weft/base/number_text.h"
#include "weft/fabric/fabric.h"
#include "weft/fabric/orthotropic.h"

namespace weft::app {
namespace {

struct FabricsArguments {
  std::string name;
  std::vector<std::string> scale;
  std::string out;
  bool json = false;
};

/// "bend_stiffness=3" multiplies that value. The result must stay inside the parameter's range.
void apply_scale(Fabric& fabric, const std::string& text) {
  const std::size_t sign = text.find('=');
  const auto factor = sign == std::string::npos
                          ? std::nullopt
                          : number_of<double>(std::string_view(text).substr(sign + 1));
  if (!factor)
    throw Error(fmt::format("--scale {}: give NAME=FACTOR, such as bend_stiffness=3", text));
  const std::string parameter = text.substr(0, sign);
  fabric.set(parameter, *factor * fabric.value(parameter));
  fabric.provenance += fmt::format("; {} times {:g}", parameter, *factor);
}

std::string optional_text(const ParameterInfo& info) {
  if (info.presence == Presence::required) return "";
  if (info.left_out_as.empty()) return "Optional. ";
  return fmt::format("Optional; left out, it is {}. ", info.left_out_as);
}

void print_parameters(std::string_view model) {
  fmt::print("parameters of {}\n", model);
  fmt::print("  {:<19} {:<11} {:>8} {:>8} {:>9}  {}\n", "name", "unit", "lower", "upper", "default",
             "meaning");
  for (const ParameterInfo& p : model_parameters(model)) {
    fmt::print("  {:<19} {:<11} {:>8g} {:>8g} {:>9g}  {}{}{} ({})\n", p.name, p.unit, p.lower,
               p.upper, p.default_value, optional_text(p), p.meaning,
               p.curve_over.empty() ? "" : " May be a curve.", p.source);
  }
}

void print_fabric(const Fabric& fabric) {
  fmt::print("{}  ({})\n  {}\n", fabric.name, fabric.model, fabric.provenance);
  for (int i = 0; i < fabric.values.size(); ++i) {
    const ParameterInfo info = fabric.info(i);
    fmt::print("  {:<19} {:>12.6g} {}\n", info.name, fabric.values[i], info.unit);
  }
}

nlohmann::json to_json(const Fabric& fabric) {
  nlohmann::json values;
  for (int i = 0; i < fabric.values.size(); ++i) {
    const ParameterInfo info = fabric.info(i);
    values[std::string(info.name)] = {{"value", fabric.values[i]},
                                      {"unit", info.unit},
                                      {"lower", info.lower},
                                      {"upper", info.upper}};
  }
  return {{"name", fabric.name},
          {"model", fabric.model},
          {"provenance", fabric.provenance},
          {"parameters", values}};
}

void run_fabrics(const FabricsArguments& arguments) {
  if (arguments.name.empty() && (!arguments.scale.empty() || !arguments.out.empty())) {
    throw Error(fmt::format("{} needs the name of a fabric",
                            arguments.scale.empty() ? "--out" : "--scale"));
  }
  if (!arguments.name.empty()) {
    Fabric fabric = find_fabric(arguments.name);
    for (const std::string& scale : arguments.scale) apply_scale(fabric, scale);
    refuse_same_file({{"--out", arguments.out}}, {{"the fabric that is read", arguments.name}});
    if (!arguments.out.empty()) write_fabric(arguments.out, fabric);
    if (arguments.json) {
      fmt::print("{}\n", to_json(fabric).dump(2));
    } else {
      print_fabric(fabric);
    }
    return;
  }
  if (arguments.json) {
    nlohmann::json all = nlohmann::json::array();
    for (const Fabric& fabric : fabric_presets()) all.push_back(to_json(fabric));
    fmt::print("{}\n", all.dump(2));
    return;
  }
  for (const std::string_view model : model_names()) print_parameters(model);
  fmt::print("\npresets\n  {:<18}", "name");
  for (const char* column : {"stretch", "shear", "bend", "k_stretch", "k_shear", "k_bend", "drag_T",
                             "drag_N", "drag_f"}) {
    fmt::print(" {:>9}", column);
  }
  fmt::print("  provenance\n");
  for (const Fabric& fabric : fabric_presets()) {
    fmt::print("  {:<18}", fabric.name);
    for (double value : fabric.values) fmt::print(" {:>9.3g}", value);
    fmt::print("  {}\n", fabric.provenance);
  }
  fmt::print("\npresets of model stvk\n  {:<24} {:>8} {:>8} {:>8} {:>7} {:>9}\n", "name", "E_u N/m",
             "E_v N/m", "mu N/m", "nu", "b N m");
  for (const Fabric& fabric : orthotropic_presets()) {
    const OrthotropicModuli m = moduli_of(stiffness_of(fabric));
    fmt::print("  {:<24} {:>8.4g} {:>8.4g} {:>8.4g} {:>7.4g} {:>9.3g}  {}\n", fabric.name, m.e_u,
               m.e_v, m.shear, m.poisson, m.b, fabric.provenance);
  }
}

}  // namespace

void add_fabrics(CLI::App& app) {
  auto* command = add_command(app, "fabrics", "list the built-in fabrics and the parameters");
  auto arguments = std::make_shared<FabricsArguments>();
  command->add_option("name", arguments->name, "one fabric: a preset or a file");
  command->add_option("--scale", arguments->scale, "multiply values: NAME=FACTOR ...");
  command->add_option("--out", arguments->out, "write the fabric to this file");
  command->add_flag("--json", arguments->json, "print JSON");
  command->footer(
      "Examples:\n  weft fabrics satin\n  weft fabrics satin --scale bend_stiffness=3 --out "
      "stiffer.toml");
  command->callback([arguments] { run_fabrics(*arguments); });
}

}  // namespace weft::app
