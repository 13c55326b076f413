#pragma once
/// The fabric, an orthotropic sheet or of another elastic model, that explains scanned shapes and
/// the forces at their clamps (Larionov et al. 2022, section 3.4, equations 7 and 8).
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "weft/estimate/least_squares.h"
#include "weft/estimate/linearize_trial.h"
#include "weft/estimate/mesh_error.h"
#include "weft/estimate/number_store.h"
#include "weft/estimate/residual_intervals.h"
#include "weft/estimate/scan_trial.h"
#include "weft/estimate/shared_errors.h"
#include "weft/estimate/weighed_priors.h"

namespace weft {

/// An unknown: a number that one value of the fabric is, or several are in proportion to.
struct ScanParameter {
  ParameterInfo info;
  std::vector<std::pair<int, double>> values;  ///< index of Fabric::values, factor
  bool bending = false;
};
/// A value of the fabric by its name, or of the model "stvk" "bend": the paper's b, one flexural
/// rigidity for all directions (bend_uu = bend_vv = b, bend_twist = b / 2, bend_uv =
/// kNoBendCoupling). The feasible box of equation 7 is the ranges of the fabric; that of b is
/// bend_uu's. Throws Error for another name.
ScanParameter scan_parameter(const Fabric& fabric, const std::string& name);
/// Of "stvk" membrane_uu, membrane_vv, membrane_uv, membrane_shear, bend: C00, C11, C01, C22, b. Of
/// another model its stiffnesses: values in N/m and N m.
std::vector<std::string> default_scan_parameters(const Fabric& fabric);

/// What divides the two kinds of residuals, shape and forces, before their squares are added.
enum class ScanBalance {
  /// The noise of each: of a descriptor's entry to first order from that of the coordinates, of a
  /// force as stated. What is minimized is then minus the logarithm of the likelihood.
  noise,
  /// Also what the model lacks: after a fit with `noise`, the noise of each target, of its shape
  /// and
  /// of its forces, is multiplied by the root mean square of what is left of its shape, where that
  /// is above 1, and the fit goes on; four times. A target that the model cannot reach, because it
  /// wrinkles more finely than the mesh or otherwise than the start, then does not outweigh those
  /// that it can. (The few forces of a target are too few to say how large their own error is.)
  residual,
};
ScanBalance scan_balance_from_name(std::string_view name);

struct ScanCostOptions {
  /// Of the model "stvk", Poisson's ratios above are penalized: (max(0, nu - limit) / tolerance)^2
  /// is added to the mean square. The paper adds 1e8 max(0, nu - 0.5).
  double poisson_limit = 0.5;
  double poisson_tolerance = 1e-3;
  /// N: a target whose largest net force is above counts as without equilibrium.
  double largest_residual = 1e-5;
  /// Of values of the fabric; those that no unknown moves have no effect.
  std::vector<ParameterPrior> priors{};
};

/// The mean over all residuals of their squares, with the penalty. Priors are no part of it: a fit
/// adds them.
class ScanProblem {
 public:
  /// `fabric`: its values where nothing is searched, its ranges as the box. Throws Error for no
  /// parameters, ones that overlap, options out of range, no targets, a model that the solver does
  /// not take, and descriptors of the energy for another model than "stvk".
  ScanProblem(std::vector<std::shared_ptr<const ScanTrial>> trials,
              std::shared_ptr<const EquilibriumSolver> solver, Fabric fabric,
              const std::vector<std::string>& free, const ScanCostOptions& options = {},
              int threads = 0);

  int dimension() const { return static_cast<int>(parameters_.size()); }
  const std::vector<ScanParameter>& parameters() const { return parameters_; }
  std::vector<ParameterInfo> infos() const;
  const std::vector<std::shared_ptr<const ScanTrial>>& trials() const { return trials_; }
  const EquilibriumSolver& solver() const { return *solver_; }
  /// Numbers that are compared; those of a descriptor as its weights count
  /// (ShapeDescriptor::counted).
  double residual_count() const { return residual_count_; }
  int threads() const { return threads_; }
  /// The same on cells of half the width (scan_trial.h). Nothing of it is kept in a store. Throws
  /// Error where these would be more than may be.
  ScanProblem refined() const;
  /// The same by another solver. Nothing of it is kept in a store.
  ScanProblem solved_by(std::shared_ptr<const EquilibriumSolver> solver) const;
  VecX scaled(const Fabric& fabric) const;
  Fabric fabric(const VecX& scaled) const;

