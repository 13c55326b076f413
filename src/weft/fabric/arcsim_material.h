#pragma once
#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "weft/fabric/fabric.h"

namespace weft {

/// The numbers of a material file of the simulator ARCSim, as they stand in it: the format in which
/// the measurements of Wang, O'Brien and Ramamoorthi 2011 are published.
///
/// What they are in that simulator (0.3.1; read from it, and checked by running it:
/// scripts/validate_arcsim): u is weft, v is warp, and
/// - a membrane, N_uu = 2 c0 E_uu + 2 c1 E_vv, N_vv = 2 c1 E_uu + 2 c2 E_vv, N_uv = 2 c3 E_uv with
///   Green's strain E and (c0, c1, c2, c3) a row of `stretching`, N/m: at rest, and at a principal
///   stretch of 7/6 at 0, 22.5, 45, 67.5 and 90 degrees;
/// - hinges at the edges of triangles, k l^2 theta^2 / (8 A) with A the area of both triangles:
///   a plate of k / 4 bent across its edges. k, N m, is from the row of `bending` for the edge's
///   own direction, 0, 45 and 90 degrees (an edge along the weft resists curvature along the warp),
///   at curvatures of 0, 10, 20, 30 and 40 1/m.
struct ArcsimMaterial {
  double density = 0;                      ///< kg/m^2
  Eigen::Matrix<double, 6, 4> stretching;  ///< N/m
  Eigen::Matrix<double, 3, 5> bending;     ///< N m
};

/// The fabric that a material is in that simulator, of model "piecewise-linear", named as the file:
/// `density` (0.001 to 100 kg/m^2), `stretching`, `bending`. Lines of comment are allowed. Throws
/// Error, with file and key, for anything else.
Fabric read_arcsim_material(const std::filesystem::path& path);

/// What a bend is right on: meshes whose edges lie across it, whatever they are, or a grid along
/// the threads whose diagonals alternate, as weft's do.
enum class ArcsimMesh { any, alternating };

struct ArcsimClothOptions {
  double areal_density = 0.2;  ///< kg/m^2, > 0
  double drag_speed = 0.5;     ///< m/s along the normal, where drag is to be right, > 0
  ArcsimMesh mesh = ArcsimMesh::any;
};

/// A material, and what a scene says beside it.
struct ArcsimCloth {
  ArcsimMaterial material;
  double damping = 0;       ///< s, of the material in the scene
  double wind_density = 0;  ///< N s^2/m^4, of the scene's wind
  double wind_drag = 0;     ///< N s/m^3
  /// What the simulator cannot express, a sentence each.
  std::vector<std::string> lost;
};

/// The material with which ARCSim is `fabric`, of a motion model or "piecewise-linear"; of the
/// latter it is the inverse of read_arcsim_material().
///
/// Bending of a motion model's is that of strips whose edges lie across them, at 0, 45 and 90
/// degrees, or on a grid whose diagonals alternate that along the threads, and twist. There
/// vertices between hinges give way: with k along the threads and k_d on the diagonals the plate is
///
///     D11 = D22 = k (k + 4 k_d) / (8 (k + 2 k_d)),  D12 = -k^2 / (8 (k + 2 k_d)),  twist k_d / 2
///
/// (a strip with free edges has D11 - D12^2 / D22), so that bend B and twist T take k = 4 (B - T +
/// sqrt(B^2 + T^2)) and k_d = 2 T. Damping is there one time for all of a material's stiffnesses:
/// the smallest of those that the fabric has, so that nothing is damped more than in the fabric.
/// Diagonals that act in tension only become shear as the fabric's while one of them is slack,
/// diagonal_stiffness / 4. Throws Error for a fabric of another model, for a table on a mesh of its
/// own, and for options out of range.
ArcsimCloth arcsim_cloth(const Fabric& fabric, const ArcsimClothOptions& options);

/// By their names in a scene.
std::vector<std::pair<std::string, double>> settings_of(const ArcsimCloth& cloth);

/// The material's file, which begins with what the scene has to say and what is lost, as comments.
std::string arcsim_text(const Fabric& fabric, const ArcsimCloth& cloth);

}  // namespace weft
