#include "weft/estimate/optimize.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <mutex>

#include "weft/base/error.h"
#include "weft/base/parallel.h"
#include "weft/base/random.h"

namespace weft {
namespace {

/// A NaN is an evaluation that went wrong, as much as a simulation that diverged.
double sanitized(double error) { return std::isnan(error) ? kInfinity : error; }

void check(const CoarseOptions& options, const VecX& base) {
  if (options.levels < 1 || options.levels > 100)
    throw Error(fmt::format("coarse search: levels = {}, valid: 1 to 100", options.levels));
  std::vector<int> sorted = options.dimensions;
  std::sort(sorted.begin(), sorted.end());
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    if (sorted[i] < 0 || sorted[i] >= base.size())
      throw Error(fmt::format("coarse search: dimension {} of {}", sorted[i], base.size()));
    if (i > 0 && sorted[i] == sorted[i - 1])
      throw Error(fmt::format("coarse search: dimension {} is listed twice", sorted[i]));
  }
  const double points = std::pow(options.levels, double(sorted.size()));
  if (points > 1e6) throw Error(fmt::format("coarse search: {} points, at most 1000000", points));
}

void check(const AnnealingOptions& options, const VecX& start) {
  const auto require = [](bool valid, const char* text) {
    if (!valid) throw Error(fmt::format("annealing: {}", text));
  };
  require(start.size() > 0, "no parameter to search");
  require((start.array() >= 0).all() && (start.array() <= 1).all(), "the start is outside [0, 1]");
  require(options.max_evaluations > 0, "max_evaluations must be at least 1");
  require(options.initial_temperature >= 0 && std::isfinite(options.initial_temperature),
          "initial_temperature must be finite and not negative");
  require(options.final_temperature_ratio > 0 && options.final_temperature_ratio <= 1,
          "final_temperature_ratio must be in (0, 1]");
  require(options.simplex_size > 0 && options.simplex_size <= 1, "simplex_size must be in (0, 1]");
  require(options.reset_factor > 1, "reset_factor must be above 1");
  require(options.parallel_moves >= 1, "parallel_moves must be at least 1");
}

struct Vertex {
  VecX x;
  double error = kInfinity;
};

class Annealer {
 public:
  Annealer(const ErrorFunction& error, const VecX& start, const AnnealingOptions& options,
           const SearchObserver& observer)
      : function_(error),
        options_(options),
        observer_(observer),
        rng_(options.seed),
        dimension_(start.size()),
        moves_(std::clamp<Eigen::Index>(start.size() / 2, 1, options.parallel_moves)),
        initial_temperature_(options.initial_temperature) {
    result_.best = start;
    result_.error = kInfinity;
  }

  SearchResult run() {
    evaluate_start();
    while (running()) {
      if (reset_is_due()) {
        build_simplex();
      } else {
        move_worst();
      }
    }
    return std::move(result_);
  }

 private:
  bool running() const {
    return !result_.stopped && result_.evaluations < options_.max_evaluations;
  }

  double progress() const { return double(result_.evaluations) / double(options_.max_evaluations); }

  double temperature() const {
    return initial_temperature_ * std::pow(options_.final_temperature_ratio, progress());
  }

  /// Evaluates the points together; errors of points beyond the budget stay infinite.
  void evaluate(std::vector<Vertex>& points) {
    const std::size_t left = options_.max_evaluations - result_.evaluations;
    const std::size_t count = std::min(points.size(), left);
    parallel_for(count, options_.threads,
                 [&](std::size_t i) { points[i].error = sanitized(function_(points[i].x)); });
    if (initial_temperature_ == 0) set_temperature(points);
    const double now = temperature();
    for (std::size_t i = 0; i < count; ++i) {
      ++result_.evaluations;
      if (points[i].error < result_.error) {
        result_.error = points[i].error;
        result_.best = points[i].x;
      }
      if (observer_ && !observer_(result_.evaluations, points[i].error, result_.error, now))
        result_.stopped = true;
    }
  }

  void evaluate_start() {
    std::vector<Vertex> start{{result_.best, kInfinity}};
    evaluate(start);
  }

