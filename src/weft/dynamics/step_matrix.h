#pragma once
/// The matrix of an implicit step, r^2 M + K - r df_drag/dv (implicit_stepper.h), and its factor.
#include <vector>

#include "weft/dynamics/sparse_cholesky.h"
#include "weft/dynamics/symmetric_product.h"
#include "weft/model/cloth_model.h"

namespace weft {

/// Where a step's matrix is asked for.
struct StepPoint {
  const Points& x;
  const Points& velocity_in_air;  ///< m/s, of the cloth relative to the air
  DampingRate damping;
  double rate;  ///< r, 1/s
};

class StepMatrix {
 public:
  /// `held`: one flag a vertex.
  StepMatrix(const ClothModel& model, const std::vector<char>& held);

  /// matrix(), and the gradient of the potential alone.
  void assemble(const StepPoint& at, HessianKind kind, Points& gradient);
  /// The lower triangle.
  const SparseMatrix& matrix() const { return matrix_; }
  /// y = matrix() x; both 3 x n.
  void multiply(const Points& x, Points& y) const { product_.multiply(matrix_, x, y); }

  enum class Factor { none, of_matrix, of_projection };
  /// A new factor: of matrix(), as assembled at `at`, or, if that is indefinite, of its positive
  /// definite projection, which is assembled for it. `none`: neither is positive definite.
  Factor factorize(const StepPoint& at);
  const SparseCholesky<float>& factor() const { return factor_; }

 private:
  void assemble(const StepPoint& at, HessianKind kind, Points& gradient,
                SparseMatrix& matrix) const;

  const ClothModel& model_;
  SparseCholesky<float> factor_;
  SparseMatrix matrix_, projection_;
  SymmetricProduct product_;
  Points unused_gradient_;
};

}  // namespace weft
