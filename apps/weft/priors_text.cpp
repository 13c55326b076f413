#include "priors_text.h"

#include <fmt/core.h>

namespace weft::app {

nlohmann::json priors_json(const std::vector<ParameterPrior>& priors) {
  nlohmann::json result = nlohmann::json::object();
  for (const ParameterPrior& prior : priors)
    result[prior.parameter] = {{"median", prior.median}, {"factor", prior.factor}};
  return result;
}

void print_priors(const std::vector<ParameterPrior>& priors) {
  fmt::print("as priors, for the rows of a fabric.toml:\n");
  for (const ParameterPrior& prior : priors)
    fmt::print("  {:<18} {}\n", prior.parameter, prior_to_toml(prior));
}

}  // namespace weft::app
