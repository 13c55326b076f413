#pragma once
/// Decompositions of small dense matrices, compiled once: their templates take a compiler up to ten
/// seconds in each source that calls them. Nothing is checked: what is singular gives what Eigen
/// gives.
#include <optional>

#include "weft/base/types.h"

namespace weft {

/// Eigenvalues, ascending, and an eigenvector a column.
struct SymmetricEigen {
  VecX values;
  MatX vectors;
};
struct SymmetricEigen3 {
  Vec3 values;
  Mat3 vectors;
};
/// Of symmetric matrices, of which the lower triangle is read.
SymmetricEigen symmetric_eigen(const MatX& matrix);
SymmetricEigen3 symmetric_eigen_3(const Mat3& matrix);

/// matrix = u diag(values) v^T, values descending.
struct SingularValues3 {
  Mat3 u;
  Vec3 values;
  Mat3 v;
};
SingularValues3 singular_values_3(const Mat3& matrix);
/// The rotation R (det 1) of the largest trace of R^T matrix: for matrix = sum of world_i
/// material_i^T about their means, that which takes the material points nearest to the world's.
Mat3 nearest_rotation(const SingularValues3& of);

/// The least turn from the direction of `from` to that of `to`.
Mat3 turn_between(const Vec3& from, const Vec3& to);

/// a^-1 b of a symmetric a, of which the lower triangle is read (LDL^T).
MatX solve_symmetric(const MatX& a, const MatX& b);
/// The same of a positive definite one (Cholesky); nothing where it is not.
std::optional<MatX> solve_positive(const MatX& a, const MatX& b);
/// Has a symmetric matrix, of which the lower triangle is read, a Cholesky factor? Inline, for the
/// loops over elements.
template <int N>
bool is_positive_definite(Eigen::Matrix<double, N, N> a) {
  for (int k = 0; k < N; ++k) {
    if (!(a(k, k) > 0)) return false;
    for (int j = k + 1; j < N; ++j) {
      const double factor = a(j, k) / a(k, k);
      for (int i = j; i < N; ++i) a(i, j) -= factor * a(i, k);
    }
  }
  return true;
}
/// L^-1 of a = L L^T.
MatX inverse_of_cholesky_factor(const MatX& a);
MatX inverse(const MatX& a);
/// b^T a b.
MatX congruence(const MatX& a, const MatX& b);
/// The x of the least |a x - b|, a column of b each, of a full rank.
MatX least_squares_solution(const MatX& a, const MatX& b);
/// An orthonormal basis of all of space whose first columns span those of a, a of full rank.
MatX orthonormal_basis(const MatX& a);

}  // namespace weft
