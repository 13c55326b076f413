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
  linear,       ///< t = value: may be negative
};

enum class Presence {
  required,
  optional,  ///< a term that a fabric may leave out
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
  /// Unit of the strain that a curve of it (stiffness_curve.h) runs over; empty: one number only.
  std::string_view curve_over = "";
  Presence presence = Presence::required;
  /// Of an optional term: the parameter whose value it has where it is left out; empty: none, the
  /// term is zero then.
  std::string_view left_out_as = "";
};

/// The nine parameters of `baraff-witkin`, in the order of all vectors of parameters:
/// stretch_stiffness, shear_stiffness, bend_stiffness, stretch_damping, shear_damping,
/// bend_damping, drag_linear, drag_quadratic, drag_degradation. Without the optional
/// twist_stiffness and drag_normal_linear, which are the last of the model's table.
std::span<const ParameterInfo> baraff_witkin_parameters();

/// The table of a model. Throws Error for a name that is not known. Models:
/// - "baraff-witkin": these nine, and twist_stiffness and drag_normal_linear as optional terms;
/// - "baraff-witkin-diagonals": the same nine, then diagonal_stiffness, diagonal_damping, and the
///   same optional terms;
/// - "baraff-witkin-hinges": those of "baraff-witkin-diagonals";
/// - "stvk": membrane_uu, membrane_uv, membrane_vv, membrane_shear (A11, A12, A22, A66), bend_uu,
///   bend_uv, bend_vv, bend_twist (D11, D12, D22, D66);
/// - "soft-constraints", "stvk-diagonal", "springs": weft_stretch, warp_stretch, shear, weft_bend,
///   warp_bend, diagonal_bend, each a constant or a curve, and but for springs stretch_coupling and
///   shear_stiffening as optional terms;
/// - these, "stvk" and "piecewise-linear" may have internal friction in any of the components
///   weft_stretch, warp_stretch, shear, weft_bend, warp_bend, diagonal_bend: NAME_friction and
///   NAME_friction_scale, both or none;
/// - "piecewise-linear": six rows of a table of membrane stiffness (rest, weft, deg22, deg45,
/// deg67,
///   warp; each _uu, _uv, _vv, _shear) and three of bending stiffness (weft_bend, diagonal_bend,
///   warp_bend; each _0, _10, _20, _30, _40 1/m).
std::span<const ParameterInfo> model_parameters(std::string_view model);
std::vector<std::string_view> model_names();

/// Name of control value `knot` (from 0) of a curve of a parameter: "shear_1", ... Throws Error
/// unless the parameter may be a curve and the knot is below StiffnessCurve::kMostKnots.
std::string_view curve_value_name(std::string_view model, std::string_view parameter, int knot);

/// Index in the model's table; throws Error naming the known ones.
int parameter_index(std::string_view model, std::string_view name);

/// value <-> search coordinate, and search coordinate scaled so that the range is [0, 1].
double to_scaled(const ParameterInfo& info, double value);
double from_scaled(const ParameterInfo& info, double scaled);

}  // namespace weft
