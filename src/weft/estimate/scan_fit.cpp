#include "weft/estimate/scan_fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "weft/base/clock.h"
#include "weft/base/error.h"
#include "weft/base/parallel.h"
#include "weft/base/random.h"
#include "weft/estimate/content_hash.h"
#include "weft/estimate/packed_numbers.h"
#include "weft/estimate/replays.h"
#include "weft/fabric/orthotropic.h"

namespace weft {
namespace {

constexpr int kBalancePasses = 4;
constexpr double kSameScale = 1.01;    // of a target's noise, of the priors' weight, of the cost
constexpr double kLeastChange = 0.01;  // of the sum of squares
constexpr double kLeastPoisson = 0.02, kMostPoisson = 0.45;  // of a random start
/// A force whose direction is not known within itself has no magnitude to differentiate.
constexpr double kLeastForce = 1e-12;  // N

/// `count`: as ShapeDescriptor::counted().
double root_mean_square(const VecX& r, double count) {
  return count > 0 ? std::sqrt(r.squaredNorm() / count) : 0;
}

/// The simulated surface where it is compared.
Points compared_points(const ScanTrial& trial, const ScanSimulation& simulation) {
  const VecX sampled = trial.sampling * flat(simulation.rest.x);
  return Points::Map(sampled.data(), 3, sampled.size() / 3);
}

/// Clamps whose force was measured.
std::vector<Eigen::Index> measured_forces(const ScanTarget& target) {
  std::vector<Eigen::Index> measured;
  for (std::size_t c = 0; c < target.clamps.size(); ++c)
    if (target.clamps[c].force) measured.push_back(static_cast<Eigen::Index>(c));
  return measured;
}

}  // namespace

ScanParameter scan_parameter(const Fabric& fabric, const std::string& name) {
  if (name != "bend" || !is_orthotropic_sheet(fabric)) {
    const int index = fabric.value_index(name);
    return {fabric.info(index), {{index, 1}}, name.find("bend") != std::string::npos};
  }
  ScanParameter bend;
  const int uu = fabric.value_index("bend_uu");
  bend.info = fabric.info(uu);
  bend.info.name = "bend";
  bend.info.meaning = "b: moment per width by curvature, the same in all directions.";
  bend.info.source = "Larionov 2022, section 3.3.1";
  bend.values = {
      {uu, 1}, {fabric.value_index("bend_vv"), 1}, {fabric.value_index("bend_twist"), 0.5}};
  bend.bending = true;
  return bend;
}

std::vector<std::string> default_scan_parameters(const Fabric& fabric) {
  if (is_orthotropic_sheet(fabric))
    return {"membrane_uu", "membrane_vv", "membrane_uv", "membrane_shear", "bend"};
  std::vector<std::string> names;
  for (int i = 0; i < fabric.values.size(); ++i)
    if (const ParameterInfo info = fabric.info(i); info.unit == "N/m" || info.unit == "N m")
      names.emplace_back(info.name);
  return names;
}

ScanBalance scan_balance_from_name(std::string_view name) {
  if (name == "noise") return ScanBalance::noise;
  if (name == "residual") return ScanBalance::residual;
  throw Error(fmt::format("balance \"{}\" is not known; known: noise, residual", name));
}

ScanSchedule scan_schedule_from_name(std::string_view name) {
  if (name == "together") return ScanSchedule::together;
  if (name == "alternating") return ScanSchedule::alternating;
  throw Error(fmt::format("schedule \"{}\" is not known; known: together, alternating", name));
}

ScanProblem::ScanProblem(std::vector<std::shared_ptr<const ScanTrial>> trials,
                         std::shared_ptr<const EquilibriumSolver> solver, Fabric fabric,
                         const std::vector<std::string>& free, const ScanCostOptions& options,
                         int threads)
    : trials_(std::move(trials)),
      solver_(std::move(solver)),
      fabric_(std::move(fabric)),
      options_(options),
      threads_(threads) {
  if (trials_.empty()) throw Error("no targets to fit");
  if (free.empty()) throw Error("no parameters to search");
  if (!solver_->takes(fabric_.model))
    throw Error(fmt::format("solver \"{}\" does not take fabrics of model \"{}\"", solver_->name(),
                            fabric_.model));
  if (!(options_.poisson_limit > 0) || !(options_.poisson_tolerance > 0))
    throw Error("limit and tolerance of Poisson's ratio must be above 0");
  std::vector<int> used;
  for (const std::string& name : free) {
    if (name == "bend" && is_orthotropic_sheet(fabric_))
      fabric_.values[fabric_.value_index("bend_uv")] = kNoBendCoupling;
    parameters_.push_back(scan_parameter(fabric_, name));
    for (const auto& [index, factor] : parameters_.back().values) {
      if (std::find(used.begin(), used.end(), index) != used.end())
        throw Error(fmt::format("parameter \"{}\" is searched twice",
                                std::string(fabric_.info(index).name)));
      used.push_back(index);
    }
  }
  for (const auto& trial : trials_) {
    if (trial->measured_descriptor->depends_on_material()) require_model(fabric_, "stvk");
    // The noise is taken at the scan and the fabric given: one that moved with the estimate would
    // be a residual's denominator that a fit can enlarge.
    const VecX noise =
        trial->measured_descriptor->noise(trial->measured, fabric_.values, trial->target.noise);
    if (!(noise.minCoeff() > 0))
      throw Error(fmt::format("target \"{}\": an entry of its descriptor has no noise",
                              trial->target.name));
    shape_noise_.push_back(noise);
    residual_count_ += trial->measured_descriptor->counted();
    for (const ScanClamp& clamp : trial->target.clamps)
      if (clamp.force) ++residual_count_;
  }
  if (!(residual_count_ > 0))
    throw Error("nothing to compare: no vertex of the targets was measured, and no force");
  scales_ = no_scales();
  priors_ = WeighedPriors(
      options.priors, dimension(), [&](const VecX& x) { return this->fabric(x); },
      residual_noise(*this));
}

std::vector<ParameterInfo> ScanProblem::infos() const {
  std::vector<ParameterInfo> infos;
  for (const ScanParameter& p : parameters_) infos.push_back(p.info);
  return infos;
}

VecX ScanProblem::scaled(const Fabric& fabric) const {
  VecX x(dimension());
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const ScanParameter& p = parameters_[at(i)];
    // Tied values may differ in a start that comes from elsewhere: their mean.
    double sum = 0;
    for (const auto& [index, factor] : p.values) sum += fabric.values[index] / factor;
    x[i] = to_scaled(p.info, sum / static_cast<double>(p.values.size()));
  }
  return x;
}

