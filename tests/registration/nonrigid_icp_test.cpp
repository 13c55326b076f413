#include "weft/registration/nonrigid_icp.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "registration/developable.h"
#include "weft/base/error.h"

namespace weft {
namespace {

using weft::testing::cone;
using weft::testing::cylinder;
using weft::testing::error_of;
using weft::testing::RegistrationError;
using weft::testing::sampled;
using weft::testing::scan_of;
using weft::testing::ScanMaking;
using weft::testing::Surface;
using weft::testing::wave;

constexpr double kWidth = 0.32, kHeight = 0.4;
const Vec3 right = Vec3::UnitX(), down = -Vec3::UnitZ();

ScanRegistration from_flat(const GridTemplate& grid, const Scan& scan,
                           const RegistrationOptions& options = {}) {
  const ScanGeometry geometry = scan_geometry(scan);
  return register_scan(grid, scan, geometry, flat_starts(grid, scan, geometry, right, down), {},
                       options);
}

void report(const std::string& name, const RegistrationError& e, const ScanRegistration& r) {
  std::printf(
      "%-20s same %.3f mm max %.3f  off %.3f mm  rms %.3f med %.3f p95 %.3f reach %.3f inl %d/%d "
      "strain %.4f rounds %d\n",
      name.c_str(), 1e3 * e.same_point, 1e3 * e.same_point_max, 1e3 * e.off_surface,
      1e3 * r.residual_rms, 1e3 * r.residual_median, 1e3 * r.residual_p95, 1e3 * r.reach, r.inliers,
      r.points, r.strain_rms, r.rounds);
}

TEST(NonrigidIcp, Explore) {
  const GridTemplate grid = make_grid_template(kWidth, kHeight, 25, 31);
  const std::vector<std::pair<std::string, Surface>> surfaces = {
      {"cylinder", cylinder(0.15, 0.3, kWidth, kHeight)},
      {"cone", cone(0.5, 0.1, kWidth)},
      {"wave", wave(0.8, 0.15, 0.4, kWidth, kHeight)},
      {"wave straight", wave(0.8, 0.12, 0, kWidth, kHeight)},
  };
  for (const auto& [name, surface] : surfaces) {
    if (getenv("ONLY") && name != getenv("ONLY")) continue;
    for (int kind = 0; kind < 4; kind += 3) {
      ScanMaking making;
      making.hole = kind == 1 || kind == 3;
      making.outliers = kind >= 2 ? 0.1 : 0;
      making.clutter = kind == 3;
      const Scan scan = scan_of(surface, kWidth, kHeight, making);
      const ScanRegistration r = from_flat(grid, scan);
      Eigen::Index worst = 0;
      (r.x - sampled(surface, grid.mesh.material)).colwise().norm().maxCoeff(&worst);
      if (getenv("WD") && name == "wave" && kind == 0) {
        for (int j = 26; j < 31; ++j) {
          for (int i = 20; i < 25; ++i) {
            const Vec3 d =
                1e3 * (r.x.col(j * 25 + i) - surface(grid.mesh.material.col(j * 25 + i)));
            std::printf("(%.1f %.1f %.1f d %.2f w %.2f) ", d.x(), d.y(), d.z(),
                        1e3 * r.distance[j * 25 + i], r.weight[j * 25 + i]);
          }
          std::printf("\n");
        }
      }
      std::printf("%ld %ld ", long(worst % 25), long(worst / 25));
      report(name + std::to_string(kind), error_of(grid, r.x, surface), r);
    }
  }
}

}  // namespace
}  // namespace weft
