#pragma once
/// Between vectors and matrices of a mesh and elements that are worked on kLanes at a time.
#include <algorithm>
#include <array>
#include <cstring>
#include <vector>

#include "weft/model/block_pattern.h"
#include "weft/strain/cell_hinges.h"

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

/// The numbers in an object of Lanes: kLanes of the first, of the second, ...
using LaneNumber = double __attribute__((may_alias));
template <class T>
const LaneNumber* lane_numbers(const T& object) {
  return reinterpret_cast<const LaneNumber*>(&object);
}

inline void scatter_add(const Vector3<Lanes>& a, const LaneIndices& vertices, double* points) {
  const LaneNumber* from = lane_numbers(a);
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    double* p = points + 3 * vertices[lane];
    p[0] += from[lane];
    p[1] += from[kLanes + lane];
    p[2] += from[2 * kLanes + lane];
  }
}

/// For all vertices of a group. (What is added is a vector of its own on purpose: GCC 12 drops the
/// stores of a loop that scatters what it computes.)
template <std::size_t kVertices>
void scatter_add(const std::array<Vector3<Lanes>, kVertices>& a,
                 const std::array<LaneIndices, kVertices>& vertices, double* points) {
  for (std::size_t i = 0; i < kVertices; ++i) scatter_add(a[i], vertices[i], points);
}

/// (a, b, c, 0) of each lane.
using PaddedTriple = double __attribute__((vector_size(4 * sizeof(double))));
using PaddedTriples = std::array<PaddedTriple, kLanes>;
inline PaddedTriples padded(const Lanes& a, const Lanes& b, const Lanes& c) {
#if defined(__AVX512F__)
  const Lanes zero{};
  const Lanes even = __builtin_shufflevector(a, b, 0, 8, 2, 10, 4, 12, 6, 14);
  const Lanes odd = __builtin_shufflevector(a, b, 1, 9, 3, 11, 5, 13, 7, 15);
  const Lanes even_c = __builtin_shufflevector(c, zero, 0, 8, 2, 8, 4, 8, 6, 8);
  const Lanes odd_c = __builtin_shufflevector(c, zero, 1, 8, 3, 8, 5, 8, 7, 8);
  const Lanes v02 = __builtin_shufflevector(even, even_c, 0, 1, 8, 9, 2, 3, 10, 11);
  const Lanes v13 = __builtin_shufflevector(odd, odd_c, 0, 1, 8, 9, 2, 3, 10, 11);
  const Lanes v46 = __builtin_shufflevector(even, even_c, 4, 5, 12, 13, 6, 7, 14, 15);
  const Lanes v57 = __builtin_shufflevector(odd, odd_c, 4, 5, 12, 13, 6, 7, 14, 15);
  const auto low = [](const Lanes& v) { return __builtin_shufflevector(v, v, 0, 1, 2, 3); };
  const auto high = [](const Lanes& v) { return __builtin_shufflevector(v, v, 4, 5, 6, 7); };
  return {low(v02), low(v13), high(v02), high(v13), low(v46), low(v57), high(v46), high(v57)};
#else
  PaddedTriples out;
  for (int lane = 0; lane < kLanes; ++lane)
    out[static_cast<std::size_t>(lane)] = PaddedTriple{a[lane], b[lane], c[lane], 0};
  return out;
#endif
}

/// Adds 3 x 3 blocks of kLanes elements to the values of a matrix with a BlockPattern.
class BlockWriter {
 public:
  BlockWriter(double* values, const std::vector<ColumnLayout>& columns)
      : values_(values), columns_(columns.data()) {}

  /// A diagonal block.
  void add(const SymmetricMatrix3<Lanes>& block, const LaneIndices& vertices) {
    const LaneNumber* m = lane_numbers(block);
    for (std::size_t lane = 0; lane < kLanes; ++lane)
      add_to_diagonal(vertices[lane], m[lane], m[kLanes + lane], m[2 * kLanes + lane],
                      m[3 * kLanes + lane], m[4 * kLanes + lane], m[5 * kLanes + lane]);
  }