Fabric ScanProblem::fabric(const VecX& scaled) const {
  Fabric fabric = fabric_;
  for (Eigen::Index i = 0; i < scaled.size(); ++i) {
    const ScanParameter& p = parameters_[at(i)];
    for (const auto& [index, factor] : p.values)
      fabric.values[index] = factor * from_scaled(p.info, scaled[i]);
  }
  return fabric;
}

ScanProblem ScanProblem::refined() const {
  ScanProblem finer = *this;
  for (auto& trial : finer.trials_) trial = weft::refined(*trial);
  finer.store_.reset();
  return finer;
}

ScanProblem ScanProblem::solved_by(std::shared_ptr<const EquilibriumSolver> solver) const {
  ScanProblem other = *this;
  other.solver_ = std::move(solver);
  other.store_.reset();
  return other;
}

MatX ScanProblem::by_scaled(const VecX& scaled, const MatX& by_values) const {
  MatX result = MatX::Zero(by_values.rows(), dimension());
  for (Eigen::Index i = 0; i < scaled.size(); ++i) {
    const ScanParameter& p = parameters_[at(i)];
    const double slope = scaled_slope(p.info, scaled[i]);
    for (const auto& [index, factor] : p.values)
      result.col(i) += slope * factor * by_values.col(index);
  }
  return result;
}

