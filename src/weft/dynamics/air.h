#pragma once
/// Air that moves by itself: a draught, a fan, a gust. Drag acts by the velocity of the cloth
/// relative to it. The cloth does not act back on the air.
#include <vector>

#include "weft/dynamics/sensitivity.h"

namespace weft {

/// Velocity of the air at each vertex, linear in time between samples, constant before the first
/// and after the last.
struct AirMotion {
  std::vector<double> times;     ///< s, finite, strictly increasing; empty: still air
  std::vector<Points> velocity;  ///< one a time: 3 x vertices, finite, m/s

  bool still() const { return times.empty(); }
  /// `velocity`: 3 x vertices at `time`; no columns for still air.
  void at(double time, Points& velocity) const;
};

/// simulate() and simulate_with_sensitivities() in moving air. An equilibrium that a motion starts
/// from is one in still air: let the air begin at rest. Throws Error besides for air of another
/// number of vertices, times that do not increase, numbers that are not finite, and moving air with
/// Integrator::runge_kutta.
Trajectory simulate(const Scene& scene, const AirMotion& air, const Fabric& fabric,
                    const SimulationOptions& options = {});
TrajectoryWithSensitivities simulate_with_sensitivities(const Scene& scene, const AirMotion& air,
                                                        const Fabric& fabric,
                                                        const std::vector<int>& parameters,
                                                        const SimulationOptions& options = {},
                                                        int threads = 1);

}  // namespace weft
