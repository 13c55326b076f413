#include <fmt/format.h>

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "commands.h"
#include "options.h"
#include "weft/base/error.h"
#include "weft/base/text_file.h"
#include "weft/fabric/arcsim_material.h"
#include "weft/fabric/blender_cloth.h"
#include "weft/fabric/mujoco_cloth.h"

namespace weft::app {
namespace {

struct ExportArguments {
  std::string fabric, to, out;
  double drag_speed = 0.5;
  std::optional<double> spacing, areal_density, frame_rate, hem_width;
  std::vector<int> cells;
  std::optional<MujocoHold> held;
  std::optional<ArcsimMesh> mesh;
  bool json = false;
};

/// What an export says and writes.
struct Exported {
  nlohmann::ordered_json settings;
  std::vector<std::string> lost;
  std::string text;
};

void set_all(nlohmann::ordered_json& settings,
             const std::vector<std::pair<std::string, double>>& values) {
  for (const auto& [name, value] : values) settings[name] = value;
}

void refuse_options_of_others(const ExportArguments& arguments) {
  const auto refuse = [&](bool given, std::string_view option, std::string_view simulator) {
    if (given && arguments.to != simulator)
      throw Error(fmt::format("{}: is for {}", option, simulator));
  };
  refuse(arguments.frame_rate.has_value(), "--frame-rate", "blender");
  refuse(!arguments.cells.empty(), "--cells", "mujoco");
  refuse(arguments.hem_width.has_value(), "--hem-width", "mujoco");
  refuse(arguments.held.has_value(), "--hold", "mujoco");
  refuse(arguments.mesh.has_value(), "--mesh", "arcsim");
  if (arguments.spacing && arguments.to == "arcsim")
    throw Error("--spacing: is for blender and mujoco");
}

double needed_spacing(const ExportArguments& arguments) {
  if (!arguments.spacing) throw Error("--spacing: needed, the numbers are those of one mesh");
  return *arguments.spacing;
}

Exported for_arcsim(const Fabric& fabric, const ExportArguments& arguments, double density) {
  const ArcsimCloth cloth =
      arcsim_cloth(fabric, {.areal_density = density,
                            .drag_speed = arguments.drag_speed,
                            .mesh = arguments.mesh.value_or(ArcsimMesh::any)});
  Exported exported{{}, cloth.lost, arcsim_text(fabric, cloth)};
  set_all(exported.settings, settings_of(cloth));
  return exported;
}

Exported for_blender(const Fabric& fabric, const ExportArguments& arguments, double density) {
  BlenderClothOptions options;
  options.spacing = needed_spacing(arguments);
  options.frame_rate = arguments.frame_rate.value_or(options.frame_rate);
  options.areal_density = density;
  options.drag_speed = arguments.drag_speed;
  const BlenderCloth cloth = blender_cloth(fabric, options);
  Exported exported{{}, cloth.lost, blender_script(fabric, cloth, options)};
  set_all(exported.settings, settings_of(cloth));
  exported.settings["gravity"] = cloth.gravity;
  return exported;
}

Exported for_mujoco(const Fabric& fabric, const ExportArguments& arguments, double density) {
  if (arguments.cells.empty()) throw Error("--cells: needed, a model has its mesh in it");
  MujocoClothOptions options;
  options.spacing = needed_spacing(arguments);
  options.columns = arguments.cells[0];
  options.rows = arguments.cells[1];
  options.areal_density = density;
  options.drag_speed = arguments.drag_speed;
  options.hem_width = arguments.hem_width.value_or(options.hem_width);
  options.held = arguments.held.value_or(options.held);
  const MujocoCloth cloth = mujoco_cloth(fabric, options);
  Exported exported{{}, cloth.lost, mujoco_model(fabric, cloth, options)};
  set_all(exported.settings, settings_of(cloth));
  return exported;
}

Exported for_simulator(const Fabric& fabric, const ExportArguments& arguments, double density) {
  refuse_options_of_others(arguments);
  if (arguments.to == "arcsim") return for_arcsim(fabric, arguments, density);
  if (arguments.to == "mujoco") return for_mujoco(fabric, arguments, density);
  return for_blender(fabric, arguments, density);
}

void run_export(const ExportArguments& arguments) {
  const Fabric fabric = find_fabric(arguments.fabric);
  const auto density = arguments.areal_density ? arguments.areal_density : fabric.areal_density;
  if (!density) throw Error("--areal-density: needed, the fabric has none");
  refuse_same_file({{"--out", arguments.out}}, {{"the fabric that is read", arguments.fabric}});
  const Exported exported = for_simulator(fabric, arguments, *density);
  if (!arguments.out.empty()) write_text(arguments.out, exported.text);
  if (arguments.json) {
    fmt::print(
        "{}\n",
        nlohmann::ordered_json{{"settings", exported.settings}, {"lost", exported.lost}}.dump(2));
    return;
  }
  for (const auto& [name, value] : exported.settings.items())
    fmt::print("{:<22} {:.6g}\n", name, value.get<double>());
  for (const std::string& sentence : exported.lost) fmt::print("lost: {}\n", sentence);
  if (!arguments.out.empty()) fmt::print("{}\n", arguments.out);
}

}  // namespace

void add_export(CLI::App& app) {
  auto* command = add_command(app, "export", "a fabric as cloth of another simulator");
  auto arguments = std::make_shared<ExportArguments>();
  command->add_option("fabric", arguments->fabric, "preset or file")->required();
  command
      ->add_option("--to", arguments->to,
                   "the simulator: arcsim, a material; blender, settings of its cloth modifier; "
                   "mujoco, a model")
      ->required()
      ->check(CLI::IsMember({"arcsim", "blender", "mujoco"}));
  command
      ->add_option("--spacing", arguments->spacing,
                   "m, side of the mesh's quads (blender and mujoco, needed)")
      ->check(number_in(1e-4, 1));
  command
      ->add_option("--frame-rate", arguments->frame_rate,
                   "frames a second of the scene (blender; 24)")
      ->check(number_in(1, 1000));
  command->add_option("--cells", arguments->cells, "quads along weft and warp (mujoco, needed)")
      ->expected(2)
      ->check(CLI::Range(2, 1000));
  command
      ->add_option("--hem-width", arguments->hem_width,
                   "m, of a strip folded over along the rim (mujoco; 0)")
      ->check(number_in(0, 0.1));
  command
      ->add_option("--hold", arguments->held,
                   "what is held, by bodies of mocap (mujoco): none, the two upper corners, the "
                   "upper edge")
      ->transform(CLI::CheckedTransformer(
          std::map<std::string, MujocoHold>{{"none", MujocoHold::none},
                                            {"corners", MujocoHold::corners},
                                            {"edge", MujocoHold::edge}}));
  command
      ->add_option(
          "--mesh", arguments->mesh,
          "what bend is to be right on (arcsim): any mesh, as near as its edges lie across "
          "the bend, or a grid along the threads whose diagonals alternate")
      ->transform(CLI::CheckedTransformer(std::map<std::string, ArcsimMesh>{
          {"any", ArcsimMesh::any}, {"alternating", ArcsimMesh::alternating}}));
  command
      ->add_option("--areal-density", arguments->areal_density, "kg/m^2; default: the fabric's own")
      ->check(number_in(0.001, 10));
  command
      ->add_option("--drag-speed", arguments->drag_speed,
                   "m/s along the normal, where drag is to be right: it is linear in blender and "
                   "mujoco, quadratic in arcsim")
      ->check(number_in(1e-3, 100))
      ->capture_default_str();
  command->add_option(
      "--out", arguments->out,
      "a file to write: a material, a script to run in Blender, a model for MuJoCo");
  command->add_flag("--json", arguments->json, "print JSON");
  command->footer(
      "Examples:\n  weft export out/my_fabric/fabric.toml --to blender --spacing 0.0125 "
      "--frame-rate 30 --out my_fabric.py\n  weft export out/my_fabric/fabric.toml --to mujoco "
      "--spacing 0.0125 --cells 40 40 --hold corners --out my_fabric.xml\n  weft "
      "export out/my_fabric/fabric.toml --to arcsim --out my_fabric.json");
  command->callback([arguments] { run_export(*arguments); });
}

}  // namespace weft::app