double ScanProblem::penalty(const Fabric& fabric, VecX* gradient) const {
  if (gradient) gradient->setZero(fabric.values.size());
  if (!is_orthotropic_sheet(fabric)) return 0;
  const int c01 = fabric.value_index("membrane_uv"), c11 = fabric.value_index("membrane_vv");
  const double nu = fabric.values[c01] / fabric.values[c11];
  if (nu <= options_.poisson_limit) return 0;
  if (gradient) {
    (*gradient)[c01] = 1 / fabric.values[c11] / options_.poisson_tolerance;
    (*gradient)[c11] = -nu / fabric.values[c11] / options_.poisson_tolerance;
  }
  return (nu - options_.poisson_limit) / options_.poisson_tolerance;
}

bool ScanProblem::simulate(const VecX& scaled, HeldDerivatives derivatives,
                           std::vector<ScanSimulation>& simulations, std::string* reason) const {
  std::string found;
  try {
    simulations = simulate_scans(trials_, *solver_, fabric(scaled), derivatives, threads_);
  } catch (const Error& error) {
    found = error.what();  // of values that the model refuses
  }
  for (std::size_t t = 0; found.empty() && t < simulations.size(); ++t)
    if (!(simulations[t].rest.residual <= options_.largest_residual))
      found = fmt::format("target \"{}\": no equilibrium: a net force of {:.2g} N is left",
                          trials_[t]->target.name, simulations[t].rest.residual);
  if (reason) *reason = found;
  return found.empty();
}

ScanProblem::Residuals ScanProblem::residuals(std::size_t t, const ScanSimulation& simulation,
                                              const Fabric& fabric,
                                              HeldDerivatives derivatives) const {
  const ScanTrial& trial = *trials_[t];
  const bool all = derivatives == HeldDerivatives::all;
  const VecX& values = fabric.values;
  const Points x = compared_points(trial, simulation);
  const auto target = static_cast<Eigen::Index>(t);
  const double scale = scales_[target];
  const VecX weight = (scale * shape_noise_[t]).cwiseInverse();
  Residuals r;
  r.shape = weight.cwiseProduct(trial.simulated_descriptor->value(x, values) -
                                trial.measured_descriptor->value(trial.measured, values));
  if (all)
    r.shape_jacobian = weight.asDiagonal() *
                       (trial.simulated_descriptor->derivative(
                            x, values, trial.sampling * simulation.rest.x_derivative) -
                        trial.measured_descriptor->derivative(trial.measured, values, MatX()));
  const std::vector<Eigen::Index> measured = measured_forces(trial.target);
  const auto count = static_cast<Eigen::Index>(measured.size());
  r.force.resize(count);
  if (all) r.force_jacobian = MatX::Zero(count, values.size());
  for (Eigen::Index i = 0; i < count; ++i) {
    const Eigen::Index c = measured[at(i)];
    const ScanClamp& clamp = trial.target.clamps[at(c)];
    const double noise = scale * clamp.force_noise;
    const Vec3 force = simulation.forces.col(c);
    const double magnitude = force.norm();
    r.force[i] = (magnitude - *clamp.force) / noise;
    if (all && magnitude > kLeastForce)
      r.force_jacobian.row(i) = force.transpose() *
                                simulation.force_derivative.middleRows(3 * c, 3) /
                                (magnitude * noise);
  }
  if (shared_errors_.empty()) return r;
  const auto weigh = [&](auto& shape, auto& forces) {
    MatX both(shape.rows() + count, shape.cols());
    both << shape, forces;
    both = shared_errors_[t].weighed(both, scale);
    shape = both.topRows(shape.rows());
    forces = both.bottomRows(count);
  };
  weigh(r.shape, r.force);
  if (all) weigh(r.shape_jacobian, r.force_jacobian);
  return r;
}

