#include "weft/dynamics/symmetric_product.h"

#include <gtest/gtest.h>

#include "weft/base/random.h"
#include "weft/model/block_pattern.h"

namespace weft::symmetric_product_test {
namespace {

SparseMatrix random_matrix(const detail::BlockPattern& pattern, Rng& rng) {
  SparseMatrix matrix = pattern.matrix();
  for (double& value : matrix.coeffs()) value = rng.uniform(-1, 1);
  return matrix;
}

void expect_product_as_eigens(const detail::BlockPattern& pattern, int vertices) {
  Rng rng(7);
  const SymmetricProduct product(pattern.matrix());
  for (int repeat = 0; repeat < 2; ++repeat) {
    const SparseMatrix matrix = random_matrix(pattern, rng);
    Points x(3, vertices);
    for (double& value : x.reshaped()) value = rng.uniform(-1, 1);
    Points y = Points::Constant(3, vertices, 100);  // what is there does not count
    product.multiply(matrix, x, y);
    const VecX expected = matrix.selfadjointView<Eigen::Lower>() * VecX(x.reshaped());
    // Sums of at most some 100 numbers below 1, in another order.
    EXPECT_LT((y.reshaped() - expected).cwiseAbs().maxCoeff(), 1e-13);
  }
}

TEST(SymmetricProduct, RunsOfAllLengths) {
  // Each vertex is coupled to the next `reach`, so that its rows are one run, of up to 3 reach + 2.
  for (int reach = 0; reach < 8; ++reach) {
    const int vertices = 20;
    detail::BlockPattern pattern(vertices);
    for (int v = 0; v < vertices; ++v)
      for (int w = v + 1; w < std::min(vertices, v + reach + 1); ++w)
        pattern.add_element(std::array{v, w});
    pattern.finish();
    expect_product_as_eigens(pattern, vertices);
  }
}

TEST(SymmetricProduct, ScatteredNeighboursAndVerticesAlone) {
  const int vertices = 60;
  detail::BlockPattern pattern(vertices);
  Rng rng(3);
  for (int element = 0; element < 70; ++element) {
    std::array<int, 4> corners;
    for (int& v : corners) v = static_cast<int>(rng.uniform(0, 50));  // the last ten are alone
    pattern.add_element(corners);
  }
  pattern.finish();
  expect_product_as_eigens(pattern, vertices);
}

}  // namespace
}  // namespace weft::symmetric_product_test
