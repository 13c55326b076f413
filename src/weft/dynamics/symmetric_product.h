#pragma once
#include <vector>

#include "weft/base/types.h"

namespace weft {

/// y = A x for a symmetric matrix of which the lower triangle is stored, in 3 x 3 blocks, again and
/// again in one pattern. Neighbours of a vertex have numbers that follow each other, row by row of
/// a grid: the rows of a column fall into a few runs, which are worked on as vectors.
class SymmetricProduct {
 public:
  /// `pattern`: lower triangle of a 3 n x 3 n matrix, compressed, as ClothModel::hessian_pattern().
  explicit SymmetricProduct(const SparseMatrix& pattern);

  /// `matrix` has that pattern; x and y are 3 x n, not the same.
  void multiply(const SparseMatrix& matrix, const Points& x, Points& y) const;

 private:
  struct Run {
    int row, count;
  };
  std::vector<Run> runs_;              // of the rows below the blocks on the diagonal
  std::vector<std::size_t> run_ends_;  // of those of each vertex, in runs_
};

}  // namespace weft
