#pragma once
/// How a sheet answers to the strain of a triangle.
///
/// Membrane: the strain is that of Green, (E_uu, E_vv, gamma) with E_uu = (|w_u|^2 - 1) / 2, E_vv
/// alike and gamma = 2 E_uv = w_u . w_v; the stress, second Piola-Kirchhoff times the thickness
/// (N/m), is the derivative of the energy density (J/m^2). Every membrane that depends on |w_u|,
/// |w_v| and their scalar product is such a law, whatever strain it is written in: a function of
/// |w_u| - 1 is one of E_uu.
///
/// Bend: the strain is the curvature (K_uu, K_vv, sqrt(2) K_uv), 1/m; the stress is the moment per
/// width, N, by the same rule: (M_uu, M_vv, sqrt(2) M_uv).
#include <memory>

#include "weft/base/types.h"

namespace weft::detail {

struct SheetResponse {
  double energy;   ///< density, J/m^2
  Vec3 stress;     ///< d energy / d strain
  Mat3 stiffness;  ///< d stress / d strain, symmetric
};

class SheetLaw {
 public:
  virtual ~SheetLaw() = default;

  virtual int parameter_count() const = 0;
  /// Values that have been checked.
  virtual void set_parameters(const Eigen::Ref<const VecX>& values) = 0;
  virtual SheetResponse respond(const Vec3& strain) const = 0;
  /// d stress / d parameters at a fixed strain: a column a parameter. Overwrites.
  virtual void stress_derivative(const Vec3& strain,
                                 Eigen::Ref<Eigen::Matrix3Xd> derivative) const = 0;
};

/// A linear orthotropic law: stress = (k0 c0 + k1 c1, k1 c0 + k2 c1, f k3 c2) with four parameters
/// (k0, k1, k2, k3) and a fixed f: 1 for the membrane, where c2 is the engineering shear and k3 =
/// A66; 2 for the plate, where c2 = sqrt(2) K_uv and k3 = D66, M_uv = 2 D66 K_uv.
std::unique_ptr<SheetLaw> make_orthotropic_law(double shear_factor);

}  // namespace weft::detail
