#pragma once
#include <string>
#include <utility>
#include <vector>

#include "weft/fabric/fabric.h"

namespace weft {

/// The mesh and the scene that settings are for: in Blender a stiffness belongs to a spring and a
/// mass to a vertex, so that the same numbers are another fabric on another mesh; and a unit of the
/// solver's time is a frame.
struct BlenderClothOptions {
  double spacing = 0.01;       ///< m, side of the mesh's quads, > 0
  double frame_rate = 24;      ///< 1/s, of the scene, > 0
  double areal_density = 0.2;  ///< kg/m^2, > 0
  double drag_speed = 0.5;     ///< m/s along the normal, where drag is to be right, > 0
};

/// Settings of the cloth modifier, in its own units.
struct BlenderCloth {
  double vertex_mass = 0;
  double tension_stiffness = 0;  ///< of compression, too
  double shear_stiffness = 0;
  double bending_stiffness = 0;  ///< of the angular model
  double tension_damping = 0;    ///< of compression, too
  double shear_damping = 0;
  double bending_damping = 0;
  double air_damping = 0;
  double gravity = 0;  ///< weight of the scene's gravity, which is 9.81 m/s^2
  /// What the modifier cannot express, a sentence each.
  std::vector<std::string> lost;
};

/// The settings with which Blender's cloth modifier is `fabric` on a grid of quads.
///
/// The modifier joins vertices by springs along the edges and both diagonals of a quad; the
/// diagonals act in tension only. With h the spacing, rho the areal density, M the vertex mass, T a
/// frame and F = rho h^2 / (M T^2) the newtons in one of its units of force, the springs are (read
/// from the solver of Blender 3.4, and checked by running it: scripts/validate_blender)
///
///     k   = F tension_stiffness / h           N/m, along weft and warp
///     k_d = F shear_stiffness / h             N/m, of each diagonal: 2 k_d = diagonal_stiffness
///     B   = F bending_stiffness 0.05 h^2      N m
///     rho h^2 / (M T) times tension_damping and shear_damping   N s/m (half of diagonal_damping)
///     rho h^2 / (M T) h^2 / 4 times bending_damping             N m s
///     air_damping / (100 M T)                 1/s, rate at which speed decays: drag over rho
///
/// and the scene's gravity counts 1 / (1000 T^2) of what it says. All settings are proportional to
/// M, which is 0.3, as in Blender's own presets, or as much less as their ranges ask for.
///
/// Shear without diagonals (shear_stiffness k_s) becomes diagonals that resist a small shear alike
/// while one of them is slack, k_d = 2 k_s. Drag along the normal is made linear at
/// `drag_speed`, drag_normal_linear + drag_quadratic v / (1 + drag_degradation v^2), and counts in
/// every direction. Throws Error for a fabric that is not of a motion model and for options out of
/// range.
BlenderCloth blender_cloth(const Fabric& fabric, const BlenderClothOptions& options);

/// By their names in Blender's Python, in the order of its panel; without the gravity.
std::vector<std::pair<std::string, double>> settings_of(const BlenderCloth& cloth);

/// A script of Python that gives these settings to the active object, for Blender 2.91 and later.
/// It raises an error where the object's quads or the scene's frame rate are others than in
/// `options`, and where Blender does not take a value.
std::string blender_script(const Fabric& fabric, const BlenderCloth& cloth,
                           const BlenderClothOptions& options);

}  // namespace weft
