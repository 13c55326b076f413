#include "weft/mesh/triangle_mesh.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <string>

#include "weft/base/error.h"
#include "weft/mesh/grid_cells.h"

namespace weft {
namespace {

/// One side of a triangle: the edge runs from `from` to `to` counter-clockwise.
struct Side {
  int from, to, apex;
  int low() const { return std::min(from, to); }
  int high() const { return std::max(from, to); }
};

/// All sides, those of one edge next to each other, in an order that depends on the mesh alone.
std::vector<Side> sorted_sides(const TriangleMesh& mesh) {
  std::vector<Side> sides;
  sides.reserve(mesh.triangles.size() * 3);
  for (const auto& [a, b, c] : mesh.triangles) {
    sides.push_back({a, b, c});
    sides.push_back({b, c, a});
    sides.push_back({c, a, b});
  }
  std::stable_sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
    return a.low() != b.low() ? a.low() < b.low() : a.high() < b.high();
  });
  return sides;
}

bool same_edge(const Side& a, const Side& b) { return a.low() == b.low() && a.high() == b.high(); }

double cross(const Vec2& a, const Vec2& b) { return a.x() * b.y() - a.y() * b.x(); }

void validate_triangle(const TriangleMesh& mesh, int t, std::string_view name) {
  for (const int vertex : mesh.triangles[static_cast<std::size_t>(t)]) {
    if (vertex < 0 || vertex >= mesh.vertex_count()) {
      throw Error(fmt::format("{}: triangle {} names vertex {}; there are {} vertices", name, t,
                              vertex, mesh.vertex_count()));
    }
  }
  const auto& [a, b, c] = mesh.triangles[static_cast<std::size_t>(t)];
  const double longest = std::max({(mesh.material.col(b) - mesh.material.col(a)).squaredNorm(),
                                   (mesh.material.col(c) - mesh.material.col(b)).squaredNorm(),
                                   (mesh.material.col(a) - mesh.material.col(c)).squaredNorm()});
  const double area = material_area(mesh, t);
  // Height below 1e-9 of the longest side: what rounding leaves of three points on a line.
  if (!(std::abs(area) > 1e-9 * longest)) {
    throw Error(fmt::format("{}: triangle {} has no area in (u, v)", name, t));
  }
  if (area < 0) {
    throw Error(
        fmt::format("{}: triangle {} is clockwise in (u, v); must be counter-clockwise", name, t));
  }
}

void validate_edges(const TriangleMesh& mesh, std::string_view name) {
  const std::vector<Side> sides = sorted_sides(mesh);
  for (std::size_t i = 0; i + 1 < sides.size(); ++i) {
    const Side& side = sides[i];
    if (i + 2 < sides.size() && same_edge(side, sides[i + 1]) && same_edge(side, sides[i + 2])) {
      throw Error(fmt::format("{}: the edge of vertices {} and {} has more than two triangles",
                              name, side.low(), side.high()));
    }
    if (same_edge(side, sides[i + 1]) && side.from == sides[i + 1].from) {
      throw Error(
          fmt::format("{}: the two triangles at the edge of vertices {} and {} overlap in "
                      "(u, v)",
                      name, side.low(), side.high()));
    }
  }
}

/// Barycentric weights of `uv`; any sign outside the triangle.
Vec3 barycentric(const Vec2& a, const Vec2& b, const Vec2& c, const Vec2& uv) {
  const double area = cross(b - a, c - a);
  const double wb = cross(uv - a, c - a) / area;
  const double wc = cross(b - a, uv - a) / area;
  return {1 - wb - wc, wb, wc};
}

/// Weights of the nearest point of the segment from corner i to corner j of `corners`.
Vec3 nearest_on_side(const std::array<Vec2, 3>& corners, int i, int j, const Vec2& uv) {
  const Vec2& a = corners[static_cast<std::size_t>(i)];
  const Vec2 side = corners[static_cast<std::size_t>(j)] - a;
  const double t = std::clamp((uv - a).dot(side) / side.squaredNorm(), 0.0, 1.0);
  Vec3 weights = Vec3::Zero();
  weights[i] = 1 - t;
  weights[j] = t;
  return weights;
}

}  // namespace

GridPattern grid_pattern_from_name(std::string_view name) {
  for (const GridPattern pattern : {GridPattern::alternating, GridPattern::uniform})
    if (name == name_of(pattern)) return pattern;
  throw Error(fmt::format("grid pattern \"{}\" is not known; known: alternating, uniform", name));
}

