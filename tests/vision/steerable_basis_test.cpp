#include "weft/vision/steerable_basis.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace weft::detail::steerable_basis_test {
namespace {

/// A whole row of taps, n = -radius .. radius.
double tap(const Taps& taps, int n, int parity) {
  return double(taps[std::size_t(std::abs(n))]) * (n < 0 ? parity : 1);
}

TEST(SteerableBasis, FactorsAddUpToTheTurnedFilters) {
  // Against the definition in the turned coordinate u', at every tap. c is taken from the basis.
  const SteerableBasis basis = make_steerable_basis(6, 2.4, 17);
  const double k = 2.254, c = -double(basis.g2[0]);
  for (const double theta : {0.0, 0.4, 1.1, 2.0, -0.7}) {
    const double cosine = std::cos(theta), sine = std::sin(theta);
    for (int y = -6; y <= 6; ++y)
      for (int x = -6; x <= 6; ++x) {
        const double u = x * basis.spacing, v = y * basis.spacing;
        const double turned = u * cosine + v * sine, gauss = std::exp(-u * u - v * v);
        const auto even = [&](const Taps& t, int n) { return tap(t, n, 1); };
        const auto odd = [&](const Taps& t, int n) { return tap(t, n, -1); };
        const double g2 = cosine * cosine * even(basis.g2, x) * even(basis.e, y) +
                          4 * cosine * sine * odd(basis.u1, x) * odd(basis.u1, y) +
                          sine * sine * even(basis.e, x) * even(basis.g2, y);
        const double h2 = std::pow(cosine, 3) * odd(basis.h3, x) * even(basis.e, y) +
                          3 * cosine * cosine * sine * even(basis.h2, x) * odd(basis.u1, y) +
                          3 * cosine * sine * sine * odd(basis.u1, x) * even(basis.h2, y) +
                          std::pow(sine, 3) * even(basis.e, x) * odd(basis.h3, y);
        EXPECT_NEAR(g2, (2 * turned * turned - c) * gauss, 1e-6);
        EXPECT_NEAR(h2, (std::pow(turned, 3) - k * turned) * gauss, 1e-6);
      }
  }
}

TEST(SteerableBasis, IsBlindToConstantLightAndAQuadraturePair) {
  for (const int radius : {4, 6, 10}) {
    const double period = 17.0 / 6 * radius;
    const SteerableBasis basis = make_steerable_basis(radius, 2.4, period);
    const double omega = 2 * std::numbers::pi / period;
    double constant = 0, across = 0, even = 0, odd = 0;
    for (int n = -radius; n <= radius; ++n) {
      constant += tap(basis.g2, n, 1);
      across += tap(basis.e, n, 1);
      even += tap(basis.g2, n, 1) * std::cos(omega * n);
      odd += tap(basis.h3, n, -1) * std::sin(omega * n);
    }
    EXPECT_NEAR(constant, 0, 1e-6);
    EXPECT_NEAR(std::abs(even) * across * double(basis.gain_g), 1, 1e-5);
    EXPECT_NEAR(std::abs(odd) * across * double(basis.gain_h), 1, 1e-5);
  }
}

TEST(GaussianTaps, HaveUnitSumAndTheVariance) {
  for (const double sigma : {1.0, 3.0, 4.5}) {
    const Taps taps = gaussian_taps(sigma);
    double sum = double(taps[0]), variance = 0;
    for (std::size_t n = 1; n < taps.size(); ++n) {
      sum += 2 * double(taps[n]);
      variance += 2 * double(n * n) * double(taps[n]);
    }
    EXPECT_NEAR(sum, 1, 1e-5);
    // Cut at 3 sigma: 2.7 % of the variance is lost at most.
    EXPECT_NEAR(variance / (sigma * sigma), 1, 0.03);
  }
}

}  // namespace
}  // namespace weft::detail::steerable_basis_test
