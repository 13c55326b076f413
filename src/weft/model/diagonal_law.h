#pragma once
/// Laws whose stress components depend on their own strain each, by a stiffness curve: the models
/// of Miguel 2012, section 4.1, with what section 6 finds them to lack as optional terms.
///
/// Membrane. Strains c_u, c_v and c_s = w_u . w_v; c_u = (|w_u|^2 - 1) / 2 (equation 3, diagonal
/// St. Venant-Kirchhoff) or |w_u| - 1 (equation 4, soft constraints), c_v alike. Energy density
///
///     psi = psi_u(c_u) + psi_v(c_v) + F psi_s(|c_s|) + k_c c_u c_v,
///     F = 1 + a (<c_u>^2 + <c_v>^2),   <c> = max(c, 0),
///
/// with psi_i the integral of k_i(c) c, k_c the coupling of weft and warp (Poisson effect, N/m) and
/// a the stiffening of shear under tension (dimensionless); both are left out unless the fabric has
/// them. F has continuous first derivatives, so that stresses are continuous.
///
/// Bend. Components K_uu, K_vv and sqrt(2) K_uv of the curvature of a triangle (bending.h), each
/// with a curve over its magnitude, N m. The paper measures angles at the edges of a regular mesh
/// instead, (theta - theta_0) / h_0 (equation 5), and takes the direction of the edge for the
/// direction of the bend. A sum over edges is no plate: its stiffness depends on the mesh
/// (bending.h gives figures), and a fit on one mesh does not hold on another. With the tensor it
/// does, and the three stiffnesses mean what they say: moments per width by curvature along weft
/// and warp, and twist; diagonal_bend = 2 D66, so that three equal values are an isotropic plate
/// with Poisson's ratio 0.
#include "weft/fabric/fabric.h"
#include "weft/model/sheet_law.h"

namespace weft::detail {

enum class StretchStrain {
  green,                ///< (|w|^2 - 1) / 2
  relative_elongation,  ///< |w| - 1
};

/// The membrane of a "soft-constraints" or "stvk-diagonal" fabric. Parameters: the values of
/// weft_stretch, warp_stretch, shear, and of stretch_coupling and shear_stiffening where present.
std::unique_ptr<SheetLaw> make_diagonal_membrane(const Fabric& fabric, StretchStrain strain);

/// Its bend: the values of weft_bend, warp_bend, diagonal_bend.
std::unique_ptr<SheetLaw> make_diagonal_bending(const Fabric& fabric);

}  // namespace weft::detail
