#pragma once
/// Least squares on forces and shapes at equilibrium (Miguel et al. 2012, section 5.1, equations 6
/// to 9): equilibria in the inner loop (mechanical_problem.h), Levenberg-Marquardt in the outer
/// one.
#include <functional>
#include <string>
#include <vector>

#include "weft/base/error.h"
#include "weft/estimate/least_squares.h"
#include "weft/estimate/mechanical_problem.h"
#include "weft/estimate/mesh_error.h"
#include "weft/estimate/residual_intervals.h"
#include "weft/estimate/uncertainty.h"
#include "weft/estimate/weighed_priors.h"

namespace weft {

/// Where a search begins: far from its end an evaluation on fine cells is slow and says no more
/// than one on coarse cells.
enum class FirstCells {
  halved,   ///< on half as many cells along a side, where these are 8 or more, then on all of them
  as_given  ///< on those of the trials
};

struct MechanicalFitOptions {
  MechanicalFitOptions() {
    least_squares.max_iterations = 60;
    least_squares.step_tolerance = 1e-5;
    least_squares.cost_tolerance = 1e-6;
  }
  LeastSquaresOptions least_squares;
  double confidence = 0.9;  ///< of the intervals
  MeshError mesh_error = MeshError::left_out;
  FirstCells first_cells = FirstCells::halved;
};

struct MechanicalFitStep {
  std::size_t evaluation = 0;  ///< from 1; the first is the start
  double cost = 0, best = 0;   ///< with what priors add; best: of those with the same weights
  bool replayed = false;       ///< taken from the store
};

struct CordFrictionEstimate {
  std::size_t trial = 0;  ///< of the problem's
  /// Of the name of the capture, N, not below 0; as undetermined without intervals.
  ParameterInterval interval;
};

struct MechanicalFitResult {
  Fabric start, fabric;
  /// Of the data, each with the weights, and on the cells, of then.
  double cost_start = 0, cost = 0;
  /// Where the weights of the beginning led, with these; with what priors add. The cost without a
  /// noise of clips and without priors.
  double cost_first = 0;
  double prior_weight = 0;             ///< of the end; 0 without priors
  double prior_error = 0;              ///< what they add to the cost there
  WeighedPriors::Roughness roughness;  ///< of the smooth curves
  double force_share = 1;              ///< MechanicalProblem::force_share()
  double residual_count = 0;    ///< numbers that are compared: the cost times it is their sum
  ForceWeights weights;         ///< of the end
  std::size_t evaluations = 0;  ///< of all frames, with or without derivatives
  std::size_t replayed = 0;     ///< of these, taken from the store
  std::vector<MechanicalFitStep> history;
  LeastSquaresEnd end = LeastSquaresEnd::max_iterations;
  /// Of the free parameters, by the jackknife over frames (residual_intervals.h); empty for an
  /// estimate without equilibrium.
  std::vector<ParameterInterval> intervals;
  ResidualCertainty certainty;  ///< of the free parameters
  /// Of the problem's with_friction(). The intervals above hold what it leaves open.
  std::vector<CordFrictionEstimate> cord_friction;
  MeshShift mesh;  ///< with MeshError::included; in the intervals where it is known
  int inexact = 0;
  double wall_s = 0;
};
/// After each evaluation; false stops.
using MechanicalFitObserver = std::function<bool(const MechanicalFitStep&)>;

/// A hash of all that decides a search from `start`, for its MechanicalStore.
std::string fit_fingerprint(const MechanicalProblem& problem, const Fabric& start,
                            const MechanicalFitOptions& options = {});

/// The start of a fit has no equilibrium, or values that the model refuses.
class MechanicalStartError : public Error {
 public:
  using Error::Error;
};

/// From the values of `start`, with equilibria that start from those of the step before, until two
/// steps in a row have lowered the sum of squares by less than 0.01 (a parameter one standard
/// deviation off costs 1), or as the options say. Throws MechanicalStartError if the start cannot
/// be computed.
///
/// With a noise of clips: a search with the weights that the problem has, or those of the start;
/// then more of them, each with the weights of where the one before ended, until one lowers the sum
/// of squares by less than 0.1, eight at most. Where no weights can be had the search ends.
///
/// With priors what they add is part of the cost in all of this. Their weight is the dispersion
/// that the stated noise makes in the first search (or that of the problem), then that of the
/// residuals (residual_dispersion()) where the search before ended, until it stays within 1 %.
///
/// A search on half the cells comes first, as the options say, of which the values are taken over
/// that do not end at a bound. Where that has no start it is left out.
///
/// `near`: equilibria to start from, where there are any; those of the end, after; there is no
/// search on half the cells then. Without it the
/// end is looked at from the start that simulate_mechanical() has by itself. Cells of half the
/// width start from the shapes on those of the fit.
MechanicalFitResult fit_mechanical(const MechanicalProblem& problem, const Fabric& start,
                                   const MechanicalFitOptions& options = {},
                                   const MechanicalFitObserver& observer = {},
                                   MechanicalShapes* near = nullptr);

/// No search: cost and intervals at `fabric`, as if a fit had ended there; weighed as the problem
/// is, or as at `fabric`. `shapes`: where to leave the equilibria.
MechanicalFitResult assess_mechanical(const MechanicalProblem& problem, const Fabric& fabric,
                                      const MechanicalFitOptions& options = {},
                                      MechanicalShapes* shapes = nullptr);
/// The same at the end of a fit that was stopped: what the mesh does, which takes as long as
/// several steps of the search, counts as unknown then.
MechanicalFitResult assess_stopped(const MechanicalProblem& problem, const Fabric& fabric,
                                   const MechanicalFitOptions& options,
                                   MechanicalShapes* shapes = nullptr);

}  // namespace weft
