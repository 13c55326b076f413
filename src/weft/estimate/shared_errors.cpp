#include "weft/estimate/shared_errors.h"

#include <utility>

#include "weft/base/dense.h"

namespace weft {

SharedErrors::SharedErrors(MatX by_errors) : by_errors_(std::move(by_errors)) {
  if (by_errors_.cols() == 0) return;
  SymmetricEigen eigen = symmetric_eigen(by_errors_.transpose() * by_errors_);
  squares_ = eigen.values.cwiseMax(0);
  directions_ = std::move(eigen.vectors);
}

MatX SharedErrors::weighed(const MatX& columns, double scale) const {
  if (by_errors_.cols() == 0) return columns;
  // With J / s = U S V^T the root is I - U (1 - (1 + S^2)^-1/2) U^T, and with q^2 = 1 + S^2 the
  // factor of V^T J^T is (1 - 1 / q) / S^2 = 1 / (q (q + 1)): nothing is divided by small S.
  const VecX q = (1 + squares_.array() / (scale * scale)).sqrt();
  const VecX factor = 1 / (q.array() * (q.array() + 1) * scale * scale);
  const MatX along = directions_.transpose() * (by_errors_.transpose() * columns);
  return columns - by_errors_ * (directions_ * (factor.asDiagonal() * along));
}

VecX SharedErrors::estimate(const VecX& residuals) const {
  if (none()) return VecX(0);
  const VecX along = directions_.transpose() * (by_errors_.transpose() * residuals);
  return directions_ * (along.array() / (1 + squares_.array())).matrix();
}

}  // namespace weft
