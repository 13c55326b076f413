#include "weft/report/ticks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "weft/report/text.h"

namespace weft {
namespace {

/// Positions within this part of a step outside the range still count: 0.30000000000000004 <= 0.3.
constexpr double kSlack = 1e-9;

std::string fixed(double value, int decimals) {
  if (std::abs(value) < 0.5 * std::pow(10.0, -decimals)) value = 0;
  std::string text = fmt::format("{:.{}f}", value, decimals);
  if (text.front() == '-') text.replace(0, 1, "\u2212");
  return text;
}

struct Step {
  double size = 1;
  int decimals = 0;  ///< that its multiples have
};

/// The smallest of 1, 2, 2.5, 5 times a power of ten that is at least `least`; a whole number if
/// asked.
Step nice_step(double least, TickStep kind) {
  const bool whole = kind == TickStep::whole;
  if (whole) least = std::max(1.0, least);
  const int exponent = static_cast<int>(std::floor(std::log10(least)));
  for (const int power : {exponent, exponent + 1}) {
    for (const double factor : {1.0, 2.0, 2.5, 5.0}) {
      const Step step{factor * std::pow(10.0, power), (factor == 2.5 ? 1 : 0) - power};
      if (step.size < least * (1 - kSlack) || (whole && step.decimals > 0)) continue;
      return step;
    }
  }
  return {std::pow(10.0, exponent + 2), -exponent - 2};
}

/// A label on a logarithmic axis: mantissa (1 to 9) times ten to `exponent`.
std::string log_label(int mantissa, int exponent, bool plain) {
  if (plain) return fixed(mantissa * std::pow(10.0, exponent), std::max(0, -exponent));
  return mantissa == 1 ? power_of_ten(exponent)
                       : fmt::format("{}×{}", mantissa, power_of_ten(exponent));
}

}  // namespace

Ticks linear_ticks(double lower, double upper, int most, TickStep kind) {
  Ticks ticks;
  if (!(lower < upper) || !std::isfinite(upper - lower)) return ticks;
  const auto [step, step_decimals] = nice_step((upper - lower) / std::max(1, most), kind);
  const double largest = std::max(std::abs(lower), std::abs(upper));
  const int magnitude = static_cast<int>(std::floor(std::log10(largest)));
  if (magnitude >= 5 || magnitude <= -3) {
    ticks.exponent = 3 * static_cast<int>(std::floor(magnitude / 3.0));
  }
  const double unit = std::pow(10.0, ticks.exponent);
  const int decimals = std::max(0, step_decimals + ticks.exponent);
  const double first = std::ceil(lower / step - kSlack);
  const double last = std::floor(upper / step + kSlack);
  for (double k = first; k <= last; ++k) {
    ticks.positions.push_back(k * step);
    ticks.labels.push_back(fixed(k * step / unit, decimals));
  }
  return ticks;
}

Ticks log_ticks(double lower, double upper, int most) {
  Ticks ticks;
  if (!(0 < lower && lower < upper) || !std::isfinite(upper)) return ticks;
  const double decades = std::log10(upper / lower);
  if (decades < 0.5) {
    ticks = linear_ticks(lower, upper, most);
    if (ticks.exponent == 0) return ticks;
    for (std::size_t i = 0; i < ticks.labels.size(); ++i) {
      ticks.labels[i] += "×" + power_of_ten(ticks.exponent);
    }
    ticks.exponent = 0;
    return ticks;
  }
  const int first = static_cast<int>(std::floor(std::log10(lower) + kSlack));
  const int last = static_cast<int>(std::floor(std::log10(upper) + kSlack));
  const bool plain = std::log10(lower) >= -3 - kSlack && std::log10(upper) < 5;
  const int every = std::max(1, static_cast<int>(std::ceil(decades / std::max(1, most))));
  for (int exponent = first; exponent <= last; ++exponent) {
    for (int mantissa = 1; mantissa <= 9; ++mantissa) {
      const double position = mantissa * std::pow(10.0, exponent);
      if (position < lower * (1 - kSlack) || position > upper * (1 + kSlack)) continue;
      const bool major = mantissa == 1 ? (exponent % every + every) % every == 0
                                       : decades < 2 && (mantissa == 2 || mantissa == 5);
      if (major) {
        ticks.positions.push_back(position);
        ticks.labels.push_back(log_label(mantissa, exponent, plain));
      } else if (mantissa == 1 || every == 1) {
        ticks.minor.push_back(position);
      }
    }
  }
  return ticks;
}

}  // namespace weft
