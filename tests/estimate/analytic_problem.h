#pragma once
#include <atomic>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>

#include "weft/estimate/problem.h"

namespace weft {

/// A problem whose error is a formula of the scaled coordinates: no simulation, no images. The
/// fabric has the optional terms that are free.
inline Problem analytic_problem(const std::vector<std::string>& free,
                                const std::function<double(const VecX& scaled)>& error,
                                std::atomic<int>* calls = nullptr) {
  Fabric initial = Fabric::with_defaults("test");
  for (const std::string& name : free) initial.include(name);
  auto trial = std::make_shared<Trial>();
  trial->capture.name = "analytic";
  const auto scale =
      std::make_shared<Problem>(std::vector<std::shared_ptr<const Trial>>{trial}, initial, free);
  const Evaluator evaluator = [=](const Fabric& fabric, int) {
    if (calls) ++*calls;
    ProblemEvaluation evaluation;
    evaluation.error = error(scale->scaled(fabric));
    evaluation.error_per_frame = 1000 * evaluation.error;
    evaluation.diverged = std::isinf(evaluation.error);
    return evaluation;
  };
  return Problem({trial}, initial, free, evaluator);
}

/// Quadratic about `target` with a ripple that has many local minima; smallest (1) at `target`.
inline double rippled_bowl(const VecX& scaled, const VecX& target) {
  double sum = 1;
  for (Eigen::Index i = 0; i < scaled.size(); ++i) {
    const double d = scaled[i] - target[i];
    sum += 4 * d * d + 0.02 * (1 - std::cos(2 * std::numbers::pi * d / 0.15));
  }
  return sum;
}

}  // namespace weft
