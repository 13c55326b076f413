#include "weft/registration/registration_checks.h"

#include <fmt/format.h>

#include <algorithm>

#include "weft/base/error.h"

namespace weft {
namespace {

constexpr double kStrays = 0.01;         // of the points, at either end of an axis
constexpr double kLargestRatio = 30;     // of the longest sides of scan and swatch
constexpr double kUnsupported = 0.25;    // of the vertices
constexpr double kLargestStrain = 0.05;  // rms

std::string sizes(const Scan& scan, const GridTemplate& grid) {
  const Vec3 extent = scan_extent(scan);
  return fmt::format("it is {:.3g} x {:.3g} x {:.3g} m, the swatch {:g} x {:g} m", extent.x(),
                     extent.y(), extent.z(), grid.width, grid.height);
}

std::string hints(const ScanSource& source) {
  const std::string unit = fmt::format("is {} (m per unit of its coordinates) right", source.unit);
  if (source.landmarks.empty()) return unit + "?";
  return fmt::format("{}, and is {} in m, in its axes?", unit, source.landmarks);
}

}  // namespace

Vec3 scan_extent(const Scan& scan) {
  Vec3 extent = Vec3::Zero();
  if (scan.size() == 0) return extent;
  const auto strays = static_cast<Eigen::Index>(kStrays * scan.size());
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    VecX along = scan.position.row(axis);
    const auto first = along.begin() + strays, last = along.end() - 1 - strays;
    std::nth_element(along.begin(), first, along.end());
    const double lower = *first;
    std::nth_element(along.begin(), last, along.end());
    extent[axis] = *last - lower;
  }
  return extent;
}

void check_scan_extent(const Scan& scan, const GridTemplate& grid, const ScanSource& source) {
  const double longest = scan_extent(scan).maxCoeff();
  const double side = std::max(grid.width, grid.height);
  if (longest < kLargestRatio * side && longest * kLargestRatio > side) return;
  throw Error(fmt::format("{}: {}; is {} (m per unit of its coordinates) right?", source.scan,
                          sizes(scan, grid), source.unit));
}

void check_registration(const ScanRegistration& registration, const Scan& scan,
                        const GridTemplate& grid, const ScanSource& source) {
  if (unsupported_vertices(registration) < registration.weight.size()) return;
  throw Error(fmt::format(
      "{}: the swatch was not found: no vertex of the grid has points about it "
      "({} of {} points lie on the grid); {}; {}",
      source.scan, registration.inliers, registration.points, sizes(scan, grid), hints(source)));
}

int unsupported_vertices(const ScanRegistration& registration) {
  int count = 0;
  for (int v = 0; v < registration.weight.size(); ++v) count += !registration.supported(v);
  return count;
}

std::vector<std::string> registration_doubts(const ScanRegistration& registration) {
  std::vector<std::string> doubts;
  const int unsupported = unsupported_vertices(registration);
  const Eigen::Index vertices = registration.weight.size();
  if (unsupported > kUnsupported * static_cast<double>(vertices))
    doubts.push_back(
        fmt::format("{} of {} vertices are without points of the scan; look at the "
                    "registered grid before it is used",
                    unsupported, vertices));
  if (!(registration.strain_rms <= kLargestStrain))
    doubts.push_back(
        fmt::format("the registered grid is strained by {:.3g} % rms, cloth at rest "
                    "hardly by {:g} %; are the size of the swatch, the unit and the "
                    "landmarks right?",
                    100 * registration.strain_rms, 100 * kLargestStrain));
  return doubts;
}

}  // namespace weft
