#pragma once
/// The linear equation of the derivatives of a state by parameters: matrix * dx = right side, with
/// the matrix of a step or of an equilibrium.
#include <array>
#include <vector>

#include "weft/dynamics/sparse_cholesky.h"
#include "weft/dynamics/state.h"

namespace weft {

/// Derivatives of a state by parameters of the fabric.
struct StateDerivatives {
  Directions x, v, a, c, c_rate;
};

/// H(dC), the history of the strains' derivatives in a step: a sum of the derivatives of states
/// before, which it refers to.
class StrainHistory {
 public:
  /// + `factor` `strains`. At most three, not counting those with a factor of 0.
  void add(double factor, const Directions& strains);
  bool empty() const { return count_ == 0; }
  DirectionsRow row(int component) const {
    DirectionsRow sum = DirectionsRow::Zero();
    for (std::size_t i = 0; i < count_; ++i)
      sum += terms_[i].factor * row_of(*terms_[i].strains, component);
    return sum;
  }

 private:
  struct Term {
    double factor;
    const Directions* strains;
  };
  std::array<Term, 3> terms_;
  std::size_t count_ = 0;
};

/// Collects the right side of the equation in sensitivity.h and solves it.
class LinearResponse {
 public:
  /// Starts with - d(grad P)/dtheta + df_drag/dtheta at `state` + G^T w kd `history`.
  void set_state(const ClothModel& model, const State& state, const std::vector<int>& parameters,
                 const StrainHistory& history = {});
  /// + M (`rate` `velocity` + `acceleration`).
  void add_inertia(const VecX& masses, double rate, const Directions& velocity,
                   const Directions& acceleration);
  /// - df_drag/dv `velocity_history`.
  void add_velocity_history(const Directions& velocity_history);

  /// x: the solution of (`matrix` - df_drag/dx) x = right side at the vertices that are not held,
  /// by iterative refinement with `factor`, a factor of a matrix near `matrix` (a lower triangle).
  /// False if the last correction is still above the tolerance.
  template <class Scalar>
  bool solve(const SparseMatrix& matrix, const SparseCholesky<Scalar>& factor, Directions& x);

  /// (matrix - df_drag/dx) x - right side at the fixtures' vertices, 3 fixtures rows: the
  /// derivatives of what holds them.
  Directions reactions(const SparseMatrix& matrix, const std::vector<PointFixture>& fixtures,
                       const Directions& x);
  /// right side - (matrix - df_drag/dx) x.
  const Directions& residual(const SparseMatrix& matrix, const Directions& x);

  const StrainJacobian& strains() const { return strains_; }

 private:
  StrainJacobian strains_;
  DragJacobian drag_;
  Directions right_side_, residual_;
  Points velocity_in_air_, drag_derivative_;
};

/// Derivatives of a state at rest (state_from_rest). `settled`: it is an equilibrium, which moves
/// with the parameters; otherwise its positions are given. `reactions`: of the fixtures' forces.
/// Where the stiffness matrix is not positive definite, multiples of the mass matrix are added
/// until it is, and `inexact` counts one.
StateDerivatives derivatives_at_rest(const ClothModel& model,
                                     const std::vector<PointFixture>& fixtures, const State& state,
                                     const std::vector<int>& parameters, bool settled,
                                     Directions& reactions, long& inexact);

}  // namespace weft
