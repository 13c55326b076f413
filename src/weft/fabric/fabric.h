#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "weft/fabric/parameter.h"
#include "weft/fabric/stiffness_curve.h"

namespace weft {

/// How a fabric gives one row of its model's table.
struct ParameterForm {
  /// Strain knots of a stiffness curve; empty: one number.
  VecX knots;
  /// False for an optional term that is left out.
  bool present = true;
};

/// A fabric: a model by name and a value for each of its free numbers, SI.
struct Fabric {
  std::string name;
  std::string model = "baraff-witkin";
  /// In the order of model_parameters(model). A row that is a curve has one value a knot, one that
  /// is left out has none.
  VecX values;
  std::optional<double> areal_density;  ///< kg/m^2, where known
  std::string provenance;               ///< where the numbers come from
  /// Ranges that this fabric's file gives for its values; empty: those of the model's table.
  VecX lower, upper;
  /// One a row of the table; empty: each row is one number and optional ones are left out.
  std::vector<ParameterForm> forms;

  /// All parameters at their defaults, optional ones left out.
  static Fabric with_defaults(std::string name, const std::string& model = "baraff-witkin");
  /// Values that a row of the table (by name, or by number) has: 0 where it is left out. Where the
  /// first of them stands in `values`.
  int value_count(std::string_view row) const;
  int value_count(int row) const;
  int first_value(std::string_view row) const;
  int first_value(int row) const;
  /// By the name of a parameter that is one number, or of a control value (curve_value_name).
  /// Throws Error where there is none.
  int value_index(std::string_view parameter) const;
  double value(std::string_view parameter) const;
  /// Throws Error unless finite and inside the parameter's range.
  void set(std::string_view parameter, double value);
  /// The row of the table that `values[index]` belongs to, with the name of the control value and
  /// this fabric's own range, where it has one: what a search scales with.
  ParameterInfo info(int index) const;

  /// The curve that a row is, a constant where it is one number. Throws Error where it is left out
  /// or may not be a curve.
  StiffnessCurve curve(std::string_view row) const;
  /// Makes a curve of a row, through `curve`'s control values; one knot: a number. The ranges of
  /// the row's values are those of its first one. Throws Error for a row that may not be a curve.
  void set_curve(std::string_view row, const StiffnessCurve& curve);
  /// All of them, in the order of `values`.
  std::vector<std::string> value_names() const;
  /// Takes an optional term into the fabric, at its default or, if left out it has the value of
  /// another parameter (ParameterInfo::left_out_as), at that; or out of it.
  void include(std::string_view row);
  void leave_out(std::string_view row);

 private:
  /// Gives a row another number of values; its range becomes that of `range`.
  void resize_row(int row, const ParameterForm& form, const VecX& row_values);
};

/// Throws Error unless there is a finite value for each parameter, none is negative (but for those
/// of "piecewise-linear" that are measured so), curves stand
/// where they may and have knots that StiffnessCurve takes, and values that are only valid together
/// are: of "stvk", the stiffness matrices of membrane and plate must be positive definite,
/// membrane_uv^2 < membrane_uu membrane_vv and bend_uv^2 < bend_uu bend_vv; a stretch_coupling must
/// be below the geometric mean of the least values of weft_stretch and warp_stretch.
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
/// Throws Error in one line unless the fabric is of `model`: for what works with that model alone.
void require_model(const Fabric& fabric, std::string_view model);
/// The same unless it is of a model that motions are simulated with, which has damping and drag:
/// "baraff-witkin", "baraff-witkin-diagonals" or "baraff-witkin-hinges".
void require_motion_model(const Fabric& fabric);
/// A preset by name (`linen` is short for `linen-waving`), or else a file: fabric.toml, numbers of
/// KES-F (kes_fabric.h), or where it ends in .json an ARCSim material. Throws Error otherwise.
Fabric find_fabric(const std::string& name_or_path);

}  // namespace weft
