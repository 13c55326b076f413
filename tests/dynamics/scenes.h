#pragma once
/// Small scenes and closed forms that the tests of this module share.
#include <cmath>
#include <functional>

#include "weft/dynamics/simulate.h"

namespace weft::test {

constexpr double kGravity = 9.81;  // m/s^2

struct FabricValues {
  double stretch = 500, shear = 50, bend = 1e-5;                     // N/m, N/m, N m
  double stretch_damping = 0, shear_damping = 0, bend_damping = 0;   // N s/m, N s/m, N m s
  double drag_linear = 0, drag_quadratic = 0, drag_degradation = 0;  // SI
};

/// Straight into the vector: tests need values (no damping at all) outside the search ranges.
inline Fabric make_fabric(const FabricValues& f) {
  Fabric fabric = Fabric::with_defaults("test");
  fabric.values = VecX(9);
  fabric.values << f.stretch, f.shear, f.bend, f.stretch_damping, f.shear_damping, f.bend_damping,
      f.drag_linear, f.drag_quadratic, f.drag_degradation;
  return fabric;
}

/// Vertices placed by a function of (u, v).
inline Points place(const TriangleMesh& mesh, const std::function<Vec3(double, double)>& position) {
  Points x(3, mesh.vertex_count());
  for (int i = 0; i < mesh.vertex_count(); ++i) {
    x.col(i) = position(mesh.material(0, i), mesh.material(1, i));
  }
  return x;
}

/// A fixture that holds `vertex` where `x` has it.
inline PointFixture hold(int vertex, const Points& x) {
  return {"vertex " + std::to_string(vertex), vertex, Motion::fixed(x.col(vertex))};
}

inline std::vector<double> uniform_times(double end, int intervals) {
  std::vector<double> times;
  for (int i = 0; i <= intervals; ++i) times.push_back(end * i / intervals);
  return times;
}

/// Kinetic, elastic and gravitational energy, J.
inline double total_energy(const ClothModel& model, const Points& x, const Points& v) {
  double kinetic = 0;
  for (Eigen::Index i = 0; i < v.cols(); ++i) {
    kinetic += 0.5 * model.masses()(i) * v.col(i).squaredNorm();
  }
  return kinetic + model.elastic_energy(x) + model.gravity_energy(x);
}

/// Largest distance between vertices, m.
inline double largest_distance(const Points& a, const Points& b) {
  return (a - b).colwise().norm().maxCoeff();
}

/// Root of a function with a change of sign in [low, high].
inline double bisect(const std::function<double(double)>& f, double low, double high) {
  const bool rising = f(high) > 0;
  for (int i = 0; i < 200; ++i) {
    const double middle = 0.5 * (low + high);
    ((f(middle) > 0) == rising ? high : low) = middle;
  }
  return 0.5 * (low + high);
}

/// A swatch of side 0.5 m held by its two top corners 0.375 m apart, v downwards: a smooth surface
/// that is near an equilibrium, folds and all. At z = 1 on top.
inline Points sagging_start(const TriangleMesh& mesh) {
  return place(mesh, [](double u, double v) {
    const double s = u / 0.5;                         // 0 .. 1
    const double squeeze = 0.375 + 0.08 * (v / 0.5);  // m, wider below
    const double sag = 0.16 * (1 - 4 * (s - 0.5) * (s - 0.5)) * std::exp(-v / 0.25);
    const double bulge = -0.10 * std::sin(M_PI * s) * (1 - 0.5 * v / 0.5);
    return Vec3((s - 0.5) * squeeze, bulge, 1 - v * 0.97 - sag);
  });
}

/// A small, soft, damped swatch let go from the horizontal, held by two corners: smooth from the
/// start, all frequencies within reach of the steps taken here.
inline Scene swinging_scene(double end, int frames) {
  Scene scene;
  scene.mesh = make_swatch(0.3, 0.3, 4, 4);
  scene.areal_density = 0.3;
  scene.start = place(scene.mesh, [](double u, double v) { return Vec3(0.95 * u, v, 0); });
  scene.fixtures = {hold(0, scene.start), hold(3, scene.start)};
  scene.frame_times = uniform_times(end, frames);
  return scene;
}

inline Fabric soft_fabric() {
  return make_fabric({.stretch = 20,
                      .shear = 10,
                      .bend = 1e-4,
                      .stretch_damping = 0.1,
                      .shear_damping = 0.05,
                      .bend_damping = 1e-6,
                      .drag_linear = 0.1,
                      .drag_quadratic = 0.5,
                      .drag_degradation = 0.1});
}

/// A strip clamped by two columns of vertices, horizontal, bent by its own weight. The hinges on
/// the inner column stand for half a cell on each side, so that the free length begins in the
/// middle of the held cells.
struct Cantilever {
  double free_length = 0.2;  // m
  double width = 0.05;       // m
  double areal_density = 0.2;
  int columns, rows;
  TriangleMesh mesh;
  Points start;
  std::vector<PointFixture> fixtures;
  Fabric fabric;

  /// load = rho g L^3 / B. `model`: one of motion (fabric.h).
  Cantilever(int cells, GridPattern pattern, double load,
             const std::string& model = "baraff-witkin") {
    const double cell = free_length / (cells + 0.5);
    columns = cells + 2;
    rows = std::max(3, static_cast<int>(std::lround(width / cell)) + 1);
    mesh = make_swatch(cell * (cells + 1), width, columns, rows, pattern);
    start = place(mesh, [](double u, double v) { return Vec3(u, v, 0); });
    for (int row = 0; row < rows; ++row) {
      fixtures.push_back(hold(row * columns, start));
      fixtures.push_back(hold(row * columns + 1, start));
    }
    const double bend = areal_density * kGravity * std::pow(free_length, 3) / load;
    const FabricValues values{.stretch = 2000, .shear = 2000, .bend = bend};
    fabric = Fabric::with_defaults("test", model);
    fabric.values.setZero();
    fabric.values.head(9) = make_fabric(values).values;
    if (model != "baraff-witkin") fabric.set("diagonal_stiffness", 2000);
  }

  /// Mean of the free edge, m downwards; NaN without an equilibrium.
  double deflection() const {
    const ClothModel model(mesh, fabric, areal_density, Vec3(0, 0, -kGravity));
    const StaticResult result = solve_static(model, start, fixtures, 0);
    if (!result.converged) return std::nan("");
    double sum = 0;
    for (int row = 0; row < rows; ++row) sum -= result.x(2, row * columns + columns - 1);
    return sum / rows;
  }
};

}  // namespace weft::test