  /// Weighed as if residuals scattered as stated, until weigh_priors() says otherwise.
  const WeighedPriors& priors() const { return priors_; }
  void weigh_priors(double weight) { priors_.weigh(weight); }

  /// Factors on the noise of each target, >= 1; ones at first.
  void set_scales(VecX scales) { scales_ = std::move(scales); }
  const VecX& scales() const { return scales_; }
  VecX no_scales() const { return VecX::Ones(static_cast<Eigen::Index>(trials_.size())); }

  /// From then on residuals are weighed as the errors of where clamps are held make them scatter
  /// about this fabric (ScanTrial::clamp_errors, response_of_scan(), shared_errors.h): the force of
  /// a stiff cloth hangs on micrometres that a scan does not see. Not at first. Where there is no
  /// equilibrium nothing changes.
  void take_clamp_errors_at(const VecX& scaled);

  /// Infinity where a target has no equilibrium or the solver refuses the values; `reason` says
  /// which.
  double cost(const VecX& scaled, std::string* reason = nullptr) const;
  struct Linearization {
    QuadraticModel model;
    std::vector<CostPart> parts;  ///< of each target its shape and, where measured, its forces
    int inexact = 0;              ///< targets with inexact derivatives
    /// Root mean square of the residuals, in units of the stated noise.
    double shape_rms = 0, force_rms = 0;
    VecX target_rms;     ///< of the shape of each target
    std::string reason;  ///< where the cost is infinite, as of cost()
  };
  Linearization linearize(const VecX& scaled) const;

  /// A hash of all that decides cost and derivatives: targets, solver, fabric, parameters, options.
  std::string fingerprint() const;
  /// Finite costs and their linearizations are then taken from there, or added. The store must be
  /// of this problem's fingerprint().
  void keep_in(std::shared_ptr<NumberStore> store) { store_ = std::move(store); }
  /// Costs and linearizations that were taken from there.
  std::size_t replayed() const { return store_ ? store_->replayed() : 0; }

 private:
  std::string key(const char* what, const VecX& scaled) const;
  double compute_cost(const VecX& scaled, std::string* reason) const;
  Linearization compute_linearization(const VecX& scaled) const;
  struct Residuals {
    VecX shape, force;
    MatX shape_jacobian, force_jacobian;  ///< by the values of the fabric
  };
  Residuals residuals(std::size_t trial, const ScanSimulation& simulation, const Fabric& fabric,
                      HeldDerivatives derivatives) const;
  bool simulate(const VecX& scaled, HeldDerivatives derivatives,
                std::vector<ScanSimulation>& simulations, std::string* reason) const;
  MatX by_scaled(const VecX& scaled, const MatX& by_values) const;
  /// The penalty as a residual and its gradient by the values of the fabric.
  double penalty(const Fabric& fabric, VecX* gradient) const;
  /// What the clamps' errors do to the residuals of a target, its shape's and then its forces', in
  /// units of the stated noise; a column for each.
  MatX by_clamp_errors(std::size_t trial, const ScanSimulation& simulation,
                       const Fabric& fabric) const;

