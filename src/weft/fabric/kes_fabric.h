#pragma once
#include <filesystem>

#include "weft/fabric/fabric.h"

namespace weft {

/// Conversions of the numbers that the Kawabata evaluation system (KES-F) prints, in gram-force,
/// centimetres and degrees, to SI.
namespace kes {
inline constexpr double kGramForce = 9.80665e-3;  // N
/// Force per width: gf/cm to N/m.
double force_per_width(double gf_per_cm);
/// Shear stiffness G: gf/(cm deg) to N/m (a radian).
double shear_stiffness(double gf_per_cm_deg);
/// Bending rigidity B: gf cm^2/cm to N m.
double bending_rigidity(double gf_cm2_per_cm);
/// Moment per width, as the hysteresis 2HB: gf cm/cm to N.
double moment_per_width(double gf_cm_per_cm);
/// Areal density W: mg/cm^2 to kg/m^2.
double areal_density(double mg_per_cm2);

/// Stiffness k(strain) whose stress k c is `stress` (N/m) at `strain` and whose energy up to there
/// is `linearity` times that of a constant stiffness, stress strain / 2 (KES: LT). The simplest
/// that does it: a straight line k where linearity >= 2/3 (k falls with strain above 1), and below
/// that a curve that is zero up to some strain. Throws Error unless stress and strain are above 0
/// and 0.2 <= linearity <= 1.3.
StiffnessCurve tensile_curve(double stress, double strain, double linearity);
}  // namespace kes

/// Reads a file of KES-F numbers (docs/formats.md, format "weft-kes") as a fabric of model
/// "soft-constraints", whose strains are those of the tests: relative elongation, shear and
/// curvature.
///
/// - weft_stretch, warp_stretch: a curve through the maximum load at the elongation EMT, with the
///   work that LT says; a constant without LT.
/// - shear: the mean of both directions' G. Friction is half of the mean of their 2HG: loading and
///   unloading are twice the friction apart. Over 0.5 / 3 degrees, so that it is there where the
///   slope is taken, from 0.5 degrees on.
/// - weft_bend, warp_bend: B, with friction half of 2HB over 0.5 / 3 per cm for the same reason.
/// - diagonal_bend is not measured; the geometric mean of both, which is 2 D66 = D for an isotropic
///   sheet without Poisson effect.
///
/// The provenance says so. Throws Error, with file and key, for anything else.
Fabric read_kes_fabric(const std::filesystem::path& path);

}  // namespace weft
