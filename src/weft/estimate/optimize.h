#pragma once
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "weft/base/types.h"

namespace weft {

/// An evaluation as an optimizer sees it: scaled coordinates in [0, 1]^n to an error; infinity for a
/// simulation that diverged. Called from several threads by the coarse search.
using ErrorFunction = std::function<double(const VecX& scaled)>;
/// After each evaluation: how many are done, the error of this one, and the best so far. Returning
/// false stops the search, which then returns the best so far.
using SearchObserver =
    std::function<bool(std::size_t done, double error, double best, double temperature)>;

struct SearchResult {
  VecX best;               ///< scaled
  double error = 0;
  std::size_t evaluations = 0;
  bool stopped = false;    ///< by the observer
};

/// Coarse search (Bhat 2003, section 6): all points of a grid of `levels` values per coordinate, at
/// the centres of equal cells of [0, 1], in the dimensions listed; the others stay as in `base`.
struct CoarseOptions {
  int levels = 4;
  std::vector<int> dimensions;
  int threads = 0;
};
SearchResult coarse_search(const ErrorFunction& error, const VecX& base, const CoarseOptions& options,
                           const SearchObserver& observer = {});

/// Continuous simulated annealing (Press et al. 1992, section 10.9, as cited by Bhat 2003, section 6):
/// the downhill simplex method in which each stored value is raised and each trial value lowered by a
/// fluctuation -T log(uniform); geometric cooling; the simplex is built anew around the best point
/// when the temperature has fallen by a factor of 3. Coordinates are kept in [0, 1] by reflection.
struct AnnealingOptions {
  std::size_t max_evaluations = 600;
  double initial_temperature = 0;  ///< in units of the error; 0: a tenth of the error at the start
  double final_temperature_ratio = 1e-3;  ///< of the initial temperature, at the last evaluation
  double simplex_size = 0.15;      ///< initial edge, scaled coordinates
  double reset_factor = 3;
  std::uint64_t seed = 1;
};
SearchResult anneal(const ErrorFunction& error, const VecX& start, const AnnealingOptions& options,
                    const SearchObserver& observer = {});

/// Variability (Bhat 2003, section 5): parameter i is perturbed about the estimate, a quadratic is
/// fitted to the errors, and the change of the parameter that raises the error by 1 % is reported in
/// percent of the parameter.
struct PerturbationCurve {
  std::string name;
  std::vector<double> relative;  ///< relative change of the parameter
  std::vector<double> error;
  Vec3 quadratic = Vec3::Zero(); ///< c0 + c1 r + c2 r^2
  double variability_percent = 0;  ///< infinity: the data do not determine the parameter
  bool determined = false;
};

}  // namespace weft
