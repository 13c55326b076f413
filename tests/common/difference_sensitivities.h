#pragma once
#include <algorithm>
#include <cmath>

#include "weft/dynamics/sensitivity.h"

namespace weft {

/// What simulate_with_sensitivities() returns, by central differences of simulate(): relative step
/// 1e-4 (1e-5 absolute for a parameter at zero), with Newton converged to 1e-9 m so that the
/// differences mean something. Reactions are left out.
inline TrajectoryWithSensitivities difference_sensitivities(const Scene& scene,
                                                            const Fabric& fabric,
                                                            const std::vector<int>& parameters,
                                                            SimulationOptions options,
                                                            int /*threads*/ = 1) {
  options.newton_tolerance = std::min(options.newton_tolerance, 1e-9);
  TrajectoryWithSensitivities result;
  result.trajectory = simulate(scene, fabric, options);
  result.sensitivities.parameters = parameters;
  const std::size_t frames = result.trajectory.frames.size();
  const Eigen::Index size = 3 * scene.mesh.vertex_count();
  result.sensitivities.x.assign(frames, Directions::Zero(size, kDirections));
  result.sensitivities.v = result.sensitivities.x;
  for (std::size_t j = 0; j < parameters.size(); ++j) {
    const double value = fabric.values[parameters[j]];
    const double step = value > 0 ? 1e-4 * value : 1e-5;
    Fabric above = fabric, below = fabric;
    above.values[parameters[j]] = value + step;
    below.values[parameters[j]] = value > 0 ? value - step : value;
    const Trajectory a = simulate(scene, above, options), b = simulate(scene, below, options);
    const double width = above.values[parameters[j]] - below.values[parameters[j]];
    for (std::size_t k = 0; k < std::min({frames, a.frames.size(), b.frames.size()}); ++k) {
      const auto column = static_cast<Eigen::Index>(j);
      result.sensitivities.x[k].col(column) = flat(Points(a.frames[k] - b.frames[k])) / width;
      result.sensitivities.v[k].col(column) =
          flat(Points(a.velocities[k] - b.velocities[k])) / width;
    }
  }
  return result;
}

}  // namespace weft
