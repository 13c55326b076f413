#include "weft/dynamics/state.h"

#include "weft/dynamics/air.h"

namespace weft {

const Points& State::velocity_in_air(Points& storage) const {
  if (air.cols() == 0) return v;
  storage = v - air;
  return storage;
}

void total_force(const ClothModel& model, const State& state, Points& force) {
  VecX history;
  model.potential_gradient(state.x, damping_at(state, history), force);
  force = -force;
  Points in_air;
  model.add_drag(state.x, state.velocity_in_air(in_air), force);
}

void prescribe_positions(const std::vector<PointFixture>& fixtures, double time, Points& x) {
  for (const PointFixture& fixture : fixtures) {
    x.col(fixture.vertex) = fixture.motion.position(time);
  }
}

void prescribe_velocities(const std::vector<PointFixture>& fixtures, double time, Points& v) {
  for (const PointFixture& fixture : fixtures) {
    v.col(fixture.vertex) = fixture.motion.velocity(time);
  }
}

void prescribe_accelerations(const std::vector<PointFixture>& fixtures, double time, Points& a) {
  for (const PointFixture& fixture : fixtures) {
    a.col(fixture.vertex) = fixture.motion.acceleration(time);
  }
}

std::vector<char> held_vertices(const std::vector<PointFixture>& fixtures, int vertex_count) {
  std::vector<char> held(static_cast<std::size_t>(vertex_count), 0);
  for (const PointFixture& fixture : fixtures) held[static_cast<std::size_t>(fixture.vertex)] = 1;
  return held;
}

DampingRate damping_at(const State& state, VecX& history) {
  history = state.c - state.c_rate;
  return {1.0, &history};
}

State state_from_rest(const ClothModel& model, const std::vector<PointFixture>& fixtures,
                      double time, const Points& x, const AirMotion* air) {
  State state;
  state.time = time;
  state.x = x;
  if (air) air->at(time, state.air);
  prescribe_positions(fixtures, time, state.x);
  state.v.setZero(3, x.cols());
  prescribe_velocities(fixtures, time, state.v);
  model.strains(state.x, state.c);
  state.c_rate.setZero(state.c.size());
  total_force(model, state, state.a);
  for (Eigen::Index i = 0; i < x.cols(); ++i) state.a.col(i) /= model.masses()(i);
  prescribe_accelerations(fixtures, time, state.a);
  return state;
}

Points reactions(const ClothModel& model, const std::vector<PointFixture>& fixtures,
                 const Points& acceleration, const Points& force) {
  Points reaction(3, static_cast<Eigen::Index>(fixtures.size()));
  for (std::size_t k = 0; k < fixtures.size(); ++k) {
    const int i = fixtures[k].vertex;
    reaction.col(static_cast<Eigen::Index>(k)) =
        model.masses()(i) * acceleration.col(i) - force.col(i);
  }
  return reaction;
}

}  // namespace weft