  /// An off-diagonal block with rows of `row_vertices` and columns of `column_vertices`, or
  /// transposed where its slot says so. Where an element has one vertex in both places, the block
  /// and its transpose go to the diagonal.
  void add(const Matrix3<Lanes>& block, const LaneIndices& slots, const LaneIndices& row_vertices,
           const LaneIndices& column_vertices) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const int row = row_vertices[lane], column = column_vertices[lane];
      if (row == column)
        add_with_transpose(block, lane, row);
      else
        add(block, lane, slots[lane], columns_[slots[lane] < 0 ? row : column].length);
    }
  }

  /// All blocks of a group of bending elements.
  void add(const CurvatureHessian<Lanes>& hessian, const std::array<LaneIndices, 6>& vertices,
           const std::array<LaneIndices, kPairs.size()>& slots) {
    for (std::size_t i = 0; i < vertices.size(); ++i) add(hessian.diagonal[i], vertices[i]);
    for (std::size_t k = 0; k < slots.size(); ++k)
      add(hessian.lower[k], slots[k], vertices[kPairs[k][0]], vertices[kPairs[k][1]]);
  }

  /// All blocks of a group of cells; `lengths` are those of the columns at the slots.
  void add(const CellHessian<Lanes>& hessian,
           const std::array<LaneIndices, CellStencil::vertices>& vertices,
           const std::array<LaneIndices, CellStencil::pairs.size()>& slots,
           const std::array<LaneIndices, CellStencil::pairs.size()>& lengths) {
    for (std::size_t i = 0; i < vertices.size(); ++i) add(hessian.diagonal[i], vertices[i]);
    for (std::size_t k = 0; k < slots.size(); ++k) add(hessian.lower[k], slots[k], lengths[k]);
  }

 private:
  /// Off-diagonal blocks, which in neighbouring cells are all transposed or all not.
  void add(const Matrix3<Lanes>& block, const LaneIndices& slots, const LaneIndices& lengths) {
    const auto& m = block.m;
    const auto transposed = std::count_if(slots.begin(), slots.end(), [](int s) { return s < 0; });
    if (transposed == 0)
      add_columns(padded(m[0], m[3], m[6]), padded(m[1], m[4], m[7]), padded(m[2], m[5], m[8]),
                  slots, lengths);
    else if (transposed == kLanes)
      add_columns(padded(m[0], m[1], m[2]), padded(m[3], m[4], m[5]), padded(m[6], m[7], m[8]),
                  slots, lengths);
    else
      for (std::size_t lane = 0; lane < kLanes; ++lane)
        add(block, lane, slots[lane], lengths[lane]);
  }
  /// The fourth number of each column, zero, is added to one of what follows in the matrix: below
  /// and behind such a block there always is some.
  void add_columns(const PaddedTriples& c0, const PaddedTriples& c1, const PaddedTriples& c2,
                   const LaneIndices& slots, const LaneIndices& lengths) {
#pragma GCC unroll 8
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      double* to = values_ + (slots[lane] < 0 ? ~slots[lane] : slots[lane]);
      const std::ptrdiff_t length = lengths[lane];
      add_column(to, c0[lane]);
      add_column(to + length - 1, c1[lane]);
      add_column(to + 2 * length - 3, c2[lane]);
    }
  }
  static void add_column(double* to, const PaddedTriple& column) {
    PaddedTriple sum;
    std::memcpy(&sum, to, sizeof sum);
    sum += column;
    std::memcpy(to, &sum, sizeof sum);
  }
  void add(const Matrix3<Lanes>& block, std::size_t lane, int slot, int length) {
    const LaneNumber* m = lane_numbers(block) + lane;
    double* c0 = values_ + (slot < 0 ? ~slot : slot);
    double* c1 = c0 + length - 1;
    double* c2 = c1 + length - 2;
    const std::size_t down = slot < 0 ? kLanes : 3 * kLanes, across = 4 * kLanes - down;
    for (std::size_t r = 0; r < 3; ++r) {
      c0[r] += m[r * down];
      c1[r] += m[r * down + across];
      c2[r] += m[r * down + 2 * across];
    }
  }
  void add_with_transpose(const Matrix3<Lanes>& block, std::size_t lane, int vertex) {
    const LaneNumber* m = lane_numbers(block) + lane;
    add_to_diagonal(vertex, 2 * m[0], m[kLanes] + m[3 * kLanes], 2 * m[4 * kLanes],
                    m[2 * kLanes] + m[6 * kLanes], m[5 * kLanes] + m[7 * kLanes],
                    2 * m[8 * kLanes]);
  }
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
