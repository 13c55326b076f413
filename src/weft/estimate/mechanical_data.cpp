#include "weft/estimate/mechanical_data.h"

#include <cmath>
#include <map>
#include <mutex>
#include <vector>

#include "weft/base/error.h"
#include "weft/estimate/residual_intervals.h"

namespace weft {
namespace {

/// What was computed before; searches ask for the same point again when they compare.
class Memory {
 public:
  template <class Compute>
  double operator()(const VecX& scaled, const Compute& compute) {
    const std::vector<double> key(scaled.begin(), scaled.end());
    {
      const std::lock_guard lock(mutex_);
      if (const auto found = known_.find(key); found != known_.end()) return found->second;
    }
    const double value = compute();
    const std::lock_guard lock(mutex_);
    return known_[key] = value;
  }

 private:
  std::mutex mutex_;
  std::map<std::vector<double>, double> known_;
};

/// Gradients scatter around zero with this variance, of that of independent residuals of variance
/// 1/2 (cluster_dispersion()).
double dispersion_at(const MechanicalProblem& problem, const VecX& estimate) {
  const MechanicalProblem::Linearization found = problem.linearize(estimate);
  if (!std::isfinite(found.model.cost))
    throw Error("the mechanical captures cannot be computed where they fit best by themselves");
  return residual_dispersion(found.parts, found.model.cost, problem.residual_count());
}

}  // namespace

OtherData mechanical_data(std::shared_ptr<const MechanicalProblem> problem, const VecX& estimate) {
  if (problem->weights().empty() && problem->has_clip_noise()) {
    MechanicalProblem weighed = *problem;
    weighed.weigh_by(problem->force_weights(estimate));
    problem = std::make_shared<MechanicalProblem>(std::move(weighed));
  }
  const double dispersion = dispersion_at(*problem, estimate);
  OtherData data;
  data.cost = [problem, dispersion, memory = std::make_shared<Memory>()](const VecX& scaled) {
    return (*memory)(scaled, [&] { return problem->cost(scaled) / dispersion; });
  };
  data.linearize = [problem, dispersion](const VecX& scaled) {
    QuadraticModel model = problem->linearize(scaled).model;
    model.cost /= dispersion;
    model.gradient /= dispersion;
    model.hessian /= dispersion;
    return model;
  };
  return data;
}

}  // namespace weft
