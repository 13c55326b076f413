#include "weft/estimate/weighed_priors.h"

#include <cmath>

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

/// What is known of a roughness before: it is within this factor of 1 in 68 % of cases.
constexpr double kRoughnessFactor = 2.5;
/// Steps of the roughness within 1e-2 and 1e2.
constexpr int kRoughnessSteps = 40;
double roughness_at(int step) { return std::pow(10, -2 + 4.0 * step / kRoughnessSteps); }

/// Logarithms of a curve's values.
VecX logarithms(const Fabric& fabric, std::string_view row) {
  return fabric.values.segment(fabric.first_value(row), fabric.value_count(row)).array().log();
}

/// Of values at knots: sqrt(h_i) d_i (add_smooth_curve()).
MatX bends_by_values(const VecX& knots) {
  const Eigen::Index n = knots.size();
  const VecX u = (knots.array() - knots[0]) / (knots[n - 1] - knots[0]);
  MatX bends = MatX::Zero(n - 2, n);
  for (Eigen::Index i = 1; i + 1 < n; ++i) {
    const double before = u[i] - u[i - 1], after = u[i + 1] - u[i], h = 0.5 * (before + after);
    bends.row(i - 1).segment<3>(i - 1) << 1 / before, -1 / before - 1 / after, 1 / after;
    bends.row(i - 1) /= std::sqrt(h);
  }
  return bends;
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

void WeighedPriors::add_smooth_curve(std::string_view row,
                                     const std::function<Fabric(const VecX&)>& fabric,
                                     int dimension) {
  const Fabric at_zero = fabric(VecX::Zero(dimension));
  if (at_zero.value_count(row) < 3) return;
  const MatX bends = bends_by_values(at_zero.curve(row).knots());
  const VecX t = logarithms(at_zero, row);
  SmoothCurve added{std::string(row), MatX(bends.rows(), dimension), bends * t};
  for (int i = 0; i < dimension; ++i)
    added.slopes.col(i) = bends * (logarithms(fabric(VecX::Unit(dimension, i)), row) - t);
  if (!added.slopes.isZero(0)) curves_.push_back(std::move(added));
}

WeighedPriors::Roughness WeighedPriors::roughness() const {
  Roughness all;
  for (const SmoothCurve& curve : curves_) all.emplace(curve.row, curve.roughness);
  return all;
}

void WeighedPriors::roughen_by(const Roughness& roughness) {
  for (SmoothCurve& curve : curves_)
    if (const auto found = roughness.find(curve.row); found != roughness.end())
      curve.roughness = found->second;
}

WeighedPriors::Roughness WeighedPriors::most_probable_roughness(const VecX& scaled,
                                                                const QuadraticModel& data) const {
  WeighedPriors tried = *this;
  const auto log_evidence = [&] {
    QuadraticModel all = data;
    tried.add_to(scaled, all);
    const Eigen::LDLT<MatX> factor(all.hessian / weight_);
    const VecX pivots = factor.vectorD();
    if (factor.info() != Eigen::Success || !(pivots.minCoeff() > 0)) return -kInfinity;
    // The least is evaluated where it is: far from it the terms of the prior are huge and cancel.
    const VecX step = -factor.solve(all.gradient / weight_);
    const double least = data.gradient.dot(step) + 0.5 * step.dot(data.hessian * step) +
                         tried.cost(scaled.head(step.size()) + step);
    double value = -least / weight_ - 0.5 * pivots.array().log().sum();
    for (const SmoothCurve& curve : tried.curves_) {
      const double logarithm = std::log(curve.roughness);
      value -= static_cast<double>(curve.offset.size()) * logarithm +
               0.5 * std::pow(logarithm / std::log(kRoughnessFactor), 2);
    }
    return value;
  };
  for (int sweep = 0; sweep < 2; ++sweep)
    for (SmoothCurve& curve : tried.curves_) {
      double best = -kInfinity, found = curve.roughness;
      for (int step = 0; step <= kRoughnessSteps; ++step) {
        curve.roughness = roughness_at(step);
        const double value = log_evidence();
        if (value > best) {
          best = value;
          found = curve.roughness;
        }
      }
      curve.roughness = found;
    }
  return tried.roughness();
}

double WeighedPriors::cost(const VecX& scaled) const {
  double sum = 0;
  for (const Row& row : rows_) sum += 0.5 * row.z(scaled) * row.z(scaled);
  for (const SmoothCurve& curve : curves_)
    sum += 0.5 * curve.bends(scaled).squaredNorm() / (curve.roughness * curve.roughness);
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
  for (const SmoothCurve& curve : curves_) {
    const MatX slopes = curve.slopes / curve.roughness;
    const Eigen::Index n = slopes.cols();
    gradient.head(n) += slopes.transpose() * curve.bends(scaled) / curve.roughness;
    precision.topLeftCorner(n, n) += slopes.transpose() * slopes;
  }
  return {weight() * gradient, weight() * precision, weight() * weight() * precision};
}

void WeighedPriors::add_to(ContentHash& hash) const {
  for (const Row& row : rows_) {
    hash.add(row.slope);
    hash.add(row.offset);
    hash.add(row.deviation);
  }
  for (const SmoothCurve& curve : curves_) {
    hash.add(curve.slopes);
    hash.add(curve.offset);
  }
}

}  // namespace weft
