#pragma once
#include <cmath>

namespace weft::test {

/// Tip deflection over length of a strip clamped horizontally and bent by its own weight: the heavy
/// elastica theta'' = -load (1 - s) cos(theta), theta(0) = 0, theta'(1) = 0, with s in lengths,
/// theta downwards and load = rho g L^3 / B. Classical Runge-Kutta and shooting for theta'(0).
inline double elastica_tip_deflection(double load) {
  constexpr int kSteps = 2000;
  struct End {
    double curvature, deflection;
  };
  auto shoot = [load](double curvature) {
    double theta = 0, deflection = 0;
    const double h = 1.0 / kSteps;
    auto bend = [load](double s, double angle) { return -load * (1 - s) * std::cos(angle); };
    for (int i = 0; i < kSteps; ++i) {
      const double s = i * h;
      const double t1 = curvature, c1 = bend(s, theta), d1 = std::sin(theta);
      const double t2 = curvature + h / 2 * c1, c2 = bend(s + h / 2, theta + h / 2 * t1),
                   d2 = std::sin(theta + h / 2 * t1);
      const double t3 = curvature + h / 2 * c2, c3 = bend(s + h / 2, theta + h / 2 * t2),
                   d3 = std::sin(theta + h / 2 * t2);
      const double t4 = curvature + h * c3, c4 = bend(s + h, theta + h * t3),
                   d4 = std::sin(theta + h * t3);
      theta += h / 6 * (t1 + 2 * t2 + 2 * t3 + t4);
      curvature += h / 6 * (c1 + 2 * c2 + 2 * c3 + c4);
      deflection += h / 6 * (d1 + 2 * d2 + 2 * d3 + d4);
    }
    return End{curvature, deflection};
  };
  // The end's curvature rises with the clamp's; the first root from below is the hanging shape.
  double low = 0;
  double high = 0.1;
  while (shoot(high).curvature < 0) {
    low = high;
    high *= 1.1;
  }
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (low + high);
    (shoot(middle).curvature < 0 ? low : high) = middle;
  }
  return shoot(0.5 * (low + high)).deflection;
}

}  // namespace weft::test
