#pragma once
/// The lattice that moved the true surfaces of the captures: its constants, its grid, and the
/// surface that was shown, whose control points are the lattice's vertices.
#include <Eigen/LU>
#include <array>
#include <cmath>
#include <string>

#include "weft/base/error.h"
#include "weft/base/toml_reader.h"
#include "weft/capture/capture.h"

namespace weft::validation {

/// What the source ran with.
struct Constants {
  double density;                 // kg/m^2
  double edge, edge_compression;  // N/m
  double diagonal;                // N/m
  double tension_damping;         // N s/m
  double bending;                 // N m
  double bending_damping;         // N m s
  double drag_rate;               // 1/s
};

/// Of CAPTURE/truth/parameters.toml. Throws Error.
inline Constants read_constants(const Capture& capture) {
  const TomlTable file = TomlTable::parse_file(capture.folder / "truth" / "parameters.toml");
  constexpr Range any{0, 1e6};
  return {.density = file.number("areal_density_kg_m2", {1e-3, 10}),
          .edge = file.number("edge_spring_k_N_per_m", any),
          .edge_compression = file.number("edge_spring_compression_k_N_per_m", any),
          .diagonal = file.number("diagonal_spring_k_d_N_per_m", any),
          .tension_damping = file.number("tension_damping_N_s_per_m", any),
          .bending = file.number("bending_stiffness_N_m", any),
          .bending_damping = file.number("bending_damping_N_m_s", any),
          .drag_rate = file.number("air_drag_rate_per_s", any)};
}

/// Which points of a video capture's true surface are a scan.
enum class SourceSurface {
  shown,   ///< those of the surface that was rendered
  lattice  ///< its control points, which are what the source's forces act on
};

/// Throws Error for another name.
inline SourceSurface surface_from_name(const std::string& name) {
  if (name == "shown") return SourceSurface::shown;
  if (name == "lattice") return SourceSurface::lattice;
  throw Error("--surface " + name + ": must be shown or lattice");
}

/// Vertex = row * columns + column.
struct Grid {
  int columns, rows;
  double side;  // of a quad, m
  int vertex(int row, int column) const { return row * columns + column; }
  bool rim_row(int row) const { return row == 0 || row == rows - 1; }
  bool rim_column(int column) const { return column == 0 || column == columns - 1; }
  /// In order around the quad whose first corner is (row, column).
  std::array<int, 4> quad(int row, int column) const {
    return {vertex(row, column), vertex(row, column + 1), vertex(row + 1, column + 1),
            vertex(row + 1, column)};
  }
};

/// Throws Error unless the true surface is a grid of square quads over the swatch.
inline Grid grid_of(const Capture& capture, const TriangleMesh& mesh) {
  constexpr double kMaterialTolerance = 2e-6;  // m; (u, v) are written with 1e-6 m
  const auto v = mesh.material.row(1);
  const auto columns = static_cast<int>(((v.array() - v[0]).abs() < kMaterialTolerance).count());
  const int rows = mesh.vertex_count() / columns;
  const Error refused(capture.name + ": the true surface is not a grid of square quads");
  if (columns < 2 || rows < 2 || rows * columns != mesh.vertex_count()) throw refused;
  const MaterialPoints expected =
      make_swatch(capture.width, capture.height, columns, rows).material;
  const double side = capture.width / (columns - 1);
  if (std::abs(side - capture.height / (rows - 1)) > kMaterialTolerance ||
      (mesh.material - expected).cwiseAbs().maxCoeff() > kMaterialTolerance) {
    throw refused;
  }
  return {columns, rows, side};
}

/// Control points of a subdivision surface and their limits: (1, 4, 1)/6 along both directions,
/// along the rim only on it, corners as they are.
class LimitSurface {
 public:
  explicit LimitSurface(const Grid& grid)
      : across_(weights(grid.columns)),
        down_(weights(grid.rows)),
        across_inverse_(across_.inverse()),
        down_inverse_(down_.inverse()) {}
  Points limits(const Points& control) const { return apply(across_, down_, control); }
  Points control(const Points& limits) const {
    return apply(across_inverse_, down_inverse_, limits);
  }

 private:
  static MatX weights(int count) {
    MatX w = MatX::Identity(count, count);
    for (int i = 1; i + 1 < count; ++i) w.row(i).segment<3>(i - 1) << 1. / 6, 4. / 6, 1. / 6;
    return w;
  }
  static Points apply(const MatX& across, const MatX& down, const Points& points) {
    Points result(3, points.cols());
    for (int k = 0; k < 3; ++k) {
      const MatX from = points.row(k).reshaped(across.rows(), down.rows());
      const MatX to = across * from * down.transpose();
      result.row(k) = to.reshaped().transpose();
    }
    return result;
  }

  MatX across_, down_, across_inverse_, down_inverse_;
};

}  // namespace weft::validation
