#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "weft/fabric/parameter.h"

namespace weft {

/// A fabric: a model by name and a value for each of its parameters, SI.
struct Fabric {
  std::string name;
  std::string model = "baraff-witkin";
  VecX values;                          ///< in the order of model_parameters(model)
  std::optional<double> areal_density;  ///< kg/m^2, where known
  std::string provenance;               ///< where the numbers come from
  /// Ranges that this fabric's file gives for its parameters; empty: those of the model's table.
  VecX lower, upper;

  /// All parameters at their defaults.
  static Fabric with_defaults(std::string name, const std::string& model = "baraff-witkin");
  double value(std::string_view parameter) const;
  /// Throws Error unless finite and inside the parameter's range.
  void set(std::string_view parameter, double value);
  /// Row `index` of the model's table with this fabric's own range, where it has one: what a search
  /// scales with.
  ParameterInfo info(int index) const;
};

/// Throws Error unless there is a finite value for each parameter, none is negative, and those that
/// are only valid together are: of "stvk", the stiffness matrices of membrane and plate must be
/// positive definite, membrane_uv^2 < membrane_uu membrane_vv and bend_uv^2 < bend_uu bend_vv.
/// Ranges are not looked at: a value may lie outside the range of the search.
void validate(const Fabric& fabric);

/// fabric.toml, see docs/formats.md. Rejects unknown keys, missing parameters, values outside
/// their ranges and what validate() rejects. `lower`/`upper` written in a file narrow or widen the
/// search, never the meaning.
Fabric read_fabric(const std::filesystem::path& path);
void write_fabric(const std::filesystem::path& path, const Fabric& fabric);

/// The text of a fabric.toml, and back; `name` stands for the file in errors.
std::string fabric_to_toml(const Fabric& fabric);
Fabric fabric_from_toml(std::string_view text, const std::filesystem::path& name);

/// Built-in fabrics: the paper's linen, fleece, satin and knit, each from the static experiments
/// (Table 1, both of them: `linen-static-1`, `linen-static-2`) and from the waving experiments
/// (Table 3: `linen-waving`, of the two the one with the smaller E1 + E2), with table and column as
/// provenance.
///
/// The paper prints no units; its numbers are read as SI. The other system of its field, CGS, is
/// excluded by the paper's own experiment, a swatch hung by two corners. Take 0.5 m of fabric of
/// 0.2 kg/m^2: its upper edge carries 0.2 * 9.81 * 0.5 = 0.98 N per metre of width. Satin's stretch
/// stiffness of about 32, as dyn/cm, is 0.032 N/m: the top would stretch by a factor of 31 and the
/// swatch hang 8 m long; as N/m, the top stretches by 3 % and the swatch by 1.5 %. Linen's bend of
/// 0.0008, as dyn cm, is 8e-11 N m and gives folds of the size (B / (rho g))^(1/3) = 0.3 mm; as N
/// m, 74 mm, which is what a stiff linen shows.
const std::vector<Fabric>& fabric_presets();
/// A preset by name, or else a file. `linen` is short for `linen-waving`, and so on. Throws Error
/// naming the presets.
Fabric find_fabric(const std::string& name_or_path);

}  // namespace weft
