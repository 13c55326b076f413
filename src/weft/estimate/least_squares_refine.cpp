#include "weft/estimate/least_squares_refine.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "weft/base/error.h"
#include "weft/base/parallel.h"
#include "weft/base/random.h"

namespace weft {
namespace {

/// Weights of the better half, as usual: falling like log(rank).
VecX recombination_weights(int population) {
  VecX weights(population / 2);
  for (Eigen::Index i = 0; i < weights.size(); ++i)
    weights[i] = std::log(0.5 * (population + 1)) - std::log(double(i + 1));
  return weights / weights.sum();
}

/// A, with columns along the eigenvectors of H: each adds an equal part of the expected rise.
MatX sampling_metric(const MatX& hessian, double rise, double largest_step) {
  const Eigen::SelfAdjointEigenSolver<MatX> eigen(hessian);
  const auto n = double(hessian.rows());
  VecX scale(hessian.rows());
  for (Eigen::Index i = 0; i < scale.size(); ++i) {
    const double curvature = std::max(eigen.eigenvalues()[i], 0.0);
    scale[i] = 1 / std::sqrt(0.5 * n * curvature / rise + 1 / (largest_step * largest_step));
  }
  return eigen.eigenvectors() * scale.asDiagonal();
}

}  // namespace

SearchResult refine(const ErrorFunction& error, const VecX& start, double start_error,
                    const MatX& hessian, const RefineOptions& options,
                    const RefineObserver& observer) {
  const Eigen::Index n = start.size();
  if (n == 0 || hessian.rows() != n || hessian.cols() != n)
    throw Error("refine: start and matrix must have the same size");
  if (options.generations < 0) throw Error("refine: generations must not be negative");
  if (options.population < 4) throw Error("refine: population must be at least 4");
  if (!(options.spread > 0) || !(options.largest_step > 0))
    throw Error("refine: spread and largest_step must be above 0");

  const MatX metric =
      sampling_metric(hessian, options.spread * std::max(start_error, 1e-12), options.largest_step);
  const VecX weights = recombination_weights(options.population);
  const double mass = 1 / weights.squaredNorm(), size = double(n);
  const double rate = (mass + 2) / (size + mass + 5);
  const double damping = 1 + rate + 2 * std::max(0.0, std::sqrt((mass - 1) / (size + 1)) - 1);
  const double expected = std::sqrt(size) * (1 - 1 / (4 * size) + 1 / (21 * size * size));

  SearchResult result{start, start_error, 0, false, {}};
  Rng rng(options.seed, 4);
  VecX mean = start, path = VecX::Zero(n);
  double sigma = 1;
  const auto count = static_cast<std::size_t>(options.population);
  std::vector<VecX> normal(count, VecX(n)), points(count);
  std::vector<double> errors(count);
  std::vector<std::size_t> order(count);
  for (int generation = 0; generation < options.generations && !result.stopped; ++generation) {
    for (std::size_t k = 0; k < count; ++k) {
      for (double& z : normal[k]) z = rng.normal();
      points[k] = (mean + sigma * (metric * normal[k])).unaryExpr(&reflect_into_unit);
    }
    parallel_for(count, options.threads, [&](std::size_t k) { errors[k] = error(points[k]); });
    for (std::size_t k = 0; k < count; ++k) {
      if (errors[k] < result.error) {
        result.error = errors[k];
        result.best = points[k];
      }
      ++result.evaluations;
      if (observer && !observer(result.evaluations, points[k], errors[k])) result.stopped = true;
    }
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return errors[a] < errors[b]; });
    VecX next = VecX::Zero(n), step = VecX::Zero(n);
    for (Eigen::Index i = 0; i < weights.size(); ++i) {
      next += weights[i] * points[order[static_cast<std::size_t>(i)]];
      step += weights[i] * normal[order[static_cast<std::size_t>(i)]];
    }
    mean = next;
    path = (1 - rate) * path + std::sqrt(rate * (2 - rate) * mass) * step;
    sigma *= std::exp(rate / damping * (path.norm() / expected - 1));
  }
  return result;
}

}  // namespace weft
