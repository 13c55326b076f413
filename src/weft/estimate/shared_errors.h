#pragma once
#include "weft/base/types.h"

namespace weft {

/// Errors that several residuals share. Residuals r with independent noise of variance s^2 that
/// independent errors of variance 1 move by J have the covariance s^2 I + J J^T. Weighed by the
/// root of its inverse they are again independent, of variance 1: least squares of them is that of
/// the residuals and the errors together, to first order (as in a bundle adjustment, whose nuisance
/// unknowns are eliminated).
class SharedErrors {
 public:
  SharedErrors() = default;  ///< none
  /// A row for each residual, a column for each error.
  explicit SharedErrors(MatX by_errors);

  /// (I + J J^T / s^2)^-1/2 of each column, s = `scale` > 0: of residuals divided by s, or their
  /// derivatives. Without errors as they are.
  MatX weighed(const MatX& columns, double scale = 1) const;

  /// The most probable errors behind `residuals`, in standard deviations: (I + J^T J)^-1 J^T r.
  VecX estimate(const VecX& residuals) const;

  bool none() const { return by_errors_.cols() == 0; }
  const MatX& by_errors() const { return by_errors_; }

 private:
  MatX by_errors_, directions_;  ///< J; eigenvectors of J^T J
  VecX squares_;                 ///< its eigenvalues
};

}  // namespace weft
