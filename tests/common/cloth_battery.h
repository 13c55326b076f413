#pragma once
/// The battery of energy_battery.h for a ClothModel.
#include <string>

#include "common/elastic_battery.h"
#include "weft/model/cloth_model.h"

namespace weft::testing {

/// Stiffness and damping of a size that lets every term show.
inline Fabric test_fabric(const std::string& model = "baraff-witkin") {
  Fabric fabric = Fabric::with_defaults("test", model);
  fabric.set("stretch_stiffness", 40);
  fabric.set("shear_stiffness", 25);
  fabric.set("bend_stiffness", 5e-3);
  fabric.set("stretch_damping", 0.3);
  fabric.set("shear_damping", 0.2);
  fabric.set("bend_damping", 1e-5);
  fabric.set("drag_linear", 0.4);
  fabric.set("drag_quadratic", 0.9);
  fabric.set("drag_degradation", 0.3);
  fabric.include("drag_normal_linear");
  fabric.set("drag_normal_linear", 0.7);
  fabric.include("twist_stiffness");
  fabric.set("twist_stiffness", 8e-3);
  return fabric;
}

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
