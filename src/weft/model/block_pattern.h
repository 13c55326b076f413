#pragma once
/// The sparsity of a Hessian by vertices: its lower triangle in 3 x 3 blocks, and the place of each
/// block in it.
#include <span>
#include <vector>

#include "weft/base/types.h"

namespace weft::detail {

/// Where the 3 x 3 blocks of a vertex' columns start in the values of the lower triangle. Column
/// 3 v has `length` entries, columns 3 v + 1 and 3 v + 2 one and two fewer (the triangle's corner).
struct ColumnLayout {
  int start;
  int length;
};

/// Pairs (row, column) of the off-diagonal blocks of an element of up to six vertices: (1,0),
/// (2,0), (2,1), (3,0) ... (5,4).
inline constexpr std::array<std::array<std::size_t, 2>, 15> kPairs = {{{1, 0},
                                                                       {2, 0},
                                                                       {2, 1},
                                                                       {3, 0},
                                                                       {3, 1},
                                                                       {3, 2},
                                                                       {4, 0},
                                                                       {4, 1},
                                                                       {4, 2},
                                                                       {4, 3},
                                                                       {5, 0},
                                                                       {5, 1},
                                                                       {5, 2},
                                                                       {5, 3},
                                                                       {5, 4}}};

class BlockPattern {
 public:
  /// Collects the elements; all diagonal blocks are there without being asked for.
  explicit BlockPattern(int vertex_count);
  void add_element(std::span<const int> vertices);
  /// To be called once, after all elements.
  void finish();

  /// Lower triangle with explicit zeros, 3 n x 3 n, compressed.
  const SparseMatrix& matrix() const { return matrix_; }
  const std::vector<ColumnLayout>& columns() const { return columns_; }
  /// Positions in the values of the 3 n diagonal entries.
  std::vector<int> diagonal_slots() const;
  /// Where block (row, column) starts in the values; complemented (~) where row < column, so that
  /// the block is to be written transposed. For row = column the diagonal block.
  int slot(int row, int column) const;

  /// Adds the block of two vertices, row before column or after, to the values of a matrix with
  /// this pattern. Where the vertices are equal, block + block^T goes to the diagonal: an element
  /// that has a vertex in two places.
  void add_off_diagonal(double* values, int row, int column, int slot,
                        const Eigen::Ref<const Mat3, 0, Eigen::OuterStride<>>& block) const;
  /// Adds a symmetric block to the diagonal.
  void add_diagonal(double* values, int vertex,
                    const Eigen::Ref<const Mat3, 0, Eigen::OuterStride<>>& block) const;

 private:
  std::vector<std::vector<int>> rows_;  ///< of each vertex: itself and its larger neighbours
  SparseMatrix matrix_;
  std::vector<ColumnLayout> columns_;
};

}  // namespace weft::detail
