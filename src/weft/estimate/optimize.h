#pragma once
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "weft/base/types.h"

namespace weft {

/// An evaluation as an optimizer sees it: scaled coordinates in [0, 1]^n to an error; infinity for
/// a simulation that diverged. Must be pure; called from several threads at once.
using ErrorFunction = std::function<double(const VecX& scaled)>;
/// After each evaluation: how many are done, the error of this one, the best so far, and the
/// temperature (0 in the coarse search). Never called from two threads at once. Returning false
/// stops the search, which then returns the best so far.
using SearchObserver =
    std::function<bool(std::size_t done, double error, double best, double temperature)>;

struct SearchResult {
  VecX best;         ///< scaled; the start where every error was infinite
  double error = 0;  ///< of best; infinity where every error was infinite
  std::size_t evaluations = 0;
  bool stopped = false;  ///< by the observer
  /// Coarse search only: of every point in grid order; NaN where it was stopped before.
  std::vector<double> errors;
};

/// Coarse search (Bhat 2003, section 6): all points of a grid of `levels` values per coordinate, at
/// the centres of equal cells of [0, 1], in the dimensions listed; the others stay as in `base`.
struct CoarseOptions {
  int levels = 4;               ///< 1 to 100
  std::vector<int> dimensions;  ///< distinct indices into the coordinates
  int threads = 0;              ///< 0: all cores
};
/// The observer is called in the order in which evaluations finish, which depends on the threads;
/// the result does not, unless the observer stops the search. Of equal errors the first in grid
/// order wins (first dimension slowest). Throws Error for options out of range or more than 1e6
/// points.
SearchResult coarse_search(const ErrorFunction& error, const VecX& base,
                           const CoarseOptions& options, const SearchObserver& observer = {});
/// The points that coarse_search visits, in grid order.
std::vector<VecX> coarse_grid(const VecX& base, const CoarseOptions& options);

/// Continuous simulated annealing (Press et al. 1992, section 10.9, as cited by Bhat 2003, section
/// 6): the downhill simplex method in which each stored value is raised and each trial value
/// lowered by a fluctuation -T log(uniform), so that a move uphill by d is taken with a probability
/// that falls like exp(-d / T). Cooling is geometric in the number of evaluations. When T has
/// fallen by `reset_factor` the simplex is built anew around the best point so far, with edges that
/// shrink like the square root of T (the width of a quadratic valley that fluctuations of size T
/// can see). Coordinates are kept in [0, 1] by reflection.
///
/// The simplex is sequential by nature. To use several cores, the `parallel_moves` worst vertices
/// are moved at once, each through the centroid of the others (Lee and Wiswall 2007): all
/// reflections are evaluated together, then all expansions and contractions. The result depends on
/// `parallel_moves` and on the seed, never on `threads`. docs/results.md has what it costs and
/// gains.
struct AnnealingOptions {
  std::size_t max_evaluations = 600;
  double initial_temperature = 0;  ///< in units of the error; 0: a tenth of the error at the start
  double final_temperature_ratio =
      1e-3;                    ///< of the initial temperature, at the last evaluation; (0, 1]
  double simplex_size = 0.25;  ///< initial edge, scaled coordinates, (0, 1]
  double reset_factor = 3;     ///< > 1
  int parallel_moves = 2;      ///< >= 1; at most half of the dimension is used (at least 1)
  int threads = 0;             ///< 0: all cores
  std::uint64_t seed = 1;
};
/// Uses exactly max_evaluations unless the observer stops it; the observer is called in a fixed
/// order. Throws Error for options out of range or a start outside [0, 1]^n.
SearchResult anneal(const ErrorFunction& error, const VecX& start, const AnnealingOptions& options,
                    const SearchObserver& observer = {});

/// `value` reflected at 0 and 1 as often as needed to lie in [0, 1].
double reflect_into_unit(double value);

/// Variability (Bhat 2003, section 5) of one parameter; see variability.h.
struct PerturbationCurve {
  std::string name;
  std::vector<double> relative;  ///< relative change of the parameter
  std::vector<double> error;
  Vec3 quadratic = Vec3::Zero();            ///< c0 + c1 r + c2 r^2
  double noise = 0;                         ///< rms of the errors about the quadratic
  double variability_percent = 0;           ///< infinity: the data do not determine the parameter
  bool determined = false;                  ///< significant, and at most 100 %
  bool at_lower = false, at_upper = false;  ///< the estimate lies at a bound of the search
  std::string warning;                      ///< one sentence; empty if there is nothing to warn of
};

}  // namespace weft
