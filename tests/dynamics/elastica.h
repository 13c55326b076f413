#pragma once
#include <cmath>

namespace weft::test {

/// Tip deflection over length of a strip clamped horizontally and bent by its own weight: the heavy
/// elastica theta'' = -load (1 - s) cos(theta), theta(0) = 0, theta'(1) = 0, with s in lengths,
/// theta downwards and load = rho g L^3 / B.
///
/// Shooting from the free end: with t = 1 - s and phi = pi / 2 - theta, phi'' = load t sin(phi) and
/// phi'(0) = 0. While phi is below pi, phi(1) rises with phi(0), so that bisection finds the phi(0)
/// for which phi reaches pi / 2 at the clamp. Classical Runge-Kutta.
inline double elastica_tip_deflection(double load) {
  constexpr int kSteps = 2000;
  constexpr double h = 1.0 / kSteps;
  struct Clamp {
    double phi, deflection;
  };
  const auto shoot = [load](double phi) {
    const auto bend = [load](double t, double angle) { return load * t * std::sin(angle); };
    double rate = 0, deflection = 0;
    for (int i = 0; i < kSteps && phi < 2; ++i) {
      const double t = i * h;
      const double p1 = rate, r1 = bend(t, phi);
      const double p2 = rate + h / 2 * r1, r2 = bend(t + h / 2, phi + h / 2 * p1);
      const double p3 = rate + h / 2 * r2, r3 = bend(t + h / 2, phi + h / 2 * p2);
      const double p4 = rate + h * r3, r4 = bend(t + h, phi + h * p3);
      deflection += h / 6 *
                    (std::cos(phi) + 2 * std::cos(phi + h / 2 * p1) +
                     2 * std::cos(phi + h / 2 * p2) + std::cos(phi + h * p3));
      phi += h / 6 * (p1 + 2 * p2 + 2 * p3 + p4);
      rate += h / 6 * (r1 + 2 * r2 + 2 * r3 + r4);
    }
    return Clamp{phi, deflection};
  };
  double low = 0;
  double high = M_PI / 2;
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (low + high);
    (shoot(middle).phi < M_PI / 2 ? low : high) = middle;
  }
  return shoot(low).deflection;
}

}  // namespace weft::test
