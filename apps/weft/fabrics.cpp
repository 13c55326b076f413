#include <fmt/core.h>

#include <nlohmann/json.hpp>
#include <string>

#include "commands.h"
#include "weft/fabric/fabric.h"

namespace weft::app {
namespace {

struct Arguments {
  std::string name;
  bool json = false;
};

void print_parameters() {
  fmt::print("parameters of baraff-witkin\n");
  fmt::print("  {:<19} {:<11} {:>8} {:>8} {:>9}  {}\n", "name", "unit", "lower", "upper", "default",
             "meaning");
  for (const ParameterInfo& p : baraff_witkin_parameters()) {
    fmt::print("  {:<19} {:<11} {:>8g} {:>8g} {:>9g}  {} ({})\n", p.name, p.unit, p.lower, p.upper,
               p.default_value, p.meaning, p.source);
  }
}

void print_fabric(const Fabric& fabric) {
  fmt::print("{}  ({})\n  {}\n", fabric.name, fabric.model, fabric.provenance);
  const auto parameters = model_parameters(fabric.model);
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    fmt::print("  {:<19} {:>12.6g} {}\n", parameters[i].name, fabric.values[static_cast<long>(i)],
               parameters[i].unit);
  }
}

nlohmann::json to_json(const Fabric& fabric) {
  nlohmann::json values;
  const auto parameters = model_parameters(fabric.model);
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    values[std::string(parameters[i].name)] = {{"value", fabric.values[static_cast<long>(i)]},
                                               {"unit", parameters[i].unit}};
  }
  return {{"name", fabric.name},
          {"model", fabric.model},
          {"provenance", fabric.provenance},
          {"parameters", values}};
}

void run(const Arguments& arguments) {
  if (!arguments.name.empty()) {
    const Fabric fabric = find_fabric(arguments.name);
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
  print_parameters();
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
}

}  // namespace

void add_fabrics(CLI::App& app) {
  auto* command = app.add_subcommand("fabrics", "list the built-in fabrics and the parameters");
  auto arguments = std::make_shared<Arguments>();
  command->add_option("name", arguments->name, "one fabric: a preset or a file");
  command->add_flag("--json", arguments->json, "print JSON");
  command->footer("Example:\n  weft fabrics satin");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace weft::app