std::string_view name_of(GridPattern pattern) {
  return pattern == GridPattern::uniform ? "uniform" : "alternating";
}

TriangleMesh make_swatch(double width, double height, int columns, int rows, GridPattern pattern) {
  if (!(width > 0) || !(height > 0) || !std::isfinite(width) || !std::isfinite(height)) {
    throw Error(
        fmt::format("swatch of {:g} x {:g} m: width and height must be above 0", width, height));
  }
  if (columns < 2 || rows < 2) {
    throw Error(fmt::format("grid of {} x {} vertices: at least 2 x 2 are needed", columns, rows));
  }
  TriangleMesh mesh;
  mesh.material.resize(2, columns * rows);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      // Multiplied before divided: the last column and row are exactly at width and height.
      mesh.material.col(row * columns + column) =
          Vec2(width * column / (columns - 1), height * row / (rows - 1));
    }
  }
  mesh.triangles.reserve(static_cast<std::size_t>(2 * (columns - 1) * (rows - 1)));
  for (int row = 0; row + 1 < rows; ++row) {
    for (int column = 0; column + 1 < columns; ++column) {
      const int a = row * columns + column, b = a + 1, c = b + columns, d = a + columns;
      if (pattern == GridPattern::uniform || (row + column) % 2 == 0) {
        mesh.triangles.push_back({a, b, c});
        mesh.triangles.push_back({a, c, d});
      } else {
        mesh.triangles.push_back({a, b, d});
        mesh.triangles.push_back({b, c, d});
      }
    }
  }
  return mesh;
}

double material_area(const TriangleMesh& mesh, int t) {
  const auto& [a, b, c] = mesh.triangles[static_cast<std::size_t>(t)];
  return 0.5 * cross(mesh.material.col(b) - mesh.material.col(a),
                     mesh.material.col(c) - mesh.material.col(a));
}

void validate(const TriangleMesh& mesh, std::string_view name) {
  if (mesh.triangles.empty()) throw Error(fmt::format("{}: no triangles", name));
  if (!mesh.material.allFinite()) {
    throw Error(fmt::format("{}: a material coordinate is not a finite number", name));
  }
  for (int t = 0; t < mesh.triangle_count(); ++t) validate_triangle(mesh, t, name);
  validate_edges(mesh, name);
  std::vector<bool> used(static_cast<std::size_t>(mesh.vertex_count()), false);
  for (const auto& triangle : mesh.triangles) {
    for (const int vertex : triangle) used[static_cast<std::size_t>(vertex)] = true;
  }
  const auto unused = std::find(used.begin(), used.end(), false);
  if (unused != used.end()) {
    throw Error(fmt::format("{}: vertex {} belongs to no triangle", name, unused - used.begin()));
  }
}

std::vector<Hinge> hinges(const TriangleMesh& mesh) {
  const std::vector<Side> sides = sorted_sides(mesh);
  std::vector<Hinge> result;
  for (std::size_t i = 0; i + 1 < sides.size(); ++i) {
    const Side &one = sides[i], &other = sides[i + 1];
    if (same_edge(one, other)) result.push_back({{one.from, one.to, one.apex, other.apex}});
  }
  return result;
}

VecX vertex_areas(const TriangleMesh& mesh) {
  VecX areas = VecX::Zero(mesh.vertex_count());
  const auto shares = area_shares(mesh);
  for (int t = 0; t < mesh.triangle_count(); ++t) {
    const auto at = static_cast<std::size_t>(t);
    const double area = material_area(mesh, t);
    for (std::size_t i = 0; i < 3; ++i) areas[mesh.triangles[at][i]] += shares[at][i] * area;
  }
  return areas;
}

Points vertex_normals(const TriangleMesh& mesh, const Points& x) {
  Points normals = Points::Zero(3, mesh.vertex_count());
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vec3 side_b = x.col(b) - x.col(a);
    const Vec3 side_c = x.col(c) - x.col(a);
    const Vec3 twice_area = side_b.cross(side_c);
    normals.col(a) += twice_area;
    normals.col(b) += twice_area;
    normals.col(c) += twice_area;
  }
  for (int i = 0; i < mesh.vertex_count(); ++i) {
    const double length = normals.col(i).norm();
    if (length > 0) normals.col(i) /= length;
  }
  return normals;
}

