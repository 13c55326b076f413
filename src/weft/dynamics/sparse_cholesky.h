#pragma once
#include <memory>
#include <vector>

#include "weft/base/types.h"

namespace weft {

/// Direct solver for the matrices of implicit steps and of equilibria: symmetric, positive
/// definite, 3 x 3 blocks coupled as the vertices are, always in the same pattern. Vertices that
/// are held drop out: their rows and columns are left unread and their unknowns are zero.
///
/// Scalar is the precision of the factor: double, or float for a preconditioner at about half the
/// cost. Right-hand sides and solutions are double.
template <class Scalar>
class SparseCholesky {
 public:
  /// `pattern`: lower triangle of a 3 n x 3 n matrix, compressed, as ClothModel::hessian_pattern();
  /// `held`: n flags; `material`: 2 x n, m, where the vertices lie, for the order of elimination.
  SparseCholesky(const SparseMatrix& pattern, const std::vector<char>& held,
                 const MaterialPoints& material);
  /// For other matrices of the same pattern with the same vertices held: what was found about them
  /// is shared, the factor is not.
  SparseCholesky another() const;
  ~SparseCholesky();
  SparseCholesky(SparseCholesky&&) noexcept;
  SparseCholesky& operator=(SparseCholesky&&) noexcept;

  /// Factorizes a matrix of that pattern. False if it is not positive definite (or not finite).
  bool factorize(const SparseMatrix& matrix);
  /// b (3 x n) becomes the solution with the last factorization. Columns of held vertices become
  /// zero.
  void solve(Points& b) const;
  /// The same for kDirections right-hand sides at once (3 n x kDirections).
  void solve(Directions& b) const;

 private:
  struct Structure;
  struct Impl;
  explicit SparseCholesky(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace weft
