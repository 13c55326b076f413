#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <limits>

#include "scan_validation.h"
#include "weft/estimate/estimate_scatter.h"
#include "weft/fabric/orthotropic.h"

namespace weft {
namespace {

void print_moduli(const char* name, const Fabric& fabric) {
  const OrthotropicModuli m = moduli_of(stiffness_of(fabric));
  fmt::print("{:<9} {:>10.4f} {:>10.4f} {:>10.4f} {:>9.5f} {:>12.5g}\n", name, m.e_u, m.e_v,
             m.shear, m.poisson, m.b);
}

void print_errors(const Fabric& found, const Fabric& truth) {
  const OrthotropicModuli a = moduli_of(stiffness_of(found)), b = moduli_of(stiffness_of(truth));
  fmt::print("{:<9} {:>9.3f}% {:>9.3f}% {:>9.3f}% {:>8.3f}% {:>11.3f}%\n", "error",
             100 * (a.e_u / b.e_u - 1), 100 * (a.e_v / b.e_v - 1), 100 * (a.shear / b.shear - 1),
             100 * (a.poisson / b.poisson - 1), 100 * (a.b / b.b - 1));
}

std::string interval_text(const ParameterInterval& p, double truth) {
  if (!p.determined) return "not determined";
  const bool holds = p.lower <= truth && truth <= p.upper;
  return fmt::format("{:.5g} to {:.5g}{}", p.lower, p.upper,
                     std::isnan(truth) ? ""
                     : holds           ? " holds"
                                       : " MISSES");
}

void print_moduli_of(const ScanFitResult& fit, const Fabric* truth) {
  fmt::print("{:<9} {:>10} {:>10} {:>10} {:>9} {:>12}\n", "", "E_u N/m", "E_v N/m", "mu N/m", "nu",
             "b N m");
  print_moduli("start", fit.start);
  print_moduli("found", fit.fabric);
  if (!truth) return;
  print_moduli("truth", *truth);
  print_errors(fit.fabric, *truth);
}

void print_values_of(const ScanProblem& problem, const ScanFitResult& fit, const Fabric* truth) {
  for (const ScanParameter& p : problem.parameters()) {
    const int index = p.values.front().first;
    fmt::print("  {:<20} start {:>10.5g}, found {:>10.5g} {}", p.info.name, fit.start.values[index],
               fit.fabric.values[index], p.info.unit);
    if (truth)
      fmt::print(", true {:.5g}, {:.3f} of it", truth->values[index],
                 fit.fabric.values[index] / truth->values[index]);
    fmt::print("\n");
  }
}

/// Of the noise alone, and with what the width of the cells does.
void print_intervals(const ScanProblem& problem, const ScanFitResult& fit, const Fabric* truth) {
  if (fit.intervals.empty()) return;
  if (!fit.mesh.unknown.empty()) fmt::print("mesh's error unknown: {}\n", fit.mesh.unknown);
  fmt::print("  {:<15} {:>11} {:>9} {:>9}  {:<32} {}\n", "parameter", "found", "error", "mesh",
             "90 % of the noise", "90 % of noise and mesh");
  const VecX scaled = problem.scaled(fit.fabric), added = mesh_half_widths(fit.mesh.shift);
  for (std::size_t k = 0; k < fit.intervals.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    const ParameterInterval& p = fit.intervals[k];
    const ScanParameter& parameter = problem.parameters()[k];
    const auto& [index, factor] = parameter.values.front();
    const double value =
        truth ? truth->values[index] / factor : std::numeric_limits<double>::quiet_NaN();
    const double moved = added.size() == 0
                             ? std::numeric_limits<double>::quiet_NaN()
                             : from_scaled(parameter.info, scaled[i] + fit.mesh.shift[i]) / p.value;
    ParameterInterval noise = p;
    if (p.determined && added.size() > 0)
      noise = interval_about(parameter.info, scaled[i], p.half_width - added[i]);
    fmt::print("  {:<15} {:>11.5g} {:>8.2f}% {:>8.2f}%  {:<32} {}\n", p.name, p.value,
               100 * (p.value / value - 1), 100 * (moved - 1), interval_text(noise, value),
               interval_text(p, value));
  }
}

}  // namespace

void print_fit(const ScanProblem& problem, const ScanFitResult& fit, const Fabric* truth) {
  const bool sheet = is_orthotropic_sheet(fit.fabric);
  if (sheet)
    print_moduli_of(fit, truth);
  else
    print_values_of(problem, fit, truth);
  fmt::print(
      "cost {:.4g} from {:.4g}; {} iterations, {} evaluations, {:.1f} s; residuals in units of "
      "noise: shape {:.3g}, force {:.3g}; {} inexact\n",
      fit.cost, fit.cost_start, fit.iterations, fit.evaluations, fit.wall_s, fit.shape_rms,
      fit.force_rms, fit.inexact);
  for (std::size_t i = 0; sheet && fit.ends.size() > 1 && i < fit.ends.size(); ++i) {
    const OrthotropicModuli a = moduli_of(stiffness_of(fit.ends[i].start)),
                            b = moduli_of(stiffness_of(fit.ends[i].fabric));
    fmt::print(
        "  from E_u {:.4g}, E_v {:.4g}, mu {:.4g}, nu {:.3g}, b {:.3g} to {:.5g}, {:.5g}, {:.5g}, "
        "{:.4g}, {:.4g}: cost {:.6g}, {} iterations\n",
        a.e_u, a.e_v, a.shear, a.poisson, a.b, b.e_u, b.e_v, b.shear, b.poisson, b.b,
        fit.ends[i].cost, fit.ends[i].iterations);
  }
  print_intervals(problem, fit, truth);
  std::fflush(stdout);
}

/// How far a fabric is from each target.
void print_targets(const ScanProblem& problem, const Fabric& fabric, const char* name) {
  const auto simulations = simulate_scans(problem.trials(), problem.solver(), fabric);
  const auto found = problem.linearize(problem.scaled(fabric));
  fmt::print("{}: cost {:.4g}, residuals in units of noise: shape {:.3g}, force {:.3g}\n", name,
             found.model.cost, found.shape_rms, found.force_rms);
  for (std::size_t i = 0; i < simulations.size(); ++i) {
    const ScanTrial& trial = *problem.trials()[i];
    const ScanDifference d = compare_scan(trial, simulations[i]);
    fmt::print("  {:<22} distance mean {:.3f}, max {:.2f} mm, {:5.1f} % within {:g} mm, forces",
               trial.target.name, 1e3 * d.distance.mean, 1e3 * d.distance.max, 100 * d.within,
               1e3 * d.near);
    for (std::size_t c = 0; c < trial.target.clamps.size(); ++c)
      if (trial.target.clamps[c].force)
        fmt::print(" {:.4f}/{:.4f}", d.forces[static_cast<Eigen::Index>(c)],
                   *trial.target.clamps[c].force);
    fmt::print(" N{}\n", d.converged ? "" : "  NOT at rest");
  }
  std::fflush(stdout);
}

}  // namespace weft
