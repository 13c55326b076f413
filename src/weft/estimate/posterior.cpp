#include "weft/estimate/posterior.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "weft/base/dense.h"
#include "weft/base/error.h"
#include "weft/base/random.h"

namespace weft {
namespace {

constexpr double kStretch = 2;            // a of the stretch move
constexpr double kLargestCost = 20;       // exp(-20) is no density
constexpr std::size_t kMostPoints = 400;  // the correction costs their number each time
constexpr double kLengths[] = {0.05, 0.1, 0.2, 0.4};
constexpr double kNoises[] = {1e-3, 1e-2, 0.1, 1};  // variance, of the process's

class Ensemble {
 public:
  Ensemble(const LogDensity& density, const VecX& lower, const VecX& upper,
           const SamplingOptions& options, int walkers)
      : density_(density), lower_(lower), upper_(upper), rng_(options.seed), walkers_(walkers) {}

  void start(const VecX& x, double spread) {
    const double here = density_(x);
    if (!(here > -kInfinity)) throw Error("sampling: the start has no density");
    positions_.resize(x.size(), walkers_);
    values_.resize(walkers_);
    for (int k = 0; k < walkers_; ++k) {
      VecX tried(x.size());
      // Some draws may fall where there is no density; the start has some.
      for (int attempt = 0;; ++attempt) {
        if (attempt == 1000) throw Error("sampling: no density about the start");
        const double width = spread * std::pow(0.99, attempt);
        for (Eigen::Index i = 0; i < x.size(); ++i) tried[i] = x[i] + width * rng_.normal();
        tried = reflected(tried);
        values_[k] = density_(tried);
        if (values_[k] > -kInfinity) break;
      }
      positions_.col(k) = tried;
    }
  }

  /// Each walker once: one half moves along lines to the other. Returns the moves that were taken.
  int step() {
    const int half = walkers_ / 2;
    int accepted = 0;
    for (const int first : {0, half}) {
      const int others = first == 0 ? half : 0;
      for (int k = first; k < first + half; ++k) {
        const int partner = others + static_cast<int>(rng_.uniform() * half);
        accepted += move(k, partner);
      }
    }
    return accepted;
  }

  const MatX& positions() const { return positions_; }

 private:
  bool move(int k, int partner) {
    const double root =
        1 / std::sqrt(kStretch) + rng_.uniform() * (std::sqrt(kStretch) - 1 / std::sqrt(kStretch));
    const double z = root * root;
    const double threshold = std::log(std::max(rng_.uniform(), 1e-300));
    tried_ = positions_.col(partner) + z * (positions_.col(k) - positions_.col(partner));
    if ((tried_.array() < lower_.array()).any() || (tried_.array() > upper_.array()).any())
      return false;
    const double value = density_(tried_);
    const double ratio = double(tried_.size() - 1) * std::log(z) + value - values_[k];
    if (!(threshold < ratio)) return false;
    positions_.col(k) = tried_;
    values_[k] = value;
    return true;
  }

  VecX reflected(VecX x) const {
    for (Eigen::Index i = 0; i < x.size(); ++i) {
      if (x[i] < lower_[i]) x[i] = 2 * lower_[i] - x[i];
      if (x[i] > upper_[i]) x[i] = 2 * upper_[i] - x[i];
      x[i] = std::clamp(x[i], lower_[i], upper_[i]);
    }
    return x;
  }