MatX ScanProblem::by_clamp_errors(std::size_t t, const ScanSimulation& simulation,
                                  const Fabric& fabric) const {
  const ScanTrial& trial = *trials_[t];
  const Points x = compared_points(trial, simulation);
  const ShapeDescriptor& descriptor = *trial.simulated_descriptor;
  const VecX weight = shape_noise_[t].cwiseInverse();
  const std::vector<Eigen::Index> measured = measured_forces(trial.target);
  const Eigen::Index entries = weight.size(), errors = trial.clamp_errors.cols();
  // A descriptor's derivative is by the values of the fabric: so many errors at a time, less what
  // the values themselves do.
  const Eigen::Index most = fabric.values.size();
  const MatX by_values = descriptor.derivative(x, fabric.values, MatX());
  MatX result = MatX::Zero(entries + static_cast<Eigen::Index>(measured.size()), errors);
  for (Eigen::Index first = 0; first < errors; first += most) {
    const Eigen::Index count = std::min(most, errors - first);
    MatX moves = MatX::Zero(simulation.rest.x.size(), most);
    moves.leftCols(count) = trial.clamp_errors.middleCols(first, count);
    const ScanResponse response = response_of_scan(trial, fabric, simulation.rest.x, moves);
    const MatX by_moves =
        descriptor.derivative(x, fabric.values, trial.sampling * response.x) - by_values;
    auto own = result.middleCols(first, count);
    own.topRows(entries) = weight.asDiagonal() * by_moves.leftCols(count);
    for (std::size_t i = 0; i < measured.size(); ++i) {
      const Eigen::Index c = measured[i];
      const Vec3 force = simulation.forces.col(c);
      const double magnitude = force.norm();
      if (magnitude > kLeastForce)
        own.row(entries + static_cast<Eigen::Index>(i)) =
            force.transpose() * response.forces.middleRows(3 * c, 3).leftCols(count) /
            (magnitude * trial.target.clamps[at(c)].force_noise);
    }
  }
  return result;
}

void ScanProblem::take_clamp_errors_at(const VecX& scaled) {
  if (clamp_errors_at_.size() > 0 && clamp_errors_at_ == scaled) return;
  std::vector<ScanSimulation> simulations;
  if (!simulate(scaled, HeldDerivatives::none, simulations, nullptr)) return;
  const Fabric found = fabric(scaled);
  std::vector<SharedErrors> taken(trials_.size());
  parallel_for(trials_.size(), threads_, [&](std::size_t t) {
    taken[t] = SharedErrors(by_clamp_errors(t, simulations[t], found));
  });
  shared_errors_ = std::move(taken);
  clamp_errors_at_ = scaled;
}

double ScanProblem::compute_cost(const VecX& scaled, std::string* reason) const {
  std::vector<ScanSimulation> simulations;
  if (!simulate(scaled, HeldDerivatives::none, simulations, reason)) return kInfinity;
  const Fabric found = fabric(scaled);
  double sum = 0;
  for (std::size_t t = 0; t < trials_.size(); ++t) {
    const Residuals r = residuals(t, simulations[t], found, HeldDerivatives::none);
    sum += r.shape.squaredNorm() + r.force.squaredNorm();
  }
  const double p = penalty(found, nullptr);
  return sum / residual_count_ + p * p;
}

ScanProblem::Linearization ScanProblem::compute_linearization(const VecX& scaled) const {
  Linearization result;
  const int n = dimension();
  result.model.gradient = VecX::Zero(n);
  result.model.hessian = MatX::Zero(n, n);
  std::vector<ScanSimulation> simulations;
  if (!simulate(scaled, HeldDerivatives::all, simulations, &result.reason)) {
    result.model.cost = kInfinity;
    return result;
  }
  const Fabric found = fabric(scaled);
  const double factor = 1 / residual_count_;
  const auto add = [&](std::size_t t, int part, const VecX& r, const MatX& by_values) {
    const MatX jacobian = by_scaled(scaled, by_values);
    CostPart own = part_of_squares(t, part, factor, jacobian, r);
    result.model.cost += factor * r.squaredNorm();
    result.model.gradient += own.gradient;
    result.model.hessian += own.hessian;
    result.parts.push_back(std::move(own));
  };
  result.target_rms = no_scales();
  double shape = 0, force = 0;
  int forces = 0;
  for (std::size_t t = 0; t < trials_.size(); ++t) {
    const auto target = static_cast<Eigen::Index>(t);
    const Residuals r = residuals(t, simulations[t], found, HeldDerivatives::all);
    add(t, 0, r.shape, r.shape_jacobian);
    if (r.force.size() > 0) add(t, 1, r.force, r.force_jacobian);
    if (simulations[t].rest.inexact) ++result.inexact;
    result.target_rms[target] =
        scales_[target] * root_mean_square(r.shape, trials_[t]->measured_descriptor->counted());
    shape += result.target_rms[target] * result.target_rms[target];
    force += scales_[target] * scales_[target] * r.force.squaredNorm();
    forces += static_cast<int>(r.force.size());
  }
  result.shape_rms = std::sqrt(shape / static_cast<double>(trials_.size()));
  result.force_rms = forces ? std::sqrt(force / forces) : 0;
  VecX gradient;
  const double p = penalty(found, &gradient);
  const VecX by = by_scaled(scaled, gradient.transpose()).transpose();
  result.model.cost += p * p;
  result.model.gradient += 2 * p * by;
  result.model.hessian += 2 * by * by.transpose();
  return result;
}

