#pragma once
/// The cantilever test: a strip that overhangs an edge and bends under its own weight (ASTM D1388
/// option A; Peirce 1930). Lengths m, weights N/m^2 (areal density times g), rigidities N m.
#include <numbers>

#include "weft/base/types.h"
#include "weft/fabric/stiffness_curve.h"

namespace weft {

inline constexpr double kStandardGravity = 9.80665;  // m/s^2
/// Below the horizontal, of the line from the edge to the tip, at which the overhang is read.
inline constexpr double kCantileverAngle = 41.5 * std::numbers::pi / 180;

/// Bending length of the standard: half of the overhang at 41.5 degrees.
double standard_bending_length(double overhang);
/// Peirce's: c = l (cos(angle / 2) / (8 tan(angle)))^(1/3). At 41.5 degrees it is 1.9 % above the
/// elastica's (rigidity_of_overhang), the half 0.03 %.
double peirce_bending_length(double overhang, double angle = kCantileverAngle);
/// G = w c^3, and back. c is the length that gives the strip's own weight w c the rigidity's
/// measure.
double flexural_rigidity(double weight, double bending_length);
double bending_length(double weight, double rigidity);

/// The moment per width of a strip that has been bent from flat to the curvature kappa without
/// turning back: M = k(kappa) kappa + f (1 - exp(- kappa / c)), with f and c of the component's
/// internal friction (model/friction.h).
struct BendLaw {
  StiffnessCurve bend{1.0};
  double friction = 0;        ///< f, N
  double friction_scale = 1;  ///< c, 1/m, > 0

  struct Response {
    double moment, tangent;
  };
  Response respond(double curvature) const;
};

/// The heavy elastica: an inextensible strip clamped at `root_angle` below the horizontal.
struct ElasticaProfile {
  VecX arc;           ///< m from the clamp, increasing
  MaterialPoints at;  ///< x horizontal from the clamp, y up; 2 x points, m
  VecX angle;         ///< below the horizontal, rad
  VecX curvature;     ///< 1/m
  VecX moment;        ///< per width, N
};
/// theta' = kappa, M' = - w (L - s) cos(theta), M(L) = 0, theta(0) = root_angle; from the free end
/// by Runge-Kutta, bisection for the angle there. Throws Error for length, weight or stiffness not
/// above 0, `root_angle` outside +- 80 degrees, and a moment that does not rise with curvature up
/// to the last knot.
ElasticaProfile heavy_elastica(const BendLaw& law, double weight, double length,
                               double root_angle = 0, int steps = 400);
inline ElasticaProfile heavy_elastica(double rigidity, double weight, double length,
                                      double root_angle = 0, int steps = 400) {
  return heavy_elastica(BendLaw{StiffnessCurve(rigidity)}, weight, length, root_angle, steps);
}

/// The load w L^3 / B at which the line from clamp to tip is `angle` below the horizontal (0.01 to
/// 1.3 rad), by the elastica with a constant B.
double load_of_chord_angle(double angle);
/// B of a strip whose overhang reaches `angle`, and the overhang of a B.
double rigidity_of_overhang(double weight, double overhang, double angle = kCantileverAngle);
double overhang_of_rigidity(double weight, double rigidity, double angle = kCantileverAngle);

/// Along the points of a profile (2 x points, m) from the first, m. Throws Error where two points
/// coincide.
VecX profile_arc(const MaterialPoints& profile);
/// Per width, N, at each point of a profile from clamp to tip: M(s) = weight times the integral
/// from s to L of (x(t) - x(s)) dt, exact for the polygon.
VecX profile_moment(const MaterialPoints& profile, double weight);

/// What a profile says of itself, from clamp to tip.
struct MomentCurvature {
  VecX arc;        ///< m from the clamp, along the points
  VecX moment;     ///< profile_moment()
  VecX curvature;  ///< 1/m, positive downwards
};
/// Of points on the strip's line from clamp to tip (2 x points, x horizontal away from the clamp, y
/// up, m). The curvature is that of a cubic in s fitted to x and y within `window` (m; 0: a third
/// of the length, or more where that would hold fewer than 8 points) to both sides, with weights
/// that fall to zero there. Throws Error for fewer than 8 points, points that coincide, weight not
/// above 0, a window with fewer than 8 points, a length above 10 m, and a tip that is not beyond
/// the first point, or above the line along which the strip leaves it by more than 1 % of the
/// length.
MomentCurvature moment_curvature(const MaterialPoints& profile, double weight, double window = 0);

/// What a strip's law is made of in a fit.
enum class BendTerms {
  constant,  ///< one rigidity
  friction,  ///< a rigidity, and internal friction with its scale
};
/// The bending law that explains a profile.
struct CantileverFit {
  BendLaw law;
  double root_angle = 0;    ///< rad below the horizontal
  double distance_rms = 0;  ///< m, between points of the same arc length
  double distance_max = 0;  ///< m
};
/// Least squares over the terms and the angle at the clamp, between points of equal arc length.
/// Throws Error as moment_curvature, but for the window, and where no strip under gravity bends
/// like the profile: an rms above 10 % of the length, a clamp at 1 rad, the end of its range.
CantileverFit fit_cantilever(const MaterialPoints& profile, double weight,
                             BendTerms terms = BendTerms::constant);

}  // namespace weft
