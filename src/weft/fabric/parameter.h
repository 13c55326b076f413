#pragma once
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "weft/base/types.h"

namespace weft {

/// Coordinates in which a parameter is searched.
enum class Scale {
  logarithmic,  ///< t = log(value); lower bound > 0
  shifted_log,  ///< t = log(1 + value / 0.1): near linear below 0.1 of the unit, may be zero
};

/// One row of the table that code, help and documents share.
struct ParameterInfo {
  std::string_view name;  ///< "bend_stiffness"
  std::string_view unit;  ///< "N m"
  double lower, upper;    ///< default range of the search, and of what a file may hold
  double default_value;
  Scale scale;
  std::string_view meaning;  ///< one sentence
  std::string_view source;   ///< where it is defined
};

/// The nine parameters of `baraff-witkin`, in the order of all vectors of parameters:
/// stretch_stiffness, shear_stiffness, bend_stiffness, stretch_damping, shear_damping,
/// bend_damping, drag_linear, drag_quadratic, drag_degradation.
std::span<const ParameterInfo> baraff_witkin_parameters();

/// The table of a model. Models known by name: "baraff-witkin", and "stvk" with membrane_uu,
/// membrane_uv, membrane_vv, membrane_shear (A11, A12, A22, A66), bend_uu, bend_uv, bend_vv,
/// bend_twist (D11, D12, D22, D66). Throws Error for another name.
std::span<const ParameterInfo> model_parameters(std::string_view model);

/// Index in the model's table; throws Error naming the known ones.
int parameter_index(std::string_view model, std::string_view name);

/// value <-> search coordinate, and search coordinate scaled so that the range is [0, 1].
double to_scaled(const ParameterInfo& info, double value);
double from_scaled(const ParameterInfo& info, double scaled);

}  // namespace weft
