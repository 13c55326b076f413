#include "weft/estimate/problem.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "weft/base/error.h"
#include "weft/base/parallel.h"
#include "weft/estimate/content_hash.h"
#include "weft/estimate/evaluate_trial.h"

namespace weft {

Problem::Problem(std::vector<std::shared_ptr<const Trial>> trials, Fabric initial,
                 std::vector<std::string> free, Evaluator evaluator,
                 std::vector<ParameterPrior> priors, OtherData other)
    : trials_(std::move(trials)),
      initial_(std::move(initial)),
      free_(std::move(free)),
      priors_(std::move(priors)),
      other_(std::move(other)),
      evaluator_(std::move(evaluator)) {
  if (trials_.empty()) throw Error("no capture to fit");
  if (free_.empty()) throw Error("no parameter to search");
  for (const std::string& name : free_) {
    const int index = initial_.value_index(name);
    if (std::find(indices_.begin(), indices_.end(), index) != indices_.end())
      throw Error(fmt::format("parameter {} is listed twice", name));
    indices_.push_back(index);
    infos_.push_back(initial_.info(index));
  }
  prior_mean_ = VecX::Constant(dimension(), 0.5);
  prior_precision_ = VecX::Zero(dimension());
  for (const ParameterPrior& prior : priors_) {
    parameter_index(initial_.model, prior.parameter);  // throws for an unknown one
    const int i = index_of(prior.parameter);
    if (i < 0) continue;
    const ScaledPrior scaled = scaled_prior(info(i), prior);
    prior_mean_[i] = scaled.mean;
    prior_precision_[i] = 1 / (scaled.deviation * scaled.deviation);
  }
  ContentHash hash;
  hash.add(initial_.model);
  for (const auto& trial : trials_) add_trial(hash, *trial);
  fingerprint_ = hash.hex();
}

double Problem::prior_cost(const VecX& scaled, double weight) const {
  if (weight == 0 || !has_prior()) return 0;
  double cost = 0.5 * (scaled - prior_mean_).cwiseAbs2().dot(prior_precision_);
  if (other_.cost) cost += other_.cost(scaled);
  return weight * cost;
}

QuadraticModel Problem::prior_model(const VecX& scaled) const {
  const VecX gradient = prior_precision_.cwiseProduct(scaled - prior_mean_);
  QuadraticModel model{0.5 * (scaled - prior_mean_).dot(gradient), gradient,
                       prior_precision_.asDiagonal()};
  if (!other_.linearize) return model;
  const QuadraticModel other = other_.linearize(scaled);
  model.cost += other.cost;
  if (!std::isfinite(other.cost)) return model;
  model.gradient += other.gradient;
  model.hessian += other.hessian;
  return model;
}

Problem Problem::with_trials(std::vector<std::shared_ptr<const Trial>> trials) const {
  return {std::move(trials), initial_, free_, evaluator_, priors_, other_};
}

int Problem::index_of(std::string_view parameter) const {
  const auto at = std::find(free_.begin(), free_.end(), parameter);
  return at == free_.end() ? -1 : static_cast<int>(at - free_.begin());
}

VecX Problem::scaled(const Fabric& fabric) const {
  VecX scaled(dimension());
  for (int i = 0; i < dimension(); ++i)
    scaled[i] = to_scaled(info(i), fabric.values[indices_[static_cast<std::size_t>(i)]]);
  return scaled;
}

Fabric Problem::fabric(const VecX& scaled) const {
  Fabric fabric = initial_;
  for (int i = 0; i < dimension(); ++i) {
    const ParameterInfo& range = info(i);
    // Rounding of exp and log must not leave the range.
    fabric.values[indices_[static_cast<std::size_t>(i)]] =
        std::clamp(from_scaled(range, scaled[i]), range.lower, range.upper);
  }
  return fabric;
}

ProblemEvaluation evaluate(const Problem& problem, const Fabric& fabric, int frame_count,
                           int threads) {
  if (problem.evaluator()) return problem.evaluator()(fabric, frame_count);
  const auto& trials = problem.trials();
  std::vector<TrialEvaluation> evaluations(trials.size());
  const int inner = threads_each(trials.size(), threads);
  parallel_for(trials.size(), threads, [&](std::size_t i) {
    evaluations[i] = evaluate(*trials[i], fabric, frame_count, nullptr, inner);
  });

  ProblemEvaluation sum;
  const double share = 1 / double(trials.size());
  for (const TrialEvaluation& evaluation : evaluations) {
    sum.error += share * evaluation.error_per_mask_pixel;
    sum.error_per_frame += share * evaluation.error;
    sum.fold += share * evaluation.fold;
    sum.silhouette += share * evaluation.silhouette;
    sum.diverged = sum.diverged || evaluation.diverged;
    sum.wall_s += evaluation.wall_s;
  }
  return sum;
}

}  // namespace weft
