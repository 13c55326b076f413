#pragma once
/// Derivatives of a motion with respect to the parameters of the fabric.
///
/// A step of an implicit integrator solves R(x; history, theta) = 0 (implicit_stepper.h). Its exact
/// derivative is a linear system in dx = dx/dtheta with the step's own matrix,
///
///     (r^2 M + K - df_drag/dx - r df_drag/dv) dx
///         = M (r dH(x) + dH(v)) + G^T w kd dH(C) - df_drag/dv dH(x) - d(grad P)/dtheta
///           + df_drag/dtheta,
///
/// with K the exact Hessian of the potential P (of damping, too), G = dC/dx the gradients of the
/// strains, and dH the history formula applied to the derivatives of the states before. The
/// derivative of the matrix through every strain's second derivative and through the dependence of
/// damping and drag on position is there; nothing is left out. The equilibrium that a motion starts
/// from gives dx = -K^-1 d(grad P)/dtheta (the implicit function theorem).
///
/// All parameters are solved for at once, with one factor a step of its exact matrix (single
/// precision, refined in double until the correction to come, judged by the rate at which they
/// shrink, is below 1e-7 of the largest entry). They are exact where the step ends, to within
/// newton_tolerance of its solution. A step does not need them, so that they can follow on a thread
/// of their own.
#include <vector>

#include "weft/dynamics/simulate.h"

namespace weft {

/// Derivatives with respect to each of `parameters`, per unit of the parameter, at the frames of a
/// trajectory.
struct Sensitivities {
  std::vector<int> parameters;        ///< indices into the model's table; column i belongs to [i]
  std::vector<Directions> x;          ///< [frame](3 vertices, parameter), m per unit
  std::vector<Directions> v;          ///< [frame](3 vertices, parameter), m/s per unit
  std::vector<Directions> reactions;  ///< [frame](3 fixtures, parameter), N per unit
  /// Systems whose matrix was not positive definite, or that did not reach the tolerance: their
  /// solution is that of the nearest positive definite matrix, or the last iterate (where there is
  /// none, what the step began with). 0 is usual.
  long inexact = 0;
};

struct TrajectoryWithSensitivities {
  Trajectory trajectory;
  Sensitivities sensitivities;
};

/// simulate(), and the derivatives by `parameters` (indices into the model's table, distinct, 1 to
/// kDirections of them). The trajectory is that of simulate(). `threads`: 2 or more: derivatives
/// follow on a second one, with the same results. Throws Error for Integrator::runge_kutta,
/// parameters out of range, and what simulate() throws. If the simulation diverges there are
/// derivatives for the frames that were reached.
TrajectoryWithSensitivities simulate_with_sensitivities(const Scene& scene, const Fabric& fabric,
                                                        const std::vector<int>& parameters,
                                                        const SimulationOptions& options = {},
                                                        int threads = 1);

}  // namespace weft
