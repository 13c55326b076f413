#include "weft/registration/start_shapes.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "weft/base/dense.h"
#include "weft/base/error.h"
#include "weft/dynamics/state.h"
#include "weft/registration/stripe_surface.h"

namespace weft {
namespace {

/// world = origin + along * (a . (uv - center)) + across * (b . (uv - center)), a and b
/// orthonormal.
struct SheetFrame {
  Vec2 center;  ///< (u, v), m
  Vec2 a, b;    ///< unit, in (u, v)
  Vec3 origin;  ///< m
  Vec3 along, across;
};

Vec3 any_perpendicular(const Vec3& direction) {
  const Vec3 other =
      std::abs(direction.x()) < 0.9 * direction.norm() ? Vec3::UnitX() : Vec3::UnitY();
  return (other - direction * (direction.dot(other) / direction.squaredNorm())).normalized();
}

double start_time(const Scene& scene) {
  return scene.frame_times.empty() ? 0.0 : scene.frame_times.front();
}

SheetFrame sheet_frame(const Scene& scene) {
  const auto count = static_cast<Eigen::Index>(scene.fixtures.size());
  if (count == 0) throw Error("start shapes: the scene has no fixtures");
  const double time = start_time(scene);
  MaterialPoints material(2, count);
  Points world(3, count);
  for (Eigen::Index f = 0; f < count; ++f) {
    const PointFixture& fixture = scene.fixtures[static_cast<std::size_t>(f)];
    material.col(f) = scene.mesh.material.col(fixture.vertex);
    world.col(f) = fixture.motion.position(time);
  }
  SheetFrame frame;
  frame.center = material.rowwise().mean();
  frame.origin = world.rowwise().mean();
  material.colwise() -= frame.center;
  world.colwise() -= frame.origin;

  const SymmetricEigen axes = symmetric_eigen(material * material.transpose());
  const Vec2 spread = axes.values;
  const double size =
      (scene.mesh.material.rowwise().maxCoeff() - scene.mesh.material.rowwise().minCoeff())
          .squaredNorm();
  Vec3 down = scene.gravity;
  if (down.norm() == 0) down = -Vec3::UnitZ();
  down.normalize();

  const Vec2 hanging = scene.mesh.material.rowwise().mean() - frame.center;
  if (spread(1) < 1e-12 * size) {  // one fixture: hang from it
    frame.b = hanging.norm() > 0 ? Vec2(hanging.normalized()) : Vec2(0, 1);
    frame.a = Vec2(frame.b.y(), -frame.b.x());
    frame.across = down;
    frame.along = any_perpendicular(down);
    return frame;
  }
  frame.a = axes.vectors.col(1);
  if (frame.a.sum() < 0) frame.a = -frame.a;
  frame.b = Vec2(-frame.a.y(), frame.a.x());
  frame.along = world * material.transpose() * frame.a / spread(1);
  if (spread(0) > 1e-6 * spread(1)) {
    frame.across = world * material.transpose() * frame.b / spread(0);
    return frame;
  }
  if (frame.b.dot(hanging) < 0) frame.b = -frame.b;
  Vec3 across = down - frame.along * (frame.along.dot(down) / frame.along.squaredNorm());
  if (!(across.norm() > 1e-6)) across = any_perpendicular(frame.along);
  frame.across = across.normalized();
  return frame;
}

}  // namespace

Points flat_sheet(const Scene& scene) {
  const SheetFrame frame = sheet_frame(scene);
  Points x(3, scene.mesh.vertex_count());
  for (int v = 0; v < scene.mesh.vertex_count(); ++v) {
    const Vec2 offset = scene.mesh.material.col(v) - frame.center;
    x.col(v) =
        frame.origin + frame.along * frame.a.dot(offset) + frame.across * frame.b.dot(offset);
  }
  // More than three fixtures need not lie as a plane would have them.
  prescribe_positions(scene.fixtures, start_time(scene), x);
  return x;
}

std::vector<StartShape> generic_starts(const Scene& scene) {
  const SheetFrame frame = sheet_frame(scene);
  const Vec3 normal = frame.along.cross(frame.across).normalized();
  const Points flat = flat_sheet(scene);
  // Extent along a and b of the whole swatch, and what the narrowed direction has to spare.
  const Eigen::RowVectorXd s = frame.a.transpose() * scene.mesh.material;
  const Eigen::RowVectorXd t = frame.b.transpose() * scene.mesh.material;
  const double width = s.maxCoeff() - s.minCoeff(), height = t.maxCoeff() - t.minCoeff();
  const double narrowing = std::clamp(1.0 - frame.along.norm(), 0.02, 0.6);
  // A half sine of amplitude h over a chord L is longer than it by (pi h / L)^2 / 4.
  const double bulge =
      width * frame.along.norm() * 2 / std::numbers::pi * std::sqrt(narrowing / (1 - narrowing));

  std::vector<StartShape> shapes;
  const auto add = [&](std::string name, int folds, double sign) {
    StartShape shape{std::move(name), flat};
    for (int v = 0; v < scene.mesh.vertex_count(); ++v) {
      const double across = (s(v) - s.minCoeff()) / width, down = (t(v) - t.minCoeff()) / height;
      const double profile = std::sin(std::numbers::pi * across);
      const double alternation = folds == 0 ? 1.0 : std::cos(std::numbers::pi * folds * down);
      shape.x.col(v) += sign * bulge * profile * alternation * normal;
    }
    for (const PointFixture& fixture : scene.fixtures) {
      shape.x.col(fixture.vertex) = flat.col(fixture.vertex);
    }
    shapes.push_back(std::move(shape));
  };
  add("bulge +", 0, 1);
  add("bulge -", 0, -1);
  for (const int folds : {1, 2, 3}) {
    add(fmt::format("{} folds +", folds), folds, 1);
    add(fmt::format("{} folds -", folds), folds, -1);
  }
  return shapes;
}

}  // namespace weft
