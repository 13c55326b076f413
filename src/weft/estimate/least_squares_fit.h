#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "weft/estimate/fit.h"
#include "weft/estimate/linearize_trial.h"

namespace weft {

/// One pass of least squares over all candidates that are left.
struct FitStage {
  int frames = 0;     ///< compared of each trial, the first ones; 0: all
  int survivors = 1;  ///< the best candidates that go on to it
  int max_iterations = 10;
  double silhouette_sigma = 3;  ///< px
  double fold_scale = 1;        ///< rad
  /// The cost is raised by this part of its value for every unit of squared distance from the
  /// middle of the ranges (scaled coordinates; from the initial fabric with Start::initial): what
  /// few frames do not determine stays out of the corners, from where later frames would have to
  /// fetch it back.
  double pull = 0.05;
  double phase_weight = 0;  ///< of the stripes' phase (ResidualOptions)
  /// Of the folds (ResidualOptions); 0: the silhouette alone, whose way down is smoother. A model
  /// that cannot fold as the cloth does ends lower that way, one that can ends higher. 1 where a
  /// trial's alpha is 0.
  double fold_weight = 1;
  /// Points that are drawn about the candidates in turn, before the first frames of the stage are
  /// compared, each coordinate by up to `scatter` of its range: in a motion that snaps from one
  /// shape to another neighbours take different ways, and what fewer frames say does not tell
  /// which. Those count whose error is a tenth smaller than any candidate's.
  int scattered = 0;
  double scatter = 0.07;
};

/// After the stages, on all frames. The error along a valley is rough, and a descent ends in its
/// first dent: in each round points are drawn about the best so far by the curvature there
/// (draw_by_curvature()), and descents begin at the best of them.
struct HopOptions {
  int rounds = 0;  ///< at most; >= 0
  /// Iterations of the last stage, at most, where hops follow: they go on faster than it would. >=
  /// 1
  int steps_before = 1;
  int drawn = 10;  ///< points a round, >= 1
  CurvatureDraw draw;
  int descents = 1;          ///< a round, >= 1
  int max_iterations = 4;    ///< of each, >= 1
  double least_gain = 1e-3;  ///< of the error: a round that gains less is fruitless; >= 0
  int patience = 2;          ///< so many fruitless rounds in turn are the last ones; >= 1
};

struct LeastSquaresFitOptions {
  /// A Latin hypercube of this many points over `screening_parameters` (where free; the others as
  /// the pull has them) and the start itself are compared on `screening_frames` frames; 0: no
  /// screening.
  int screening_points = 15;
  int screening_frames = 5;
  std::vector<std::string> screening_parameters{"bend_stiffness", "stretch_stiffness",
                                                "shear_stiffness"};
  std::vector<FitStage> stages{
      {.frames = 10, .survivors = 4, .max_iterations = 5, .silhouette_sigma = 6},
      {.frames = 25, .survivors = 2, .max_iterations = 6, .silhouette_sigma = 4},
      {.survivors = 2, .max_iterations = 8, .scattered = 24}};
  HopOptions hops;  ///< with the losses and the pull of the last stage
  FitOptions::Start start = FitOptions::Start::middle;
  /// Its max_iterations is that of the stage. The error over a motion is rough: of the steps that
  /// pay most follow three or four that do not.
  LeastSquaresOptions solver{.raise = 4};
  LinearizationOptions linearization;  ///< its frames, losses and threads are overwritten
  std::uint64_t seed = 1;
  std::optional<std::uint64_t> start_seed;  ///< of Start::random; none: seed
  int threads = 0;                          ///< 0: all cores; the result does not depend on it
};

/// Fits the free parameters of `problem` by least squares through the derivatives of the motion,
/// from coarse to fine: screening on a few frames, then LevenbergMarquardt stage by stage over more
/// frames and narrower losses, then from points about its end. The estimate is the point with the
/// smallest ProblemEvaluation::error (the paper's) of all that were evaluated on all frames; where
/// the fit is stopped before a stage has them, the best of fewer frames is evaluated so first.
/// FitResult::start is where the last stage started (FitResult::initial if it was stopped before);
/// there are no variability curves. Before each stage the best candidate, and those that have the
/// same starts, are given those that suit it (with_starts_for), and again after the last, which is
/// gone through again if they are others. After each stage they are replaced by equilibria of the
/// best candidate (with_settled_starts). Of the candidates that go on to a stage one at least has
/// the starts that were given, settled, unless only one goes on. FitResult::compared has the starts
/// of the estimate. Evaluations are added to `store`, costs and linearizations of the descents,
/// too, and replayed from it. Deterministic for a seed, whatever the number of threads. Throws
/// Error for options out of range and for a problem with an evaluator of its own.
FitResult run_least_squares_fit(const Problem& problem, const LeastSquaresFitOptions& options = {},
                                EvaluationStore* store = nullptr, const FitObserver& observer = {});

/// Least squares and hops, as often as is asked for, then annealing from the best end, if it is
/// asked for. Where cloth snaps from one shape to another the error of a long motion is rough at a
/// scale far below what the data resolve, and a descent ends in the first dent; what hops do about
/// it annealing in a small simplex does more slowly.
struct AutoFitOptions {
  AutoFitOptions();  ///< sets hops to 4 rounds, and annealing to 0 evaluations in a simplex of 0.1

  LeastSquaresFitOptions least_squares;
  /// Whole ones, one after the other, with the seeds that follow; the best is kept. >= 1. Each ends
  /// in a dent of the error, not seldom of another valley: what several agree on is more than what
  /// the derivatives at one end say.
  int searches = 1;
  /// Its start and coarse search are overwritten; annealing.max_evaluations 0: no annealing.
  FitOptions annealing;
};
/// Starts that suit the annealing's end better are taken where they lower the error.
/// History and counts are those of all parts together; FitResult::start is where the least squares
/// that were kept ended. Throws what run_least_squares_fit() and run_fit() throw, and Error for
/// searches out of range.
FitResult run_auto_fit(const Problem& problem, const AutoFitOptions& options = {},
                       EvaluationStore* store = nullptr, const FitObserver& observer = {});

}  // namespace weft
