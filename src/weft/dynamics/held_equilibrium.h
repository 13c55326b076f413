#pragma once
/// Cloth at rest that is held at some vertices, by one of several solvers: what a fit to scans asks
/// for, whichever solver answers.
#include <memory>
#include <string_view>
#include <vector>

#include "weft/dynamics/simulate.h"
#include "weft/dynamics/xpbd.h"
#include "weft/fabric/fabric.h"
#include "weft/mesh/triangle_mesh.h"

namespace weft {

/// What is held and where it starts. Keeps references.
struct HeldCloth {
  const TriangleMesh& mesh;
  double areal_density;           ///< kg/m^2, > 0
  Vec3 gravity;                   ///< m/s^2
  double grain_angle;             ///< rad, as in make_elastic_model
  const std::vector<char>& held;  ///< a flag a vertex
  const Points& start;            ///< 3 x vertices, m; held vertices stay where it has them
  double hem_width = 0;           ///< m, of the models that can have one
};

enum class HeldDerivatives { none, all };

struct HeldEquilibrium {
  Points x;             ///< m
  Points reactions;     ///< what holds each held vertex up, N, its share of the weight included;
                        ///< zero elsewhere
  double residual = 0;  ///< N, largest net force on a free vertex
  int iterations = 0;
  bool converged = false;
  bool inexact = false;  ///< derivatives at the limit of stability
  /// By the values of the fabric, 3 vertices x values; empty if not asked for.
  MatX x_derivative, reaction_derivative;
};

/// What follows from moves of the held vertices, once the free ones have come to rest again.
struct HeldResponse {
  MatX x;       ///< of all vertices, m per unit: the moves, and -K_ff^-1 K_fc of them
  MatX forces;  ///< that hold the vertices, N per unit; zero where vertices are free
};
/// To first order about the equilibrium `x`, whichever solver found it, with the exact Hessian of
/// the energy, made positive definite where it is not. `moves`: 3 vertices x any, m per unit, zero
/// where vertices are free. Throws Error for a Hessian that is not finite.
HeldResponse held_response(const HeldCloth& cloth, const Fabric& fabric, const Points& x,
                           const MatX& moves);

/// Const functions keep no state: one solver may serve several threads.
class EquilibriumSolver {
 public:
  virtual ~EquilibriumSolver() = default;
  virtual std::string_view name() const = 0;
  /// Whether it takes fabrics of this elastic model.
  virtual bool takes(std::string_view /*model*/) const { return true; }
  /// Without convergence, what was reached. Throws Error for a fabric that the solver does not
  /// take.
  virtual HeldEquilibrium solve(const HeldCloth& cloth, const Fabric& fabric,
                                HeldDerivatives derivatives) const = 0;
};

/// Derivatives once the shape is at rest, bending by curvature.
XpbdOptions xpbd_solver_options();

/// Of a limp cloth, which finds its wrinkles slowly: up to 3000 iterations.
StaticOptions static_solver_options();

/// Newton's method on the energy (solve_static), derivatives by the implicit function theorem with
/// the exact Hessian; any elastic model.
std::unique_ptr<EquilibriumSolver> make_static_solver(
    const StaticOptions& options = static_solver_options());

/// XPBD (xpbd.h) with the bending of the model "stvk" (XpbdBending::curvature) unless `options` say
/// otherwise; their gravity, loads and derivatives are not read. Takes fabrics of model "stvk"
/// whose plate has one rigidity b: bend_uu = bend_vv = b, bend_twist = b / 2, bend_uv nothing
/// (kNoBendCoupling, or 1e-6 b at most); throws Error for others. The derivatives by b stand in the
/// column of bend_uu, those of bend_vv and bend_twist are zero: right where the three move
/// together.
std::unique_ptr<EquilibriumSolver> make_xpbd_solver(XpbdOptions options = xpbd_solver_options());

}  // namespace weft
