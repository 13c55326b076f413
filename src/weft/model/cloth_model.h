#pragma once
#include <memory>
#include <span>
#include <vector>

#include "weft/fabric/fabric.h"
#include "weft/mesh/triangle_mesh.h"
#include "weft/model/hessian_kind.h"
#include "weft/model/linear_maps.h"

namespace weft {

/// How the history of a time integrator enters the damping. Every linear multistep integrator
/// writes the velocity at the end of a step as v = rate * x - history; applied to each strain C
/// instead, Cdot = rate * C - strain_history, damping is the gradient of a potential of x and its
/// Hessian is symmetric (docs/architecture.md, "Damping").
struct DampingRate {
  double rate = 0;                       ///< 1/s; 0: no damping
  const VecX* strain_history = nullptr;  ///< rate * C minus the strain rate, one entry a component
};

/// A mesh and a fabric: the energy, the forces and their derivatives (Bhat 2003 section 3; Baraff
/// and Witkin 1998 section 4). Geometry and sparsity are fixed at construction; the parameters may
/// be set again. Components are ordered: stretch u and v and shear of each triangle, then the
/// curvatures K_uu, K_vv and K_uv (with a factor) of each bending element (bending.h).
///
/// Energy of a component: 1/2 w k C^2 with w the element's area (m^2). For the strains k is in
/// N/m; for the curvatures (1/m) k is the flexural rigidity in N m, of K_uv (as sqrt(2) K_uv) that
/// of the fabric's twist_stiffness if it has one. Energies are linear in area: the parameters do
/// not depend on the mesh.
///
/// A fabric of model "baraff-witkin-diagonals" has diagonals besides (strain/diagonal.h), which
/// resist elongation at 45 degrees to the threads and no shortening: of each element of diagonals.h
/// two components and an empty third one of no weight, between those of the membrane and the
/// curvatures. One of "baraff-witkin-hinges" has them, too, and bends by hinges (hinges.h): for the
/// curvatures of each element stand the bend at an edge and the two twists of a cell.
///
/// All functions are const and keep no state between calls: one model may serve several threads.
/// A triangle that has collapsed gives finite values (stretch.h, dihedral_angle.h).
class ClothModel {
 public:
  /// `hem_width` in m (hem.h). Throws Error if the areal density is not in (0, 100] kg/m^2, the
  /// mesh or fabric is not valid, or the mesh cannot have a hem.
  ClothModel(const TriangleMesh& mesh, const Fabric& fabric, double areal_density,
             const Vec3& gravity, double hem_width = 0);
  ~ClothModel();
  ClothModel(ClothModel&&) noexcept;
  ClothModel& operator=(ClothModel&&) noexcept;

  /// Throws Error if the fabric is of another model than that of the constructor, or a value is
  /// negative or not finite.
  void set_fabric(const Fabric& fabric);
  const TriangleMesh& mesh() const;
  int vertex_count() const;
  int component_count() const;
  /// Lumped masses, kg, one a vertex.
  const VecX& masses() const;
  const Vec3& gravity() const;

  /// Elastic energy, and gravitational potential relative to the origin, J.
  double elastic_energy(const Points& x) const;
  double gravity_energy(const Points& x) const;

  /// Values C of all components (strains, curvatures in 1/m): what DampingRate needs.
  void strains(const Points& x, VecX& c) const;

  /// Potential of elasticity, gravity and damping (with `damping`): the part of an implicit step
  /// that has a potential.
  double potential(const Points& x, const DampingRate& damping) const;
  /// gradient = d potential / d x, 3 x vertices. Overwrites.
  void potential_gradient(const Points& x, const DampingRate& damping, Points& gradient) const;
  /// The same gradient and, in the same pass, the Hessian of the potential into `hessian`: its
  /// lower triangle (with the diagonal), in the pattern of hessian_pattern(), added to what is
  /// there.
  void potential_hessian(const Points& x, const DampingRate& damping, HessianKind kind,
                         Points& gradient, SparseMatrix& hessian) const;
  /// The same and, as add_drag_damping() adds it, the damping of the drag.
  void step_hessian(const Points& x, const DampingRate& damping, HessianKind kind, const Points& v,
                    double factor, Points& gradient, SparseMatrix& hessian) const;
  /// Lower triangle with explicit zeros, 3 n x 3 n, compressed. Start of every Hessian.
  const SparseMatrix& hessian_pattern() const;
  /// Positions in hessian.valuePtr() of the 3 n diagonal entries.
  std::span<const int> diagonal_slots() const;

  /// Air drag (Bhat 2003, section 3): per triangle, with v the mean of its vertices' velocities
  /// by their shares of its area (grid_cells.h), by which they share the force, too,
  /// split along and across the current normal; a is the undeformed area. Added to `force`.
  void add_drag(const Points& x, const Points& v, Points& force) const;
  /// - d drag / d v (symmetric, positive semi-definite), times `factor`, added to `hessian`.
  void add_drag_damping(const Points& x, const Points& v, double factor,
                        SparseMatrix& hessian) const;

  /// All forces at a state: elasticity, damping (with Cdot = grad C . v), gravity, drag. For
  /// explicit integration and for tests. Overwrites.
  void forces(const Points& x, const Points& v, Points& force) const;

  /// d force / d p at a fixed state, with p the parameter at `parameter` in the fabric's table (N
  /// per unit of p). Overwrites. Sensitivities need it.
  void force_derivative(const Points& x, const Points& v, int parameter, Points& derivative) const;

  /// What the sensitivities of a motion need besides. The gradients of all strains at x:
  void strain_jacobian(const Points& x, StrainJacobian& jacobian) const;
  /// weights and parameters of the components; values of all parameters as in the fabric's table:
  const ComponentTable& components() const;
  const VecX& values() const;
  /// the derivatives of the drag by x and by v:
  void drag_jacobian(const Points& x, const Points& v, DragJacobian& jacobian) const;
  /// whether the drag depends on the parameter at `parameter` in the fabric's table;
  bool drag_depends_on(int parameter) const;
  /// d drag / d p, N per unit of the parameter; 3 x vertices, zero if the drag does not depend on
  /// it. Overwrites.
  void drag_derivative(const Points& x, const Points& v, int parameter, Points& derivative) const;

  /// Power taken by damping and by drag, W (both >= 0): for the energy balance.
  double damping_power(const Points& x, const Points& v) const;
  double drag_power(const Points& x, const Points& v) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace weft
