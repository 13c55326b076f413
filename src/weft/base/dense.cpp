#include "weft/base/dense.h"

#include <Eigen/Dense>

namespace weft {
namespace {

// Directions whose sum is shorter are opposite: the axis of a turn between them is lost in the
// digits.
constexpr double kOpposite = 1e-8;

}  // namespace

SymmetricEigen symmetric_eigen(const MatX& matrix) {
  const Eigen::SelfAdjointEigenSolver<MatX> solver(matrix);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

SymmetricEigen3 symmetric_eigen_3(const Mat3& matrix) {
  const Eigen::SelfAdjointEigenSolver<Mat3> solver(matrix);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

SingularValues3 singular_values_3(const Mat3& matrix) {
  const Eigen::JacobiSVD<Mat3> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return {svd.matrixU(), svd.singularValues(), svd.matrixV()};
}

Mat3 nearest_rotation(const SingularValues3& of) {
  Mat3 u = of.u;
  if ((u * of.v.transpose()).determinant() < 0) u.col(2) *= -1;
  return u * of.v.transpose();
}

Mat3 turn_between(const Vec3& from, const Vec3& to) {
  const Vec3 a = from.normalized(), b = to.normalized();
  const Vec3 between = a + b;  // twice the cosine of half the turn long
  const double length = between.norm();
  if (length < kOpposite) {
    const Vec3 axis = a.unitOrthogonal();
    return 2 * axis * axis.transpose() - Mat3::Identity();
  }
  const Vec3 half = a.cross(between) / length;
  return Eigen::Quaterniond(0.5 * length, half.x(), half.y(), half.z())
      .normalized()
      .toRotationMatrix();
}

MatX solve_symmetric(const MatX& a, const MatX& b) { return a.ldlt().solve(b); }

std::optional<MatX> solve_positive(const MatX& a, const MatX& b) {
  const Eigen::LLT<MatX> factor(a);
  if (factor.info() != Eigen::Success) return std::nullopt;
  return factor.solve(b);
}

MatX inverse_of_cholesky_factor(const MatX& a) {
  return a.llt().matrixL().solve(MatX::Identity(a.rows(), a.cols()));
}

MatX inverse(const MatX& a) { return a.inverse(); }

MatX congruence(const MatX& a, const MatX& b) { return b.transpose() * a * b; }

MatX least_squares_solution(const MatX& a, const MatX& b) {
  return a.colPivHouseholderQr().solve(b);
}

MatX orthonormal_basis(const MatX& a) { return Eigen::HouseholderQR<MatX>(a).householderQ(); }

}  // namespace weft
