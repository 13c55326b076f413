#include "weft/dynamics/xpbd.h"

#include <fmt/format.h>

#include <cmath>

#include "weft/base/error.h"
#include "weft/dynamics/xpbd_sheet.h"

namespace weft {
namespace {

using xpbd::Derivatives;
using xpbd::Record;
using xpbd::Records;

constexpr int kStepsBetweenChecks = 25;
// In so many steps the least residual is to fall by this factor, or the masses are doubled.
constexpr int kWindow = 3000;
constexpr double kLeastProgress = 0.7;
constexpr int kMostRestarts = 8;
constexpr double kFurthest = 100;      // times the size of the swatch: the iteration has diverged
constexpr double kLargestForce = 1e3;  // times the largest at the start and all that acts: likewise

double dot(const Record& a, const Record& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

void add(Record& to, double factor, const Record& a) {
  to = {to.x + factor * a.x, to.y + factor * a.y, to.z + factor * a.z, to.w};
}

Record difference(const Record& a, const Record& b, double factor) {
  return {factor * (a.x - b.x), factor * (a.y - b.y), factor * (a.z - b.z), 0};
}

void check_positive(double value, const char* what, const char* unit) {
  if (!(value > 0) || !std::isfinite(value))
    throw Error(fmt::format("{} is {:g}{}, must be above 0", what, value, unit));
}

void check_vertex(int vertex, int count, const char* what) {
  if (vertex < 0 || vertex >= count)
    throw Error(fmt::format("{} {}: the mesh has the vertices 0 to {}", what, vertex, count - 1));
}

void check(const OrthotropicSheet& sheet) {
  check_positive(sheet.c00, "C00", " N/m");
  check_positive(sheet.c11, "C11", " N/m");
  check_positive(sheet.c22, "C22", " N/m");
  check_positive(sheet.areal_density, "areal density", " kg/m^2");
  if (!(sheet.c01 * sheet.c01 < sheet.c00 * sheet.c11))
    throw Error(fmt::format("C01 is {:g} N/m, its square must be below C00 C11 = {:g} N^2/m^2",
                            sheet.c01, sheet.c00 * sheet.c11));
  if (!(sheet.bend >= 0) || !std::isfinite(sheet.bend))
    throw Error(fmt::format("bend is {:g} N m, must be 0 or more", sheet.bend));
}

void check(const XpbdOptions& options, int vertex_count) {
  for (const PointLoad& load : options.loads) {
    check_vertex(load.vertex, vertex_count, "load on vertex");
    if (!load.force.allFinite())
      throw Error(fmt::format("the load on vertex {} is not finite", load.vertex));
  }
  if (!options.gravity.allFinite()) throw Error("gravity is not finite");
  if (!(options.time_step >= 0) || !std::isfinite(options.time_step))
    throw Error(
        fmt::format("time step is {:g} s, must be above 0, or 0 for automatic", options.time_step));
  check_positive(options.force_tolerance, "force tolerance", " N");
  check_positive(options.derivative_tolerance, "derivative tolerance", "");
  if (options.sweeps_per_step < 1)
    throw Error(fmt::format("{} sweeps per step, must be 1 or more", options.sweeps_per_step));
  if (options.max_iterations < 1)
    throw Error(fmt::format("{} iterations at most, must be 1 or more", options.max_iterations));
}

class Relaxation {
 public:
  Relaxation(const TriangleMesh& mesh, const OrthotropicSheet& sheet,
             const std::vector<int>& pinned, const Points& start, const XpbdOptions& options);
  XpbdEquilibrium run();

 private:
  /// From the start, at rest.
  void begin();
  void scale_masses(double factor);
  bool is_stuck(double residual);
  void start_derivatives();
  void step();
  void stop_what_turned();
  void adapt_masses();
  void predict(std::size_t i);
  void update_velocity(std::size_t i);
  bool has_diverged(double residual) const;
  double residual();
  double derivative_residual();
  void fill_reactions(XpbdEquilibrium& result);
  template <class Task>
  void for_free_vertices(const Task& task) {
    const xpbd::SlabOrder& order = system_.order();
    system_.for_slabs([&](std::size_t slab) {
      for (std::size_t i = at(order.first[slab]); i < at(order.first[slab + 1]); ++i)
        if (masses_[i] > 0) task(i);
    });
  }

  XpbdOptions options_;
  xpbd::SheetSystem sheet_;
  xpbd::System& system_;
  std::vector<int> pinned_;
  Points start_;
  double size_;                 // m, of the swatch
  double largest_force_ = 0;    // N
  double step_;                 // s; 1 where masses are made of stiffness
  Records force_;               // gravity and loads, N
  std::vector<double> masses_;  // 0 where pinned
  Records v_, dv_;
  Records before_, dbefore_;
  std::array<double, kSheetParameters> scale_{};  // of the derivatives of the force
  int sweeps_ = 0;
  Derivatives derivatives_ = Derivatives::none;
  // Of the window at hand and the one before, N.
  double least_ = kInfinity;
  double least_before_ = kInfinity;
  int checks_ = 0;
};

Relaxation::Relaxation(const TriangleMesh& mesh, const OrthotropicSheet& sheet,
                       const std::vector<int>& pinned, const Points& start,
                       const XpbdOptions& options)
    : options_(options),
      sheet_(mesh, sheet, pinned, options),
      system_(sheet_.system()),
      pinned_(pinned),
      start_(start),
      size_((mesh.material.rowwise().maxCoeff() - mesh.material.rowwise().minCoeff()).norm()),
      step_(options.time_step > 0 ? options.time_step : 1) {
  sheet_.set_step(step_);
  system_.set_sweep(options.sweep);
  const std::size_t n = at(mesh.vertex_count());
  force_.resize(n);
  before_.resize(n);
  const auto push = [&](int vertex, const Vec3& f) {
    add(force_[at(system_.order().index[at(vertex)])], 1, {f.x(), f.y(), f.z(), 0});
  };
  const VecX weights = sheet.areal_density * vertex_areas(mesh);
  for (int i = 0; i < mesh.vertex_count(); ++i) push(i, weights[i] * options.gravity);
  for (const PointLoad& load : options.loads) push(load.vertex, load.force);
  for (std::size_t i = 0; i < n; ++i) {
    const double w = system_.inverse_mass(i);
    masses_.push_back(w > 0 ? 1 / w : 0);
  }
  begin();
  double acting = 0, most = 0;
  for (const Record& f : force_) {
    acting += std::sqrt(dot(f, f));
    most = std::max(most, std::sqrt(dot(f, f)));
  }
  const double net = residual();
  largest_force_ = kLargestForce * std::max(net, acting);
  // A start that is nearly at rest keeps its balance; a rough one would be torn by its strains.
  if (net < most && options.multipliers == XpbdMultipliers::kept)
    system_.balance_multipliers(derivatives_);
}

void Relaxation::begin() {
  system_.set_positions(start_);
  system_.forget_multipliers();
  system_.forget_strains();
  v_.assign(force_.size(), Record{});
  if (options_.derivatives == XpbdDerivatives::along_iterates) start_derivatives();
}

void Relaxation::scale_masses(double factor) {
  for_free_vertices([&](std::size_t i) {
    masses_[i] *= factor;
    system_.set_inverse_mass(i, 1 / masses_[i]);
  });
}

/// Neither falling nor so large that it counts as diverged: a cycle of masses that are too small.
bool Relaxation::is_stuck(double residual) {
  least_ = std::min(least_, residual);
  if (++checks_ < kWindow / kStepsBetweenChecks) return false;
  const bool stuck = least_ > kLeastProgress * least_before_;
  least_before_ = stuck ? kInfinity : least_;
  least_ = kInfinity;
  checks_ = 0;
  return stuck;
}

void Relaxation::start_derivatives() {
  derivatives_ = Derivatives::all;
  system_.start_derivatives();
  dv_.assign(kSheetParameters * v_.size(), Record{});
  dbefore_ = dv_;
  // With the shape held these are the derivatives of the elastic force alone.
  system_.gather(xpbd::Pass::elastic, Derivatives::all);
  scale_.fill(0);
  for (std::size_t k = 0; k < dv_.size(); ++k) {
    const Record& d = system_.vertices().dpull[k];
    double& scale = scale_[k % kSheetParameters];
    scale = std::max(scale, std::sqrt(dot(d, d)));
  }
}

/// A velocity against the force that made it has gone past the valley's floor. `pull` is at hand.
void Relaxation::stop_what_turned() {
  const xpbd::Vertices& vertices = system_.vertices();
  double power = 0;
  for (std::size_t i = 0; i < v_.size(); ++i)
    power += step_ * step_ * dot(v_[i], force_[i]) + dot(v_[i], vertices.pull[i]);
  if (power < 0) {
    std::fill(v_.begin(), v_.end(), Record{});
    if (options_.derivatives == XpbdDerivatives::along_iterates)
      std::fill(dv_.begin(), dv_.end(), Record{});
  }
  if (derivatives_ == Derivatives::none || options_.derivatives == XpbdDerivatives::along_iterates)
    return;
  // At rest the derivatives come to rest by themselves, each parameter's by itself.
  std::array<double, kSheetParameters> powers{};
  for (std::size_t k = 0; k < dv_.size(); ++k)
    powers[k % kSheetParameters] += dot(dv_[k], vertices.dpull[k]);
  for (std::size_t k = 0; k < dv_.size(); ++k)
    if (powers[k % kSheetParameters] < 0) dv_[k] = {};
}

/// What the multipliers pull changes as the constraints turn; sweeps do not see that, and a vertex
/// lighter than this stiffness would run away.
void Relaxation::adapt_masses() {
  if (options_.time_step > 0 || derivatives_ == Derivatives::all) return;
  for_free_vertices([&](std::size_t i) {
    system_.set_inverse_mass(i, 1 / std::max(masses_[i], system_.vertices().pull[i].w));
  });
}

void Relaxation::predict(std::size_t i) {
  xpbd::Vertices& vertices = system_.vertices();
  const double w = system_.inverse_mass(i);
  before_[i] = vertices.x[i];
  add(vertices.x[i], step_, v_[i]);
  add(vertices.x[i], w * step_ * step_, force_[i]);
  add(vertices.x[i], w, vertices.pull[i]);
  if (derivatives_ == Derivatives::none) return;
  for (std::size_t k = kSheetParameters * i; k < kSheetParameters * (i + 1); ++k) {
    dbefore_[k] = vertices.dx[k];
    add(vertices.dx[k], step_, dv_[k]);
    add(vertices.dx[k], w, vertices.dpull[k]);
  }
}

void Relaxation::update_velocity(std::size_t i) {
  const xpbd::Vertices& vertices = system_.vertices();
  v_[i] = difference(vertices.x[i], before_[i], 1 / step_);
  if (derivatives_ == Derivatives::none) return;
  for (std::size_t k = kSheetParameters * i; k < kSheetParameters * (i + 1); ++k)
    dv_[k] = difference(vertices.dx[k], dbefore_[k], 1 / step_);
}

void Relaxation::step() {
  if (options_.multipliers == XpbdMultipliers::from_zero) system_.forget_multipliers();
  system_.gather(xpbd::Pass::warm, derivatives_);
  stop_what_turned();
  adapt_masses();
  for_free_vertices([&](std::size_t i) { predict(i); });
  for (int k = 0; k < options_.sweeps_per_step; ++k) system_.sweep(derivatives_);
  sweeps_ += options_.sweeps_per_step;
  for_free_vertices([&](std::size_t i) { update_velocity(i); });
}

double Relaxation::residual() {
  system_.gather(xpbd::Pass::elastic, Derivatives::none);
  double largest = 0;
  for (std::size_t i = 0; i < force_.size(); ++i) {
    if (masses_[i] == 0) continue;
    Record net = system_.vertices().pull[i];
    add(net, 1, force_[i]);
    const double size = std::sqrt(dot(net, net));
    if (!(size <= largest)) largest = size;  // NaN, too
  }
  return largest;
}

double Relaxation::derivative_residual() {
  system_.gather(xpbd::Pass::elastic, Derivatives::all);
  double largest = 0;
  for (std::size_t k = 0; k < dv_.size(); ++k) {
    if (masses_[k / kSheetParameters] == 0) continue;
    const Record& d = system_.vertices().dpull[k];
    const double scale = scale_[k % kSheetParameters];
    const double size = scale > 0 ? std::sqrt(dot(d, d)) / scale : std::sqrt(dot(d, d));
    if (!(size <= largest)) largest = size;
  }
  return largest;
}

bool Relaxation::has_diverged(double residual) const {
  if (!(residual < largest_force_)) return true;
  const Points moved = system_.positions() - start_;
  return !(moved.colwise().norm().maxCoeff() < kFurthest * size_);
}

XpbdEquilibrium Relaxation::run() {
  XpbdEquilibrium result;
  int restarts = 0;
  while (sweeps_ < options_.max_iterations) {
    for (int k = 0; k < kStepsBetweenChecks && sweeps_ < options_.max_iterations; ++k) step();
    result.residual = residual();
    if (has_diverged(result.residual)) {
      if (options_.time_step > 0 || ++restarts > kMostRestarts) break;
      scale_masses(4);
      begin();
      continue;
    }
    if (options_.time_step == 0 && derivatives_ == Derivatives::none && is_stuck(result.residual))
      scale_masses(2);
    if (result.residual > options_.force_tolerance) continue;
    if (options_.derivatives == XpbdDerivatives::none) {
      result.converged = true;
      break;
    }
    if (derivatives_ == Derivatives::none) start_derivatives();
    result.derivative_residual = derivative_residual();
    if (result.derivative_residual <= options_.derivative_tolerance) {
      result.converged = true;
      break;
    }
  }
  result.iterations = sweeps_;
  result.x = system_.positions();
  if (derivatives_ == Derivatives::all) result.derivative_residual = derivative_residual();
  fill_reactions(result);
  return result;
}

void Relaxation::fill_reactions(XpbdEquilibrium& result) {
  const xpbd::Vertices& vertices = system_.vertices();
  const std::vector<int>& index = system_.order().index;
  system_.gather(xpbd::Pass::elastic, derivatives_);
  result.reactions.resize(3, static_cast<Eigen::Index>(pinned_.size()));
  for (std::size_t k = 0; k < pinned_.size(); ++k) {
    const std::size_t i = at(index[at(pinned_[k])]);
    Record net = vertices.pull[i];
    add(net, 1, force_[i]);
    result.reactions.col(static_cast<Eigen::Index>(k)) << -net.x, -net.y, -net.z;
  }
  if (derivatives_ == Derivatives::none) return;
  const auto n = static_cast<Eigen::Index>(index.size());
  result.position_derivative.resize(3 * n, kSheetParameters);
  result.reaction_derivative.resize(3 * result.reactions.cols(), kSheetParameters);
  for (int p = 0; p < kSheetParameters; ++p) {
    const auto record = [&](const Records& from, std::size_t i) {
      const Record& r = from[kSheetParameters * i + at(p)];
      return Vec3(r.x, r.y, r.z);
    };
    for (Eigen::Index i = 0; i < n; ++i)
      result.position_derivative.block<3, 1>(3 * i, p) =
          record(vertices.dx, at(index[static_cast<std::size_t>(i)]));
    for (std::size_t k = 0; k < pinned_.size(); ++k)
      result.reaction_derivative.block<3, 1>(3 * static_cast<Eigen::Index>(k), p) =
          -record(vertices.dpull, at(index[at(pinned_[k])]));
  }
}

}  // namespace

XpbdEquilibrium xpbd_equilibrium(const TriangleMesh& mesh, const OrthotropicSheet& sheet,
                                 const std::vector<int>& pinned, const Points& start,
                                 const XpbdOptions& options) {
  validate(mesh, "mesh");
  check(sheet);
  check(options, mesh.vertex_count());
  for (const int i : pinned) check_vertex(i, mesh.vertex_count(), "pinned vertex");
  if (start.cols() != mesh.vertex_count() || !start.allFinite())
    throw Error(fmt::format("the start has {} positions; {} finite ones are needed", start.cols(),
                            mesh.vertex_count()));
  return Relaxation(mesh, sheet, pinned, start, options).run();
}

}  // namespace weft
