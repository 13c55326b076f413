#pragma once
/// Fits of stiffness curves to mechanical tests that isolate one strain each (Miguel et al. 2012,
/// sections 5.2 and 6): component by component or all at once, with curves that are subdivided as
/// far as the measurement asks for it, in four variants.
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "weft/estimate/isolated_strain.h"
#include "weft/estimate/mechanical_fit.h"

namespace weft {

enum class FitOrder {
  joint,  ///< all parameters to all captures at once
  /// Where other components are searched beside bends, first weft and warp bend, roughly: what
  /// hangs hardly feels the stretch, but cloth between clips folds by how it bends. Then weft and
  /// warp stretch, then shear (by the forces along the clips), then weft and warp bend, each from
  /// the captures that isolate it, then the diagonal bend from those of all bends; then once more.
  /// The diagonal bend begins in the proportion to the other two that it has in the start. Where
  /// threads are stretched by a tenth more in the shear than in their own tests, curves that are
  /// subdivided get a control point there, which is found with the shear, from all components of
  /// its forces, and given back where the tests of stretch lose by it.
  incremental
};
/// "joint", "incremental". Throws Error for another name.
FitOrder fit_order_from_name(std::string_view name);

enum class CurveShape {
  as_given,    ///< the control points of the start
  linear,      ///< one control point each: the curves of the start at the middle of their knots
  subdivided,  ///< from one control point to as many as pay
  /// Where a curve pays, `most_points` of them, of a curve that is as rough as is most probable
  /// (WeighedPriors::add_smooth_curve()), with clips where they most probably are
  /// (MechanicalProblem::ClipPlaces). In the incremental order of stretch and shear, while bends,
  /// whose tests follow the cells more than noise, are subdivided; shear is found from all
  /// components of its forces, and after the first pass stretch and shear are found together.
  smooth
};
/// Whether curves are found that the start does not have.
constexpr bool finds_curves(CurveShape shape) {
  return shape == CurveShape::subdivided || shape == CurveShape::smooth;
}
enum class ThreadSymmetry {
  orthotropic,
  isotropic  ///< warp has the values of weft, in stretch and bend
};

struct CurveFitOptions {
  FitOrder order = FitOrder::incremental;
  CurveShape shape = CurveShape::as_given;
  ThreadSymmetry symmetry = ThreadSymmetry::orthotropic;
  int most_points = 5;  ///< control points of a subdivided curve, 1 to 8, of a smooth one 3 to 8
  /// Of the cost, that one more control point must bring, [0, 1), where points are compared beside
  /// forces of the forces' part of it (MechanicalProblem::force_share()); of n residuals it must
  /// also lower their sum of squares by ln n (Schwarz's criterion): less is noise. Where
  /// fit.mesh_error is included it must do both on cells of half the width, in the least cost to
  /// second order about the estimate: what pays on the cells of the fit alone follows their error.
  double least_reduction = 0.01;
  int passes = 2;  ///< of the incremental order, >= 1
  /// Without ties; `forces` is chosen by the order. Each step has the priors of the rows that it
  /// searches; costs that are compared have them with one weight.
  MechanicalCostOptions cost;
  MechanicalFitOptions fit;  ///< `first_cells`: of the first fit of a component
  int threads = 0;
  /// Evaluations are taken from there, or added; null: none are kept. Of fit_fingerprint().
  std::shared_ptr<MechanicalStore> store;
};

/// One least-squares fit on the way.
struct CurveFitStage {
  std::string name;  ///< "shear", "weft_bend, 3 points", "shear, half the cells", "all"
  int pass = 1;
  std::vector<std::string> captures;  ///< names of those that it was fitted to
  int points = 1;                     ///< control points of its curve
  /// False: one control point more than pays, or, in the incremental order, a constant that ran off
  /// to an end of its range and a diagonal bend that its tests do not determine; the parameters are
  /// those of before.
  bool kept = false;
  double cost_start = 0, cost = 0;
  /// On cells of half the width, with what priors add, where that was asked; else, and where it is
  /// not known, not a number.
  double finer_cost = std::numeric_limits<double>::quiet_NaN();
  std::size_t evaluations = 0;
  double wall_s = 0;
};

struct CurveFitResult {
  /// Of all captures and all free parameters together: the cost is the joint one whatever the
  /// order, its start infinite where `start` has no equilibrium; the history is that of all stages
  /// one after the other, each with its own cost.
  MechanicalFitResult fit;
  std::vector<std::string> free;  ///< parameters of the intervals
  std::vector<CurveFitStage> stages;
  /// Rows that were asked for, but that no capture isolates (incremental order).
  std::vector<std::string> without_test;
};

/// A hash of all that decides a fit of curves, for its MechanicalStore; `rows` as fit_curves()
/// takes them.
std::string fit_fingerprint(const std::vector<std::shared_ptr<const MechanicalTrial>>& trials,
                            const Fabric& start, const std::vector<std::string>& rows,
                            const CurveFitOptions& options);

/// After each evaluation, with the name of the stage; false stops.
using CurveFitObserver = std::function<bool(const std::string&, const MechanicalFitStep&)>;

/// Fits `rows` (of the model's table; a curve's values all together; empty: all that `start` has).
/// Where the start of a stage has no equilibrium its parameters are tried at 10, 1/10, 100 and
/// 1/100 times their values. Throws Error where none has, for rows that are not there, for a model
/// without components along the threads if the order is incremental, priors of rows that follow
/// others, and options out of range.
CurveFitResult fit_curves(const std::vector<std::shared_ptr<const MechanicalTrial>>& trials,
                          const Fabric& start, const std::vector<std::string>& rows,
                          const CurveFitOptions& options = {},
                          const CurveFitObserver& observer = {});

/// A stiffness curve with its band.
struct CurveBand {
  VecX strains, stiffness, lower, upper;
};
/// At `strains`, from the intervals of the control values and their correlation: to first order the
/// logarithm of k moves by the sum of (dk/dk_j) k_j / k times that of k_j. Where an interval is
/// missing or not determined the band reaches from 0 to infinity; a row that was not searched has
/// none (lower = upper = stiffness). Throws Error for a row that may not be a curve.
CurveBand curve_band(const MechanicalFitResult& fit, std::string_view row, const VecX& strains);

}  // namespace weft
