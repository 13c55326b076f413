#include "weft/fabric/parameter.h"

#include <fmt/format.h>

#include <array>
#include <cmath>

#include "weft/base/error.h"
#include "weft/fabric/stiffness_curve.h"

namespace weft {
namespace {

constexpr double kShift = 0.1;  // of the parameter's unit, see Scale::shifted_log

/// Those of Bhat 2003, then the optional terms.
constexpr std::size_t kBhat = 9, kBhatOptional = 2;
constexpr std::array<ParameterInfo, kBhat + kBhatOptional> kBaraffWitkin = {{
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
    {"twist_stiffness", "N m", 1e-7, 1e-2, 1e-5, Scale::logarithmic,
     "Moment sqrt(2) M_uv by the twist sqrt(2) K_uv; that of an isotropic plate without Poisson "
     "effect is bend_stiffness.",
     "twice the D66 of an orthotropic plate; model/cloth_model.h", "", Presence::optional,
     "bend_stiffness"},
    {"drag_normal_linear", "N s/m^3", 0, 10, 0.1, Scale::shifted_log,
     "k_L: drag per area and normal speed, along the normal velocity, beside the quadratic one.",
     "drag of air that seeps through; model/drag.h", "", Presence::optional},
}};

/// Those of `baraff-witkin`, in which the resistance to shear may be nearly nothing, and the
/// diagonals.
constexpr std::array<ParameterInfo, kBaraffWitkin.size() + 2> with_diagonals() {
  std::array<ParameterInfo, kBaraffWitkin.size() + 2> out{};
  for (std::size_t i = 0; i < kBhat; ++i) out[i] = kBaraffWitkin[i];
  out[1].lower = 0.01;
  out[1].default_value = 1;
  out[kBhat] = {
      "diagonal_stiffness",
      "N/m",
      1,
      5000,
      100,
      Scale::logarithmic,
      "Force per width that resists an elongation at 45 degrees to the threads; none against "
      "shortening.",
      "springs along both diagonals that act in tension only: strain/diagonal.h"};
  out[kBhat + 1] = {
      "diagonal_damping",
      "N s/m",
      1e-3,
      20,
      0.1,
      Scale::logarithmic,
      "Force per width that resists the rate of elongation at 45 degrees while in tension.",
      "as stretch_damping, along taut diagonals"};
  for (std::size_t i = kBhat; i < kBaraffWitkin.size(); ++i) out[i + 2] = kBaraffWitkin[i];
  return out;
}
constexpr std::array kDiagonals = with_diagonals();

constexpr Presence kOptional = Presence::optional;
constexpr const char* kFrictionSource = "P. R. Dahl 1968; quasi-static, see model/friction.h";
constexpr std::array<ParameterInfo, 12> kFriction = {{
    {"weft_stretch_friction", "N/m", 1e-3, 1e5, 5, Scale::logarithmic,
     "Internal friction: stress that resists a change of strain along the weft.", kFrictionSource,
     "", kOptional},
    {"weft_stretch_friction_scale", "1", 1e-5, 1, 0.005, Scale::logarithmic,
     "Change of strain along the weft over which friction reverses.", kFrictionSource, "",
     kOptional},
    {"warp_stretch_friction", "N/m", 1e-3, 1e5, 5, Scale::logarithmic,
     "Internal friction: stress that resists a change of strain along the warp.", kFrictionSource,
     "", kOptional},
    {"warp_stretch_friction_scale", "1", 1e-5, 1, 0.005, Scale::logarithmic,
     "Change of strain along the warp over which friction reverses.", kFrictionSource, "",
     kOptional},
    {"shear_friction", "N/m", 1e-3, 1e5, 5, Scale::logarithmic,
     "Internal friction: stress that resists a change of shear.", kFrictionSource, "", kOptional},
    {"shear_friction_scale", "1", 1e-5, 1, 0.005, Scale::logarithmic,
     "Change of shear over which friction reverses.", kFrictionSource, "", kOptional},
    {"weft_bend_friction", "N", 1e-6, 1e2, 1e-4, Scale::logarithmic,
     "Internal friction: stress that resists a change of curvature along the weft.",
     kFrictionSource, "", kOptional},
    {"weft_bend_friction_scale", "1/m", 1e-3, 1e4, 5, Scale::logarithmic,
     "Change of curvature along the weft over which friction reverses.", kFrictionSource, "",
     kOptional},
    {"warp_bend_friction", "N", 1e-6, 1e2, 1e-4, Scale::logarithmic,
     "Internal friction: stress that resists a change of curvature along the warp.",
     kFrictionSource, "", kOptional},
    {"warp_bend_friction_scale", "1/m", 1e-3, 1e4, 5, Scale::logarithmic,
     "Change of curvature along the warp over which friction reverses.", kFrictionSource, "",
     kOptional},
    {"diagonal_bend_friction", "N", 1e-6, 1e2, 1e-4, Scale::logarithmic,
     "Internal friction: stress that resists a change of twist.", kFrictionSource, "", kOptional},
    {"diagonal_bend_friction_scale", "1/m", 1e-3, 1e4, 5, Scale::logarithmic,
     "Change of twist over which friction reverses.", kFrictionSource, "", kOptional},
}};

/// Of springs, whose bends are elongations.
constexpr std::array<ParameterInfo, 12> spring_friction() {
  auto out = kFriction;
  for (std::size_t i = 6; i < out.size(); i += 2) {
    out[i].unit = "N/m";
    out[i].lower = 1e-6;
    out[i].upper = 1e5;
    out[i].default_value = 1e-3;
    out[i].meaning =
        "Internal friction: stress that resists a change of elongation between next neighbours "
        "but one.";
    out[i + 1].unit = "1";
    out[i + 1].lower = 1e-9;
    out[i + 1].upper = 1;
    out[i + 1].default_value = 1e-4;
    out[i + 1].meaning =
        "Change of elongation between next neighbours but one over which friction reverses.";
  }
  return out;
}

/// A model's own rows, then those of friction.
template <std::size_t kCount>
constexpr std::array<ParameterInfo, kCount + kFriction.size()> with_friction(
    const std::array<ParameterInfo, kCount>& own,
    const std::array<ParameterInfo, kFriction.size()>& friction = kFriction) {
  std::array<ParameterInfo, kCount + kFriction.size()> all{};
  for (std::size_t i = 0; i < kCount; ++i) all[i] = own[i];
  for (std::size_t i = 0; i < friction.size(); ++i) all[kCount + i] = friction[i];
  return all;
}

constexpr const char* kMembraneSource = "Larionov 2022, section 3.3.1, equations 5 and 6";
constexpr const char* kPlateSource = "theory of thin orthotropic plates, M = D kappa";

constexpr std::array<ParameterInfo, 8> kStvkOwn = {{
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

constexpr const char* kStrainSource = "Miguel 2012, section 4.1, equations 3 and 4";
constexpr const char* kSpringSource = "Miguel 2012, section 4.1, equation 1";
constexpr const char* kBendSource = "Miguel 2012, section 4.1; curvature instead of angles";
constexpr const char* kCrossSource = "Miguel 2012, section 6: what its models lack";

/// soft-constraints and stvk-diagonal: the same components on different strains.
constexpr std::array<ParameterInfo, 8> kDiagonalOwn = {{
    {"weft_stretch", "N/m", 0.1, 1e6, 500, Scale::logarithmic,
     "Force per width by strain along the weft.", kStrainSource, "1"},
    {"warp_stretch", "N/m", 0.1, 1e6, 500, Scale::logarithmic,
     "Force per width by strain along the warp.", kStrainSource, "1"},
    {"shear", "N/m", 0.01, 1e6, 50, Scale::logarithmic,
     "Shear force per width by w_u . w_v; a curve is over its magnitude.", kStrainSource, "1"},
    {"stretch_coupling", "N/m", 1e-4, 1e6, 50, Scale::logarithmic,
     "Poisson effect: force per width along one thread by strain along the other.", kCrossSource,
     "", kOptional},
    {"shear_stiffening", "1", 1e-3, 1e6, 100, Scale::logarithmic,
     "Shear stiffness grows by this times the squared strains of threads under tension.",
     kCrossSource, "", kOptional},
    {"weft_bend", "N m", 1e-9, 1, 1e-5, Scale::logarithmic,
     "Moment per width by curvature along the weft; a curve is over its magnitude.", kBendSource,
     "1/m"},
    {"warp_bend", "N m", 1e-9, 1, 1e-5, Scale::logarithmic,
     "Moment per width by curvature along the warp; a curve is over its magnitude.", kBendSource,
     "1/m"},
    {"diagonal_bend", "N m", 1e-9, 1, 1e-5, Scale::logarithmic,
     "Moment sqrt(2) M_uv by the twist sqrt(2) K_uv; a curve is over its magnitude.", kBendSource,
     "1/m"},
}};

constexpr std::array<ParameterInfo, 6> kSpringsOwn = {{
    {"weft_stretch", "N/m", 0.1, 1e6, 500, Scale::logarithmic,
     "Force per width by relative elongation of edges along the weft.", kSpringSource, "1"},
    {"warp_stretch", "N/m", 0.1, 1e6, 500, Scale::logarithmic,
     "Force per width by relative elongation of edges along the warp.", kSpringSource, "1"},
    {"shear", "N/m", 0.01, 1e6, 50, Scale::logarithmic,
     "Shear force per width by the angle between weft and warp, from both diagonals.",
     kSpringSource, "1"},
    {"weft_bend", "N/m", 1e-6, 1e6, 1, Scale::logarithmic,
     "Force per width by relative elongation between next neighbours but one along the weft.",
     kSpringSource, "1"},
    {"warp_bend", "N/m", 1e-6, 1e6, 1, Scale::logarithmic,
     "Force per width by relative elongation between next neighbours but one along the warp.",
     kSpringSource, "1"},
    {"diagonal_bend", "N/m", 1e-6, 1e6, 1, Scale::logarithmic,
     "Force per width by relative elongation between next neighbours but one along both diagonals.",
     kSpringSource, "1"},
}};

constexpr const char* kTableSource = "Wang, O'Brien and Ramamoorthi 2011, section 3";

/// Entries of measured tables may be below zero.
constexpr ParameterInfo table_entry(std::string_view name, std::string_view meaning,
                                    double standard) {
  return {name, "N/m", -1e4, 1e7, standard, Scale::linear, meaning, kTableSource};
}
constexpr ParameterInfo table_bend(std::string_view name, std::string_view meaning) {
  return {name, "N m", 1e-9, 1, 1e-5, Scale::logarithmic, meaning, kTableSource};
}

constexpr std::array<ParameterInfo, 39> kPiecewiseLinearOwn = {{
    table_entry("rest_uu", "Weft stress by weft strain, at rest.", 500),
    table_entry("rest_uv", "Stress along one thread by strain along the other, at rest.", 50),
    table_entry("rest_vv", "Warp stress by warp strain, at rest.", 500),
    table_entry("rest_shear", "Shear stress by E_uv, at rest.", 100),
    table_entry("weft_uu", "Weft stress by weft strain, stretched along the weft.", 500),
    table_entry("weft_uv",
                "Stress along one thread by strain along the other, stretched along the weft.", 50),
    table_entry("weft_vv", "Warp stress by warp strain, stretched along the weft.", 500),
    table_entry("weft_shear", "Shear stress by E_uv, stretched along the weft.", 100),
    table_entry("deg22_uu", "Weft stress by weft strain, stretched at 22.5 degrees.", 500),
    table_entry("deg22_uv",
                "Stress along one thread by strain along the other, stretched at 22.5 degrees.",
                50),
    table_entry("deg22_vv", "Warp stress by warp strain, stretched at 22.5 degrees.", 500),
    table_entry("deg22_shear", "Shear stress by E_uv, stretched at 22.5 degrees.", 100),
    table_entry("deg45_uu", "Weft stress by weft strain, stretched at 45 degrees.", 500),
    table_entry("deg45_uv",
                "Stress along one thread by strain along the other, stretched at 45 degrees.", 50),
    table_entry("deg45_vv", "Warp stress by warp strain, stretched at 45 degrees.", 500),
    table_entry("deg45_shear", "Shear stress by E_uv, stretched at 45 degrees.", 100),
    table_entry("deg67_uu", "Weft stress by weft strain, stretched at 67.5 degrees.", 500),
    table_entry("deg67_uv",
                "Stress along one thread by strain along the other, stretched at 67.5 degrees.",
                50),
    table_entry("deg67_vv", "Warp stress by warp strain, stretched at 67.5 degrees.", 500),
    table_entry("deg67_shear", "Shear stress by E_uv, stretched at 67.5 degrees.", 100),
    table_entry("warp_uu", "Weft stress by weft strain, stretched along the warp.", 500),
    table_entry("warp_uv",
                "Stress along one thread by strain along the other, stretched along the warp.", 50),
    table_entry("warp_vv", "Warp stress by warp strain, stretched along the warp.", 500),
    table_entry("warp_shear", "Shear stress by E_uv, stretched along the warp.", 100),
    table_bend("weft_bend_0", "Moment per width and curvature along the weft at 0 1/m."),
    table_bend("weft_bend_10", "Moment per width and curvature along the weft at 10 1/m."),
    table_bend("weft_bend_20", "Moment per width and curvature along the weft at 20 1/m."),
    table_bend("weft_bend_30", "Moment per width and curvature along the weft at 30 1/m."),
    table_bend("weft_bend_40", "Moment per width and curvature along the weft at 40 1/m."),
    table_bend("diagonal_bend_0", "Moment per width and curvature at 45 degrees at 0 1/m."),
    table_bend("diagonal_bend_10", "Moment per width and curvature at 45 degrees at 10 1/m."),
    table_bend("diagonal_bend_20", "Moment per width and curvature at 45 degrees at 20 1/m."),
    table_bend("diagonal_bend_30", "Moment per width and curvature at 45 degrees at 30 1/m."),
    table_bend("diagonal_bend_40", "Moment per width and curvature at 45 degrees at 40 1/m."),
    table_bend("warp_bend_0", "Moment per width and curvature along the warp at 0 1/m."),
    table_bend("warp_bend_10", "Moment per width and curvature along the warp at 10 1/m."),
    table_bend("warp_bend_20", "Moment per width and curvature along the warp at 20 1/m."),
    table_bend("warp_bend_30", "Moment per width and curvature along the warp at 30 1/m."),
    table_bend("warp_bend_40", "Moment per width and curvature along the warp at 40 1/m."),
}};

constexpr auto kStvk = with_friction(kStvkOwn);
constexpr auto kDiagonal = with_friction(kDiagonalOwn);
constexpr auto kSprings = with_friction(kSpringsOwn, spring_friction());
constexpr auto kPiecewiseLinear = with_friction(kPiecewiseLinearOwn);

struct ModelTable {
  std::string_view model;
  std::span<const ParameterInfo> parameters;
};
constexpr std::array<ModelTable, 8> kModels = {{{"baraff-witkin", kBaraffWitkin},
                                                {"baraff-witkin-diagonals", kDiagonals},
                                                {"baraff-witkin-hinges", kDiagonals},
                                                {"stvk", kStvk},
                                                {"soft-constraints", kDiagonal},
                                                {"stvk-diagonal", kDiagonal},
                                                {"springs", kSprings},
                                                {"piecewise-linear", kPiecewiseLinear}}};

using CurveNames = std::vector<std::array<std::string, StiffnessCurve::kMostKnots>>;

/// Of each row of a table.
CurveNames make_curve_names(std::span<const ParameterInfo> table) {
  CurveNames names(table.size());
  for (std::size_t row = 0; row < table.size(); ++row)
    for (std::size_t knot = 0; knot < names[row].size(); ++knot)
      names[row][knot] = fmt::format("{}_{}", table[row].name, knot + 1);
  return names;
}

double search_coordinate(Scale scale, double value) {
  switch (scale) {
    case Scale::logarithmic:
      return std::log(value);
    case Scale::shifted_log:
      return std::log1p(value / kShift);
    case Scale::linear:
      break;
  }
  return value;
}

double from_search_coordinate(Scale scale, double t) {
  switch (scale) {
    case Scale::logarithmic:
      return std::exp(t);
    case Scale::shifted_log:
      return kShift * std::expm1(t);
    case Scale::linear:
      break;
  }
  return t;
}

}  // namespace

std::span<const ParameterInfo> baraff_witkin_parameters() {
  return std::span(kBaraffWitkin).first<kBhat>();
}

std::span<const ParameterInfo> model_parameters(std::string_view model) {
  std::string known;
  for (const ModelTable& table : kModels) {
    if (table.model == model) return table.parameters;
    known += fmt::format("{}\"{}\"", known.empty() ? "" : ", ", table.model);
  }
  throw Error(fmt::format("model \"{}\" is not known; known: {}", model, known));
}

std::vector<std::string_view> model_names() {
  std::vector<std::string_view> names;
  for (const ModelTable& table : kModels) names.push_back(table.model);
  return names;
}

std::string_view curve_value_name(std::string_view model, std::string_view parameter, int knot) {
  static const CurveNames kDiagonalNames = make_curve_names(kDiagonal);
  static const CurveNames kSpringNames = make_curve_names(kSprings);
  const auto row = static_cast<std::size_t>(parameter_index(model, parameter));
  if (model_parameters(model)[row].curve_over.empty() || knot < 0 ||
      knot >= StiffnessCurve::kMostKnots)
    throw Error(fmt::format("parameter \"{}\" of model \"{}\" has no control value {}", parameter,
                            model, knot + 1));
  return (model == "springs" ? kSpringNames : kDiagonalNames)[row][static_cast<std::size_t>(knot)];
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
