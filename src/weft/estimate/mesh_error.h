#pragma once
/// What the width of the cells does to a least-squares estimate. Noise is not what limits a fit to
/// forces and shapes that are known to micrometres: cells are.
#include <cmath>
#include <optional>
#include <string>

#include "weft/base/error.h"
#include "weft/estimate/least_squares.h"

namespace weft {

/// Left out of the intervals, or in them.
enum class MeshError { left_out, included };

/// How far an estimate would move on cells of half the width.
struct MeshShift {
  VecX shift;           ///< of each parameter, scaled coordinates; empty: left out or unknown
  std::string unknown;  ///< why it is not known; empty: it is, or was left out
};

/// The Gauss-Newton step -H^-1 g on cells of half the width less the one `here`, on the cells of
/// the fit: both about the estimate at `scaled` ([0, 1]), whose covariance is `noise` H^-1 (2 / n
/// where the cost is the mean of n squares of variance 1). A direction whose standard deviation is
/// more than half of the range does not count. The steps stay within the ranges: a parameter at a
/// bound towards which a mesh's cost falls is held there, as in the intervals
/// (residual_intervals.h), and one that would cross a bound stops at it.
VecX mesh_shift(const VecX& scaled, const QuadraticModel& here, const QuadraticModel& finer,
                double noise);

/// Least cost of the model within the ranges, over the directions that count for mesh_shift().
double least_cost(const VecX& scaled, const QuadraticModel& model, double noise);

/// `noise` of the functions above for a problem whose cost is the mean of its squares.
template <typename Problem>
double residual_noise(const Problem& problem) {
  return 2 / problem.residual_count();
}

/// `model`, with what the priors of a problem add that has priors().
template <typename Problem>
QuadraticModel with_priors(const Problem& problem, const VecX& scaled, QuadraticModel model) {
  if constexpr (requires { problem.priors(); }) problem.priors().add_to(scaled, model);
  return model;
}

/// At `scaled`, on cells of half the width, of a problem with refined() and linearize(), which
/// takes `near`, if anything, as well. Nothing, and in `reason` why, where these would be more than
/// may be.
template <typename Problem, typename... Near>
std::optional<typename Problem::Linearization> linearize_refined(const Problem& problem,
                                                                 const VecX& scaled,
                                                                 std::string* reason = nullptr,
                                                                 Near... near) {
  std::optional<Problem> refined;
  try {
    refined.emplace(problem.refined());
  } catch (const Error& error) {
    if (reason) *reason = error.what();
    return std::nullopt;
  }
  return refined->linearize(scaled, near...);
}

/// Of a problem with refined() and linearize(), which takes `near`, if anything, as well, and whose
/// linearization at `scaled` is `here`; if it has priors() they are in the steps. Unknown where the
/// finer cells would be more than may be, and where no equilibrium is found.
template <typename Problem, typename... Near>
MeshShift find_mesh_shift(const Problem& problem, const VecX& scaled,
                          const typename Problem::Linearization& here, Near... near) {
  if (!std::isfinite(here.model.cost)) return {{}, here.reason};
  const auto unknown = [](const std::string& reason) {
    return MeshShift{{}, "on cells of half the width, " + reason};
  };
  std::string reason;
  const auto finer = linearize_refined(problem, scaled, &reason, near...);
  if (!finer) return unknown(reason);
  if (!std::isfinite(finer->model.cost)) return unknown(finer->reason);
  return {mesh_shift(scaled, with_priors(problem, scaled, here.model),
                     with_priors(problem, scaled, finer->model), residual_noise(problem)),
          {}};
}

/// What is added to the half widths of the intervals: twice the shift, where the estimate would go
/// if the error fell in proportion to the width of the cells; scaled coordinates. Empty for none.
VecX mesh_half_widths(const VecX& shift);

}  // namespace weft
