#include "report_of_scan.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "weft/fabric/orthotropic.h"
#include "weft/registration/registration_checks.h"

namespace weft::app {
namespace {

/// Both shapes at the scan's vertices; those that were not measured are not coloured as errors.
void add_shape(const ScanTrial& trial, const ScanSimulation& simulation, ReportMechanical& report) {
  const Points& measured = trial.shape.x;
  const VecX flat =
      trial.at_scan * Eigen::Map<const VecX>(simulation.rest.x.data(), simulation.rest.x.size());
  const Points computed = Eigen::Map<const Points>(flat.data(), 3, flat.size() / 3);
  VecX residual = (computed - measured).colwise().norm().transpose();
  if (trial.shape.weights.size() == residual.size())
    residual = (trial.shape.weights.array() > 0).select(residual, 0);
  ShapeView view;
  if (trial.target.gravity.norm() > 0) view.up = -trial.target.gravity.normalized();
  view.lower = measured.rowwise().minCoeff().cwiseMin(computed.rowwise().minCoeff());
  view.upper = measured.rowwise().maxCoeff().cwiseMax(computed.rowwise().maxCoeff());
  std::vector<double> sorted(residual.begin(), residual.end());
  std::ranges::sort(sorted);
  report.full_distance = std::max(sorted[sorted.size() * 99 / 100], 1e-6);
  report.shapes.push_back({0, encode_png(shape_picture(trial.shape.mesh, measured, {}, 1, view)),
                           encode_png(shape_picture(trial.shape.mesh, computed, residual,
                                                    report.full_distance, view))});
}

std::vector<ReportClampForce> report_clamps(const ScanTarget& target,
                                            const ScanDifference& difference) {
  std::vector<ReportClampForce> clamps;
  for (std::size_t i = 0; i < target.clamps.size(); ++i) {
    const ScanClamp& clamp = target.clamps[i];
    clamps.push_back({clamp.name, clamp.force, clamp.force_noise,
                      difference.forces[static_cast<Eigen::Index>(i)]});
  }
  return clamps;
}

std::optional<ReportRegistration> report_registration(const ScanTrial& trial) {
  if (!trial.registration) return std::nullopt;
  const ScanRegistration& found = *trial.registration;
  ReportRegistration r;
  r.points = found.points;
  r.inliers = found.inliers;
  r.residual_median = found.residual_median;
  r.residual_95 = found.residual_p95;
  r.strain_rms = found.strain_rms;
  r.vertices = static_cast<int>(found.weight.size());
  r.unsupported = unsupported_vertices(found);
  return r;
}

using ModuliValues = Eigen::Array<double, 5, 1>;
constexpr std::array<std::array<const char*, 3>, 5> kModuli{
    {{"E_u", "N/m", "Young's modulus times thickness along u."},
     {"E_v", "N/m", "Young's modulus times thickness along v."},
     {"mu", "N/m", "Shear modulus times thickness."},
     {"nu", "", "Poisson's ratio: contraction along v under tension along u."},
     {"b", "N m", "Flexural rigidity, the mean of u and v."}}};
constexpr Eigen::Index kPoisson = 3;

/// In the scale of their intervals: logarithms, but of Poisson's ratio, which may be zero.
ModuliValues moduli_coordinates(const Fabric& fabric) {
  const OrthotropicModuli m = moduli_of(stiffness_of(fabric));
  return {std::log(m.e_u), std::log(m.e_v), std::log(m.shear), m.poisson, std::log(m.b)};
}

double from_coordinate(Eigen::Index modulus, double coordinate) {
  return modulus == kPoisson ? coordinate : std::exp(coordinate);
}

/// By the scaled coordinates of what was searched: a row a modulus.
MatX moduli_derivative(const ScanProblem& problem, const VecX& scaled) {
  constexpr double kStep = 1e-6;
  MatX derivative(ModuliValues::SizeAtCompileTime, scaled.size());
  for (Eigen::Index i = 0; i < scaled.size(); ++i) {
    // Inwards at an end of the range.
    VecX lower = scaled, upper = scaled;
    lower[i] = std::max(0.0, scaled[i] - kStep);
    upper[i] = std::min(1.0, scaled[i] + kStep);
    derivative.col(i) =
        (moduli_coordinates(problem.fabric(upper)) - moduli_coordinates(problem.fabric(lower))) /
        (upper[i] - lower[i]);
  }
  return derivative;
}

/// Half widths of what was searched and their covariance in units of them; zero where it is not
/// determined.
MatX interval_covariance(const ScanFitResult& fit) {
  const auto n = static_cast<Eigen::Index>(fit.intervals.size());
  MatX covariance = MatX::Zero(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      const ParameterInterval& a = fit.intervals[static_cast<std::size_t>(i)];
      const ParameterInterval& b = fit.intervals[static_cast<std::size_t>(j)];
      if (!a.bounded() || !b.bounded()) continue;
      const double correlation = i == j ? 1 : fit.certainty.correlation(i, j);
      if (std::isfinite(correlation)) covariance(i, j) = correlation * a.half_width * b.half_width;
    }
  }
  return covariance;
}

ReportMechanical report_target(const ScanCapture& capture, const ScanTrial& trial,
                               const ScanSimulation& simulation, const ScanDifference& difference) {
  ReportMechanical report;
  report.name = capture.name == trial.target.name || trial.target.name.empty()
                    ? capture.name
                    : capture.name + ", " + trial.target.name;
  report.description = capture.description;
  report.folder = capture.folder.string();
  report.width = capture.width;
  report.height = capture.height;
  report.areal_density = trial.areal_density;
  report.grain_angle = trial.grain_angle;
  report.point_count = difference.point_count;
  report.force_count = difference.force_count;
  report.force_rms = difference.force_rms;
  for (const ScanClamp& clamp : trial.target.clamps)
    report.force_largest = std::max(report.force_largest, clamp.force.value_or(0));
  if (report.force_largest > 0) report.force_relative = report.force_rms / report.force_largest;
  if (difference.point_count > 0)
    report.distance =
        ReportDistance{difference.distance.mean, difference.distance.rms, difference.distance.max};
  ReportMechanicalFrame& frame = report.frames.emplace_back();
  frame.converged = difference.converged;
  frame.distance = report.distance;
  report.clamps = report_clamps(trial.target, difference);
  report.registration = report_registration(trial);
  add_shape(trial, simulation, report);
  return report;
}

}  // namespace

