#include <fmt/core.h>

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "commands.h"
#include "options.h"
#include "weft/base/error.h"
#include "weft/base/text_file.h"
#include "weft/fabric/blender_cloth.h"

namespace weft::app {
namespace {

struct ExportArguments {
  std::string fabric, to, out;
  std::optional<double> areal_density;
  BlenderClothOptions blender;
  bool json = false;
};

nlohmann::ordered_json to_json(const BlenderCloth& cloth) {
  nlohmann::ordered_json settings;
  for (const auto& [name, value] : settings_of(cloth)) settings[name] = value;
  settings["gravity"] = cloth.gravity;
  return settings;
}

void run_export(ExportArguments arguments) {
  const Fabric fabric = find_fabric(arguments.fabric);
  const auto density = arguments.areal_density ? arguments.areal_density : fabric.areal_density;
  if (!density) throw Error("--areal-density: needed, the fabric has none");
  arguments.blender.areal_density = *density;
  refuse_same_file({{"--out", arguments.out}}, {{"the fabric that is read", arguments.fabric}});
  const BlenderCloth cloth = blender_cloth(fabric, arguments.blender);
  if (!arguments.out.empty())
    write_text(arguments.out, blender_script(fabric, cloth, arguments.blender));
  nlohmann::ordered_json settings = to_json(cloth);
  if (arguments.json) {
    fmt::print("{}\n",
               nlohmann::ordered_json{{"settings", settings}, {"lost", cloth.lost}}.dump(2));
    return;
  }
  for (const auto& [name, value] : settings.items())
    fmt::print("{:<22} {:.6g}\n", name, value.get<double>());
  for (const std::string& sentence : cloth.lost) fmt::print("lost: {}\n", sentence);
  if (!arguments.out.empty()) fmt::print("{}\n", arguments.out);
}

}  // namespace

void add_export(CLI::App& app) {
  auto* command = add_command(app, "export", "a fabric as the settings of another simulator");
  auto arguments = std::make_shared<ExportArguments>();
  command->add_option("fabric", arguments->fabric, "preset or file")->required();
  command->add_option("--to", arguments->to, "the simulator: blender, its cloth modifier")
      ->required()
      ->check(CLI::IsMember({"blender"}));
  command->add_option("--spacing", arguments->blender.spacing, "m, side of the mesh's quads")
      ->required()
      ->check(number_in(1e-4, 1));
  command->add_option("--frame-rate", arguments->blender.frame_rate, "frames a second of the scene")
      ->check(number_in(1, 1000))
      ->capture_default_str();
  command
      ->add_option("--areal-density", arguments->areal_density, "kg/m^2; default: the fabric's own")
      ->check(number_in(0.001, 10));
  command
      ->add_option("--drag-speed", arguments->blender.drag_speed,
                   "m/s along the normal, where drag is to be right: Blender's is linear")
      ->check(number_in(1e-3, 100))
      ->capture_default_str();
  command->add_option("--out", arguments->out, "script to run in Blender, a file to write");
  command->add_flag("--json", arguments->json, "print JSON");
  command->footer(
      "Example:\n  weft export out/my_fabric/fabric.toml --to blender --spacing 0.0125 "
      "--frame-rate 30 --out my_fabric.py");
  command->callback([arguments] { run_export(*arguments); });
}

}  // namespace weft::app