std::string ScanProblem::fingerprint() const {
  ContentHash hash;
  hash.add(solver_->name());
  hash.add(std::string_view(fabric_.model));
  hash.add(fabric_.values);
  for (const ScanParameter& p : parameters_) {
    hash.add(std::string_view(p.info.name));
    hash.add(p.info.lower);
    hash.add(p.info.upper);
  }
  hash.add(options_.poisson_limit);
  hash.add(options_.poisson_tolerance);
  hash.add(options_.largest_residual);
  for (std::size_t t = 0; t < trials_.size(); ++t) {
    const ScanTrial& trial = *trials_[t];
    hash.add(trial.areal_density);
    hash.add(trial.grain_angle);
    hash.add(trial.hem_width);
    hash.add(trial.target.gravity);
    hash.add(trial.target.noise);
    hash.add(trial.mesh.material);
    for (const auto& triangle : trial.mesh.triangles)
      hash.add_bytes(triangle.data(), sizeof triangle);
    hash.add_bytes(trial.clamp_of.data(), trial.clamp_of.size() * sizeof(int));
    hash.add(trial.start);
    hash.add_bytes(trial.clamp_errors.valuePtr(),
                   at(trial.clamp_errors.nonZeros()) * sizeof(double));
    hash.add_bytes(trial.clamp_errors.innerIndexPtr(),
                   at(trial.clamp_errors.nonZeros()) * sizeof(int));
    for (const ScanClamp& clamp : trial.target.clamps) {
      hash.add(clamp.force.value_or(-1));
      hash.add(clamp.force_noise);
    }
    // What of the shape is compared, and how.
    hash.add(trial.grid.mesh.material);
    hash.add(trial.grid.weights);
    hash.add(trial.measured);
    hash.add(trial.simulated_descriptor->value(trial.measured, fabric_.values));
    hash.add(trial.measured_descriptor->value(trial.measured, fabric_.values));
    hash.add(shape_noise_[t]);
  }
  priors_.add_to(hash);
  return hash.hex();
}

std::string ScanProblem::key(const char* what, const VecX& scaled) const {
  ContentHash hash;
  hash.add(std::string_view(what));
  hash.add(scaled);
  hash.add(scales_);
  hash.add(clamp_errors_at_);
  return hash.hex();
}

double ScanProblem::cost(const VecX& scaled, std::string* reason) const {
  if (!store_) return compute_cost(scaled, reason);
  const std::string at = key("cost", scaled);
  if (const auto found = store_->find(at)) {
    if (reason) reason->clear();
    return (*found)[0];
  }
  const double value = compute_cost(scaled, reason);
  if (std::isfinite(value)) store_->add(at, VecX::Constant(1, value));
  return value;
}

namespace {

/// A linearization as numbers: what is one, then each part.
VecX scan_to_numbers(const ScanProblem::Linearization& l) {
  NumberWriter writer;
  for (const double number :
       {l.model.cost, static_cast<double>(l.inexact), l.shape_rms, l.force_rms})
    writer.add(number);
  writer.add(l.model.gradient);
  writer.add(l.model.hessian);
  writer.add(l.target_rms);
  add_parts(l.parts, writer);
  return writer.numbers();
}

ScanProblem::Linearization scan_from_numbers(const VecX& numbers, Eigen::Index n,
                                             Eigen::Index targets) {
  ScanProblem::Linearization l;
  NumberReader reader(numbers);
  l.model.cost = reader.number();
  l.inexact = static_cast<int>(reader.number());
  l.shape_rms = reader.number();
  l.force_rms = reader.number();
  l.model.gradient = reader.vector(n);
  l.model.hessian = reader.matrix(n, n);
  l.target_rms = reader.vector(targets);
  l.parts = read_parts(reader, n);
  return l;
}

}  // namespace

