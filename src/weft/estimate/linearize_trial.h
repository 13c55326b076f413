#pragma once
#include <functional>
#include <vector>

#include "weft/dynamics/sensitivity.h"
#include "weft/estimate/least_squares.h"
#include "weft/estimate/problem.h"
#include "weft/objective/residuals.h"

namespace weft {

/// simulate_with_sensitivities(), or a stand-in.
using SensitivitySimulator = std::function<TrajectoryWithSensitivities(
    const Scene&, const Fabric&, const std::vector<int>& parameters, const SimulationOptions&,
    int threads)>;

/// How a problem is looked at as least squares.
struct LinearizationOptions {
  ResidualOptions residual;        ///< its alpha is overwritten by each trial's
  int frame_count = 0;             ///< compared frames of each trial, the first ones; 0: all
  int threads = 0;                 ///< 0: all cores; results do not depend on it
  SensitivitySimulator simulator;  ///< empty: simulate_with_sensitivities
  /// m rms over the vertices, per whole range of a parameter. The derivatives of a frame's
  /// positions are split into principal directions of the parameters (of D^T D). A direction that
  /// moves the cloth by less is taken not to move it at all, which saves its images: 1e-4 m are
  /// about a tenth of a pixel.
  double least_motion = 1e-4;
  /// m rms per range. Where cloth snaps from one shape to another, derivatives grow without bound
  /// and say nothing about steps of a useful size (the distance over which they hold shrinks as
  /// they grow). A direction with motion m counts by 1 / (1 + (m / this)^2) in its frame; infinity:
  /// fully.
  double unstable_motion = 2;
};

/// The cost of a fabric: like ProblemEvaluation::error (the mean over the trials, per masked pixel,
/// rad^2) with the losses of residuals.h in place of equations 5 and 6.
struct ProblemCost {
  double cost = 0;               ///< infinity if a simulation diverged
  ProblemEvaluation evaluation;  ///< the paper's numbers for the same frames
};
/// Part of the cost: gradients and matrices of all parts add up to those of the whole.
struct CostPart {
  std::size_t trial = 0;
  int frame = 0;  ///< compared frame of the trial, from 0
  VecX gradient;
  MatX hessian;
  /// Of the frame's sums over pixels in the cost: gradient and hessian are this times theirs.
  double factor = 1;
};
/// That of factor |residuals|^2, `jacobian` their derivatives by the scaled coordinates.
CostPart part_of_squares(std::size_t trial, int frame, double factor, const MatX& jacobian,
                         const VecX& residuals);
struct ProblemLinearization {
  ProblemEvaluation evaluation;
  QuadraticModel model;         ///< in scaled coordinates; empty if the cost is infinite
  std::vector<CostPart> parts;  ///< one a frame, in order
  long inexact = 0;             ///< Sensitivities::inexact, summed
};

ProblemCost evaluate_cost(const Problem& problem, const VecX& scaled,
                          const LinearizationOptions& options = {});
ProblemLinearization linearize(const Problem& problem, const VecX& scaled,
                               const LinearizationOptions& options = {});

/// d value / d scaled of a parameter.
double scaled_slope(const ParameterInfo& info, double scaled);

}  // namespace weft
