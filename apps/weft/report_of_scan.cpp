#include "report_of_scan.h"

#include <algorithm>
#include <cmath>

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
  report.distance =
      ReportDistance{difference.distance.mean, difference.distance.rms, difference.distance.max};
  ReportMechanicalFrame& frame = report.frames.emplace_back();
  frame.converged = difference.converged;
  frame.distance = report.distance;
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

}  // namespace weft::app
