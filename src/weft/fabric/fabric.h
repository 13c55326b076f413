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
  VecX values;                           ///< in the order of model_parameters(model)
  std::optional<double> areal_density;   ///< kg/m^2, where known
  std::string provenance;                ///< where the numbers come from

  /// All parameters at their defaults.
  static Fabric with_defaults(std::string name, const std::string& model = "baraff-witkin");
  double value(std::string_view parameter) const;
  /// Throws Error unless finite and inside the parameter's range.
  void set(std::string_view parameter, double value);
};

/// fabric.toml, see docs/formats.md. Rejects unknown keys, missing parameters and values outside
/// their ranges. `lower`/`upper` written in a file narrow or widen the search, never the meaning.
Fabric read_fabric(const std::filesystem::path& path);
void write_fabric(const std::filesystem::path& path, const Fabric& fabric);

/// Built-in fabrics: the paper's linen, fleece, satin and knit, each from the static and the waving
/// experiments, with table and column as provenance.
const std::vector<Fabric>& fabric_presets();
/// A preset by name, or else a file. Throws Error naming the presets.
Fabric find_fabric(const std::string& name_or_path);

}  // namespace weft
