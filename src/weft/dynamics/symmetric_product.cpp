#include "weft/dynamics/symmetric_product.h"

#include <algorithm>

#include "weft/dynamics/dense_kernels.h"

namespace weft {

SymmetricProduct::SymmetricProduct(const SparseMatrix& pattern) {
  const int* rows = pattern.innerIndexPtr();
  for (Eigen::Index v = 0; v < pattern.cols() / 3; ++v) {
    const int begin = pattern.outerIndexPtr()[3 * v];
    const int end = pattern.outerIndexPtr()[3 * v + 1];
    for (int first = begin + 3; first < end;) {
      int last = first + 1;
      while (last < end && rows[last] == rows[last - 1] + 1) ++last;
      runs_.push_back({rows[first], last - first});
      first = last;
    }
    run_ends_.push_back(runs_.size());
  }
}

void SymmetricProduct::multiply(const SparseMatrix& matrix, const Points& x, Points& y) const {
  using dense::load_first, dense::multiply_add;
  using Vector = dense::Vector<double>;
  constexpr int kWidth = dense::kWidth<double>;
  y.setZero(3, x.cols());
  std::size_t r = 0;
  for (std::size_t v = 0; v < run_ends_.size(); ++v) {
    const int* begin = matrix.outerIndexPtr() + 3 * v;  // of the vertex' columns
    const double* a0 = matrix.valuePtr() + begin[0];
    const double* a1 = matrix.valuePtr() + begin[1];
    const double* a2 = matrix.valuePtr() + begin[2];
    const double* at = x.data() + 3 * v;
    double* to = y.data() + 3 * v;
    const double own[3] = {a0[0] * at[0] + a0[1] * at[1] + a0[2] * at[2],
                           a0[1] * at[0] + a1[0] * at[1] + a1[1] * at[2],
                           a0[2] * at[0] + a1[1] * at[1] + a2[0] * at[2]};
    a0 += 3;
    a1 += 2;
    a2 += 1;
    // Below the diagonal: the columns times x of the vertex go to the rows' y, their transpose
    // times the rows' x to y of the vertex.
    const Vector x0 = dense::broadcast(at[0]);
    const Vector x1 = dense::broadcast(at[1]);
    const Vector x2 = dense::broadcast(at[2]);
    Vector y0{}, y1{}, y2{};
    for (; r < run_ends_[v]; ++r) {
      const Run& run = runs_[r];
      for (int i = 0; i < run.count; i += kWidth) {
        const int lanes = std::min(run.count - i, kWidth);
        const Vector l0 = load_first(a0 + i, lanes);
        const Vector l1 = load_first(a1 + i, lanes);
        const Vector l2 = load_first(a2 + i, lanes);
        double* rows_y = y.data() + run.row + i;
        const Vector sum = multiply_add(
            l2, x2, multiply_add(l1, x1, multiply_add(l0, x0, load_first(rows_y, lanes))));
        dense::store_first(rows_y, lanes, sum);
        const Vector rows_x = load_first(x.data() + run.row + i, lanes);
        y0 = multiply_add(l0, rows_x, y0);
        y1 = multiply_add(l1, rows_x, y1);
        y2 = multiply_add(l2, rows_x, y2);
      }
      a0 += run.count;
      a1 += run.count;
      a2 += run.count;
    }
    to[0] += own[0] + dense::sum<double>(y0);
    to[1] += own[1] + dense::sum<double>(y1);
    to[2] += own[2] + dense::sum<double>(y2);
  }
}

}  // namespace weft
