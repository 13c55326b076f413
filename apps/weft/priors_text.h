#pragma once
#include <nlohmann/json.hpp>
#include <vector>

#include "weft/fabric/prior.h"

namespace weft::app {

/// By the parameter's name: `median` and `factor`.
nlohmann::json priors_json(const std::vector<ParameterPrior>& priors);
/// The same as keys of the rows of a fabric.toml, a line each.
void print_priors(const std::vector<ParameterPrior>& priors);

}  // namespace weft::app
