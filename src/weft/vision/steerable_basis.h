#pragma once
#include <vector>

namespace weft::detail {

/// Half of a symmetric or antisymmetric row of taps: n = 0 .. radius.
using Taps = std::vector<float>;

/// One-dimensional factors of the steerable pair of Freeman and Adelson 1991 (tables III and V),
/// sampled at n = -radius .. radius. With s = `spacing`, u = s n, e(u) = exp(-u^2), and u' the
/// coordinate along direction theta (x axis towards y, y down),
///   G2 = (2 u'^2 - c) e(u) e(v),   H2 = (u'^3 - k u') e(u) e(v),   k = 2.254,
/// which expand into products of these factors:
///   G2 = cos^2 g2(x) e(y) + 4 cos sin u1(x) u1(y) + sin^2 e(x) g2(y)
///   H2 = cos^3 h3(x) e(y) + 3 cos^2 sin h2(x) u1(y) + 3 cos sin^2 u1(x) h2(y) + sin^3 e(x) h3(y).
/// c is 1 in the continuum; here it is the value that makes the sampled G2 sum to zero.
struct SteerableBasis {
  int radius = 0;
  double spacing = 0;  ///< 1/px
  Taps e;              ///< even
  Taps u1;             ///< odd: u e
  Taps g2;             ///< even: (2 u^2 - c) e
  Taps h2;             ///< even: (u^2 - k / 3) e
  Taps h3;             ///< odd: (u^3 - k u) e
  float gain_g = 1;    ///< for unit response to a grating of unit amplitude at the design period
  float gain_h = 1;
};

/// `reach` = spacing * radius: the last tap stands where the Gaussian is exp(-reach^2). The gains
/// make G2 and H2 a quadrature pair at `period` px.
SteerableBasis make_steerable_basis(int radius, double reach, double period);

/// Normalized Gaussian out to 3 sigma.
Taps gaussian_taps(double sigma);

}  // namespace weft::detail
