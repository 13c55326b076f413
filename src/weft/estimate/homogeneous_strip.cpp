#include "weft/estimate/homogeneous_strip.h"

#include <fmt/format.h>

#include <cmath>
#include <optional>

#include "weft/base/dense.h"
#include "weft/base/error.h"
#include "weft/estimate/linearize_trial.h"

namespace weft {
namespace {

constexpr int kMostIterations = 100;
constexpr double kTolerance = 1e-11;  // of the stiffness: stress across that is left
constexpr double kRounding = 1e-15;   // of the stiffness: what energies are known to

/// Positions of the unit square by (stretch, lateral, shear) are linear: d x / d those.
using Shape = Eigen::Matrix<double, 12, 3>;
Shape shape_of(const MaterialPoints& material) {
  Shape shape = Shape::Zero();
  for (Eigen::Index i = 0; i < 4; ++i) {
    shape(3 * i, 0) = material(0, i);
    shape(3 * i + 1, 1) = material(1, i);
    shape(3 * i, 2) = material(1, i);
  }
  return shape;
}

struct Local {
  double energy;
  Vec3 gradient;
  Mat3 hessian;
};
Local local(const ElasticModel& model, const Shape& shape, const Vec3& state) {
  const Eigen::Matrix<double, 12, 1> flat_x = shape * state;
  const Points x = Eigen::Map<const Points>(flat_x.data(), 3, 4);
  Points gradient;
  SparseMatrix lower = model.hessian_pattern();
  for (double& value : Eigen::Map<VecX>(lower.valuePtr(), lower.nonZeros())) value = 0;
  model.hessian(x, HessianKind::exact, gradient, lower);
  const MatX dense = lower;
  const MatX full = dense.selfadjointView<Eigen::Lower>();
  return {model.energy(x), shape.transpose() * flat(gradient), congruence(full, shape)};
}

int free_count(StripSides sides) {
  return sides == StripSides::free ? 2 : sides == StripSides::unsheared ? 1 : 0;
}

/// Newton's method with halving over the last entries of `state`; false without equilibrium.
bool settle(const ElasticModel& model, const Shape& shape, int free, Vec3& state, Local& found) {
  found = local(model, shape, state);
  for (int i = 0; i < kMostIterations; ++i) {
    const double scale = std::max(found.hessian(0, 0), 1e-12);
    if (free == 0 || found.gradient.segment(1, free).norm() <= kTolerance * scale) return true;
    MatX h = found.hessian.block(1, 1, free, free);
    const VecX downhill = -found.gradient.segment(1, free);
    std::optional<MatX> step = solve_positive(h, downhill);
    for (double added = 1e-9 * scale; !step; added *= 10) {
      h.diagonal().array() += added;
      step = solve_positive(h, downhill);
    }
    double part = std::min(1.0, 0.2 / std::max(step->norm(), 1e-300));
    Local next;
    Vec3 moved;
    for (;; part /= 2) {
      moved = state;
      moved.segment(1, free) += part * *step;
      next = local(model, shape, moved);
      if (next.energy <= found.energy + kRounding * scale || part < 1e-9) break;
    }
    // Nothing lower within rounding: as near as numbers go.
    if (part < 1e-9) return found.gradient.segment(1, free).norm() <= 1e-6 * scale;
    state = moved;
    found = next;
  }
  return false;
}

StripState state_of(const Vec3& state, const Local& at) {
  return {at.gradient[0], state[1], state[2]};
}

}  // namespace

HomogeneousStrip::HomogeneousStrip(const Fabric& fabric, double grain_angle, StripSides sides)
    : sides_(sides) {
  if (fabric.model == "springs")
    throw Error("a homogeneous strip needs the model of a sheet; springs depend on the mesh");
  model_ = make_elastic_model(make_swatch(1, 1, 2, 2), fabric, grain_angle);
}

void HomogeneousStrip::set_parameters(const VecX& values) { model_->set_parameters(values); }

std::vector<StripState> HomogeneousStrip::pull(const VecX& stretches, Derivatives* derivatives) {
  ElasticModel& model = *model_;
  const VecX flat_history = model.history();
  const Shape shape = shape_of(model.mesh().material);
  const int free = free_count(sides_);
  const Eigen::Index parameters = model.parameters().size();
  MatX history_derivative = MatX::Zero(model.history_size(), parameters);
  if (derivatives) {
    derivatives->force.resize(stretches.size(), parameters);
    derivatives->lateral.resize(stretches.size(), parameters);
  }
  std::vector<StripState> result;
  Vec3 state(1, 1, 0);
  for (Eigen::Index i = 0; i < stretches.size(); ++i) {
    state[0] = stretches[i];
    Local found;
    if (!(stretches[i] > 0) || !settle(model, shape, free, state, found)) {
      model.set_history(flat_history);
      throw Error(fmt::format("strip: no equilibrium at a stretch of {:g}", stretches[i]));
    }
    result.push_back(state_of(state, found));
    const Eigen::Matrix<double, 12, 1> flat_x = shape * state;
    const Points x = Eigen::Map<const Points>(flat_x.data(), 3, 4);
    if (derivatives) {
      MatX by_parameters(12, parameters);
      model.parameter_derivative(x, by_parameters);
      model.add_history_derivative(x, history_derivative, by_parameters);
      const MatX reduced = shape.transpose() * by_parameters;
      MatX moved = MatX::Zero(3, parameters);
      if (free > 0)
        moved.middleRows(1, free) =
            -inverse(found.hessian.block(1, 1, free, free)) * reduced.middleRows(1, free);
      derivatives->force.row(i) = reduced.row(0) + found.hessian.row(0) * moved;
      derivatives->lateral.row(i) = moved.row(1);
      if (model.history_size() > 0)
        history_derivative = model.next_history_derivative(x, shape * moved, history_derivative);
    }
    if (model.history_size() > 0) model.set_history(model.next_history(x));
  }
  if (model.history_size() > 0) model.set_history(flat_history);
  return result;
}

std::vector<std::string> value_names(const Fabric& fabric, std::string_view row) {
  std::vector<std::string> names;
  const int first = fabric.first_value(row);
  for (int i = 0; i < fabric.value_count(row); ++i) names.emplace_back(fabric.info(first + i).name);
  return names;
}

namespace {

class StripProblem {
 public:
  StripProblem(const std::vector<StripTest>& tests, const Fabric& start,
               const std::vector<std::string>& free)
      : tests_(tests), fabric_(start) {
    for (const std::string& name : free) indices_.push_back(start.value_index(name));
    for (const StripTest& test : tests) {
      if (test.force.size() != test.stretch.size() ||
          (test.lateral.size() != 0 && test.lateral.size() != test.stretch.size()))
        throw Error("strip test: as many forces and widths as stretches are needed");
      if (!(test.force_noise > 0) || !(test.lateral_noise > 0))
        throw Error("strip test: noise must be above 0");
    }
  }

