#pragma once
#include <string>
#include <utility>
#include <vector>

#include "weft/fabric/fabric.h"

namespace weft {

/// What hangs still, or is moved by whoever moves the bodies of mocap.
enum class MujocoHold { none, corners, edge };

/// The mesh that a model is for: cells of one size, weft along x, warp down.
struct MujocoClothOptions {
  double spacing = 0.01;        ///< m, side of the cells, > 0
  int columns = 20, rows = 20;  ///< cells along weft and warp, >= 2
  double areal_density = 0.2;   ///< kg/m^2, > 0
  double drag_speed = 0.5;      ///< m/s along the normal, where drag is to be right, > 0
  double hem_width = 0;         ///< m, as of a swatch (model/hem.h), >= 0; its bend is left out
  MujocoHold held = MujocoHold::none;  ///< the two upper corners, or the upper edge
};

/// The lattice that MuJoCo moves.
struct MujocoCloth {
  double thread_stiffness =
      0;  ///< N/m, a spring along weft or warp inside; half of it, and a hem, on the rim
  double thread_damping = 0;   ///< N s/m
  double shear_stiffness = 0;  ///< N/m, a spring along a diagonal, both ways
  double shear_damping = 0;    ///< N s/m
  double taut_stiffness = 0;   ///< N/m, a tendon along a diagonal, in tension only; 0: none
  double taut_damping = 0;     ///< N s/m
  double bend_stiffness = 0;   ///< N m, geometric mean of those along a thread and at 45 degrees
  double bend_damping = 0;     ///< s, of the stiffness
  double drag = 0;             ///< N s/m^3
  double timestep = 0;         ///< s, half of the largest that is stable
  /// What the model cannot express, a sentence each.
  std::vector<std::string> lost;
};

/// The lattice with which MuJoCo (3.14; scripts/validate_mujoco runs it) is `fabric`.
///
/// Its own membrane is isotropic with a Poisson ratio below 1/2, so that shear is a third to a half
/// of stretch; cloth's is its own. So every vertex is a body of mass rho h^2 with three slides
/// (half of it on the rim, a quarter at a corner, and the hem's), and what joins them are flexes
/// that share these bodies:
///
/// - of edges, along threads (a N/m) and along both diagonals of a cell (k N/m, both ways), k =
///   shear_stiffness. Diagonals add to stretch and couple weft with warp: a + k = x with
///   x - k^2 / x = stretch_stiffness, so that a strip is as stiff as the fabric, and narrows by
///   k / x of its strain. Damping alike.
/// - tendons that are slack below their length, for `diagonal_stiffness`: half of it each.
/// - of triangles with `elastic2d="bend"`, diagonals alternating. An edge has there the energy
///   3 D / A |sum c x|^2 / 2, A the area of its two triangles, D = E t^3 / 48 at a Poisson ratio of
///   0, c from cotangents: a plate of 2.5 D along the threads, 4 D at 45 degrees. (Its vertices
///   give way between each other; other stencils, such as those of weft's plate, would need several
///   such flexes on one body, which 3.14 refuses.) sqrt(10) D is the geometric mean of the fabric's
///   own, bend_stiffness and (bend_stiffness + twist_stiffness) / 2.
///
/// The joints' damping is drag times area, linear and the same in every direction
/// (exported_terms.h). With w^2 = (4 (a + k + k_taut) + 288 D / h^2) / (rho h^2) and c the same
/// of the dampers, steps below (sqrt(c^2 + 4 w^2) - c) / w^2 are stable in Euler's integrator.
///
/// Throws Error for a fabric that is not of a motion model and for options out of range.
MujocoCloth mujoco_cloth(const Fabric& fabric, const MujocoClothOptions& options);

/// By the names above, in their order; without the sentences.
std::vector<std::pair<std::string, double>> settings_of(const MujocoCloth& cloth);

/// MJCF: bodies `cloth_I_J`, column I of row J at (I h, 0, -J h), held ones of mocap; the flex
/// `cloth`, which bends and is seen and touched, and those of edges, in group 5 and without
/// contacts.
std::string mujoco_model(const Fabric& fabric, const MujocoCloth& cloth,
                         const MujocoClothOptions& options);

}  // namespace weft
