#pragma once
/// The orthotropic sheet of Larionov et al. 2022 in its two sets of numbers (section 3.3.1,
/// equation 6), as a fabric of model "stvk", and the paper's CGS units.
#include <vector>

#include "weft/fabric/fabric.h"

namespace weft {

/// What the paper optimizes over (equation 7): N_uu = c00 E_uu + c01 E_vv, N_vv = c01 E_uu + c11
/// E_vv, N_uv = c22 2 E_uv, N/m, and one flexural rigidity b, N m, for all directions.
struct OrthotropicStiffness {
  double c00 = 0, c11 = 0, c01 = 0, c22 = 0, b = 0;
};

/// What it reports: Young's moduli times thickness, N/m, the shear modulus times thickness, N/m,
/// and Poisson's ratio nu = nu_uv = - E_vv / E_uu under tension along u. nu_vu = nu E_v / E_u: then
/// the matrix of equation 6 is symmetric.
struct OrthotropicModuli {
  double e_u = 0, e_v = 0, shear = 0, poisson = 0, b = 0;
};

/// c00 = e_u / d, c11 = e_v / d, c01 = nu_vu e_u / d = nu e_v / d with d = 1 - nu nu_vu, c22 =
/// shear. Equation 6 as printed has nu_vu e_u = nu_uv e_v, which makes nu_vu = nu_uv e_v / e_u.
/// Throws Error unless moduli are above 0, nu is at least 0 and d above 0.
OrthotropicStiffness stiffness_of(const OrthotropicModuli& moduli);
/// The inverse. Throws Error unless c00, c11, c22, b > 0, c01 >= 0 and c01^2 < c00 c11.
OrthotropicModuli moduli_of(const OrthotropicStiffness& stiffness);

/// What stands for zero as bend_uv, which the model "stvk" searches in its logarithm.
inline constexpr double kNoBendCoupling = 1e-12;  // N m

/// Fabric of model "stvk". A plate of rigidity b without Poisson effect: bend_uu = bend_vv = b,
/// bend_twist = b / 2, bend_uv = kNoBendCoupling.
Fabric orthotropic_fabric(std::string name, const OrthotropicStiffness& stiffness);
/// Whether a fabric is such a sheet: of model "stvk".
bool is_orthotropic_sheet(const Fabric& fabric);
/// Of a fabric of model "stvk"; b is the mean of bend_uu and bend_vv. Throws Error for another
/// model.
OrthotropicStiffness stiffness_of(const Fabric& fabric);

/// From dyn/cm (g/s^2) and dyn cm to SI: 1 dyn/cm = 1e-3 N/m, 1 dyn cm = 1e-7 N m.
OrthotropicModuli moduli_from_cgs(const OrthotropicModuli& cgs);
/// From g/cm^2 to kg/m^2.
double areal_density_from_cgs(double cgs);

/// The paper's materials, "larionov-cotton" and so on, each with its table as provenance: cotton,
/// denim, silk and the start "larionov-initial" of Table 1; "larionov-houdini-" denim, cotton, silk
/// of Table 2; "larionov-real-" denim, cotton, polyester of Table 3.
const std::vector<Fabric>& orthotropic_presets();

}  // namespace weft