  Eigen::Index dimension() const { return static_cast<Eigen::Index>(indices_.size()); }
  ParameterInfo info(Eigen::Index i) const { return fabric_.info(index(i)); }
  int index(Eigen::Index i) const { return indices_[static_cast<std::size_t>(i)]; }

  VecX scaled() const {
    VecX x(dimension());
    for (Eigen::Index i = 0; i < x.size(); ++i) x[i] = to_scaled(info(i), fabric_.values[index(i)]);
    return x;
  }
  Fabric fabric(const VecX& x) const {
    Fabric fabric = fabric_;
    for (Eigen::Index i = 0; i < x.size(); ++i)
      fabric.values[index(i)] = from_scaled(info(i), x[i]);
    return fabric;
  }

  struct Evaluation {
    double sum = 0;
    Eigen::Index count = 0;
    VecX gradient;
    MatX normal;
    std::vector<VecX> force, lateral;
  };
  enum class Derivatives { none, all };
  Evaluation evaluate(const VecX& x, Derivatives wanted) const {
    Evaluation out;
    out.gradient = VecX::Zero(dimension());
    out.normal = MatX::Zero(dimension(), dimension());
    const Fabric fabric = this->fabric(x);
    VecX slopes(dimension());
    for (Eigen::Index i = 0; i < dimension(); ++i) slopes[i] = scaled_slope(info(i), x[i]);
    for (const StripTest& test : tests_) {
      HomogeneousStrip strip(fabric, test.grain_angle, test.sides);
      HomogeneousStrip::Derivatives derivatives;
      const auto states =
          strip.pull(test.stretch, wanted == Derivatives::all ? &derivatives : nullptr);
      VecX force(test.stretch.size()), lateral(test.stretch.size());
      for (Eigen::Index i = 0; i < force.size(); ++i) {
        force[i] = states[static_cast<std::size_t>(i)].force;
        lateral[i] = states[static_cast<std::size_t>(i)].lateral;
      }
      add(force, test.force, test.force_noise, derivatives.force, slopes, out);
      if (test.lateral.size() > 0)
        add(lateral, test.lateral, test.lateral_noise, derivatives.lateral, slopes, out);
      out.force.push_back(force);
      out.lateral.push_back(lateral);
    }
    return out;
  }

 private:
  void add(const VecX& found, const VecX& measured, double noise, const MatX& derivative,
           const VecX& slopes, Evaluation& out) const {
    for (Eigen::Index i = 0; i < found.size(); ++i) {
      if (std::isnan(measured[i])) continue;
      const double r = (found[i] - measured[i]) / noise;
      out.sum += r * r;
      ++out.count;
      if (derivative.size() == 0) continue;
      VecX row(dimension());
      for (Eigen::Index j = 0; j < row.size(); ++j)
        row[j] = derivative(i, index(j)) * slopes[j] / noise;
      out.gradient += 2 * r * row;
      out.normal += 2 * row * row.transpose();
    }
  }

  const std::vector<StripTest>& tests_;
  Fabric fabric_;
  std::vector<int> indices_;
};

}  // namespace

StripFit fit_strips(const std::vector<StripTest>& tests, const Fabric& start,
                    const std::vector<std::string>& free, int max_iterations) {
  const StripProblem problem(tests, start, free);
  const auto count = static_cast<double>(
      problem.evaluate(problem.scaled(), StripProblem::Derivatives::none).count);
  if (count == 0) throw Error("strip test: nothing was measured");
  const auto cost = [&](const VecX& x) {
    try {
      return problem.evaluate(x, StripProblem::Derivatives::none).sum / count;
    } catch (const Error&) {
      return kInfinity;
    }
  };
  const auto linearize = [&](const VecX& x) -> QuadraticModel {
    const auto at = problem.evaluate(x, StripProblem::Derivatives::all);
    return {at.sum / count, at.gradient / count, at.normal / count};
  };
  LeastSquaresOptions options;
  options.max_iterations = max_iterations;
  options.step_tolerance = 1e-6;
  options.cost_tolerance = 1e-7;
  options.initial_damping = 1e-6;
  const VecX zero = VecX::Zero(problem.dimension()), one = VecX::Ones(problem.dimension());
  StripFit fit;
  fit.search = minimize_least_squares(linearize, cost, problem.scaled(), zero, one, options);
  fit.fabric = problem.fabric(fit.search.x);
  auto at = problem.evaluate(fit.search.x, StripProblem::Derivatives::none);
  fit.cost = at.sum / count;
  fit.force = std::move(at.force);
  fit.lateral = std::move(at.lateral);
  return fit;
}

}  // namespace weft