MaterialLocator::MaterialLocator(const TriangleMesh& mesh) : mesh_(&mesh) {
  const Vec2 lower = mesh.material.rowwise().minCoeff();
  const Vec2 upper = mesh.material.rowwise().maxCoeff();
  const Vec2 extent = upper - lower;
  origin_ = lower;
  // About two triangles a cell; at most a million cells even where the triangles' sizes differ
  // widely.
  const double per_cell = extent.prod() * 2 / std::max(mesh.triangle_count(), 1);
  cell_ = std::max(std::sqrt(per_cell), extent.maxCoeff() / 1000);
  columns_ = static_cast<int>(extent.x() / cell_) + 1;
  rows_ = static_cast<int>(extent.y() / cell_) + 1;
  cells_.resize(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
  for (int t = 0; t < mesh.triangle_count(); ++t) {
    Vec2 low = upper, high = lower;
    for (const int vertex : mesh.triangles[static_cast<std::size_t>(t)]) {
      low = low.cwiseMin(mesh.material.col(vertex));
      high = high.cwiseMax(mesh.material.col(vertex));
    }
    const Eigen::Vector2i first = ((low - origin_) / cell_).cast<int>();
    const Eigen::Vector2i last = ((high - origin_) / cell_).cast<int>();
    for (int row = first.y(); row <= std::min(last.y(), rows_ - 1); ++row) {
      for (int column = first.x(); column <= std::min(last.x(), columns_ - 1); ++column) {
        cells_[static_cast<std::size_t>(row * columns_ + column)].push_back(t);
      }
    }
  }
}

MaterialLocator::Hit MaterialLocator::locate(const Vec2& uv) const {
  const Vec2 scaled = (uv - origin_) / cell_;
  const int column = static_cast<int>(std::clamp(scaled.x(), 0.0, columns_ - 1.0));
  const int row = static_cast<int>(std::clamp(scaled.y(), 0.0, rows_ - 1.0));

  Hit best{-1, Vec3::Zero()};
  double best_distance = kInfinity;
  const auto consider = [&](int t) {
    const auto& triangle = mesh_->triangles[static_cast<std::size_t>(t)];
    const std::array<Vec2, 3> corners{mesh_->material.col(triangle[0]),
                                      mesh_->material.col(triangle[1]),
                                      mesh_->material.col(triangle[2])};
    const auto offer = [&](const Vec3& weights) {
      const Vec2 point =
          weights[0] * corners[0] + weights[1] * corners[1] + weights[2] * corners[2];
      const double distance = (point - uv).squaredNorm();
      if (distance < best_distance) {
        best_distance = distance;
        best = {t, weights};
      }
    };
    const Vec3 weights = barycentric(corners[0], corners[1], corners[2], uv);
    if (weights.minCoeff() >= 0) {
      best_distance = 0;
      best = {t, weights};
      return;
    }
    offer(nearest_on_side(corners, 0, 1, uv));
    offer(nearest_on_side(corners, 1, 2, uv));
    offer(nearest_on_side(corners, 2, 0, uv));
  };

  // Rings of cells around the point's own (or the nearest) cell. What lies in ring r + 1 or beyond
  // is at least r cells from a point inside the grid; from a point outside it is further still.
  const int rings = std::max(columns_, rows_);
  for (int ring = 0; ring < rings && best_distance > 0; ++ring) {
    const double reach = (ring - 1) * cell_;
    if (ring > 0 && best.triangle >= 0 && best_distance <= reach * reach) break;
    for (int i = std::max(row - ring, 0); i <= std::min(row + ring, rows_ - 1); ++i) {
      const bool whole_row = std::abs(i - row) == ring;
      const int stride = whole_row || ring == 0 ? 1 : 2 * ring;
      for (int j = column - ring; j <= column + ring; j += stride) {
        if (j < 0 || j >= columns_) continue;
        for (const int t : cells_[static_cast<std::size_t>(i * columns_ + j)]) {
          consider(t);
          if (best_distance == 0) return best;
        }
      }
    }
  }
  return best;
}

Points interpolate(const TriangleMesh& mesh, const MaterialLocator& locator, const Points& x,
                   const MaterialPoints& uv) {
  Points result(3, uv.cols());
  for (Eigen::Index i = 0; i < uv.cols(); ++i) {
    const MaterialLocator::Hit hit = locator.locate(uv.col(i));
    const auto& [a, b, c] = mesh.triangles[static_cast<std::size_t>(hit.triangle)];
    result.col(i) = hit.barycentric[0] * x.col(a) + hit.barycentric[1] * x.col(b) +
                    hit.barycentric[2] * x.col(c);
  }
  return result;
}

}  // namespace weft
