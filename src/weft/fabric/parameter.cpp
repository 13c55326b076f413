#include "weft/fabric/parameter.h"

#include <fmt/format.h>

#include <array>
#include <cmath>

#include "weft/base/error.h"

namespace weft {
namespace {

constexpr double kShift = 0.1;  // of the parameter's unit, see Scale::shifted_log

constexpr std::array<ParameterInfo, 9> kBaraffWitkin = {{
    {"stretch_stiffness", "N/m", 5, 5000, 500, Scale::logarithmic,
     "Force per width that resists a relative elongation along weft or warp.",
     "Bhat 2003, section 3, equation 1; Baraff and Witkin 1998, section 4.2"},
    {"shear_stiffness", "N/m", 1, 5000, 50, Scale::logarithmic,
     "Force per width that resists a change of the angle between weft and warp.",
     "Bhat 2003, section 3, equation 1; Baraff and Witkin 1998, section 4.3"},
    {"bend_stiffness", "N m", 1e-7, 1e-2, 1e-5, Scale::logarithmic,
     "Moment per width that resists curvature (flexural rigidity).",
     "Bhat 2003, section 3, equation 1; Baraff and Witkin 1998, section 4.4"},
    {"stretch_damping", "N s/m", 1e-3, 20, 0.1, Scale::logarithmic,
     "Force per width that resists the rate of elongation along weft or warp.",
     "Bhat 2003, section 3, equation 3; Baraff and Witkin 1998, section 4.5"},
    {"shear_damping", "N s/m", 1e-3, 20, 0.1, Scale::logarithmic,
     "Force per width that resists the rate of shear.",
     "Bhat 2003, section 3, equation 3; Baraff and Witkin 1998, section 4.5"},
    {"bend_damping", "N m s", 1e-9, 1e-5, 1e-7, Scale::logarithmic,
     "Moment per width that resists the rate of change of curvature.",
     "Bhat 2003, section 3, equation 3; Baraff and Witkin 1998, section 4.5"},
    {"drag_linear", "N s/m^3", 0, 10, 0.1, Scale::shifted_log,
     "k_T: drag per area and tangential speed, along the tangential velocity.",
     "Bhat 2003, section 3, drag law"},
    {"drag_quadratic", "N s^2/m^4", 0, 10, 0.5, Scale::shifted_log,
     "k_N: drag per area and squared normal speed, along the normal velocity.",
     "Bhat 2003, section 3, drag law"},
    {"drag_degradation", "s^2/m^2", 0, 10, 0.1, Scale::shifted_log,
     "k_f: bounds the normal drag per area by k_N / k_f at high speed.",
     "Bhat 2003, section 3, drag law"},
}};

/// Those of `baraff-witkin`, in which the resistance to shear may be nearly nothing, and the
/// diagonals.
constexpr std::array<ParameterInfo, 11> with_diagonals() {
  std::array<ParameterInfo, 11> out{};
  for (std::size_t i = 0; i < kBaraffWitkin.size(); ++i) out[i] = kBaraffWitkin[i];
  out[1].lower = 0.01;
  out[1].default_value = 1;
  out[9] = {"diagonal_stiffness",
            "N/m",
            1,
            5000,
            100,
            Scale::logarithmic,
            "Force per width that resists an elongation at 45 degrees to the threads; none against "
            "shortening.",
            "springs along both diagonals that act in tension only: strain/diagonal.h"};
  out[10] = {"diagonal_damping",
             "N s/m",
             1e-3,
             20,
             0.1,
             Scale::logarithmic,
             "Force per width that resists the rate of elongation at 45 degrees while in tension.",
             "as stretch_damping, along taut diagonals"};
  return out;
}
constexpr std::array<ParameterInfo, 11> kDiagonals = with_diagonals();

double search_coordinate(Scale scale, double value) {
  return scale == Scale::logarithmic ? std::log(value) : std::log1p(value / kShift);
}

double from_search_coordinate(Scale scale, double t) {
  return scale == Scale::logarithmic ? std::exp(t) : kShift * std::expm1(t);
}

}  // namespace

std::span<const ParameterInfo> baraff_witkin_parameters() { return kBaraffWitkin; }

std::span<const ParameterInfo> model_parameters(std::string_view model) {
  if (model == "baraff-witkin") return kBaraffWitkin;
  if (model == "baraff-witkin-diagonals") return kDiagonals;
  throw Error(fmt::format(
      "model \"{}\" is not known; known: \"baraff-witkin\", \"baraff-witkin-diagonals\"", model));
}

int parameter_index(std::string_view model, std::string_view name) {
  const auto table = model_parameters(model);
  std::string known;
  for (std::size_t i = 0; i < table.size(); ++i) {
    if (table[i].name == name) return static_cast<int>(i);
    known += fmt::format("{}{}", i ? ", " : "", table[i].name);
  }
  throw Error(
      fmt::format("parameter \"{}\" of model \"{}\" is not known; known: {}", name, model, known));
}

double to_scaled(const ParameterInfo& info, double value) {
  const double lower = search_coordinate(info.scale, info.lower);
  const double upper = search_coordinate(info.scale, info.upper);
  return (search_coordinate(info.scale, value) - lower) / (upper - lower);
}

double from_scaled(const ParameterInfo& info, double scaled) {
  // The ends are returned as they are written, so that a value at a bound stays inside the range.
  if (scaled == 0) return info.lower;
  if (scaled == 1) return info.upper;
  const double lower = search_coordinate(info.scale, info.lower);
  const double upper = search_coordinate(info.scale, info.upper);
  const double value = from_search_coordinate(info.scale, lower + scaled * (upper - lower));
  return scaled > 0 && scaled < 1 ? std::min(std::max(value, info.lower), info.upper) : value;
}

}  // namespace weft
