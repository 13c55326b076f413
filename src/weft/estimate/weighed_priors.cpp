#include "weft/estimate/weighed_priors.h"

#include "weft/estimate/content_hash.h"

namespace weft {
namespace {

/// Of the scaled coordinates of a row's values.
double mean_coordinate(const Fabric& fabric, int row) {
  double sum = 0;
  const int first = fabric.first_value(row), count = fabric.value_count(row);
  for (int i = first; i < first + count; ++i) sum += to_scaled(fabric.info(i), fabric.values[i]);
  return sum / count;
}

}  // namespace

WeighedPriors::WeighedPriors(const std::vector<ParameterPrior>& priors, int dimension,
                             const std::function<Fabric(const VecX& scaled)>& fabric, double weight)
    : weight_(weight) {
  if (priors.empty()) return;
  const VecX zero = VecX::Zero(dimension);
  const Fabric at_zero = fabric(zero);
  for (const ParameterPrior& prior : priors) {
    const int row = parameter_index(at_zero.model, prior.parameter);
    if (at_zero.value_count(row) == 0) continue;
    const ScaledPrior known = scaled_prior(at_zero.info(at_zero.first_value(row)), prior);
    const double t = mean_coordinate(at_zero, row);
    Row added{zero, t - known.mean, known.deviation};
    for (int i = 0; i < dimension; ++i)
      added.slope[i] = mean_coordinate(fabric(VecX::Unit(dimension, i)), row) - t;
    if (!added.slope.isZero(0)) rows_.push_back(std::move(added));
  }
}

double WeighedPriors::cost(const VecX& scaled) const {
  double sum = 0;
  for (const Row& row : rows_) sum += 0.5 * row.z(scaled) * row.z(scaled);
  return weight() * sum;
}

void WeighedPriors::add_to(const VecX& scaled, QuadraticModel& model) const {
  if (empty()) return;
  const PriorTerm added = term(scaled, model.gradient.size());
  model.cost += cost(scaled);
  model.gradient += added.gradient;
  model.hessian += added.hessian;
}

PriorTerm WeighedPriors::term(const VecX& scaled, Eigen::Index size) const {
  if (empty()) return {};
  VecX gradient = VecX::Zero(size);
  MatX precision = MatX::Zero(size, size);
  for (const Row& row : rows_) {
    const VecX slope = row.slope / row.deviation;
    const Eigen::Index n = slope.size();
    gradient.head(n) += row.z(scaled) * slope;
    precision.topLeftCorner(n, n) += slope * slope.transpose();
  }
  return {weight() * gradient, weight() * precision, weight() * weight() * precision};
}

void WeighedPriors::add_to(ContentHash& hash) const {
  for (const Row& row : rows_) {
    hash.add(row.slope);
    hash.add(row.offset);
    hash.add(row.deviation);
  }
}

}  // namespace weft