  std::vector<std::shared_ptr<const ScanTrial>> trials_;
  std::shared_ptr<const EquilibriumSolver> solver_;
  Fabric fabric_;
  std::vector<ScanParameter> parameters_;
  ScanCostOptions options_;
  int threads_ = 0;
  VecX scales_;
  std::vector<VecX> shape_noise_;
  VecX clamp_errors_at_;                     ///< empty: not taken
  std::vector<SharedErrors> shared_errors_;  ///< of each target, then
  WeighedPriors priors_;
  double residual_count_ = 0;
  std::shared_ptr<NumberStore> store_;
};

enum class ScanSchedule {
  together,     ///< all parameters at once
  alternating,  ///< bending, then membrane; repeated (section 5 of the paper)
};
ScanSchedule scan_schedule_from_name(std::string_view name);

struct ScanFitOptions {
  ScanFitOptions() {
    least_squares.max_iterations = 40;
    least_squares.step_tolerance = 1e-6;
    least_squares.cost_tolerance = 1e-5;
    least_squares.initial_damping = 1e-6;
    least_squares.largest_step = 0.1;
  }
  LeastSquaresOptions least_squares;  ///< of each descent
  ScanSchedule schedule = ScanSchedule::together;
  int rounds = 3;  ///< of `alternating`, >= 1
  ScanBalance balance = ScanBalance::residual;
  int random_starts = 0;  ///< besides the given start, >= 0; the best end is the result
  double spread = 3;      ///< they lie within this factor of the start, > 1
  std::uint64_t seed = 1;
  double confidence = 0.9;
  MeshError mesh_error = MeshError::left_out;
  /// Of both evaluations that tell the mesh's error, on the fit's cells and on finer ones; null:
  /// the problem's. For solvers that take long on fine meshes.
  std::shared_ptr<const EquilibriumSolver> mesh_solver;
};

struct ScanFitStep {
  std::size_t evaluation = 0;  ///< from 1
  double cost = 0, best = 0;   ///< with what priors add
  std::string phase;           ///< "start 1, bending 2", ...
  bool replayed = false;       ///< taken from the store
};
struct ScanFitEnd {
  Fabric start, fabric;
  /// Of the data, with its noise as stated; at the end with the clamps' errors as about the end of
  /// the first start, in ScanFitResult as about its own.
  double cost_start = 0, cost = 0;
  int iterations = 0;  ///< linearizations
};
struct ScanFitResult {
  Fabric start, fabric;
  double cost_start = 0, cost = 0;  ///< of the data
  /// Of the priors where the search ended, and what they add to the cost there; 0 without priors.
  double prior_weight = 0, prior_error = 0;
  int iterations = 0;           ///< linearizations of the descent that led to `fabric`
  std::size_t evaluations = 0;  ///< of all descents, of all targets, with or without derivatives
  std::size_t replayed = 0;     ///< of these, taken from the store
  std::vector<ScanFitStep> history;
  std::vector<ScanFitEnd> ends;  ///< one a start, the given one first
  std::vector<ParameterInterval> intervals;
  MeshShift mesh;  ///< with MeshError::included; in the intervals where it is known
  ResidualCertainty certainty;
  int inexact = 0;
  double shape_rms = 0, force_rms = 0;  ///< at the end, in units of the noise
  VecX scales;                          ///< factors on the noise of the targets
  bool stopped = false;
  double wall_s = 0;
};
using ScanFitObserver = std::function<bool(const ScanFitStep&)>;

/// Bounded Levenberg-Marquardt (least_squares.h) on the exact sensitivities. Ceres, which the paper
/// uses, would see the same residuals: here five numbers are searched, the Jacobian's product is
/// all that is needed, bounds are met exactly, and the intervals want the Gauss-Newton matrix of
/// each part.
///
/// A descent also ends after two steps in a row that lower the sum of squares by less than 0.01.
/// Residuals are weighed by what the scan's noise leaves open of where clamps are held
/// (take_clamp_errors_at()), first about the start, then about where the descent before ended, for
/// which there are four more descents at most, with those that balance.
///
/// With priors what they add is part of the cost. Their weight is the dispersion that the noise
/// makes in the first descent, then that of the residuals (residual_dispersion()) where the one
/// before ended: four more descents at most, with those that balance. Of several starts the end
/// of least cost with priors counts, all with the weight that the first one's residuals have.
///
/// Throws Error if the given start has no equilibrium; a random start without one is left out.
ScanFitResult fit_scan(ScanProblem problem, const Fabric& start, const ScanFitOptions& options = {},
                       const ScanFitObserver& observer = {});

}  // namespace weft
