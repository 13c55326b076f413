#include "weft/registration/hung_start.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "weft/base/dense.h"
#include "weft/base/error.h"
#include "weft/base/parallel.h"
#include "weft/dynamics/clips.h"
#include "weft/fabric/orthotropic.h"
#include "weft/mesh/grid_lines.h"
#include "weft/registration/start_shapes.h"
#include "weft/registration/stripe_surface.h"

namespace weft {
namespace {

constexpr OrthotropicModuli kPlausible{200, 200, 40, 0.3, 5e-6};
constexpr double kDensity = 0.2;  // kg/m^2
// It need not be at rest to the last: a start.
constexpr StaticOptions kSag{.force_tolerance = 1e-5, .max_iterations = 150};
// Shapes nearer than this share of the swatch's size, on average, are one.
constexpr double kAlike = 0.02;
// Reach of the first step, of the swatch's size.
constexpr double kReach = 0.06;

/// Turns of a sheet that hangs by one point, about the vertical through it.
std::vector<Points> turned(const std::vector<Points>& shapes, const Vec3& pivot, const Vec3& down,
                           const Vec3& along) {
  std::vector<Points> result;
  for (const Points& x : shapes) {
    // Where the sheet lies now: the horizontal direction in which it spreads most.
    const Points d = x.colwise() - pivot;
    const Points flat = d - down * (down.transpose() * d);
    const Vec3 side = symmetric_eigen_3(flat * flat.transpose()).vectors.col(2);
    const Mat3 turn = turn_between(side, along);
    const Mat3 half = Eigen::AngleAxisd(M_PI, down).toRotationMatrix();
    result.push_back((turn * d).colwise() + pivot);
    result.push_back((half * turn * d).colwise() + pivot);
  }
  return result;
}

/// The horizontal direction in which the points of the scan that lie on a surface spread most.
Vec3 spread_of(const Scan& scan, const ScanGeometry& geometry, const Vec3& down) {
  Vec3 mean = Vec3::Zero();
  int count = 0;
  for (int i = 0; i < scan.size(); ++i) {
    if (!geometry.on_surface[static_cast<std::size_t>(i)]) continue;
    mean += scan.position.col(i);
    ++count;
  }
  mean /= std::max(count, 1);
  Mat3 sum = Mat3::Zero();
  for (int i = 0; i < scan.size(); ++i) {
    if (!geometry.on_surface[static_cast<std::size_t>(i)]) continue;
    Vec3 d = scan.position.col(i) - mean;
    d -= down.dot(d) * down;
    sum += d * d.transpose();
  }
  return symmetric_eigen_3(sum).vectors.col(2);
}

Scene hung_scene(const GridTemplate& grid, const std::vector<Landmark>& held,
                 const HungStartOptions& options) {
  std::vector<double> u, v;
  for (const Landmark& point : held) {
    u.push_back(point.uv.x());
    v.push_back(point.uv.y());
  }
  const double spacing = std::min(grid.width, grid.height) / options.cells;
  Scene scene;
  scene.mesh = make_swatch(grid_lines(grid.width, u, spacing), grid_lines(grid.height, v, spacing));
  scene.areal_density = kDensity;
  scene.gravity = options.gravity;
  scene.frame_times = {0};
  for (const Landmark& point : held) {
    Eigen::Index vertex = 0;
    (scene.mesh.material.colwise() - point.uv).colwise().squaredNorm().minCoeff(&vertex);
    scene.fixtures.push_back({"held", static_cast<int>(vertex), Motion::fixed(point.position)});
  }
  return scene;
}

void check(const GridTemplate& grid, const std::vector<Landmark>& held,
           const HungStartOptions& options) {
  if (held.empty()) throw Error("a sheet that hangs needs at least one held point");
  if (!(options.gravity.norm() > 0)) throw Error("a sheet that hangs needs gravity");
  if (options.cells < 4 || options.cells > 100)
    throw Error(fmt::format("a sheet of {} cells, valid: 4 to 100", options.cells));
  for (const Landmark& point : held) {
    const bool on = point.uv.x() >= -1e-9 && point.uv.x() <= grid.width + 1e-9 &&
                    point.uv.y() >= -1e-9 && point.uv.y() <= grid.height + 1e-9;
    if (!on || !point.position.allFinite())
      throw Error(fmt::format("held point at (u, v) = ({}, {}) m: not on the swatch of {} x {} m",
                              point.uv.x(), point.uv.y(), grid.width, grid.height));
  }
}

}  // namespace

std::vector<RegistrationStart> hung_starts(const GridTemplate& grid, const Scan& scan,
                                           const ScanGeometry& geometry,
                                           const std::vector<Landmark>& held,
                                           const HungStartOptions& options) {
  check(grid, held, options);
  const Scene scene = hung_scene(grid, held, options);
  std::vector<char> fixed(static_cast<std::size_t>(scene.mesh.vertex_count()), 0);
  for (const PointFixture& fixture : scene.fixtures)
    fixed[static_cast<std::size_t>(fixture.vertex)] = 1;
  std::vector<Points> shapes{flat_sheet(scene)};
  for (StartShape& shape : generic_starts(scene)) shapes.push_back(std::move(shape.x));

  const auto model =
      make_elastic_model(scene.mesh, orthotropic_fabric("plausible", stiffness_of(kPlausible)));
  const HeavyCloth cloth(*model, kDensity, options.gravity);
  parallel_for(shapes.size(), options.threads,
               [&](std::size_t i) { shapes[i] = solve_static(cloth, shapes[i], fixed, kSag).x; });

  const double size = std::sqrt(grid.width * grid.height), alike = kAlike * size;
  std::vector<Points> different;
  for (const Points& x : shapes) {
    const bool known = std::any_of(different.begin(), different.end(), [&](const Points& other) {
      return (x - other).colwise().norm().mean() < alike;
    });
    if (!known && x.allFinite()) different.push_back(x);
  }
  if (held.size() == 1) {
    const Vec3 down = options.gravity.normalized();
    different = turned(different, held.front().position, down, spread_of(scan, geometry, down));
  }
  const MaterialLocator locator(scene.mesh);
  std::vector<RegistrationStart> starts;
  for (const Points& x : different)
    starts.push_back({interpolate(scene.mesh, locator, x, grid.mesh.material),
                      {},
                      RegistrationStart::View::part,
                      kReach * size});
  return starts;
}

}  // namespace weft
