#include "weft/estimate/raw_scan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "weft/base/error.h"
#include "weft/capture/landmark_file.h"
#include "weft/registration/hung_start.h"
#include "weft/registration/registration_checks.h"

namespace weft {
namespace {

/// Whether three of them are corners of a triangle in (u, v).
bool off_a_line(const std::vector<Landmark>& landmarks) {
  if (landmarks.size() < 3) return false;
  const Vec2 first = landmarks.front().uv;
  const auto far = std::max_element(
      landmarks.begin(), landmarks.end(), [&](const Landmark& a, const Landmark& b) {
        return (a.uv - first).squaredNorm() < (b.uv - first).squaredNorm();
      });
  const Vec2 along = far->uv - first;
  return std::any_of(landmarks.begin(), landmarks.end(), [&](const Landmark& l) {
    const Vec2 d = l.uv - first;
    return std::abs(along.x() * d.y() - along.y() * d.x()) > 1e-2 * along.squaredNorm();
  });
}

std::vector<Landmark> held_of(const std::vector<Landmark>& landmarks, const ScanTarget& target) {
  std::vector<Landmark> held;
  for (const Landmark& landmark : landmarks) {
    const bool inside =
        std::any_of(target.clamps.begin(), target.clamps.end(),
                    [&](const ScanClamp& clamp) { return clamp.region.contains(landmark.uv); });
    if (inside) held.push_back(landmark);
  }
  return held;
}

Scan read_sampled(const ScanTarget& target, const GridTemplate& grid, const ScanSource& source,
                  double spacing) {
  const Scan scan = read_scan(target.scan, target.unit);
  check_scan_extent(scan, grid, source);
  return sample_scan(scan, spacing);
}

std::vector<RegistrationStart> flat_starts_of(const ScanTarget& target, const GridTemplate& grid,
                                              const Scan& scan, const ScanGeometry& geometry) {
  return with_errors_at({.file = target.scan}, [&] {
    return flat_starts(grid, scan, geometry, target.u_axis, target.v_axis);
  });
}

}  // namespace

RegisteredScan register_raw_scan(const ScanCapture& capture, const ScanTarget& target,
                                 const RawScanOptions& options) {
  if (options.cells < 2 || options.cells > 400)
    throw Error(fmt::format("a grid of {} cells, valid: 2 to 400", options.cells));
  const double spacing = std::min(capture.width, capture.height) / options.cells;
  const auto along = [&](double side) { return 1 + static_cast<int>(std::lround(side / spacing)); };
  const GridTemplate grid = make_grid_template(capture.width, capture.height, along(capture.width),
                                               along(capture.height));
  const ScanSource source{target.scan.string(), "unit",
                          target.landmarks.empty() ? "" : target.landmarks.string()};
  const Scan scan = read_sampled(target, grid, source, spacing / 4);
  const ScanGeometry geometry = scan_geometry(scan, 16, options.threads);
  std::vector<Landmark> landmarks;
  if (!target.landmarks.empty()) landmarks = read_landmarks(target.landmarks, grid);
  std::vector<RegistrationStart> starts;
  if (off_a_line(landmarks))
    starts.push_back({flat_start(grid, landmarks), {}});
  else
    starts = flat_starts_of(target, grid, scan, geometry);
  const std::vector<Landmark> held = held_of(landmarks, target);
  if (!held.empty() && target.gravity.norm() > 0) {
    HungStartOptions hang;
    hang.gravity = target.gravity;
    hang.threads = options.threads;
    for (RegistrationStart& start : hung_starts(grid, scan, geometry, held, hang))
      starts.push_back(std::move(start));
  }
  RegistrationOptions registration;
  registration.threads = options.threads;
  RegisteredScan result;
  result.registration = register_scan(grid, scan, geometry, starts, landmarks, registration);
  check_registration(result.registration, scan, grid, source);
  result.shape.mesh = grid.mesh;
  result.shape.x = result.registration.x;
  result.shape.weights = result.registration.weight;
  for (int v = 0; v < grid.mesh.vertex_count(); ++v)
    if (!result.registration.supported(v)) result.shape.weights[v] = 0;
  return result;
}

}  // namespace weft
