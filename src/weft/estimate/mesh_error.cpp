#include "weft/estimate/mesh_error.h"

#include <Eigen/Eigenvalues>

#include "weft/estimate/estimate_scatter.h"

namespace weft {
namespace {

/// Of the way to cells of half the width: all of the way, if the error falls as the width.
constexpr double kMeshLimit = 2;
/// A direction whose standard deviation is more of the range is not determined (as in
/// uncertainty.cpp).
constexpr double kWidestDeviation = 0.5;

/// - H^-1 gradient over the directions that the data determine, of the parameters that no bound
/// holds.
VecX gauss_newton_step(const VecX& scaled, const QuadraticModel& model,
                       std::size_t residual_count) {
  VecX step = VecX::Zero(scaled.size());
  const std::vector<Eigen::Index> free = inside_bounds(scaled, model.gradient);
  if (free.empty()) return step;
  const Eigen::SelfAdjointEigenSolver<MatX> eigen(MatX(model.hessian(free, free)));
  const double least =
      2 / (static_cast<double>(residual_count) * kWidestDeviation * kWidestDeviation);
  VecX along = eigen.eigenvectors().transpose() * model.gradient(free);
  for (Eigen::Index i = 0; i < along.size(); ++i)
    along[i] = eigen.eigenvalues()[i] > least ? -along[i] / eigen.eigenvalues()[i] : 0;
  step(free) = eigen.eigenvectors() * along;
  return step;
}

}  // namespace

VecX mesh_shift(const VecX& scaled, const QuadraticModel& here, const QuadraticModel& finer,
                std::size_t residual_count) {
  return gauss_newton_step(scaled, finer, residual_count) -
         gauss_newton_step(scaled, here, residual_count);
}

VecX mesh_half_widths(const VecX& shift) { return kMeshLimit * shift.cwiseAbs(); }

}  // namespace weft
