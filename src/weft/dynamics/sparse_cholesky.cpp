#include "weft/dynamics/sparse_cholesky.h"

#include <Eigen/SparseCholesky>

namespace weft {

struct SparseCholesky::Impl {
  std::vector<char> held;
  SparseMatrix masked;
  Eigen::SimplicialLLT<SparseMatrix, Eigen::Lower> llt;
};

SparseCholesky::SparseCholesky(const SparseMatrix& pattern, const std::vector<char>& held,
                               const MaterialPoints&)
    : impl_(new Impl) {
  impl_->held = held;
  impl_->masked = pattern;
  impl_->llt.analyzePattern(pattern);
}
SparseCholesky::~SparseCholesky() = default;
SparseCholesky::SparseCholesky(SparseCholesky&&) noexcept = default;
SparseCholesky& SparseCholesky::operator=(SparseCholesky&&) noexcept = default;

bool SparseCholesky::factorize(const SparseMatrix& matrix) {
  impl_->masked = matrix;
  for (int c = 0; c < matrix.cols(); ++c) {
    for (SparseMatrix::InnerIterator it(impl_->masked, c); it; ++it) {
      if (impl_->held[it.row() / 3] || impl_->held[c / 3]) it.valueRef() = it.row() == c ? 1 : 0;
    }
  }
  impl_->llt.factorize(impl_->masked);
  return impl_->llt.info() == Eigen::Success;
}

void SparseCholesky::solve(Points& b) const {
  for (int i = 0; i < b.cols(); ++i)
    if (impl_->held[i]) b.col(i).setZero();
  VecX x = impl_->llt.solve(flat(b));
  flat(b) = x;
}

}  // namespace weft