ScanProblem::Linearization ScanProblem::linearize(const VecX& scaled) const {
  if (!store_) return compute_linearization(scaled);
  const std::string at = key("linearization", scaled);
  const auto targets = static_cast<Eigen::Index>(trials_.size());
  if (const auto found = store_->find(at)) return scan_from_numbers(*found, scaled.size(), targets);
  Linearization result = compute_linearization(scaled);
  if (std::isfinite(result.model.cost)) store_->add(at, scan_to_numbers(result));
  return result;
}

namespace {

enum class StiffnessPart { membrane, bending };

/// Indices of the parameters of one part.
std::vector<Eigen::Index> indices_of(const ScanProblem& problem, StiffnessPart part) {
  const bool bending = part == StiffnessPart::bending;
  std::vector<Eigen::Index> indices;
  for (std::size_t i = 0; i < problem.parameters().size(); ++i)
    if (problem.parameters()[i].bending == bending) indices.push_back(static_cast<Eigen::Index>(i));
  return indices;
}

/// With the noise of the targets as stated and the clamps' errors as about `errors_at`.
double stated_cost(ScanProblem problem, const VecX& errors_at, const VecX& x) {
  problem.set_scales(problem.no_scales());
  problem.take_clamp_errors_at(errors_at);
  return problem.cost(x);
}

/// One fit, from one start.
class Descent {
 public:
  Descent(ScanProblem& problem, const ScanFitOptions& options, const ScanFitObserver& observer,
          ScanFitResult& result)
      : problem_(problem), options_(options), observer_(observer), result_(result) {}

  ScanFitEnd run(const Fabric& start, const std::string& name) {
    name_ = name;
    ScanFitEnd end;
    x_ = problem_.scaled(start).cwiseMax(0).cwiseMin(1);
    end.start = problem_.fabric(x_);
    problem_.set_scales(problem_.no_scales());
    problem_.take_clamp_errors_at(x_);
    problem_.weigh_priors(residual_noise(problem_));
    end.cost_start = problem_.cost(x_, &reason_);
    end.cost = end.cost_start;
    iterations_ = 0;
    if (std::isfinite(end.cost_start)) {
      schedule();
      for (int pass = 1; pass <= kBalancePasses && !result_.stopped; ++pass) {
        const bool balanced = rebalance(), weighed = weigh_priors();
        if (!balanced && !weighed) break;
        descend_all(fmt::format("{} {}", balanced ? "balance" : "priors", pass));
      }
      end.cost = stated_cost(problem_, x_, x_);
    }
    end.fabric = problem_.fabric(x_);
    end.iterations = iterations_;
    return end;
  }
  const std::string& reason() const { return reason_; }
  const VecX& x() const { return x_; }

 private:
  void schedule() {
    const auto bending = indices_of(problem_, StiffnessPart::bending);
    const auto membrane = indices_of(problem_, StiffnessPart::membrane);
    if (options_.schedule == ScanSchedule::together || bending.empty() || membrane.empty()) {
      descend_all("all");
      return;
    }
    for (int round = 1; round <= options_.rounds && !result_.stopped; ++round) {
      descend(bending, fmt::format("bending {}", round));
      descend(membrane, fmt::format("membrane {}", round));
    }
  }

  /// Weighs by what is now known of the noise: of where clamps are held, and of the targets. False
  /// where that changes nothing.
  bool rebalance() {
    const double before = problem_.cost(x_);
    problem_.take_clamp_errors_at(x_);
    const ScanProblem::Linearization found = problem_.linearize(x_);
    if (!std::isfinite(found.model.cost)) return false;
    const double change_of_sum = std::abs(found.model.cost - before) * problem_.residual_count();
    const bool reweighed = change_of_sum > std::max(kLeastChange, (kSameScale - 1) * before *
                                                                      problem_.residual_count());
    if (options_.balance == ScanBalance::noise) return reweighed;
    const VecX scales = found.target_rms.cwiseMax(1);
    const VecX change = scales.cwiseQuotient(problem_.scales());
    if (std::max(change.maxCoeff(), 1 / change.minCoeff()) < kSameScale) return reweighed;
    problem_.set_scales(scales);
    return true;
  }