  const LogDensity& density_;
  const VecX &lower_, &upper_;
  Rng rng_;
  int walkers_;
  MatX positions_;
  VecX values_, tried_;
};

/// Of coordinate i over the kept steps.
double autocorrelation_time(const MatX& samples, Eigen::Index i, int walkers) {
  const Eigen::Index steps = samples.cols() / walkers;
  MatX path(walkers, steps);
  for (Eigen::Index t = 0; t < steps; ++t)
    path.col(t) = samples.row(i).segment(t * walkers, walkers).transpose();
  path.array() -= path.mean();
  const double variance = path.squaredNorm() / double(path.size());
  if (!(variance > 0)) return double(steps);
  double time = 1;
  for (Eigen::Index lag = 1; lag < steps / 2; ++lag) {
    const double product =
        path.leftCols(steps - lag).cwiseProduct(path.rightCols(steps - lag)).sum();
    time += 2 * product / (double(walkers) * double(steps - lag) * variance);
    if (double(lag) >= 5 * time) break;
  }
  return std::max(time, 1.0);
}

void check(const VecX& start, const VecX& lower, const VecX& upper, const SamplingOptions& options,
           int walkers) {
  if (start.size() == 0 || lower.size() != start.size() || upper.size() != start.size())
    throw Error("sampling: start and bounds must have the same size, at least 1");
  if (!(lower.array() < upper.array()).all())
    throw Error("sampling: a lower bound is not below its upper bound");
  if (walkers % 2 != 0 || walkers <= 2 * start.size())
    throw Error("sampling: walkers must be even and more than twice the dimension");
  if (options.steps < 10 || options.burn_in < 0)
    throw Error("sampling: steps must be at least 10, burn_in at least 0");
  if (!(options.spread > 0)) throw Error("sampling: spread must be above 0");
}

}  // namespace

SamplingResult sample_ensemble(const LogDensity& density, const VecX& start, const VecX& lower,
                               const VecX& upper, const SamplingOptions& options,
                               const SamplingObserver& observer) {
  const auto n = static_cast<int>(start.size());
  const int walkers = options.walkers > 0 ? options.walkers : std::max(4 * n, 20);
  check(start, lower, upper, options, walkers);
  Ensemble ensemble(density, lower, upper, options, walkers);
  ensemble.start(start.cwiseMax(lower).cwiseMin(upper), options.spread);
  SamplingResult result;
  result.samples.resize(n, Eigen::Index(walkers) * options.steps);
  long accepted = 0;
  const int total = options.burn_in + options.steps;
  for (int step = 0; step < total; ++step) {
    const int moves = ensemble.step();
    const int kept = step - options.burn_in;
    if (kept >= 0) {
      accepted += moves;
      result.samples.middleCols(Eigen::Index(kept) * walkers, walkers) = ensemble.positions();
    }
    if (observer && !observer(static_cast<std::size_t>(step) + 1, static_cast<std::size_t>(total)))
      throw Error("sampling: stopped");
  }
  result.acceptance = double(accepted) / (double(walkers) * options.steps);
  result.autocorrelation.resize(n);
  for (Eigen::Index i = 0; i < n; ++i)
    result.autocorrelation[i] = autocorrelation_time(result.samples, i, walkers);
  return result;
}

LikelihoodSurrogate::LikelihoodSurrogate(VecX estimate, MatX information, VecX slope,
                                         const std::vector<LikelihoodPoint>& points)
    : estimate_(std::move(estimate)),
      information_(std::move(information)),
      slope_(std::move(slope)) {
  const Eigen::Index n = estimate_.size();
  if (information_.rows() != n || information_.cols() != n || slope_.size() != n)
    throw Error("surrogate: estimate, information and slope differ in size");
  std::vector<std::pair<double, const LikelihoodPoint*>> near;
  for (const LikelihoodPoint& point : points) {
    if (point.x.size() != n) throw Error("surrogate: an evaluation has another size");
    const double level = std::min(point.cost, quadratic(point.x));
    if (level < kLargestCost) near.emplace_back(level, &point);
  }
  std::ranges::stable_sort(near, {}, [](const auto& entry) { return entry.first; });
  if (near.size() > kMostPoints) near.resize(kMostPoints);
  points_.resize(n, static_cast<Eigen::Index>(near.size()));
  VecX differences(points_.cols());
  for (std::size_t k = 0; k < near.size(); ++k) {
    const auto column = static_cast<Eigen::Index>(k);
    points_.col(column) = near[k].second->x;
    // Far out, both are "no density": their difference, which may be huge, is not to be followed.
    const double cost = std::min(near[k].second->cost, 2 * kLargestCost);
    differences[column] = cost - std::min(quadratic(near[k].second->x), 2 * kLargestCost);
    least_ = std::min(least_, near[k].second->cost);
  }
  if (points_.cols() < 3) return;
  double best = differences.squaredNorm();  // of the quadratic alone
  for (const double length : kLengths) {
    for (const double noise : kNoises) {
      double score = 0;
      VecX weights;
      if (!fit(differences, length, noise, score, weights) || !(score < best)) continue;
      best = score;
      weights_ = weights;
      length_ = length;
    }
  }
}

/// `score`: sum of squares of the errors of predicting each point from the others, which is
/// [K^-1 y]_i / [K^-1]_ii (Rasmussen and Williams 2006, equation 5.12).
bool LikelihoodSurrogate::fit(const VecX& differences, double length, double noise, double& score,
                              VecX& weights) const {
  const Eigen::Index count = points_.cols();
  MatX matrix(count, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) {
      const double distance = (points_.col(i) - points_.col(j)).squaredNorm();
      matrix(i, j) = matrix(j, i) = std::exp(-0.5 * distance / (length * length));
    }
    matrix(i, i) += noise;
  }
  const std::optional<MatX> inverse = solve_positive(matrix, MatX::Identity(count, count));
  if (!inverse) return false;
  weights = *inverse * differences;
  score = weights.cwiseQuotient(inverse->diagonal()).squaredNorm();
  return std::isfinite(score);
}

double LikelihoodSurrogate::quadratic(const VecX& x) const {
  const VecX step = x - estimate_;
  return slope_.dot(step) + 0.5 * step.dot(information_ * step);
}

double LikelihoodSurrogate::cost(const VecX& x) const {
  const double uncorrected = quadratic(x);
  double cost = uncorrected;
  if (length_ > 0) {
    // As at the evaluations: beyond twice the largest cost there is no density either way.
    if (cost > 2 * kLargestCost) cost = 2 * kLargestCost + 0.1 * (cost - 2 * kLargestCost);
    for (Eigen::Index k = 0; k < points_.cols(); ++k)
      cost +=
          weights_[k] * std::exp(-0.5 * (points_.col(k) - x).squaredNorm() / (length_ * length_));
  }
  return std::max(cost, std::min(least_, uncorrected));
}

double sample_quantile(std::vector<double> values, double p) {
  if (values.empty()) throw Error("quantile: no values");
  if (!(p >= 0 && p <= 1)) throw Error("quantile: p must be in [0, 1]");
  std::ranges::sort(values);
  const double at = p * double(values.size() - 1);
  const auto below = static_cast<std::size_t>(at);
  const std::size_t above = std::min(below + 1, values.size() - 1);
  return values[below] + (at - double(below)) * (values[above] - values[below]);
}

}  // namespace weft
