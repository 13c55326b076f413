#pragma once
#include "dynamics/elastica.h"
#include "dynamics/scenes.h"
#include "weft/base/random.h"
#include "weft/dynamics/xpbd.h"

namespace weft::test {

/// A grid whose inner vertices are moved at random by up to a quarter of a cell along and across,
/// and whose quads each have one of their diagonals by chance. The first `kept` columns and the
/// last stay where they are along u, the first and the last row along v.
inline TriangleMesh shuffled(const TriangleMesh& grid, int columns, int rows, int kept, int seed) {
  TriangleMesh mesh = grid;
  Rng rng(static_cast<std::uint64_t>(seed));
  const double along = grid.material(0, 1) - grid.material(0, 0);
  const double across = grid.material(1, columns) - grid.material(1, 0);
  mesh.triangles.clear();
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) {
      const int i = r * columns + c, right = i + 1, below = i + columns, opposite = below + 1;
      const double du = 0.5 * along * (rng.uniform() - 0.5);
      const double dv = 0.5 * across * (rng.uniform() - 0.5);
      if (c >= kept && c < columns - 1) mesh.material(0, i) += du;
      if (r > 0 && r < rows - 1) mesh.material(1, i) += dv;
      if (r + 1 == rows || c + 1 == columns) continue;
      if (rng.uniform() < 0.5) {
        mesh.triangles.push_back({i, right, opposite});
        mesh.triangles.push_back({i, opposite, below});
      } else {
        mesh.triangles.push_back({i, right, below});
        mesh.triangles.push_back({right, opposite, below});
      }
    }
  return mesh;
}

/// A strip clamped by two columns of vertices, on a grid or, with a seed above 0, on a random
/// triangulation.
struct RandomStrip {
  static constexpr double kLength = 0.2, kWidth = 0.05, kDensity = 0.2;  // m, m, kg/m^2
  int columns, rows;
  TriangleMesh mesh;

  RandomStrip(int cells, int seed, GridPattern pattern = GridPattern::alternating) {
    const double cell = kLength / (cells + 0.5);
    columns = cells + 2;
    rows = static_cast<int>(std::lround(kWidth / cell)) + 1;
    mesh = make_swatch(cell * (cells + 1), kWidth, columns, rows, pattern);
    if (seed > 0) mesh = shuffled(mesh, columns, rows, 2, seed);
  }

  /// How far the tip sinks by XPBD, over what the elastica says, less one; load = rho g L^3 / B.
  /// NaN without an equilibrium.
  double tip_error(XpbdBending bending, double load = 5) const {
    const double b = kDensity * kGravity * std::pow(kLength, 3) / load;
    const OrthotropicSheet sheet{
        .c00 = 500, .c11 = 500, .c01 = 0, .c22 = 250, .bend = b, .areal_density = kDensity};
    std::vector<int> pinned;
    for (int r = 0; r < rows; ++r) {
      pinned.push_back(r * columns);
      pinned.push_back(r * columns + 1);
    }
    const Points start = place(mesh, [](double u, double v) { return Vec3(u, v, 0); });
    XpbdOptions options;
    options.gravity = Vec3(0, 0, -kGravity);
    options.bending = bending;
    const XpbdEquilibrium result = xpbd_equilibrium(mesh, sheet, pinned, start, options);
    if (!result.converged) return std::nan("");
    double sum = 0;
    for (int r = 0; r < rows; ++r) sum -= result.x(2, r * columns + columns - 1);
    return sum / rows / (kLength * elastica_tip_deflection(load)) - 1;
  }
};

}  // namespace weft::test
