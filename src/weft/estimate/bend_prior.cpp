#include "weft/estimate/bend_prior.h"

#include <fmt/format.h>

#include <cmath>

#include "weft/base/error.h"
#include "weft/estimate/uncertainty.h"

namespace weft {
namespace {

std::vector<std::string> bends_of(const Fabric& fabric) {
  std::vector<std::string> names;
  for (const ParameterInfo& row : model_parameters(fabric.model)) {
    const int count = fabric.value_count(row.name);
    if (row.unit != "N m" || count == 0) continue;
    if (count > 1)
      throw Error(fmt::format("prior: \"{}\" is a curve; a prior is of one number", row.name));
    if (row.scale != Scale::logarithmic)
      throw Error(fmt::format("prior: \"{}\" is not searched on a logarithmic scale", row.name));
    names.emplace_back(row.name);
  }
  if (names.empty())
    throw Error(fmt::format("prior: model \"{}\" has no bend in N m", fabric.model));
  return names;
}

ParameterPrior checked(ParameterPrior prior) {
  if (prior.factor >= least_prior_factor && prior.factor <= most_prior_factor) return prior;
  throw Error(fmt::format("prior of \"{}\": factor {:g} is out of range; must be in [{:g}, {:g}]",
                          prior.parameter, prior.factor, least_prior_factor, most_prior_factor));
}

}  // namespace

ParameterPrior prior_of_interval(std::string parameter, double lower, double upper,
                                 double confidence) {
  if (!(lower > 0 && lower < upper && std::isfinite(upper)))
    throw Error(fmt::format("prior of \"{}\": the interval {:g} to {:g} has no end on one side",
                            parameter, lower, upper));
  if (!(confidence > 0 && confidence < 1))
    throw Error(fmt::format("prior: confidence {:g}, must be in (0, 1)", confidence));
  const double quantile = student_quantile(0.5 * (1 + confidence), kInfinity);
  return checked({std::move(parameter), std::sqrt(lower * upper),
                  std::exp(0.5 * std::log(upper / lower) / quantile)});
}

std::vector<ParameterPrior> priors_of_factor(const Fabric& fabric, double lower, double upper,
                                             double confidence) {
  const std::vector<std::string> names = bends_of(fabric);
  const ParameterPrior common = prior_of_interval("factor", lower, upper, confidence);
  std::vector<ParameterPrior> priors;
  for (const std::string& name : names) {
    const ParameterInfo info = fabric.info(fabric.value_index(name));
    const double median = common.median * fabric.value(name);
    if (!(median >= info.lower && median <= info.upper))
      throw Error(
          fmt::format("prior of \"{}\": median {:g} is out of range; must be in [{:g}, {:g}]", name,
                      median, info.lower, info.upper));
    const auto count = static_cast<double>(names.size());
    priors.push_back(checked({name, median, std::pow(common.factor, std::sqrt(count))}));
  }
  return priors;
}

ParameterPrior prior_of_overhang(std::string parameter, double rigidity, double overhang,
                                 double deviation) {
  if (!(rigidity > 0 && overhang > 0 && deviation > 0))
    throw Error("prior: rigidity, overhang and deviation must be above 0");
  return checked({std::move(parameter), rigidity, std::exp(3 * deviation / overhang)});
}

}  // namespace weft
