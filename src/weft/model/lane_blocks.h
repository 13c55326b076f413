#pragma once
/// Between vectors and matrices of a mesh and elements that are worked on kLanes at a time.
#include <array>
#include <cstring>
#include <vector>

#include "weft/model/block_pattern.h"
#include "weft/strain/triangle_curvature.h"

namespace weft::detail {

/// Of one vertex, or of one block, of kLanes elements.
using LaneIndices = std::array<int, kLanes>;

/// Columns of a 3 x n matrix.
inline Vector3<Lanes> gather(const double* points, const LaneIndices& vertices) {
  Vector3<Lanes> out;
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    const double* p = points + 3 * vertices[lane];
    out.x[lane] = p[0];
    out.y[lane] = p[1];
    out.z[lane] = p[2];
  }
  return out;
}

/// For all vertices of a group.
template <std::size_t kVertices>
std::array<Vector3<Lanes>, kVertices> gather(const double* points,
                                             const std::array<LaneIndices, kVertices>& vertices) {
  std::array<Vector3<Lanes>, kVertices> out;
  for (std::size_t i = 0; i < kVertices; ++i) out[i] = gather(points, vertices[i]);
  return out;
}

inline void scatter_add(const Vector3<Lanes>& a, const LaneIndices& vertices, double* points) {
  alignas(64) double buffer[3][kLanes];
  std::memcpy(buffer, &a, sizeof buffer);
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    double* p = points + 3 * vertices[lane];
    p[0] += buffer[0][lane];
    p[1] += buffer[1][lane];
    p[2] += buffer[2][lane];
  }
}

/// For all vertices of a group. (What is added is a vector of its own on purpose: GCC 12 drops the
/// stores of a loop that scatters what it computes.)
template <std::size_t kVertices>
void scatter_add(const std::array<Vector3<Lanes>, kVertices>& a,
                 const std::array<LaneIndices, kVertices>& vertices, double* points) {
  for (std::size_t i = 0; i < kVertices; ++i) scatter_add(a[i], vertices[i], points);
}

/// Adds 3 x 3 blocks of kLanes elements to the values of a matrix with a BlockPattern.
class BlockWriter {
 public:
  BlockWriter(double* values, const std::vector<ColumnLayout>& columns)
      : values_(values), columns_(columns.data()) {}

  /// A diagonal block.
  void add(const SymmetricMatrix3<Lanes>& block, const LaneIndices& vertices) {
    alignas(64) double m[6][kLanes];
    std::memcpy(m, &block, sizeof m);
    for (std::size_t lane = 0; lane < kLanes; ++lane)
      add_to_diagonal(vertices[lane], m[0][lane], m[1][lane], m[2][lane], m[3][lane], m[4][lane],
                      m[5][lane]);
  }

  /// An off-diagonal block with rows of `row_vertices` and columns of `column_vertices`, or
  /// transposed where its slot says so. Where an element has one vertex in both places, the block
  /// and its transpose go to the diagonal.
  void add(const Matrix3<Lanes>& block, const LaneIndices& slots, const LaneIndices& row_vertices,
           const LaneIndices& column_vertices) {
    alignas(64) double m[9][kLanes];
    std::memcpy(m, &block, sizeof m);
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      if (row_vertices[lane] == column_vertices[lane]) {
        add_to_diagonal(row_vertices[lane], 2 * m[0][lane], m[1][lane] + m[3][lane], 2 * m[4][lane],
                        m[2][lane] + m[6][lane], m[5][lane] + m[7][lane], 2 * m[8][lane]);
        continue;
      }
      const bool transposed = slots[lane] < 0;
      const int slot = transposed ? ~slots[lane] : slots[lane];
      const int length = columns_[transposed ? row_vertices[lane] : column_vertices[lane]].length;
      double* c0 = values_ + slot;
      double* c1 = c0 + length - 1;
      double* c2 = c1 + length - 2;
      if (transposed) {
        for (std::size_t r = 0; r < 3; ++r) {
          c0[r] += m[r][lane];
          c1[r] += m[3 + r][lane];
          c2[r] += m[6 + r][lane];
        }
      } else {
        for (std::size_t r = 0; r < 3; ++r) {
          c0[r] += m[3 * r][lane];
          c1[r] += m[3 * r + 1][lane];
          c2[r] += m[3 * r + 2][lane];
        }
      }
    }
  }

  /// All blocks of a group of bending elements.
  void add(const CurvatureHessian<Lanes>& hessian, const std::array<LaneIndices, 6>& vertices,
           const std::array<LaneIndices, kPairs.size()>& slots) {
    for (std::size_t i = 0; i < vertices.size(); ++i) add(hessian.diagonal[i], vertices[i]);
    for (std::size_t k = 0; k < slots.size(); ++k)
      add(hessian.lower[k], slots[k], vertices[kPairs[k][0]], vertices[kPairs[k][1]]);
  }

 private:
  void add_to_diagonal(int vertex, double xx, double yx, double yy, double zx, double zy,
                       double zz) {
    const ColumnLayout column = columns_[vertex];
    double* c0 = values_ + column.start;
    double* c1 = c0 + column.length;
    c0[0] += xx;
    c0[1] += yx;
    c0[2] += zx;
    c1[0] += yy;
    c1[1] += zy;
    c1[column.length - 1] += zz;
  }

  double* values_;
  const ColumnLayout* columns_;
};

}  // namespace weft::detail
