#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "weft/base/error.h"
#include "weft/capture/capture.h"

namespace weft {
namespace {

constexpr double kVertexTolerance = 1e-6;  // m

/// The vertex of a grid of columns x rows at the fixture.
int vertex_at(const CaptureFixture& fixture, const TriangleMesh& mesh, int columns, int rows,
              const Capture& capture) {
  const auto nearest = [](double at, double side, int count) {
    return std::clamp(static_cast<int>(std::lround(at / side * (count - 1))), 0, count - 1);
  };
  const int vertex = nearest(fixture.at.y(), capture.height, rows) * columns +
                     nearest(fixture.at.x(), capture.width, columns);
  const Vec2 found = mesh.material.col(vertex);
  if ((found - fixture.at).norm() > kVertexTolerance) {
    throw Error(fmt::format(
        "fixture \"{}\" at ({:g}, {:g}) is not at a vertex of a grid of {} x {} "
        "vertices; the nearest vertex is at ({:g}, {:g})",
        fixture.name, fixture.at.x(), fixture.at.y(), columns, rows, found.x(), found.y()));
  }
  return vertex;
}

}  // namespace

Scene make_scene(const Capture& capture, int columns, int rows, int first, int last) {
  if (first < 0 || last < first || last >= capture.frame_count) {
    throw Error(fmt::format("frames {} to {}: the capture \"{}\" has frames 0 to {}", first, last,
                            capture.name, capture.frame_count - 1));
  }
  Scene scene;
  scene.mesh = make_swatch(capture.width, capture.height, columns, rows);
  scene.areal_density = capture.areal_density;
  scene.hem_width = capture.hem_width;
  scene.gravity = capture.gravity;
  for (const CaptureFixture& fixture : capture.fixtures) {
    scene.fixtures.push_back(
        {fixture.name, vertex_at(fixture, scene.mesh, columns, rows, capture), fixture.motion});
  }
  for (int frame = first; frame <= last; ++frame) {
    scene.frame_times.push_back(frame / capture.frame_rate);
  }
  return scene;
}

}  // namespace weft