  /// By the dispersion of the residuals. False where that is as it was, or not known.
  bool weigh_priors() {
    if (problem_.priors().empty()) return false;
    const ScanProblem::Linearization found = problem_.linearize(x_);
    if (!std::isfinite(found.model.cost)) return false;
    const double weight =
        residual_dispersion(found.parts, found.model.cost, problem_.residual_count());
    const double change = weight / problem_.priors().weight();
    if (std::max(change, 1 / change) < kSameScale) return false;
    problem_.weigh_priors(weight);
    return true;
  }

  void descend_all(const std::string& phase) {
    std::vector<Eigen::Index> all(at(x_.size()));
    std::iota(all.begin(), all.end(), 0);
    descend(all, phase);
  }

  void descend(const std::vector<Eigen::Index>& free, const std::string& phase) {
    if (result_.stopped) return;
    const auto full = [&](const VecX& part) {
      VecX x = x_;
      x(free) = part;
      return x;
    };
    double best = kInfinity;
    // Of each evaluation its cost, and whether it was taken from the store.
    const auto count = [&](double cost, const Replays<ScanProblem>& replays) {
      best = std::min(best, cost);
      result_.replayed += replays.since();
      result_.history.push_back(
          {++result_.evaluations, cost, best, name_ + phase, replays.since() > 0});
      if (observer_ && !observer_(result_.history.back())) result_.stopped = true;
    };
    const LinearizeFunction linearize = [&](const VecX& part) {
      const Replays replays(problem_);
      const QuadraticModel all =
          with_priors(problem_, full(part), problem_.linearize(full(part)).model);
      count(all.cost, replays);
      QuadraticModel own;
      own.cost = all.cost;
      own.gradient = all.gradient(free);
      own.hessian = all.hessian(free, free);
      return own;
    };
    const CostFunction cost = [&](const VecX& part) {
      const Replays replays(problem_);
      const double value = problem_.cost(full(part)) + problem_.priors().cost(full(part));
      count(value, replays);
      return value;
    };
    const auto size = static_cast<Eigen::Index>(free.size());
    PayingSteps steps(kInfinity, problem_.residual_count());
    const LeastSquaresObserver after_step = [&](const LeastSquaresStep& step) {
      return !result_.stopped && steps.pay_after(step);
    };
    const LeastSquaresResult found =
        minimize_least_squares(linearize, cost, x_(free), VecX::Zero(size), VecX::Ones(size),
                               options_.least_squares, after_step);
    x_ = full(found.x);
    iterations_ += found.iterations;
  }

