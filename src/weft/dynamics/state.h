#pragma once
#include <vector>

#include "weft/dynamics/scene.h"
#include "weft/model/cloth_model.h"

namespace weft {

struct AirMotion;

/// Where the cloth is and how it moves.
struct State {
  double time = 0;  ///< s
  Points x;         ///< m
  Points v;         ///< m/s
  Points a;         ///< m/s^2
  VecX c;           ///< strains of all components
  VecX c_rate;      ///< their rates as the integrator sees them, 1/s
  Points air;       ///< velocity of the air at the vertices, m/s; no columns: still

  /// Velocity of the cloth relative to the air, what drag acts by; `storage` is for it in moving
  /// air.
  const Points& velocity_in_air(Points& storage) const;
};

/// Sets the columns of the fixtures' vertices to what their motions say.
void prescribe_positions(const std::vector<PointFixture>& fixtures, double time, Points& x);
void prescribe_velocities(const std::vector<PointFixture>& fixtures, double time, Points& v);
void prescribe_accelerations(const std::vector<PointFixture>& fixtures, double time, Points& a);

/// One flag a vertex: 1 if a fixture holds it.
std::vector<char> held_vertices(const std::vector<PointFixture>& fixtures, int vertex_count);

/// The DampingRate that gives exactly the strain rates of `state`; `history` is storage for it.
DampingRate damping_at(const State& state, VecX& history);

/// Cloth at `x` with velocity `v`, strain rates zero, and accelerations from the equation of
/// motion. Fixtures are at x, v and a as prescribed. No `air`: still.
State state_from_rest(const ClothModel& model, const std::vector<PointFixture>& fixtures,
                      double time, const Points& x, const AirMotion* air = nullptr);

/// Elasticity, damping (at the strain rates of `state`), gravity and drag, 3 x vertices, N.
void total_force(const ClothModel& model, const State& state, Points& force);

/// Forces that hold the fixtures on their paths, M a - F at their vertices: 3 x fixtures, N.
/// `force` is the total force without them.
Points reactions(const ClothModel& model, const std::vector<PointFixture>& fixtures,
                 const Points& acceleration, const Points& force);

}  // namespace weft