MechanicalReport report_of_scan(const std::vector<ScanCapture>& captures,
                                const std::vector<std::shared_ptr<const ScanTrial>>& trials,
                                const std::vector<ScanSimulation>& simulations,
                                const std::vector<ScanDifference>& differences) {
  MechanicalReport report;
  std::size_t i = 0;
  for (const ScanCapture& capture : captures)
    for (std::size_t k = 0; k < capture.targets.size(); ++k, ++i)
      report.captures.push_back(report_target(capture, *trials[i], simulations[i], differences[i]));
  return report;
}

std::vector<ReportModulus> report_moduli(const ScanProblem& problem, const ScanFitResult& fit) {
  if (!is_orthotropic_sheet(fit.fabric)) return {};
  const ModuliValues found = moduli_coordinates(fit.fabric);
  std::vector<ReportModulus> moduli;
  for (const auto& [name, unit, meaning] : kModuli) {
    const auto i = static_cast<Eigen::Index>(moduli.size());
    moduli.push_back({name, unit, meaning, from_coordinate(i, found[i]), {}, {}});
  }
  if (fit.intervals.empty()) return moduli;
  const MatX derivative = moduli_derivative(problem, problem.scaled(fit.fabric));
  const MatX covariance = interval_covariance(fit);
  for (std::size_t k = 0; k < moduli.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    bool known = true;
    for (Eigen::Index j = 0; j < derivative.cols(); ++j)
      known =
          known && (derivative(i, j) == 0 || fit.intervals[static_cast<std::size_t>(j)].bounded());
    if (!known) continue;
    const double half =
        std::sqrt(std::max(0.0, derivative.row(i).dot(covariance * derivative.row(i).transpose())));
    moduli[k].lower = from_coordinate(i, found[i] - half);
    moduli[k].upper = from_coordinate(i, found[i] + half);
  }
  return moduli;
}

}  // namespace weft::app
