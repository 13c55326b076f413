#pragma once
/// Internal friction of a strain component: an element after Dahl (1968) beside the elastic one.
///
/// Its stress s follows the strain e by ds/de = (f - s sign(de)) / c: with the amplitude f and the
/// scale c the stress comes within 5 % of +- f after a strain of 3 c in one direction (6 c from -+
/// f). From frame to frame, strain and stress (e_0, s_0) to strain e, along a straight way:
///
///     s = g f + (s_0 - g f) exp(-|e - e_0| / c),   g = sign(e - e_0),
///
/// which has the potential
///
///     phi = f |e - e_0| + (s_0 g - f) c (1 - exp(-|e - e_0| / c)),
///
/// convex as long as |s_0| <= f. Loading and unloading curves are 2 f apart; a loop takes up to 2 f
/// times its strain twice over. f = 0 is none. The second derivative of phi jumps at e = e_0.
#include <cmath>
#include <vector>

#include "weft/fabric/fabric.h"

namespace weft::detail {

struct Friction {
  double amplitude = 0;  ///< f, stress
  double scale = 1;      ///< c, strain, > 0
};

/// The components in which the fabric has friction, ascending: 0 to 5 for weft_stretch,
/// warp_stretch, shear, weft_bend, warp_bend, diagonal_bend.
std::vector<int> friction_components(const Fabric& fabric);

struct FrictionResponse {
  double energy, stress, tangent;
  /// Derivatives of the stress; that by the former strain is - tangent.
  double by_amplitude, by_scale, by_former_stress;
};

inline FrictionResponse respond(const Friction& friction, double strain, double former_strain,
                                double former_stress) {
  const double f = friction.amplitude, c = friction.scale;
  const double sign = strain < former_strain ? -1 : 1, way = std::abs(strain - former_strain);
  const double rest = std::exp(-way / c), gone = -std::expm1(-way / c);
  const double lag = former_stress - sign * f;
  return {f * way + sign * lag * c * gone, sign * f + lag * rest,
          -sign * lag * rest / c,          sign * gone,
          lag * rest * way / (c * c),      rest};
}

}  // namespace weft::detail
