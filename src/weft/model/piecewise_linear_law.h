#pragma once
/// The model of Wang, O'Brien and Ramamoorthi 2011 ("Data-driven elastic models for cloth"): stress
/// is a stiffness matrix times strain, and the matrix is interpolated in a table by how far, and in
/// which direction, the cloth is stretched: 24 numbers; bending stiffness in a table by curvature
/// and direction: 15 numbers.
///
/// Membrane. Green strain E with principal strains E_1 >= E_2, the larger one at the angle phi to
/// the weft. The matrix (k_uu, k_uv, k_vv, k_shear), N_uu = k_uu E_uu + k_uv E_vv, N_vv = k_uv E_uu
/// + k_vv E_vv, N_uv = k_shear E_uv (A66 = k_shear / 2), is C(E) = C_0 + s (C_1(phi) - C_0) with s
/// = 6 (sqrt(1 + 2 E_1) - 1) cut to [0, 1]: `rest` in the table at no stretch, and five angles at a
/// principal stretch of 1 + 1/6.
///
/// A law C(E) E has no energy. Here the energy is the work along the ray from rest to E,
///
///     psi(E) = integral from 0 to 1 of t E . C(t E) E dt,
///
/// so that the work of every proportional deformation, and the stress along it, E . dpsi/dE = E .
/// C(E) E, are those of the table. For a continuous stress
/// - between the five angles the interpolation is trigonometric, sum over m of a_m cos(2 m phi),
/// not
///   linear;
/// - where no direction is the larger one the angle means nothing, and E_1 has no derivative: for 0
/// <
///   E_2 < E_1, with q the smooth step 3 t^2 - 2 t^3 of t = (E_1 - E_2) / E_1, C_1(phi) counts by q
///   and its mean over the angles by 1 - q, and s is that of (E_1 + E_2 + q (E_1 - E_2)) / 2;
/// - where E_1 < - E_2 the stretch counts by the smooth step of - E_1 / E_2: none under
/// compression.
///
/// Measured tables have entries below zero; as in the programs that use them these count as zero.
///
/// Bend. With curvature components K_uu, K_vv, K_uv (bending.h) and r = sqrt(K_uu^2 + K_vv^2 + 2
/// K_uv^2), again the work along the ray of M = (D_u(r) K_uu, D_v(r) K_vv, 2 D_t(r) K_uv), with D_u
/// and D_v the table at 0 and 90 degrees and 2 D_t such that a cylinder at 45 degrees has the
/// table's 45 degree stiffness: 4 D_45 = D_u + D_v + 4 D_t (where the table makes that negative,
/// zero). Rows of the table are linear between the curvatures 0, 10, 20, 30 and 40 1/m, constant
/// beyond.
#include <memory>

#include "weft/model/sheet_law.h"

namespace weft::detail {

/// Parameters: six rows of (uu, uv, vv, shear), N/m: at rest, then at 0, 22.5, 45, 67.5 and 90
/// degrees.
std::unique_ptr<SheetLaw> make_piecewise_linear_membrane();
/// Parameters: three rows (0, 45, 90 degrees) of five values, N m.
std::unique_ptr<SheetLaw> make_piecewise_linear_bending();

}  // namespace weft::detail