  ScanProblem& problem_;
  const ScanFitOptions& options_;
  const ScanFitObserver& observer_;
  ScanFitResult& result_;
  VecX x_;
  std::string name_, reason_;
  int iterations_ = 0;
};

/// Within `spread` of the start: of a sheet its moduli, so that it stays one, of other models each
/// of the parameters.
Fabric random_start(const ScanProblem& problem, const Fabric& start, double spread, Rng& rng) {
  const auto factor = [&] { return std::exp(std::log(spread) * rng.uniform(-1, 1)); };
  Fabric fabric = start;
  if (!is_orthotropic_sheet(start)) {
    for (const ScanParameter& parameter : problem.parameters()) {
      const double by = factor();
      for (const auto& [index, share] : parameter.values) fabric.values[index] *= by;
    }
    return fabric;
  }
  OrthotropicModuli m = moduli_of(stiffness_of(start));
  m.e_u *= factor();
  m.e_v *= factor();
  m.shear *= factor();
  m.b *= factor();
  // nu^2 E_v / E_u stays below 1.
  m.poisson = rng.uniform(kLeastPoisson, std::min(kMostPoisson, 0.9 * std::sqrt(m.e_u / m.e_v)));
  fabric.values.head(8) = orthotropic_fabric("", stiffness_of(m)).values;
  return fabric;
}

/// Of the residuals in units of the stated noise.
double unscaled_dispersion(ScanProblem problem, const VecX& x) {
  if (problem.priors().empty()) return 0;
  problem.set_scales(problem.no_scales());
  const ScanProblem::Linearization found = problem.linearize(x);
  return residual_dispersion(found.parts, found.model.cost, problem.residual_count());
}

/// ScanFitResult::mesh.
MeshShift mesh_shift_of(const ScanProblem& problem, const VecX& x,
                        const ScanProblem::Linearization& at_end, const ScanFitOptions& options) {
  if (!options.mesh_solver) return find_mesh_shift(problem, x, at_end);
  const ScanProblem other = problem.solved_by(options.mesh_solver);
  return find_mesh_shift(other, x, other.linearize(x));
}

void check(const ScanFitOptions& options) {
  if (options.rounds < 1)
    throw Error(fmt::format("rounds is {}, must be at least 1", options.rounds));
  if (options.random_starts < 0)
    throw Error(fmt::format("random starts are {}, must be at least 0", options.random_starts));
  if (!(options.spread > 1) || !std::isfinite(options.spread))
    throw Error(fmt::format("spread is {:g}, must be above 1", options.spread));
}

}  // namespace

ScanFitResult fit_scan(ScanProblem problem, const Fabric& start, const ScanFitOptions& options,
                       const ScanFitObserver& observer) {
  check(options);
  const auto begin = Clock::now();
  ScanFitResult result;
  Rng rng(options.seed);
  std::optional<VecX> first, best;
  WeighedPriors compared = problem.priors();
  double least = kInfinity;  // of the costs of the ends, with these
  for (int i = 0; i <= options.random_starts && !result.stopped; ++i) {
    const Fabric from = i == 0 ? start : random_start(problem, start, options.spread, rng);
    Descent descent(problem, options, observer, result);
    ScanFitEnd end =
        descent.run(from, options.random_starts ? fmt::format("start {}, ", i + 1) : "");
    if (i == 0 && !std::isfinite(end.cost_start))
      throw Error(fmt::format("the start cannot be computed: {}", descent.reason()));
    if (!first) first = descent.x();
    const double cost_here = end.cost;
    // Ends of several starts are compared by what they were all asked for.
    if (i > 0 && std::isfinite(cost_here)) end.cost = stated_cost(problem, *first, descent.x());
    result.ends.push_back(end);
    if (i == 0 && options.random_starts > 0)
      compared.weigh(unscaled_dispersion(problem, descent.x()));
    const double minimized = end.cost + compared.cost(descent.x());
    if (best && !(minimized < least)) continue;
    least = minimized;
    best = descent.x();
    result.cost = cost_here;
    result.fabric = end.fabric;
    result.iterations = end.iterations;
    result.scales = problem.scales();
    result.prior_weight = problem.priors().weight();
    result.prior_error = problem.priors().cost(*best);
  }
  result.start = result.ends.front().start;
  result.cost_start = result.ends.front().cost_start;
  problem.set_scales(result.scales);
  problem.take_clamp_errors_at(*best);
  problem.weigh_priors(result.prior_weight);
  const Replays replays(problem);
  const ScanProblem::Linearization at_end = problem.linearize(*best);
  ++result.evaluations;
  result.replayed += replays.since();
  result.inexact = at_end.inexact;
  result.shape_rms = at_end.shape_rms;
  result.force_rms = at_end.force_rms;
  if (options.mesh_error == MeshError::included)
    result.mesh = mesh_shift_of(problem, *best, at_end, options);
  if (std::isfinite(at_end.model.cost)) {
    ResidualIntervals found = residual_intervals(problem.infos(), *best, at_end.model, at_end.parts,
                                                 problem.residual_count(), options.confidence,
                                                 mesh_half_widths(result.mesh.shift),
                                                 problem.priors().term(*best, best->size()));
    result.intervals = std::move(found.intervals);
    result.certainty = std::move(found.certainty);
  }
  result.wall_s = seconds_since(begin);
  return result;
}

}  // namespace weft