  /// A tenth of the first finite error.
  void set_temperature(const std::vector<Vertex>& points) {
    for (const Vertex& point : points) {
      if (!std::isfinite(point.error)) continue;
      initial_temperature_ = 0.1 * std::abs(point.error);
      return;
    }
  }

  /// Without a finite error there is no valley to search: keep throwing simplices.
  bool reset_is_due() const {
    if (simplex_.empty() || !std::isfinite(result_.error)) return true;
    if (collapsed()) return true;
    return temperature() * options_.reset_factor <= reset_temperature_;
  }

  /// All vertices in one place (to a 1e-5th of the range): moves can no longer find anything.
  bool collapsed() const {
    double extent = 0;
    for (const Vertex& v : simplex_)
      extent = std::max(extent, (v.x - simplex_[0].x).cwiseAbs().maxCoeff());
    return extent < 1e-5;
  }

  /// Around the best point: one vertex along each axis, to either side at random; anywhere, while
  /// no point with a finite error is known.
  void build_simplex() {
    const bool lost = !std::isfinite(result_.error);
    reset_temperature_ = temperature();
    double edge = options_.simplex_size;
    if (initial_temperature_ > 0)
      edge *= std::max(0.05, std::sqrt(reset_temperature_ / initial_temperature_));
    std::vector<Vertex> fresh(static_cast<std::size_t>(dimension_));
    for (Eigen::Index i = 0; i < dimension_; ++i) {
      VecX& x = fresh[static_cast<std::size_t>(i)].x;
      x = result_.best;
      if (lost) {
        for (double& coordinate : x) coordinate = rng_.uniform();
      } else {
        const double step = edge * rng_.uniform(0.5, 1);
        const double sign = rng_.uniform() < 0.5 ? -1 : 1;
        x[i] = reflect_into_unit(x[i] + sign * step);
      }
    }
    simplex_.assign(1, Vertex{result_.best, result_.error});
    evaluate(fresh);
    simplex_.insert(simplex_.end(), fresh.begin(), fresh.end());
  }

  double fluctuation(double temperature) {
    // 1 - uniform is in (0, 1]: its logarithm is finite.
    return -temperature * std::log(1 - rng_.uniform());
  }

  /// Orders the simplex by its values raised by fluctuations; `raised_` goes along.
  void raise_and_sort(double temperature) {
    std::vector<std::pair<double, std::size_t>> order;
    for (std::size_t i = 0; i < simplex_.size(); ++i)
      order.emplace_back(simplex_[i].error + fluctuation(temperature), i);
    std::sort(order.begin(), order.end());
    std::vector<Vertex> sorted;
    raised_.clear();
    for (const auto& [value, i] : order) {
      sorted.push_back(std::move(simplex_[i]));
      raised_.push_back(value);
    }
    simplex_ = std::move(sorted);
  }

  Vertex moved(const Vertex& from, const VecX& centroid, double factor) const {
    Vertex to{centroid + factor * (from.x - centroid), kInfinity};
    for (double& coordinate : to.x) coordinate = reflect_into_unit(coordinate);
    return to;
  }

  /// One step of the downhill simplex for each of the worst vertices.
  void move_worst() {
    const double now = temperature();
    raise_and_sort(now);
    const std::size_t kept = simplex_.size() - static_cast<std::size_t>(moves_);
    VecX centroid = VecX::Zero(dimension_);
    for (std::size_t i = 0; i < kept; ++i) centroid += simplex_[i].x;
    centroid /= double(kept);

    std::vector<Vertex> reflected;
    for (std::size_t i = kept; i < simplex_.size(); ++i)
      reflected.push_back(moved(simplex_[i], centroid, -1));
    evaluate(reflected);
    if (!running()) return;
    std::vector<double> lowered(reflected.size());
    for (std::size_t i = 0; i < reflected.size(); ++i)
      lowered[i] = reflected[i].error - fluctuation(now);
    second_trials(now, kept, centroid, reflected, lowered);
  }

