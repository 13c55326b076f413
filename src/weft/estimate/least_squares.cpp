#include "weft/estimate/least_squares.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <vector>

#include "weft/base/dense.h"
#include "weft/base/error.h"

namespace weft {
namespace {

/// Active-set method for a strictly convex quadratic in a box.
class BoxProgram {
 public:
  BoxProgram(const MatX& a, const VecX& g, const VecX& lower, const VecX& upper)
      : a_(a),
        g_(g),
        lower_(lower),
        upper_(upper),
        s_(VecX::Zero(g.size())),
        held_(static_cast<std::size_t>(g.size()), 0) {}

  VecX solve() {
    // Each pass binds a bound or releases one at a lower value: no active set comes twice. The cap
    // is for rounding.
    const Eigen::Index passes = 20 + 10 * s_.size();
    for (Eigen::Index pass = 0; pass < passes; ++pass) {
      const VecX step = free_step();
      if (move(step)) continue;
      if (!release()) break;
    }
    return s_;
  }

 private:
  bool held(Eigen::Index i) const { return held_[static_cast<std::size_t>(i)] != 0; }

  /// From s to the minimum over the coordinates that are not held.
  VecX free_step() const {
    std::vector<Eigen::Index> free;
    for (Eigen::Index i = 0; i < s_.size(); ++i)
      if (!held(i)) free.push_back(i);
    VecX step = VecX::Zero(s_.size());
    if (free.empty()) return step;
    const VecX gradient = g_ + a_ * s_;
    const MatX matrix = a_(free, free);
    const VecX right = -gradient(free);
    const VecX solution = solve_symmetric(matrix, right);
    step(free) = solution;
    return step;
  }

  /// Along `step` to the first bound, which is held from then on; false if none is met.
  bool move(const VecX& step) {
    double fraction = 1;
    Eigen::Index first = -1;
    for (Eigen::Index i = 0; i < s_.size(); ++i) {
      if (held(i) || step[i] == 0) continue;
      const double room = (step[i] > 0 ? upper_[i] : lower_[i]) - s_[i];
      if (room / step[i] < fraction) {
        fraction = std::max(room / step[i], 0.0);
        first = i;
      }
    }
    s_ += fraction * step;
    if (first < 0) return false;
    s_[first] = step[first] > 0 ? upper_[first] : lower_[first];
    held_[static_cast<std::size_t>(first)] = 1;
    return true;
  }

  /// Frees the coordinate whose bound holds it back most; false at the minimum.
  bool release() {
    const VecX gradient = g_ + a_ * s_;
    double most = 1e-12 * g_.lpNorm<Eigen::Infinity>();
    Eigen::Index which = -1;
    for (Eigen::Index i = 0; i < s_.size(); ++i) {
      if (!held(i)) continue;
      const double pull = s_[i] == lower_[i] ? -gradient[i] : gradient[i];
      if (lower_[i] < upper_[i] && pull > most) {
        most = pull;
        which = i;
      }
    }
    if (which < 0) return false;
    held_[static_cast<std::size_t>(which)] = 0;
    return true;
  }

  const MatX& a_;
  const VecX &g_, &lower_, &upper_;
  VecX s_;
  std::vector<char> held_;
};

void check(const VecX& start, const VecX& lower, const VecX& upper,
           const LeastSquaresOptions& options) {
  if (start.size() == 0 || lower.size() != start.size() || upper.size() != start.size())
    throw Error("least squares: start and bounds must have the same size, at least 1");
  if (!(lower.array() <= upper.array()).all())
    throw Error("least squares: a lower bound is above its upper bound");
  if (options.max_iterations < 1) throw Error("least squares: max_iterations must be at least 1");
  if (!(options.step_tolerance >= 0) || !(options.cost_tolerance >= 0))
    throw Error("least squares: tolerances must not be negative");
  if (!(options.initial_damping > 0) || !(options.largest_step > 0))
    throw Error("least squares: initial_damping and largest_step must be above 0");
  if (!(options.raise > 1)) throw Error("least squares: raise must be above 1");
}

class LevenbergMarquardt {
 public:
  LevenbergMarquardt(const LinearizeFunction& linearize, const CostFunction& cost,
                     const VecX& lower, const VecX& upper, const LeastSquaresOptions& options,
                     const LeastSquaresObserver& observer)
      : linearize_(linearize),
        cost_(cost),
        lower_(lower),
        upper_(upper),
        options_(options),
        observer_(observer) {}

  LeastSquaresResult run(const VecX& start) {
    result_.x = start.cwiseMax(lower_).cwiseMin(upper_);
    while (result_.iterations < options_.max_iterations) {
      const QuadraticModel model = linearize_(result_.x);
      const bool first = ++result_.iterations == 1;
      if (!std::isfinite(model.cost)) {
        if (first) result_.cost = model.cost;
        return finished(first ? LeastSquaresEnd::start_infinite
                              : LeastSquaresEnd::linearization_infinite);
      }
      result_.cost = model.cost;
      if (first) damping_ = options_.initial_damping * scale_of(model);
      if (!improve(model)) return result_;
    }
    return finished(LeastSquaresEnd::max_iterations);
  }

 private:
  LeastSquaresResult finished(LeastSquaresEnd end) {
    result_.end = end;
    return result_;
  }

