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

constexpr const char* kMembraneSource = "Larionov 2022, section 3.3.1, equations 5 and 6";
constexpr const char* kPlateSource = "theory of thin orthotropic plates, M = D kappa";

constexpr std::array<ParameterInfo, 8> kStvk = {{
    {"membrane_uu", "N/m", 0.1, 1e6, 500, Scale::logarithmic,
     "A11: force per width along the weft by Green strain along the weft.", kMembraneSource},
    {"membrane_uv", "N/m", 1e-4, 1e6, 50, Scale::logarithmic,
     "A12: force per width along one thread by strain along the other; A12^2 < A11 A22.",
     kMembraneSource},
    {"membrane_vv", "N/m", 0.1, 1e6, 500, Scale::logarithmic,
     "A22: force per width along the warp by Green strain along the warp.", kMembraneSource},
    {"membrane_shear", "N/m", 0.01, 1e6, 50, Scale::logarithmic,
     "A66: shear force per width by the change of the angle between weft and warp.",
     kMembraneSource},
    {"bend_uu", "N m", 1e-9, 1, 1e-5, Scale::logarithmic,
     "D11: moment per width by curvature along the weft.", kPlateSource},
    {"bend_uv", "N m", 1e-12, 1, 1e-6, Scale::logarithmic,
     "D12: moment per width along one thread by curvature along the other; D12^2 < D11 D22.",
     kPlateSource},
    {"bend_vv", "N m", 1e-9, 1, 1e-5, Scale::logarithmic,
     "D22: moment per width by curvature along the warp.", kPlateSource},
    {"bend_twist", "N m", 1e-10, 1, 5e-6, Scale::logarithmic,
     "D66: twisting moment per width by twice the twist, M12 = D66 2 kappa_12.", kPlateSource},
}};

struct ModelTable {
  std::string_view model;
  std::span<const ParameterInfo> parameters;
};
constexpr std::array<ModelTable, 2> kModels = {{{"baraff-witkin", kBaraffWitkin}, {"stvk", kStvk}}};

double search_coordinate(Scale scale, double value) {
  return scale == Scale::logarithmic ? std::log(value) : std::log1p(value / kShift);
}

double from_search_coordinate(Scale scale, double t) {
  return scale == Scale::logarithmic ? std::exp(t) : kShift * std::expm1(t);
}

}  // namespace

std::span<const ParameterInfo> baraff_witkin_parameters() { return kBaraffWitkin; }

std::span<const ParameterInfo> model_parameters(std::string_view model) {
  std::string known;
  for (const ModelTable& table : kModels) {
    if (table.model == model) return table.parameters;
    known += fmt::format("{}\"{}\"", known.empty() ? "" : ", ", table.model);
  }
  throw Error(fmt::format("model \"{}\" is not known; known: {}", model, known));
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
