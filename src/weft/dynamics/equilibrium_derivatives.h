#pragma once
#include <vector>

#include "weft/dynamics/clips.h"
#include "weft/dynamics/held_equilibrium.h"
#include "weft/dynamics/static_system.h"

namespace weft::detail {

/// Derivatives of an equilibrium by all parameters of the model (implicit function theorem, as in
/// clips.h): a row a coordinate, a column a parameter.
struct EquilibriumDerivatives {
  MatX x;                ///< m per unit; zero where vertices are held
  MatX gradient;         ///< of the force that holds each vertex, N per unit; zero where it is free
  bool inexact = false;  ///< the Hessian had to be made positive definite
};
/// `system`: of `cloth`; `history_derivative` as in clip_sensitivities(). Throws Error for a
/// Hessian that is not finite.
EquilibriumDerivatives equilibrium_derivatives(const HeavyCloth& cloth, StaticSystem& system,
                                               const Points& x,
                                               const MatX& history_derivative = {});

/// The forces are the Schur complement of the exact Hessian times `moves` (3 vertices x any, m per
/// unit, zero where vertices are free). Where the Hessian is not positive definite the free
/// vertices answer as in equilibrium_derivatives(). Throws Error for a Hessian that is not finite.
HeldResponse held_response(StaticSystem& system, const Points& x, const MatX& moves);

}  // namespace weft::detail
