#pragma once
#include <functional>
#include <vector>

#include "weft/base/random.h"
#include "weft/base/types.h"

namespace weft {

/// A sum of squares about a point x: its value, its gradient and its Gauss-Newton matrix. With
/// residuals r and Jacobian J (robust losses as weights W): cost r^T W r, gradient 2 J^T W r,
/// hessian 2 J^T W J; any common factor will do.
struct QuadraticModel {
  double cost = 0;  ///< infinity where x cannot be evaluated
  VecX gradient;
  MatX hessian;  ///< symmetric, positive semidefinite
};
using LinearizeFunction = std::function<QuadraticModel(const VecX& x)>;
/// The cost alone, cheaper; infinity where x cannot be evaluated.
using CostFunction = std::function<double(const VecX& x)>;

struct LeastSquaresOptions {
  int max_iterations = 30;        ///< linearizations, >= 1
  double step_tolerance = 1e-3;   ///< ends when no coordinate moves by more, >= 0
  double cost_tolerance = 1e-4;   ///< ends when a step lowers the cost by less than this part of it
  double initial_damping = 1e-3;  ///< lambda at the start, of the largest diagonal entry; > 0
  /// What the first of a row of steps that do not pay multiplies lambda by; each further one by
  /// twice what the one before did. > 1. Where the cost is rough a larger one finds the length of
  /// step that pays sooner.
  double raise = 2;
  double largest_step = 0.3;  ///< of any coordinate, > 0
};

enum class LeastSquaresEnd {
  small_step,
  small_reduction,
  max_iterations,
  stopped,         ///< by the observer
  start_infinite,  ///< nothing could be done
  /// A point that was reached has a cost but no linearization: the result is there.
  linearization_infinite,
};

struct LeastSquaresStep {
  int iteration = 0;  ///< from 1
  VecX x;             ///< that was tried
  double cost = 0;
  bool accepted = false;
  double damping = 0;
};
/// After each trial step; false stops.
using LeastSquaresObserver = std::function<bool(const LeastSquaresStep&)>;

/// Whether the steps of a descent still pay: not once two accepted ones in turn have lowered the
/// cost times the number of residuals, which is the sum of squares, by less than 0.01 each: far
/// inside the noise, where a parameter one standard deviation off costs 1.
class PayingSteps {
 public:
  /// `cost`: before the first step; infinite if it is not known, so that the first one pays.
  PayingSteps(double cost, double residual_count) : cost_(cost), residual_count_(residual_count) {}
  bool pay_after(const LeastSquaresStep& step);

 private:
  double cost_, residual_count_;
  int small_steps_ = 0;
};

struct LeastSquaresResult {
  VecX x;
  double cost = 0;
  int iterations = 0;   ///< linearizations
  int evaluations = 0;  ///< of the cost alone
  LeastSquaresEnd end = LeastSquaresEnd::max_iterations;
};

/// Minimizes over lower <= x <= upper by Levenberg and Marquardt's method: the step s minimizes the
/// model g^T s + s^T (H + lambda I) s / 2 over the box of the bounds and of |s_i| <= largest_step,
/// exactly (a quadratic program, solved by its active set), and lambda follows the agreement of
/// model and cost (Nielsen 1999). lambda multiplies the identity, not the diagonal of H:
/// coordinates are scaled to their ranges, and a direction that the data do not determine shall not
/// move. Where the cost is infinite (no equilibrium, say) the box is halved instead, and doubles
/// again with each step that is taken: how far is too far says nothing of the curvature.
///
/// Written for few unknowns and very many residuals: a video has millions, whose Jacobian is never
/// stored; its products are summed frame by frame. Ceres evaluates residual blocks with their
/// Jacobians and linearizes at every point it accepts or not; its interface for costs without
/// residuals has no Gauss-Newton matrix. The normal equations square the condition number: their
/// limit, at 1e-16, is directions 1e8 times weaker than the strongest, and far weaker ones are of
/// no use to an estimate.
///
/// `start` is clamped into the bounds. Throws Error for sizes that differ, bounds out of order and
/// options out of range.
LeastSquaresResult minimize_least_squares(const LinearizeFunction& linearize,
                                          const CostFunction& cost, const VecX& start,
                                          const VecX& lower, const VecX& upper,
                                          const LeastSquaresOptions& options = {},
                                          const LeastSquaresObserver& observer = {});

struct CurvatureDraw {
  double rise = 0.1;     ///< of the cost: what a drawn point is expected to lie above it; > 0
  double widest = 0.15;  ///< standard deviation along what the cost hardly feels; > 0
};

/// `count` points about x, whose model is given: normally distributed along the principal
/// directions of the hessian, each of which is expected to raise the parabola alike, so that they
/// lie along its valleys; clamped to [0, 1]. Throws Error for options out of range.
std::vector<VecX> draw_by_curvature(const VecX& x, const QuadraticModel& model, int count, Rng& rng,
                                    const CurvatureDraw& options = {});

/// The minimum of g^T s + s^T A s / 2 over lower <= s <= upper, with A symmetric positive definite
/// and lower <= 0 <= upper.
VecX minimize_in_box(const MatX& a, const VecX& g, const VecX& lower, const VecX& upper);

}  // namespace weft
