#pragma once
/// What the folder of a fit says of its estimate, as far as sampling about it needs.
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string_view>
#include <vector>

#include "weft/estimate/scan_fit.h"
#include "weft/estimate/weighed_priors.h"
#include "weft/report/result.h"

namespace weft::app {

struct EstimateOfFit {
  Fabric fabric;
  Report report;
  /// Of a fit to cloth at rest the whole result.json; null of one to video.
  nlohmann::json at_rest;
  /// Of a fit to video: of its evaluations, those of the estimate's problem have this fingerprint;
  /// empty in results of earlier versions.
  std::string problem;
  std::vector<ScanParameter> unknowns;  ///< that were searched; of one value each but "bend"
  VecX scaled;
  /// Fisher's, of the data, as their residuals scatter; scaled coordinates.
  MatX information;
  /// Of minus the logarithm of the likelihood, by the scaled coordinates: where priors pull the
  /// estimate from the data's own, or a bound holds a parameter, it is not zero.
  VecX slope;
  double dispersion = 0;  ///< the unit of minus the logarithm of the likelihood, of the error
  WeighedPriors priors;   ///< in that unit

  const ParameterInfo& info(std::size_t i) const { return unknowns[i].info; }
  /// Of parameter i, in its unit.
  double value(std::size_t i) const;
  Fabric at(const VecX& scaled) const;
};
/// Throws Error where fabric.toml in a fit's folder, read as `fabric`, has not the model, values
/// and ranges of its result.json: its matrices are about its own estimate, in coordinates of its
/// own ranges.
void check_same_fabric(const Report& report, const Fabric& fabric,
                       const std::filesystem::path& folder);

/// Of result.json and fabric.toml. Throws Error for a fit that ended before its certainty was
/// known, one to video beside mechanical captures, and results of earlier versions that lack
/// something.
EstimateOfFit read_estimate_of_fit(const std::filesystem::path& folder);

/// The file in a fit's folder that holds where the motion in its video k, from 0, starts.
std::filesystem::path start_file(const std::filesystem::path& folder, std::size_t k);

/// The error at the estimate of a fit, evaluated anew.
struct ErrorAgain {
  double error;
  double tolerance;       ///< of the fit's error
  std::string_view with;  ///< what may have changed, and what to do about it: the message's end
};
/// Throws Error unless it is that of the fit.
void check_error(const EstimateOfFit& estimate, const std::filesystem::path& folder,
                 const ErrorAgain& again);

/// Minus the logarithm of the likelihood of a fit to cloth at rest, 0 at its estimate, by
/// simulating its captures, which are looked for where they were; infinity where there is no
/// equilibrium. Throws Error where the error at the estimate is not that of the fit.
std::function<double(const VecX& scaled)> simulated_at_rest(const EstimateOfFit& estimate,
                                                            const std::filesystem::path& folder,
                                                            int threads);

}  // namespace weft::app
