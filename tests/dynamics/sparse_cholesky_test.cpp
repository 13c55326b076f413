#include "weft/dynamics/sparse_cholesky.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <set>

#include "weft/base/random.h"
#include "weft/mesh/triangle_mesh.h"

namespace weft::sparse_cholesky_test {
namespace {

/// A diagonally dominant matrix of random numbers, coupled as hinges couple the vertices.
SparseMatrix random_matrix(const TriangleMesh& mesh, double diagonal) {
  std::set<std::pair<int, int>> blocks;
  auto couple = [&](const auto& vertices) {
    for (const int i : vertices) {
      for (const int j : vertices) {
        if (i >= j) blocks.insert({i, j});
      }
    }
  };
  for (const auto& triangle : mesh.triangles) couple(triangle);
  for (const Hinge& hinge : hinges(mesh)) couple(hinge.vertices);
  Rng rng(7);
  std::vector<Eigen::Triplet<double>> triplets;
  for (const auto& [i, j] : blocks) {
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) {
        const int row = 3 * i + r;
        const int column = 3 * j + c;
        if (row >= column) {
          triplets.emplace_back(row, column, row == column ? diagonal : rng.uniform(-1, 1));
        }
      }
    }
  }
  SparseMatrix matrix(3 * mesh.vertex_count(), 3 * mesh.vertex_count());
  matrix.setFromTriplets(triplets.begin(), triplets.end());
  return matrix;
}

MatX dense_free(const SparseMatrix& matrix, const std::vector<char>& held) {
  MatX dense = MatX(matrix).selfadjointView<Eigen::Lower>();
  for (Eigen::Index i = 0; i < dense.rows(); ++i) {
    if (!held[static_cast<std::size_t>(i / 3)]) continue;
    dense.row(i).setZero();
    dense.col(i).setZero();
    dense(i, i) = 1;
  }
  return dense;
}

void expect_solves(const TriangleMesh& mesh, const std::vector<char>& held) {
  const int n = mesh.vertex_count();
  const SparseMatrix matrix = random_matrix(mesh, 60);
  SparseCholesky<double> cholesky(matrix, held, mesh.material);
  ASSERT_TRUE(cholesky.factorize(matrix));
  const Points b = Points::Random(3, n);
  Points masked = b;
  for (int i = 0; i < n; ++i) {
    if (held[static_cast<std::size_t>(i)]) masked.col(i).setZero();
  }
  const VecX expected = dense_free(matrix, held).ldlt().solve(VecX(flat(masked)));
  for (int repeat = 0; repeat < 2; ++repeat) {  // a factorization leaves nothing behind
    Points x = b;
    cholesky.solve(x);
    EXPECT_LT((flat(x) - expected).cwiseAbs().maxCoeff(), 1e-13) << n << " vertices";
    ASSERT_TRUE(cholesky.factorize(matrix));
  }
}

TEST(SparseCholesky, AgreesWithADenseSolver) {
  for (const GridPattern pattern : {GridPattern::alternating, GridPattern::uniform}) {
    const TriangleMesh mesh = make_swatch(0.5, 0.4, 11, 9, pattern);
    std::vector<char> held(99, 0);
    expect_solves(mesh, held);
    held[0] = held[10] = held[50] = 1;
    expect_solves(mesh, held);
  }
}

TEST(SparseCholesky, HandlesNarrowStripsAndSeparatedPieces) {
  const TriangleMesh strip = make_swatch(0.02, 1.0, 2, 40);
  std::vector<char> held(80, 0);
  expect_solves(strip, held);
  for (int i = 30; i < 40; ++i) held[static_cast<std::size_t>(i)] = 1;  // cuts the strip in two
  expect_solves(strip, held);
  const TriangleMesh small = make_swatch(0.1, 0.1, 2, 2);
  expect_solves(small, {1, 0, 0, 1});
  expect_solves(small, {1, 1, 1, 1});
}

TEST(SparseCholesky, AnotherSolverOfThePatternHasAFactorOfItsOwn) {
  const TriangleMesh mesh = make_swatch(0.3, 0.4, 5, 7);
  const std::vector<char> held(static_cast<std::size_t>(mesh.vertex_count()), 0);
  const SparseMatrix matrix = random_matrix(mesh, 60), other = random_matrix(mesh, 90);
  SparseCholesky<double> first(matrix, held, mesh.material);
  ASSERT_TRUE(first.factorize(matrix));
  SparseCholesky<double> second = first.another();
  ASSERT_TRUE(second.factorize(other));
  const Points b = Points::Random(3, mesh.vertex_count());
  for (const auto& [solver, of] : {std::pair(&first, &matrix), std::pair(&second, &other)}) {
    Points x = b;
    solver->solve(x);
    const VecX expected = dense_free(*of, held).ldlt().solve(VecX(flat(b)));
    EXPECT_LT((flat(x) - expected).cwiseAbs().maxCoeff(), 1e-13);
  }
}

TEST(SparseCholesky, ReportsAMatrixThatIsNotPositiveDefinite) {
  const TriangleMesh mesh = make_swatch(0.5, 0.5, 7, 7);
  const std::vector<char> held(49, 0);
  SparseMatrix matrix = random_matrix(mesh, 60);
  SparseCholesky<double> cholesky(matrix, held, mesh.material);
  matrix.coeffRef(75, 75) = -1;
  EXPECT_FALSE(cholesky.factorize(matrix));
  matrix.coeffRef(75, 75) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(cholesky.factorize(matrix));
  matrix.coeffRef(75, 75) = 60;
  EXPECT_TRUE(cholesky.factorize(matrix));
}

}  // namespace
}  // namespace weft::sparse_cholesky_test
