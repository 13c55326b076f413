#pragma once
/// Static equilibrium of an orthotropic sheet by XPBD (Macklin, Müller and Chentanez 2016), with
/// derivatives by its material parameters that are accumulated along the iterates (Larionov et al.
/// 2022, section 3.3).
///
/// Energy: U = 1/2 sum over the constraints of C^T alpha^-1 C (equation 2), with
/// - a triangle of area A: C = (E_uu, E_vv, 2 E_uv), the Green strain (equation 5), and alpha^-1 =
/// A
///   [[C00, C01, 0], [C01, C11, 0], [0, 0, C22]] (equation 6), one 3 x 3 block;
/// - bending as XpbdBending says.
///
/// A step of length h starts from what the multipliers of the step before exert,
///
///     x <- x + h v + M^-1 (h^2 f + grad C(x) lambda),
///
/// and makes sweeps of (grad C^T M^-1 grad C + alpha / h^2) dlambda = -C - alpha lambda / h^2,
/// x <- x + M^-1 grad C dlambda (equations 3 and 4). Multipliers are kept from step to step. So a
/// shape is at rest exactly where f + grad C lambda / h^2 = 0 and lambda = -h^2 alpha^-1 C: at an
/// equilibrium of U, whatever the number of sweeps, their order and the step. (With multipliers
/// that start from zero in each step the cloth comes to rest where the sweeps of one step happen to
/// end, softer for fewer of them.)
///
/// A start whose net force is nowhere above the largest weight or load of a vertex begins with the
/// multipliers of its strains, and so stays where it is at rest already; another one with zeros.
///
/// The way to rest is a motion whose velocity is dropped whenever it turns against the net force.
/// It ends when the net force on every free vertex is below a tolerance, computed from U and not
/// from the multipliers, after at most max_iterations sweeps.
#include <vector>

#include "weft/mesh/triangle_mesh.h"

namespace weft {

/// A sheet at one moment. The order of the first five is that of all derivatives.
struct OrthotropicSheet {
  double c00 = 0;            ///< N/m, weft (u); > 0
  double c11 = 0;            ///< N/m, warp (v); > 0
  double c01 = 0;            ///< N/m; c01^2 < c00 c11
  double c22 = 0;            ///< N/m, shear; > 0
  double bend = 0;           ///< N m, see XpbdBending; >= 0
  double areal_density = 0;  ///< kg/m^2; > 0
};
inline constexpr int kSheetParameters = 5;

/// What `bend` = b means.
enum class XpbdBending {
  /// Larionov et al. 2022, section 3.3.1: 1/2 b theta^2 for every interior edge, with the angle of
  /// strain/dihedral_angle.h, which has a sign where the paper's arc cosine has none, and which
  /// goes
  /// on growing where a fold passes 180 degrees. What it means depends on the mesh. With the
  /// vertices
  /// on a cylinder the energy is that of a flexural rigidity b a / c on cells of a x c for a bend
  /// along u; on square cells b along u and v and, at 45 degrees, b on the alternating grid, b / 2
  /// and 5 b / 2 on the uniform one, 1.1 b to 1.5 b on random triangulations. At equilibrium the
  /// vertices give way between each other, by 6 to 21 % on grids.
  dihedral,
  /// 1/2 b w theta^2 with w = l^2 / (A_1 + A_2), edge length l and areas of its triangles: w = 1
  /// for
  /// the edges along a square grid and 2 for its diagonals. Not a plate either (model/bending.h),
  /// but
  /// the same on a finer mesh.
  weighted_dihedral,
  /// 1/2 b A |K|^2 for each triangle, with the curvature of strain/triangle_curvature.h and
  /// model/bending.h: b is the flexural rigidity, on any mesh. The same energy as the elastic model
  /// "stvk" with D11 = D22 = b, D12 = 0, D66 = b / 2.
  curvature,
};

enum class XpbdSweep {
  gauss_seidel,  ///< each constraint sees what those before it did
  jacobi,        ///< all see the same shape; each vertex is split into as many as constraints touch
                 ///< it, which makes the sweep converge, more slowly
};

enum class XpbdDerivatives {
  none,
  /// From the first sweep on, as in the paper: the derivative of exactly the iterate that is
  /// returned, with the moments when the velocity was dropped held.
  along_iterates,
  /// The same recursion, from the sweep on at which the shape has come to rest, until the
  /// derivatives of the net force are below derivative_tolerance. Cheaper: while the shape is still
  /// far from rest the sweeps are done without derivatives.
  at_rest,
};

enum class XpbdMultipliers {
  kept,  ///< from step to step, as above
  /// From zero in each step, as is usual: where the cloth comes to rest depends on the number of
  /// sweeps, and the net force there is not zero. To compare with.
  from_zero,
};

/// A force on a vertex, such as a share of a weight that hangs on a clip.
struct PointLoad {
  int vertex = 0;
  Vec3 force{0, 0, 0};  ///< N
};

struct XpbdOptions {
  Vec3 gravity{0, 0, -9.81};  ///< m/s^2
  std::vector<PointLoad>
      loads;  ///< on vertices that are not pinned, or they are part of a reaction
  XpbdBending bending = XpbdBending::dihedral;
  XpbdSweep sweep = XpbdSweep::gauss_seidel;
  /// s. 0: automatic; the masses of the vertices are then not those of the cloth but in proportion
  /// to their stiffness, so that nothing depends on the unit of time, and grow with the tension;
  /// where the iteration diverges all the same, it starts again with larger ones.
  double time_step = 0;
  int sweeps_per_step = 1;  ///< >= 1; one is fastest with the automatic step
  XpbdMultipliers multipliers = XpbdMultipliers::kept;
  /// N, largest net force on a free vertex; > 0. To be small against the weight of a vertex (3e-5 N
  /// on 41 x 41 vertices of a light swatch of 0.15 m): at 1e-7 N such a swatch, held by two
  /// corners, was 7 mm from where it came to rest, at 1e-8 N 3 um.
  double force_tolerance = 1e-8;
  int max_iterations = 200000;  ///< sweeps; >= 1
  XpbdDerivatives derivatives = XpbdDerivatives::none;
  /// Largest entry of a derivative of the net force on free vertices, over the largest entry of the
  /// derivative of the elastic force by the same parameter at a fixed shape; > 0.
  double derivative_tolerance = 1e-5;
  int threads = 1;  ///< 0: all cores. The result does not depend on it.
};

struct XpbdEquilibrium {
  Points x;                  ///< 3 x vertices, m
  MatX position_derivative;  ///< 3 vertices x 5 (rows as flat(x)), by (c00, c11, c01, c22, bend)
  Points reactions;          ///< 3 x pinned, N, in the order of `pinned`: what the pins exert
  MatX reaction_derivative;  ///< 3 pinned x 5
  double residual = 0;       ///< N, largest net force on a free vertex
  /// As derivative_tolerance, the largest of the five; 0 without derivatives.
  double derivative_residual = 0;
  int iterations = 0;      ///< sweeps, with and without derivatives
  bool converged = false;  ///< both residuals are below their tolerances
};

/// An equilibrium near `start` (3 x vertices, m) with the vertices `pinned` where `start` has them.
/// Without convergence, what was reached. Throws Error for an invalid mesh, sheet, vertex or
/// option.
XpbdEquilibrium xpbd_equilibrium(const TriangleMesh& mesh, const OrthotropicSheet& sheet,
                                 const std::vector<int>& pinned, const Points& start,
                                 const XpbdOptions& options = {});

}  // namespace weft
