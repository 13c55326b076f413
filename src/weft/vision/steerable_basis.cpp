#include "weft/vision/steerable_basis.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace weft::detail {
namespace {

constexpr double kHilbert = 2.254;

double even_response(const Taps& taps, double omega) {
  double sum = double(taps[0]);
  for (std::size_t n = 1; n < taps.size(); ++n)
    sum += 2 * double(taps[n]) * std::cos(omega * double(n));
  return sum;
}

double odd_response(const Taps& taps, double omega) {
  double sum = 0;
  for (std::size_t n = 1; n < taps.size(); ++n)
    sum += 2 * double(taps[n]) * std::sin(omega * double(n));
  return sum;
}

}  // namespace

SteerableBasis make_steerable_basis(int radius, double reach, double period) {
  SteerableBasis basis;
  basis.radius = radius;
  basis.spacing = reach / radius;
  double sum_e = 0, sum_u2 = 0;
  for (int n = -radius; n <= radius; ++n) {
    const double u = n * basis.spacing, e = std::exp(-u * u);
    sum_e += e;
    sum_u2 += u * u * e;
  }
  const double c = 2 * sum_u2 / sum_e;
  for (int n = 0; n <= radius; ++n) {
    const double u = n * basis.spacing, e = std::exp(-u * u);
    basis.e.push_back(float(e));
    basis.u1.push_back(float(u * e));
    basis.g2.push_back(float((2 * u * u - c) * e));
    basis.h2.push_back(float((u * u - kHilbert / 3) * e));
    basis.h3.push_back(float((u * u * u - kHilbert * u) * e));
  }
  const double omega = 2 * std::numbers::pi / period;
  const double across = even_response(basis.e, 0);
  basis.gain_g = float(1 / std::abs(even_response(basis.g2, omega) * across));
  basis.gain_h = float(1 / std::abs(odd_response(basis.h3, omega) * across));
  return basis;
}

Taps gaussian_taps(double sigma) {
  const int radius = std::max(1, int(std::ceil(3 * sigma)));
  std::vector<double> values;
  double sum = 0;
  for (int n = 0; n <= radius; ++n) {
    values.push_back(std::exp(-0.5 * n * n / (sigma * sigma)));
    sum += n == 0 ? values.back() : 2 * values.back();
  }
  Taps taps;
  for (const double value : values) taps.push_back(float(value / sum));
  return taps;
}

}  // namespace weft::detail
