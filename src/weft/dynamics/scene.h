#pragma once
#include <string>
#include <vector>

#include "weft/mesh/triangle_mesh.h"

namespace weft {

/// A measured path, interpolated by a C2 cubic spline (natural ends: no acceleration at the first
/// and the last sample); constant where all samples are equal. Before the first and after the last
/// sample it rests at that sample.
class Motion {
 public:
  /// Rests at the origin.
  Motion();
  /// times: at least one, finite, strictly increasing, s; positions: 3 x times, finite, m. Throws
  /// Error otherwise. A motion of one sample rests there at all times.
  Motion(std::vector<double> times, Points positions);
  static Motion fixed(const Vec3& position);
  Vec3 position(double time) const;      ///< m
  Vec3 velocity(double time) const;      ///< m/s; zero outside [start_time, end_time]
  Vec3 acceleration(double time) const;  ///< m/s^2; zero outside [start_time, end_time]
  /// The times that the samples span; -infinity and infinity for a motion of one sample.
  double start_time() const;
  double end_time() const;

 private:
  struct Cubic;
  Cubic at(double time) const;
  std::vector<double> times_;
  Points positions_;
  Points second_derivatives_;
};

/// A vertex whose position is prescribed.
struct PointFixture {
  std::string name;
  int vertex = 0;
  Motion motion;
};

/// Everything about an experiment but the fabric.
struct Scene {
  TriangleMesh mesh;
  double areal_density = 0;  ///< kg/m^2
  double hem_width = 0;      ///< m, model/hem.h
  Vec3 gravity{0, 0, -9.81};
  std::vector<PointFixture> fixtures;
  std::vector<double> frame_times;  ///< s, increasing; the first is the start
  /// Where settling starts (the measured surface, or a guess), 3 x vertices.
  Points start;
};

/// What a simulation leaves.
struct Trajectory {
  std::vector<Points> frames;      ///< positions at frame_times
  std::vector<Points> velocities;  ///< likewise, m/s
  /// Force that the fixture exerts on the cloth, N: [frame](3 x fixtures).
  std::vector<Points> reactions;
  /// True if the solution ceased to be finite or a step could not be solved at the smallest step.
  bool diverged = false;
  std::string divergence;  ///< why
  long steps = 0;
  long factorizations = 0;
  long newton_iterations = 0;
  long force_evaluations = 0;
};

}  // namespace weft