  /// Expansion where the reflection was the best of all, contraction where it was no better than
  /// the worst that stays; a shrink of the whole simplex if nothing helped.
  void second_trials(double now, std::size_t kept, const VecX& centroid,
                     const std::vector<Vertex>& reflected, const std::vector<double>& lowered) {
    std::vector<Vertex> trials;
    std::vector<std::size_t> owner;
    bool progress = false;
    for (std::size_t i = 0; i < reflected.size(); ++i) {
      Vertex& vertex = simplex_[kept + i];
      const bool better = lowered[i] < raised_[kept + i];
      if (lowered[i] < raised_[0]) {
        trials.push_back(moved(vertex, centroid, -2));
        owner.push_back(i);
      } else if (!(lowered[i] < raised_[kept - 1])) {
        // Towards the reflected point if that is the better of the two sides.
        trials.push_back(moved(vertex, centroid, better ? -0.5 : 0.5));
        owner.push_back(i);
      }
      if (better) {
        vertex = reflected[i];
        raised_[kept + i] = lowered[i];
        progress = true;
      }
    }
    evaluate(trials);
    for (std::size_t t = 0; t < trials.size(); ++t) {
      const double value = trials[t].error - fluctuation(now);
      if (value < raised_[kept + owner[t]]) {
        simplex_[kept + owner[t]] = trials[t];
        progress = true;
      }
    }
    if (!progress && running()) shrink();
  }

  void shrink() {
    std::vector<Vertex> shrunk;
    for (std::size_t i = 1; i < simplex_.size(); ++i)
      shrunk.push_back({0.5 * (simplex_[0].x + simplex_[i].x), kInfinity});
    evaluate(shrunk);
    std::move(shrunk.begin(), shrunk.end(), simplex_.begin() + 1);
  }

  const ErrorFunction& function_;
  const AnnealingOptions& options_;
  const SearchObserver& observer_;
  Rng rng_;
  Eigen::Index dimension_;
  Eigen::Index moves_;
  double initial_temperature_ = 0;
  double reset_temperature_ = 0;
  std::vector<Vertex> simplex_;
  std::vector<double> raised_;
  SearchResult result_;
};

}  // namespace

double reflect_into_unit(double value) {
  const double folded = std::fmod(std::abs(value), 2.0);
  return folded > 1 ? 2 - folded : folded;
}

std::vector<VecX> coarse_grid(const VecX& base, const CoarseOptions& options) {
  check(options, base);
  std::size_t count = 1;
  for (std::size_t i = 0; i < options.dimensions.size(); ++i)
    count *= static_cast<std::size_t>(options.levels);
  std::vector<VecX> points(count, base);
  for (std::size_t p = 0; p < count; ++p) {
    std::size_t rest = p;
    for (auto d = options.dimensions.rbegin(); d != options.dimensions.rend(); ++d) {
      const std::size_t level = rest % static_cast<std::size_t>(options.levels);
      rest /= static_cast<std::size_t>(options.levels);
      points[p][*d] = (double(level) + 0.5) / options.levels;
    }
  }
  return points;
}

SearchResult coarse_search(const ErrorFunction& error, const VecX& base,
                           const CoarseOptions& options, const SearchObserver& observer) {
  const std::vector<VecX> points = coarse_grid(base, options);
  std::mutex mutex;
  std::atomic<bool> stop = false;
  SearchResult result;
  result.best = base;
  result.error = kInfinity;
  result.errors.assign(points.size(), std::numeric_limits<double>::quiet_NaN());
  double best_so_far = kInfinity;
  parallel_for(points.size(), options.threads, [&](std::size_t i) {
    if (stop) return;
    const double value = sanitized(error(points[i]));
    const std::lock_guard lock(mutex);
    result.errors[i] = value;
    best_so_far = std::min(best_so_far, value);
    ++result.evaluations;
    if (observer && !observer(result.evaluations, value, best_so_far, 0)) stop = true;
  });
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!(result.errors[i] < result.error)) continue;
    result.error = result.errors[i];
    result.best = points[i];
  }
  result.stopped = stop;
  return result;
}

SearchResult anneal(const ErrorFunction& error, const VecX& start, const AnnealingOptions& options,
                    const SearchObserver& observer) {
  check(options, start);
  return Annealer(error, start, options, observer).run();
}

}  // namespace weft
