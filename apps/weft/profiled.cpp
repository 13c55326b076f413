#include "profiled.h"

#include <fmt/format.h>

#include <memory>

#include "weft/base/error.h"
#include "weft/estimate/linearize_trial.h"
#include "weft/estimate/mechanical_fit.h"

namespace weft::app {
namespace {

constexpr double kConfidence = 0.9;
/// At rest costs are smooth, but for the net forces that are left at equilibria.
constexpr double kLeastStep = 1e-5;

/// Each profile begins with the model at the estimate.
LinearizeFunction beginning_with(const VecX& estimate, QuadraticModel here,
                                 LinearizeFunction elsewhere) {
  return [estimate, here = std::move(here), elsewhere = std::move(elsewhere)](const VecX& x) {
    return x == estimate ? here : elsewhere(x);
  };
}

/// Dispersion and quantile of a cost that is the mean of squares.
void weigh(const ResidualCertainty& certainty, Profiled& profiled) {
  profiled.dispersion = certainty.dispersion * certainty.overdispersion;
  profiled.quantile = residual_quantile(certainty);
  profiled.least_step = kLeastStep;
}

/// Equilibria of a fit's tests start from those of the point before, or, where that is nearer, from
/// those at the estimate.
class TestsAbout {
 public:
  TestsAbout(MechanicalProblem problem, VecX estimate, MechanicalShapes there)
      : problem_(std::move(problem)),
        estimate_(std::move(estimate)),
        there_(std::move(there)),
        last_(estimate_),
        shapes_(there_) {}
  QuadraticModel linearize(const VecX& x) {
    shapes_ = near(x);
    const QuadraticModel model = problem_.linearize(x, &shapes_).model;
    last_ = x;
    return model;
  }
  double cost(const VecX& x) const {
    MechanicalShapes shapes = near(x);
    return problem_.cost(x, nullptr, &shapes);
  }

 private:
  MechanicalShapes near(const VecX& x) const {
    const bool back = shapes_.empty() || (x - estimate_).norm() < (x - last_).norm();
    return back ? there_ : shapes_;
  }

  MechanicalProblem problem_;
  VecX estimate_;
  MechanicalShapes there_;  ///< at the estimate
  VecX last_;               ///< of the last linearization
  MechanicalShapes shapes_;
};

}  // namespace

Profiled profiled_videos(const std::vector<std::string>& captures, const Fabric& fabric,
                         const TrialArguments& trial) {
  require_motion_model(fabric);
  const auto problem = std::make_shared<Problem>(
      trial.prepare_for(fabric, read_captures(captures), TrialArguments::Frames::fit), fabric,
      fabric.value_names());
  LinearizationOptions options;
  options.threads = trial.threads();
  Profiled profiled;
  for (int i = 0; i < problem->dimension(); ++i) profiled.infos.push_back(problem->info(i));
  profiled.estimate = problem->scaled(fabric);
  const std::vector<PatchPart> parts = linearize_patches(*problem, profiled.estimate, options);
  if (frames_of(parts).size() < 2)
    throw Error("profile: at least two frames with this fabric are needed");
  const Uncertainty sure = estimate_uncertainty(*problem, profiled.estimate, parts);
  profiled.intervals = sure.parameters;
  profiled.dispersion = sure.dispersion;
  profiled.quantile = student_quantile(0.5 + 0.5 * sure.confidence, sure.clusters - 1);
  profiled.least_step = least_profile_step_of_video;
  profiled.linearize = beginning_with(
      profiled.estimate, linearize(*problem, profiled.estimate, options).model,
      [problem, options](const VecX& x) { return linearize(*problem, x, options).model; });
  profiled.cost = [problem, options](const VecX& x) {
    return evaluate_cost(*problem, x, options).cost;
  };
  return profiled;
}

Profiled profiled_tests(const MechanicalFitArguments& arguments, const Fabric& fabric) {
  MechanicalProblem problem(prepare_tests(arguments), fabric, names_at_rest(fabric),
                            cost_options(arguments), arguments.threads);
  MechanicalShapes shapes("end");
  const MechanicalFitResult found = assess_mechanical(problem, fabric, {}, &shapes);
  if (found.intervals.empty())
    throw Error(
        "profile: this fabric has no equilibrium in one of the captures; `weft evaluate` "
        "says in which frame");
  problem.weigh_by(found.weights);
  Profiled profiled;
  for (int i = 0; i < problem.dimension(); ++i) profiled.infos.push_back(problem.info(i));
  profiled.estimate = problem.scaled(fabric);
  profiled.intervals = found.intervals;
  weigh(found.certainty, profiled);
  const auto tests = std::make_shared<TestsAbout>(problem, profiled.estimate, shapes);
  profiled.linearize = beginning_with(profiled.estimate, tests->linearize(profiled.estimate),
                                      [tests](const VecX& x) { return tests->linearize(x); });
  profiled.cost = [tests](const VecX& x) { return tests->cost(x); };
  return profiled;
}

Profiled profiled_scans(const ScanFitArguments& arguments, const Fabric& fabric) {
  const auto problem = std::make_shared<ScanProblem>(prepare_scans(arguments), arguments.solver,
                                                     fabric, default_scan_parameters(fabric),
                                                     ScanCostOptions{}, arguments.threads);
  Profiled profiled;
  profiled.infos = problem->infos();
  profiled.estimate = problem->scaled(fabric);
  problem->take_clamp_errors_at(profiled.estimate);
  ScanProblem::Linearization here = problem->linearize(profiled.estimate);
  if (std::isfinite(here.model.cost) &&
      scan_balance_from_name(arguments.balance) == ScanBalance::residual) {
    problem->set_scales(here.target_rms.cwiseMax(1));
    here = problem->linearize(profiled.estimate);
  }
  if (!std::isfinite(here.model.cost)) throw Error("profile: " + here.reason);
  ResidualIntervals found = residual_intervals(profiled.infos, profiled.estimate, here.model,
                                               here.parts, problem->residual_count(), kConfidence);
  profiled.intervals = std::move(found.intervals);
  weigh(found.certainty, profiled);
  profiled.linearize = beginning_with(profiled.estimate, here.model, [problem](const VecX& x) {
    return problem->linearize(x).model;
  });
  profiled.cost = [problem](const VecX& x) { return problem->cost(x); };
  return profiled;
}

}  // namespace weft::app
