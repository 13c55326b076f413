#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "weft/fabric/fabric.h"
#include "weft/fabric/parameter.h"

namespace weft {

// Valid range of a prior's factor.
inline constexpr double least_prior_factor = 1.001, most_prior_factor = 1e6;

/// What is known of a parameter before the data: with t(value) the coordinate in which it is
/// searched (parameter.h), t is normally distributed about t(median) with standard deviation
/// log(factor). For stiffness and damping, t = log(value): the value lies within median / factor
/// and median * factor in 68 % of cases. For drag, t = log(1 + value / 0.1): the same of
/// value + 0.1.
struct ParameterPrior {
  std::string parameter;
  double median = 0;  ///< in the parameter's unit, within its range
  double factor = 0;  ///< 1.001 to 1e6
};

/// The priors that a fabric.toml states (docs/formats.md), in the order of the model's parameters;
/// read_fabric() checks and passes over them. Throws what read_fabric() throws.
std::vector<ParameterPrior> read_priors(const std::filesystem::path& path);
/// Those of the file that find_fabric() reads; none of a preset.
std::vector<ParameterPrior> find_priors(const std::string& name_or_path);

/// The key of the parameter's row in fabric.toml that states it, "prior = { median = 1e-5, factor =
/// 2
/// }".
std::string prior_to_toml(const ParameterPrior& prior);
/// The text of a fabric.toml that has `priors`, of distinct parameters of the fabric that are one
/// number each. Throws Error for others.
std::string fabric_to_toml(const Fabric& fabric, const std::vector<ParameterPrior>& priors);

/// Mean and standard deviation in the coordinate that is scaled so that the range is [0, 1].
struct ScaledPrior {
  double mean = 0, deviation = 0;
};
ScaledPrior scaled_prior(const ParameterInfo& info, const ParameterPrior& prior);

}  // namespace weft
