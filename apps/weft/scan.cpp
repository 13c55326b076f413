#include "scan.h"

#include <fmt/core.h>

#include <algorithm>
#include <numbers>

#include "mechanical.h"
#include "weft/base/error.h"
#include "weft/capture/landmark_file.h"
#include "weft/registration/registration_checks.h"

namespace weft::app {

void ScanArguments::add_to(CLI::App& command) {
  command
      .add_option("--descriptor", descriptor_,
                  "scans: what of a shape is compared: position, strain, energy, or fourier (the "
                  "magnitudes of its two-dimensional Fourier transform)")
      ->check(CLI::IsMember({"position", "strain", "energy", "fourier"}))
      ->capture_default_str();
  command
      .add_option(
          "--solver", solver_,
          "scans: how an equilibrium is found: static (Newton's method on the energy) or xpbd (one "
          "rigidity of bending, slower)")
      ->check(CLI::IsMember({"static", "xpbd"}))
      ->capture_default_str();
  command
      .add_option("--pattern", pattern_,
                  "scans: how the quads of the simulated grid are split: alternating, or uniform: "
                  "every diagonal runs the same way, and folds across them lock")
      ->check(CLI::IsMember({"alternating", "uniform"}))
      ->capture_default_str();
  command
      .add_option("--registered-cells", registered_cells_,
                  "scans: cells of the grid that is laid on a raw scan, across the shorter side")
      ->check(integer_in(2, 400))
      ->capture_default_str();
}

ScanOptions ScanArguments::options(const CLI::App& command, int threads) const {
  ScanOptions options;
  options.raw.cells = registered_cells_;
  options.raw.threads = threads;
  const CLI::Option* cells = command.get_option_no_throw("--cells");
  if (cells && cells->count() > 0) options.cells = cells->as<int>();
  options.descriptor = descriptor_from_name(descriptor_);
  options.pattern = grid_pattern_from_name(pattern_);
  return options;
}

std::shared_ptr<const EquilibriumSolver> ScanArguments::solver() const {
  if (solver_ == "xpbd") return make_xpbd_solver();
  return make_static_solver();
}

std::shared_ptr<const EquilibriumSolver> ScanArguments::mesh_solver() const {
  if (solver_ == "static") return nullptr;
  return make_static_solver();
}

const std::vector<std::string>& ScanArguments::names() {
  static const std::vector<std::string> names{"--descriptor", "--solver", "--pattern",
                                              "--registered-cells"};
  return names;
}

namespace {

/// Opens the scan, and its landmarks.
void check_raw(const ScanCapture& capture, const ScanTarget& target) {
  const Scan scan = read_scan(target.scan, target.unit);
  const GridTemplate swatch = make_grid_template(capture.width, capture.height, 3, 3);
  check_scan_extent(scan, swatch, {target.scan.string(), "unit", {}});
  const Vec3 extent = scan_extent(scan);
  fmt::print(
      "target      {}: raw scan {}, which a fit registers: {} points, {:.3g} x {:.3g} x "
      "{:.3g} m\n",
      target.name, target.scan.filename().string(), scan.size(), extent.x(), extent.y(),
      extent.z());
  if (target.landmarks.empty()) return;
  fmt::print("landmarks   {}\n", read_landmarks(target.landmarks, swatch).size());
}

/// Clamps may lie between the vertices of a grid where the fit simulates on another one.
void warn_of_clamps(const ScanTarget& target, const ScanShape& shape) {
  for (const ScanClamp& clamp : target.clamps) {
    const auto columns = shape.mesh.material.colwise();
    if (std::any_of(columns.begin(), columns.end(),
                    [&](const Vec2& uv) { return clamp.region.contains(uv); }))
      continue;
    fmt::print("warning: {}\n",
               error_at(clamp.where, fmt::format("no vertex of {} lies in it; give --cells to fit",
                                                 target.grid.filename().string()))
                   .what());
  }
}

void check_registered(const ScanCapture& capture, const ScanTarget& target) {
  const ScanShape shape = read_scan_shape(capture, target);
  const auto measured = std::ranges::count_if(shape.weights, counts_as_measured);
  fmt::print("target      {}: {} vertices, {} of them measured, noise {:g} m\n", target.name,
             shape.mesh.vertex_count(), measured, target.noise);
  warn_of_clamps(target, shape);
}

}  // namespace

void check_scan(const std::string& folder) {
  const ScanCapture capture = read_scan_capture(folder);
  fmt::print("capture     {} (scan)\n", capture.name);
  if (!capture.description.empty()) fmt::print("            {}\n", capture.description);
  fmt::print("swatch      {:g} x {:g} m, {:g} kg/m^2, u of the fabric at {:g} degrees\n",
             capture.width, capture.height, capture.areal_density,
             capture.grain_angle * 180 / std::numbers::pi);
  if (capture.hem_width > 0) fmt::print("hem         {:g} m\n", capture.hem_width);
  for (const ScanTarget& target : capture.targets) {
    if (target.grid.empty())
      check_raw(capture, target);
    else
      check_registered(capture, target);
    for (const ScanClamp& clamp : target.clamps) {
      fmt::print("clamp       {} ({}): ({:g}, {:g}) to ({:g}, {:g}) m, ", clamp.name,
                 clamp.kind == ClampKind::bar ? "bar" : "points", clamp.region.lower.x(),
                 clamp.region.lower.y(), clamp.region.upper.x(), clamp.region.upper.y());
      if (clamp.force)
        fmt::print("{:.4g} N\n", *clamp.force);
      else
        fmt::print("force not measured\n");
    }
  }
  fmt::print("truth       {}\n", capture.truth ? "declared; never read by a fit" : "none");
  fmt::print("ok\n");
}

nlohmann::json registration_json(const ScanTrial& trial) {
  if (!trial.registration) return nullptr;
  const ScanRegistration& r = *trial.registration;
  return {{"points", r.points},
          {"inliers", r.inliers},
          {"residual_median", r.residual_median},
          {"residual_p95", r.residual_p95},
          {"landmark_rms", r.landmark_rms},
          {"strain_rms", r.strain_rms},
          {"vertices", r.weight.size()},
          {"unsupported_vertices", unsupported_vertices(r)},
          {"warnings", registration_doubts(r)}};
}

std::string registration_summary(const ScanTrial& trial) {
  const nlohmann::json r = registration_json(trial);
  if (r.is_null()) return {};
  std::string text = fmt::format(
      "{}: registered to {} of {} points, median {:.2f} mm off, strain {:.2f} % rms; {} of {} "
      "vertices without support\n",
      trial.target.name, r["inliers"].get<int>(), r["points"].get<int>(),
      1e3 * r["residual_median"].get<double>(), 100 * r["strain_rms"].get<double>(),
      r["unsupported_vertices"].get<int>(), r["vertices"].get<int>());
  for (const std::string& doubt : registration_doubts(*trial.registration))
    text += fmt::format("warning: {}: {}\n", trial.target.name, doubt);
  return text;
}

nlohmann::json scan_json(const std::vector<std::shared_ptr<const ScanTrial>>& trials,
                         const std::vector<ScanDifference>& differences) {
  nlohmann::json list = nlohmann::json::array();
  for (std::size_t i = 0; i < trials.size(); ++i) {
    const ScanDifference& d = differences[i];
    nlohmann::json object = {{"name", trials[i]->target.name},
                             {"converged", d.converged},
                             {"net_force", json_number(d.residual)},
                             {"near", d.near},
                             {"within_near", json_number(d.within)}};
    add_distance(object, d.distance);
    nlohmann::json clamps = nlohmann::json::array();
    for (std::size_t c = 0; c < trials[i]->target.clamps.size(); ++c) {
      const ScanClamp& clamp = trials[i]->target.clamps[c];
      nlohmann::json entry = {{"name", clamp.name},
                              {"force", json_number(d.forces[static_cast<Eigen::Index>(c)])}};
      if (clamp.force) {
        entry["force_measured"] = *clamp.force;
        entry["force_noise"] = clamp.force_noise;
      }
      clamps.push_back(entry);
    }
    object["clamps"] = clamps;
    if (d.force_count > 0) object["force_rms"] = json_number(d.force_rms);
    if (trials[i]->registration) object["registration"] = registration_json(*trials[i]);
    list.push_back(object);
  }
  return list;
}

std::string scan_summary(const ScanTrial& trial, const ScanDifference& d) {
  std::string text =
      d.point_count == 0
          ? fmt::format("{}: no vertex measured", trial.target.name)
          : fmt::format(
                "{}: distance mean {:.3f}, rms {:.3f}, max {:.2f} mm, {:.1f} % of the "
                "vertices within {:g} mm",
                trial.target.name, 1e3 * d.distance.mean, 1e3 * d.distance.rms,
                1e3 * d.distance.max, 100 * d.within, 1e3 * d.near);
  if (d.force_count > 0) text += fmt::format("; force {:.3g} N rms", d.force_rms);
  if (!d.converged) text += fmt::format("; no equilibrium, {:.2g} N are left", d.residual);
  return text + "\n";
}

void check_registered_cells(const CLI::App& command, const std::vector<ScanCapture>& captures) {
  for (const ScanCapture& capture : captures)
    for (const ScanTarget& target : capture.targets)
      if (target.grid.empty()) return;
  refuse_options(command, {"--registered-cells"}, "grids that are registered");
}

void evaluate_scan(const ScanCapture& capture, const std::string& fabric,
                   const ScanOptions& options, const EquilibriumSolver& solver, bool json,
                   int threads) {
  const Fabric found = find_fabric(fabric);
  const auto trials = prepare_scan(capture, options);
  const auto simulations = simulate_scans(trials, solver, found, HeldDerivatives::none, threads);
  std::vector<ScanDifference> differences;
  for (std::size_t i = 0; i < trials.size(); ++i)
    differences.push_back(compare_scan(*trials[i], simulations[i]));
  if (json) {
    fmt::print(
        "{}\n",
        nlohmann::json{{"kind", "scan"}, {"targets", scan_json(trials, differences)}}.dump(2));
    return;
  }
  for (std::size_t i = 0; i < trials.size(); ++i)
    fmt::print("{}{}", registration_summary(*trials[i]), scan_summary(*trials[i], differences[i]));
}

}  // namespace weft::app
