#include "weft/estimate/mesh_error.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "weft/base/dense.h"
#include "weft/estimate/estimate_scatter.h"
#include "weft/estimate/uncertainty.h"

namespace weft {
namespace {

/// Of the way to cells of half the width: all of the way, if the error falls as the width.
constexpr double kMeshLimit = 2;

/// - H^-1 gradient over the directions that the data determine: those whose standard deviation
/// alone would not make an interval that says nothing.
VecX newton_step(const MatX& hessian, const VecX& gradient, double noise) {
  const SymmetricEigen eigen = symmetric_eigen(hessian);
  const double least = noise / (widest_half_interval * widest_half_interval);
  VecX along = eigen.vectors.transpose() * gradient;
  for (Eigen::Index i = 0; i < along.size(); ++i)
    along[i] = eigen.values[i] > least ? -along[i] / eigen.values[i] : 0;
  return eigen.vectors * along;
}

/// The same within the ranges: what is at an end towards which the cost falls is held there, what
/// the step would carry beyond one goes to it, and the others make up for that.
VecX gauss_newton_step(const VecX& scaled, const QuadraticModel& model, double noise) {
  VecX step = VecX::Zero(scaled.size());
  std::vector<Eigen::Index> free = inside_bounds(scaled, model.gradient);
  while (!free.empty()) {
    const VecX gradient = model.gradient + model.hessian * step;
    const VecX end = scaled(free) + newton_step(model.hessian(free, free), gradient(free), noise);
    std::vector<Eigen::Index> inside;
    for (std::size_t k = 0; k < free.size(); ++k) {
      const double value = end[static_cast<Eigen::Index>(k)];
      if (value >= 0 && value <= 1)
        inside.push_back(free[k]);
      else
        step[free[k]] = std::clamp(value, 0.0, 1.0) - scaled[free[k]];
    }
    if (inside.size() == free.size()) {
      step(free) = end - scaled(free);
      break;
    }
    free = std::move(inside);
  }
  return step;
}

}  // namespace

VecX mesh_shift(const VecX& scaled, const QuadraticModel& here, const QuadraticModel& finer,
                double noise) {
  return gauss_newton_step(scaled, finer, noise) - gauss_newton_step(scaled, here, noise);
}

double least_cost(const VecX& scaled, const QuadraticModel& model, double noise) {
  const VecX step = gauss_newton_step(scaled, model, noise);
  return model.cost + model.gradient.dot(step) + 0.5 * step.dot(model.hessian * step);
}

VecX mesh_half_widths(const VecX& shift) { return kMeshLimit * shift.cwiseAbs(); }

}  // namespace weft
