#include "weft/fabric/blender_cloth.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string_view>

#include "weft/fabric/exported_terms.h"

namespace weft {
namespace {

constexpr double kPresetMass = 0.3;
constexpr double kBendUnits = 0.05;
constexpr double kAirUnits = 0.01;
constexpr double kGravityUnits = 0.001;
/// The twist of the modifier's hinges on quads, of their bend.
constexpr double kTwistOfLattice = 4.0 / 3;
constexpr double kSameTwist = 0.1;  // relative

struct Setting {
  std::string_view name;  ///< of ClothSettings in Blender's Python
  double BlenderCloth::*value;
  double largest;  ///< that Blender takes
};
constexpr std::array<Setting, 9> kSettings = {{
    {"tension_stiffness", &BlenderCloth::tension_stiffness, 10000},
    {"compression_stiffness", &BlenderCloth::tension_stiffness, 10000},
    {"shear_stiffness", &BlenderCloth::shear_stiffness, 10000},
    {"bending_stiffness", &BlenderCloth::bending_stiffness, 10000},
    {"tension_damping", &BlenderCloth::tension_damping, 50},
    {"compression_damping", &BlenderCloth::tension_damping, 50},
    {"shear_damping", &BlenderCloth::shear_damping, 50},
    {"bending_damping", &BlenderCloth::bending_damping, 1000},
    {"air_damping", &BlenderCloth::air_damping, 10},
}};

void check(const BlenderClothOptions& options) {
  require_positive("the spacing of a mesh", options.spacing, "m");
  require_positive("a frame rate", options.frame_rate, "1/s");
  require_positive("an areal density", options.areal_density, "kg/m^2");
  require_positive("the speed of drag", options.drag_speed, "m/s");
}

/// N/m and N s/m of a diagonal spring.
struct Diagonal {
  double stiffness, damping;
};

Diagonal diagonal_of(const Fabric& fabric, std::vector<std::string>& lost) {
  const double taut = value_or_none(fabric, "diagonal_stiffness") / 2;
  const double shear = 2 * fabric.value("shear_stiffness");
  if (taut == 0) {
    lost.emplace_back(
        "Shear is resisted by diagonals in tension only: as the fabric does while one of them is "
        "slack, and twice as much, with weft and warp coupled, where both threads are taut.");
    return {shear, 2 * fabric.value("shear_damping")};
  }
  if (shear > kWorthSaying * taut)
    lost.push_back(fmt::format(
        "There is no shear_stiffness beside the diagonals: {:.3g} N/m is added to theirs.", shear));
  return {taut + shear, value_or_none(fabric, "diagonal_damping") / 2};
}

void note_twist(const Fabric& fabric, std::vector<std::string>& lost) {
  const double twist = twist_of(fabric);
  const double of_lattice = kTwistOfLattice * fabric.value("bend_stiffness");
  if (std::abs(twist - of_lattice) > kSameTwist * of_lattice)
    lost.push_back(
        fmt::format("Twist is resisted by {:.3g} N m, which hinges on quads have beside "
                    "their bend; the fabric has {:.3g}.",
                    of_lattice, twist));
}

}  // namespace

BlenderCloth blender_cloth(const Fabric& fabric, const BlenderClothOptions& options) {
  require_motion_model(fabric);
  check(options);
  const double h = options.spacing, frame = 1 / options.frame_rate;
  BlenderCloth cloth;
  const Diagonal diagonal = diagonal_of(fabric, cloth.lost);
  const double drag = linear_drag(fabric, options.drag_speed, cloth.lost);
  note_twist(fabric, cloth.lost);

  const auto set = [&](double mass) {
    const double kilogram = options.areal_density * h * h / mass;  // in a unit of the solver's mass
    const double newton = kilogram / (frame * frame), damping = kilogram / frame;
    cloth.vertex_mass = mass;
    cloth.tension_stiffness = fabric.value("stretch_stiffness") * h / newton;
    cloth.shear_stiffness = diagonal.stiffness * h / newton;
    cloth.bending_stiffness = fabric.value("bend_stiffness") / (newton * kBendUnits * h * h);
    cloth.tension_damping = fabric.value("stretch_damping") / damping;
    cloth.shear_damping = diagonal.damping / damping;
    cloth.bending_damping = 4 * fabric.value("bend_damping") / (damping * h * h);
    cloth.air_damping = drag / options.areal_density * mass * frame / kAirUnits;
  };
  set(kPresetMass);
  double excess = 1;
  for (const Setting& setting : kSettings)
    excess = std::max(excess, cloth.*setting.value / setting.largest);
  if (excess > 1) set(kPresetMass / excess);
  cloth.gravity = frame * frame / kGravityUnits;
  return cloth;
}

std::vector<std::pair<std::string, double>> settings_of(const BlenderCloth& cloth) {
  std::vector<std::pair<std::string, double>> settings{{"mass", cloth.vertex_mass}};
  for (const Setting& setting : kSettings)
    settings.emplace_back(setting.name, cloth.*setting.value);
  return settings;
}

std::string blender_script(const Fabric& fabric, const BlenderCloth& cloth,
                           const BlenderClothOptions& options) {
  std::string settings;
  for (const auto& [name, value] : settings_of(cloth))
    settings += fmt::format("    \"{}\": {:.9g},\n", name, value);
  std::string lost;
  for (const std::string& sentence : cloth.lost) lost += fmt::format("# - {}\n", sentence);
  return fmt::format(
      R"py(# Settings of Blender's cloth modifier for a fabric that weft estimated. With the cloth active:
# Scripting > Open > Run, or blender SCENE.blend --python THIS_FILE.
# They hold for this mesh and frame rate alone: export again for others.
#
# What the modifier cannot express:
{lost}import bpy

FABRIC = {name}
SPACING = {spacing:.9g}  # m, side of the quads
FRAME_RATE = {frame_rate:.9g}  # 1/s
GRAVITY = {gravity:.9g}  # of the scene's, which has to be 9.81 m/s^2
SETTINGS = {{
{settings}}}


def mean_edge(obj):
    points = [obj.matrix_world @ v.co for v in obj.data.vertices]
    edges = [(points[a] - points[b]).length for a, b in (e.vertices for e in obj.data.edges)]
    return sum(edges) / len(edges)


def apply(obj, scene):
    rate = scene.render.fps / scene.render.fps_base
    if abs(rate - FRAME_RATE) > 1e-3 * FRAME_RATE:
        raise ValueError(f"{{FABRIC}}: for {{FRAME_RATE:g}} frames a second; the scene has {{rate:g}}")
    if any(len(p.vertices) != 4 for p in obj.data.polygons):
        raise ValueError(f"{{FABRIC}}: for a mesh of quads; {{obj.name}} has other faces")
    edge = mean_edge(obj)
    if abs(edge - SPACING) > 0.05 * SPACING:
        raise ValueError(f"{{FABRIC}}: for edges of {{SPACING:g}} m; those of {{obj.name}} have {{edge:g}} m")
    found = [m for m in obj.modifiers if m.type == "CLOTH"]
    settings = (found[0] if found else obj.modifiers.new("Cloth", "CLOTH")).settings
    settings.bending_model = "ANGULAR"
    settings.time_scale = 1
    settings.effector_weights.gravity = GRAVITY
    for name, value in SETTINGS.items():
        if hasattr(settings, name + "_max"):
            setattr(settings, name + "_max", value)
        setattr(settings, name, value)
        taken = getattr(settings, name)
        if abs(taken - value) > 1e-5 * abs(value):
            raise ValueError(f"{{FABRIC}}: Blender takes {{taken:g}} for {{name}}, not {{value:g}}")


apply(bpy.context.object, bpy.context.scene)
)py",
      fmt::arg("lost", lost), fmt::arg("name", nlohmann::json(fabric.name).dump()),
      fmt::arg("spacing", options.spacing), fmt::arg("frame_rate", options.frame_rate),
      fmt::arg("gravity", cloth.gravity), fmt::arg("settings", settings));
}

}  // namespace weft
