#include "weft/estimate/shared_errors.h"

#include <gtest/gtest.h>

#include <cmath>

#include "weft/base/random.h"

namespace weft::shared_errors_test {
namespace {

MatX random_matrix(Eigen::Index rows, Eigen::Index columns, double size, Rng& rng) {
  MatX m(rows, columns);
  for (double& entry : m.reshaped()) entry = size * rng.normal();
  return m;
}

// Products of weighed columns are those by the inverse of the covariance, by Cholesky: of errors
// that matter much, little and not at all, of two that are the same, and of another scale.
TEST(SharedErrors, WeighByTheInverseOfTheCovariance) {
  Rng rng(5);
  for (const double size : {1e-6, 1.0, 1e3})
    for (const double scale : {1.0, 3.0}) {
      MatX by_errors = random_matrix(12, 4, size, rng);
      by_errors.col(2) = by_errors.col(1);
      by_errors.col(3).setZero();
      const MatX columns = random_matrix(12, 3, 1, rng);
      const MatX covariance =
          MatX::Identity(12, 12) + by_errors * by_errors.transpose() / (scale * scale);
      const MatX expected = columns.transpose() * covariance.llt().solve(columns);
      const MatX weighed = SharedErrors(by_errors).weighed(columns, scale);
      // The condition of the covariance, up to 1e7, times rounding.
      EXPECT_LT((weighed.transpose() * weighed - expected).cwiseAbs().maxCoeff(), 1e-8)
          << size << " " << scale;
    }
}

// Residuals that hold nothing but what an error does are as large as the error.
TEST(SharedErrors, AnErrorCountsAsItself) {
  Rng rng(6);
  const MatX by_errors = random_matrix(30, 1, 1e4, rng);
  const VecX residuals = 0.7 * by_errors.col(0);
  EXPECT_NEAR(SharedErrors(by_errors).weighed(residuals, 1).norm(), 0.7, 1e-6);
}

// Least squares of the residuals and the errors together, of which two are the same.
TEST(SharedErrors, EstimateIsTheLeastOfResidualsAndErrors) {
  Rng rng(8);
  for (const double size : {1e-3, 1.0, 1e3}) {
    MatX by_errors = random_matrix(12, 4, size, rng);
    by_errors.col(2) = by_errors.col(1);
    const VecX residuals = random_matrix(12, 1, 1 + size, rng);
    const SharedErrors errors(by_errors);
    const VecX found = errors.estimate(residuals);
    const VecX slope = by_errors.transpose() * (by_errors * found - residuals) + found;
    // Rounding, of sums that are as large.
    EXPECT_LT(slope.norm(), 1e-10 * (by_errors.transpose() * residuals).norm()) << size;
    const double least = (residuals - by_errors * found).squaredNorm() + found.squaredNorm();
    EXPECT_NEAR(errors.weighed(residuals).squaredNorm(), least, 1e-8 * residuals.squaredNorm());
  }
  EXPECT_EQ(SharedErrors().estimate(VecX::Ones(3)).size(), 0);
}

TEST(SharedErrors, NoneLeaveResidualsAsTheyAre) {
  Rng rng(7);
  const MatX columns = random_matrix(5, 2, 1, rng);
  EXPECT_EQ(SharedErrors().weighed(columns, 2), columns);
  EXPECT_EQ(SharedErrors(MatX(5, 0)).weighed(columns, 2), columns);
}

}  // namespace
}  // namespace weft::shared_errors_test
