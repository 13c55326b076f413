#pragma once
/// The battery of energy_battery.h for a ClothModel.
#include "common/elastic_battery.h"
#include "weft/model/cloth_model.h"

namespace weft::testing {

/// The model's potential with the damping of an integrator's step. Keeps references to the model
/// and to the history of `damping`.
inline Energy potential_of(const ClothModel& model, const DampingRate& damping) {
  const auto hessian = [&model, damping](const VecX& x, HessianKind kind) {
    SparseMatrix h = model.hessian_pattern();
    Points gradient;
    model.potential_hessian(points(x), damping, kind, gradient, h);
    return from_lower(h);
  };
  return {[&model, damping](const VecX& x) { return model.potential(points(x), damping); },
          [&model, damping](const VecX& x) {
            Points gradient;
            model.potential_gradient(points(x), damping, gradient);
            return vector(gradient);
          },
          [hessian](const VecX& x) { return hessian(x, HessianKind::exact); },
          [hessian](const VecX& x) { return hessian(x, HessianKind::positive_semidefinite); }};
}

}  // namespace weft::testing
