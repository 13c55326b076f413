#pragma once
/// What a fabric answers to a homogeneous strain: the curves that a textile laboratory draws.
#include <array>
#include <span>
#include <string_view>

#include "weft/fabric/fabric.h"

namespace weft {

enum class MaterialTest {
  weft_stretch,  ///< u stretched by 1 + strain, v held: no lateral contraction
  warp_stretch,  ///< v stretched, u held
  shear,         ///< simple shear along u: the strain is the tangent of the angle
  weft_bend,     ///< rolled about v; the strain is the curvature, 1/m
  warp_bend,     ///< rolled about u
  /// Rolled about the diagonal u = - v, as a strip that is cut on the bias: K_uu = K_vv = K_uv =
  /// half the curvature.
  diagonal_bend
};
inline constexpr std::array<MaterialTest, 6> kMaterialTests{
    MaterialTest::weft_stretch, MaterialTest::warp_stretch, MaterialTest::shear,
    MaterialTest::weft_bend,    MaterialTest::warp_bend,    MaterialTest::diagonal_bend};
/// "weft stretch", ...
std::string_view material_test_name(MaterialTest test);
/// Bend: strain in 1/m, stress in N. Otherwise "" and N/m.
bool is_bend(MaterialTest test);

/// What internal friction remembers of the strains before.
enum class StrainPath {
  separate,  ///< nothing: each strain is the first after rest
  continued  ///< they follow each other, the first after rest: a cycle shows its loop
};

struct MaterialResponseOptions {
  StrainPath path = StrainPath::separate;
  /// Side of the square cells that the sheet is made of and that bend leaves as long as they are,
  /// m, > 0; 0: small enough for it not to matter. The bend of the model "springs" depends on it,
  /// its stretch and shear do not.
  double cell = 0;
};

/// One number a strain.
struct MaterialResponse {
  /// Derivative of the energy per undeformed area by the strain, with internal friction that of the
  /// way to it: force per undeformed width, N/m, or moment per width, N.
  VecX stress;
  MatX derivative;  ///< of the stress by the fabric's parameters: strains x parameters
};

/// Of the continuous sheet that the fabric's model stands for, from the energies of small patches
/// without what their rims lack (a free edge carries no moment): exact for stretch and shear, for
/// bend but for the chords of a cylinder, 0.02 % (diagonal 0.05 %). Throws Error for the bend of
/// "springs" without `cell`, and for a strain that is not finite or, in stretch, not above -1.
MaterialResponse material_response(const Fabric& fabric, MaterialTest test,
                                   std::span<const double> strains,
                                   const MaterialResponseOptions& options = {});

}  // namespace weft
