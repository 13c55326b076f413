#include "weft/optics/smooth_surface.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <map>

#include "weft/base/error.h"

namespace weft {
namespace {

/// Unit vector, or zero for a vector that has no direction.
Vec3 unit(const Vec3& v) {
  const double squared = v.squaredNorm();
  return squared > 0 ? Vec3(v / std::sqrt(squared)) : Vec3(Vec3::Zero());
}

}  // namespace

SmoothSurface::SmoothSurface(const TriangleMesh& mesh, int subdivision)
    : subdivision_(subdivision), vertex_count_(mesh.vertex_count()) {
  if (subdivision < 1 || subdivision > 16)
    throw Error(fmt::format("subdivision is {}; must be 1 to 16", subdivision));
  validate(mesh, "mesh");
  build_topology(mesh);
  build_weights();
  build_triangles();
  const auto samples = static_cast<Eigen::Index>(vertex_count_) +
                       static_cast<Eigen::Index>(edges_.size()) * (subdivision_ - 1) +
                       static_cast<Eigen::Index>(faces_.size() * inner_.size());
  points_.setZero(3, samples);
  normals_.setZero(3, samples);
  curves_.resize(edges_.size());
}

void SmoothSurface::build_topology(const TriangleMesh& mesh) {
  std::map<std::array<int, 2>, int> known;
  for (const auto& triangle : mesh.triangles) {
    Face face{triangle, {}, {}};
    for (int k = 0; k < 3; ++k) {
      std::array<int, 2> ends{triangle[k], triangle[(k + 1) % 3]};
      face.reversed[k] = ends[0] > ends[1];
      if (face.reversed[k]) std::swap(ends[0], ends[1]);
      const auto [it, is_new] = known.try_emplace(ends, static_cast<int>(edges_.size()));
      if (is_new) edges_.push_back({ends});
      face.edges[k] = it->second;
    }
    faces_.push_back(face);
  }
}

/// Index of the sample of `face` with barycentric coordinates (n - i - j, i, j) / n.
int SmoothSurface::sample(int face, int i, int j) const {
  const Face& f = faces_[face];
  const int n = subdivision_, k = n - i - j;
  if (k == n) return f.vertices[0];
  if (i == n) return f.vertices[1];
  if (j == n) return f.vertices[2];
  const auto on_edge = [&](int edge, int step) {
    const int along = f.reversed[edge] ? n - step : step;
    return vertex_count_ + f.edges[edge] * (n - 1) + along - 1;
  };
  if (j == 0) return on_edge(0, i);
  if (k == 0) return on_edge(1, j);
  if (i == 0) return on_edge(2, k);
  const int row = (j - 1) * (n - 1) - j * (j - 1) / 2;  // inner samples of the rows before j
  return vertex_count_ + static_cast<int>(edges_.size()) * (n - 1) +
         face * static_cast<int>(inner_.size()) + row + i - 1;
}

void SmoothSurface::build_triangles() {
  const int n = subdivision_;
  triangles_.reserve(faces_.size() * n * n);
  for (int f = 0; f < static_cast<int>(faces_.size()); ++f)
    for (int j = 0; j < n; ++j)
      for (int i = 0; i + j < n; ++i) {
        triangles_.push_back({sample(f, i, j), sample(f, i + 1, j), sample(f, i, j + 1)});
        if (i + j + 1 < n)
          triangles_.push_back({sample(f, i + 1, j), sample(f, i + 1, j + 1), sample(f, i, j + 1)});
      }
}

void SmoothSurface::build_weights() {
  const int n = subdivision_;
  for (int j = 1; j < n; ++j)
    for (int i = 1; i + j < n; ++i) {
      const double b = static_cast<double>(i) / n, c = static_cast<double>(j) / n, a = 1 - b - c;
      // Positions: corners, then the two control points of each edge in winding order, then the
      // centre.
      inner_.push_back({{a * a * a, b * b * b, c * c * c, 3 * a * a * b, 3 * a * b * b,
                         3 * b * b * c, 3 * b * c * c, 3 * c * c * a, 3 * c * a * a, 6 * a * b * c},
                        {a * a, b * b, c * c, 2 * a * b, 2 * b * c, 2 * c * a}});
    }
}

void SmoothSurface::evaluate(const Points& x) {
  if (x.cols() != vertex_count_)
    throw Error(fmt::format("{} positions for a mesh of {} vertices", x.cols(), vertex_count_));
  evaluate_vertices(x);
  evaluate_edges();
  evaluate_faces();
}

void SmoothSurface::evaluate_vertices(const Points& x) {
  points_.leftCols(vertex_count_) = x;
  normals_.leftCols(vertex_count_).setZero();
  for (const Face& face : faces_) {
    const auto [a, b, c] = face.vertices;
    const Vec3 origin = x.col(a), twice_area = (x.col(b) - origin).cross(x.col(c) - origin);
    normals_.col(a) += twice_area;
    normals_.col(b) += twice_area;
    normals_.col(c) += twice_area;
  }
  for (int v = 0; v < vertex_count_; ++v) normals_.col(v) = unit(normals_.col(v));
}

void SmoothSurface::evaluate_edges() {
  const int n = subdivision_;
  for (std::size_t e = 0; e < edges_.size(); ++e) {
    const auto [a, b] = edges_[e].vertices;
    const Vec3 pa = points_.col(a), pb = points_.col(b), na = normals_.col(a), nb = normals_.col(b);
    const Vec3 edge = pb - pa;
    EdgeCurve& curve = curves_[e];
    curve.control[0] = (2 * pa + pb - edge.dot(na) * na) / 3;
    curve.control[1] = (2 * pb + pa + edge.dot(nb) * nb) / 3;
    const double squared = edge.squaredNorm();
    const Vec3 sum = na + nb;
    curve.normal = unit(squared > 0 ? Vec3(sum - 2 * edge.dot(sum) / squared * edge) : sum);
    for (int step = 1; step < n; ++step) {
      const double t = static_cast<double>(step) / n, s = 1 - t;
      const auto at = vertex_count_ + static_cast<Eigen::Index>(e) * (n - 1) + step - 1;
      points_.col(at) = s * s * s * pa + 3 * s * s * t * curve.control[0] +
                        3 * s * t * t * curve.control[1] + t * t * t * pb;
      normals_.col(at) = unit(s * s * na + 2 * s * t * curve.normal + t * t * nb);
    }
  }
}

void SmoothSurface::evaluate_faces() {
  if (inner_.empty()) return;
  auto at = points_.cols() - static_cast<Eigen::Index>(faces_.size() * inner_.size());
  Eigen::Matrix<double, 3, 10> control;
  Eigen::Matrix<double, 3, 6> normal;
  for (const Face& face : faces_) {
    for (int k = 0; k < 3; ++k) {
      const EdgeCurve& curve = curves_[face.edges[k]];
      control.col(k) = points_.col(face.vertices[k]);
      control.col(3 + 2 * k) = curve.control[face.reversed[k] ? 1 : 0];
      control.col(4 + 2 * k) = curve.control[face.reversed[k] ? 0 : 1];
      normal.col(k) = normals_.col(face.vertices[k]);
      normal.col(3 + k) = curve.normal;
    }
    const Vec3 edge_mean = control.middleCols<6>(3).rowwise().mean();
    const Vec3 corner_mean = control.leftCols<3>().rowwise().mean();
    control.col(9) = edge_mean + (edge_mean - corner_mean) / 2;
    for (const InnerWeights& weights : inner_) {
      points_.col(at) =
          control * Eigen::Map<const Eigen::Matrix<double, 10, 1>>(weights.position.data());
      normals_.col(at) =
          unit(normal * Eigen::Map<const Eigen::Matrix<double, 6, 1>>(weights.normal.data()));
      ++at;
    }
  }
}

}  // namespace weft