  static double scale_of(const QuadraticModel& model) {
    const double largest = model.hessian.diagonal().maxCoeff();
    return largest > 0 ? largest : 1;
  }

  /// Tries steps, with ever more damping, until one lowers the cost. False if the end is reached.
  bool improve(const QuadraticModel& model) {
    for (;;) {
      const VecX step = solve(model);
      const double length = step.lpNorm<Eigen::Infinity>();
      if (!(length > 0)) return end(LeastSquaresEnd::small_step);
      LeastSquaresStep tried{result_.iterations, result_.x + step, 0, false, damping_};
      tried.x = tried.x.cwiseMax(lower_).cwiseMin(upper_);
      tried.cost = cost_(tried.x);
      ++result_.evaluations;
      tried.accepted = tried.cost < model.cost;
      const double predicted = -(model.gradient.dot(step) + 0.5 * step.dot(model.hessian * step));
      if (std::isfinite(tried.cost)) {
        adapt((model.cost - tried.cost) / predicted, scale_of(model));
      } else {
        room_ = 0.5 * length;
      }
      if (tried.accepted) {
        room_ = std::min(2 * room_, options_.largest_step);
        result_.x = tried.x;
        result_.cost = tried.cost;
      }
      if (observer_ && !observer_(tried)) return end(LeastSquaresEnd::stopped);
      if (length < options_.step_tolerance) return end(LeastSquaresEnd::small_step);
      if (predicted < options_.cost_tolerance * model.cost && !tried.accepted)
        return end(LeastSquaresEnd::small_reduction);
      if (!tried.accepted) continue;
      if (model.cost - tried.cost < options_.cost_tolerance * model.cost)
        return end(LeastSquaresEnd::small_reduction);
      return true;
    }
  }

  bool end(LeastSquaresEnd reason) {
    result_.end = reason;
    return false;
  }

  VecX solve(const QuadraticModel& model) const {
    MatX damped = model.hessian;
    damped.diagonal().array() += damping_;
    return minimize_in_box(damped, model.gradient, (lower_ - result_.x).cwiseMax(-room_),
                           (upper_ - result_.x).cwiseMin(room_));
  }

  void adapt(double gain, double scale) {
    if (gain > 0) {
      damping_ *= std::max(1.0 / 3, 1 - std::pow(2 * gain - 1, 3));
      damping_ = std::max(damping_, kLeastDamping * scale);
      raise_ = options_.raise;
    } else {
      damping_ *= raise_;
      raise_ *= 2;
    }
  }

  static constexpr double kLeastDamping = 1e-9;  // of the largest diagonal entry
  const LinearizeFunction& linearize_;
  const CostFunction& cost_;
  const VecX &lower_, &upper_;
  const LeastSquaresOptions& options_;
  const LeastSquaresObserver& observer_;
  double damping_ = 0, raise_ = options_.raise;
  // How far a coordinate may move: less than largest_step where the cost was infinite, which says
  // how far is too far, but nothing of the curvature that damping stands for.
  double room_ = options_.largest_step;
  LeastSquaresResult result_;
};

}  // namespace

VecX minimize_in_box(const MatX& a, const VecX& g, const VecX& lower, const VecX& upper) {
  assert((lower.array() <= 0).all() && (upper.array() >= 0).all());
  return BoxProgram(a, g, lower, upper).solve();
}

bool PayingSteps::pay_after(const LeastSquaresStep& step) {
  constexpr double kEnoughReduction = 0.01;
  constexpr int kEnoughSteps = 2;
  if (!step.accepted) return true;
  const double reduction = (cost_ - step.cost) * residual_count_;
  cost_ = step.cost;
  small_steps_ = reduction < kEnoughReduction ? small_steps_ + 1 : 0;
  return small_steps_ < kEnoughSteps;
}

LeastSquaresResult minimize_least_squares(const LinearizeFunction& linearize,
                                          const CostFunction& cost, const VecX& start,
                                          const VecX& lower, const VecX& upper,
                                          const LeastSquaresOptions& options,
                                          const LeastSquaresObserver& observer) {
  check(start, lower, upper, options);
  return LevenbergMarquardt(linearize, cost, lower, upper, options, observer).run(start);
}

std::vector<VecX> draw_by_curvature(const VecX& x, const QuadraticModel& model, int count, Rng& rng,
                                    const CurvatureDraw& options) {
  if (!(options.rise > 0) || !(options.widest > 0))
    throw Error("points drawn by the curvature need a rise and a width above 0");
  const SymmetricEigen principal = symmetric_eigen(model.hessian);
  // 1/2 h s^2 of each of n directions adds up to the rise.
  const double rise = 2 * options.rise * model.cost / static_cast<double>(x.size());
  const VecX widths = principal.values.unaryExpr([&](double h) {
    return h * options.widest * options.widest > rise ? std::sqrt(rise / h) : options.widest;
  });
  std::vector<VecX> points(static_cast<std::size_t>(count));
  for (VecX& point : points) {
    VecX steps = widths;
    for (double& step : steps) step *= rng.normal();
    point = (x + principal.vectors * steps).cwiseMax(0).cwiseMin(1);
  }
  return points;
}

}  // namespace weft
