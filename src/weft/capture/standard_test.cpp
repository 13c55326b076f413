#include "weft/capture/standard_test.h"

#include <limits>

#include "weft/mesh/grid_lines.h"

namespace weft {
namespace {

constexpr double kNotMeasured = std::numeric_limits<double>::quiet_NaN();
/// Of a clip in the short form, which states none: its depth does not matter, the cloth in it is
/// rigid and has no weight.
constexpr double kNominalClipDepth = 5e-3;  // m

MechanicalCapture without_fixtures(const Specimen& specimen, int clips, int frames) {
  MechanicalCapture capture;
  capture.width = specimen.free_length + clips * kNominalClipDepth;
  capture.height = specimen.width;
  capture.areal_density = specimen.areal_density;
  capture.grain_angle = specimen.grain_angle;
  capture.frame_count = frames;
  return capture;
}

MechanicalFixture jaw(const std::string& name, const MaterialRectangle& region, const VecX& shift) {
  MechanicalFixture fixture;
  fixture.name = name;
  for (const double x : shift) {
    Clip clip;
    clip.region = region;
    clip.position = Vec3(region.center().x() + x, region.center().y(), 0);
    fixture.frames.push_back(clip);
  }
  fixture.forces.resize(3, 0);
  return fixture;
}

Points along_the_pull(const VecX& force) {
  Points forces = Points::Constant(3, force.size(), kNotMeasured);
  forces.row(0) = force.transpose();
  return forces;
}

}  // namespace

MechanicalCapture strip_capture(const Specimen& specimen, const VecX& displacement,
                                const VecX& force) {
  MechanicalCapture capture = without_fixtures(specimen, 2, static_cast<int>(displacement.size()));
  capture.gravity = Vec3::Zero();
  capture.fixtures.push_back(jaw("fixed jaw", {{0, 0}, {kNominalClipDepth, capture.height}},
                                 VecX::Zero(displacement.size())));
  capture.fixtures.push_back(
      jaw("moving jaw", {{capture.width - kNominalClipDepth, 0}, {capture.width, capture.height}},
          displacement));
  capture.fixtures.back().forces = along_the_pull(force);
  return capture;
}

MechanicalCapture picture_frame_capture(const Specimen& specimen, PictureFrame frame,
                                        const VecX& force) {
  MechanicalCapture capture = without_fixtures(specimen, 0, static_cast<int>(force.size()));
  capture.gravity = Vec3::Zero();
  MechanicalFixture fixture;
  fixture.name = "frame";
  Clip clip;
  clip.region = {{0, 0}, {capture.width, capture.height}};
  fixture.frames.assign(static_cast<std::size_t>(force.size()), clip);
  fixture.forces = along_the_pull(force);
  capture.fixtures.push_back(std::move(fixture));
  capture.picture_frame = std::move(frame);
  return capture;
}

MechanicalCapture cantilever_capture(const Specimen& specimen, double clamp_angle,
                                     const Vec2& root) {
  MechanicalCapture capture = without_fixtures(specimen, 1, 1);
  MechanicalFixture fixture;
  fixture.name = "clamp";
  Clip clip;
  clip.region = {{0, 0}, {kNominalClipDepth, capture.height}};
  clip.rotation = Eigen::AngleAxisd(clamp_angle, Vec3::UnitY());
  clip.position = Vec3(root.x(), 0.5 * capture.height, root.y()) -
                  clip.rotation * Vec3(0.5 * kNominalClipDepth, 0, 0);
  fixture.frames.push_back(clip);
  fixture.forces.resize(3, 0);
  capture.fixtures.push_back(std::move(fixture));
  return capture;
}

MeasuredGeometry cantilever_geometry(const MechanicalCapture& capture, const VecX& arc,
                                     const MaterialPoints& line) {
  const Eigen::Index n = arc.size();
  std::vector<double> u, v{0, capture.height};
  for (const double s : arc) u.push_back(kNominalClipDepth + s);
  MeasuredGeometry geometry;
  geometry.mesh = make_swatch(u, v);
  Points x(3, 2 * n);
  for (Eigen::Index i = 0; i < 2 * n; ++i)
    x.col(i) = Vec3(line(0, i % n), v[static_cast<std::size_t>(i / n)], line(1, i % n));
  geometry.frames.push_back(x);
  return geometry;
}

MechanicalCapture overhang_capture(const Specimen& specimen, OverhangTest test) {
  Specimen strip = specimen;
  strip.free_length = test.lengths.mean();
  MechanicalCapture capture = cantilever_capture(strip, 0, Vec2::Zero());
  capture.frame_count = static_cast<int>(test.lengths.size());
  MechanicalFixture& edge = capture.fixtures.front();
  edge.name = "edge";
  edge.frames.assign(static_cast<std::size_t>(test.lengths.size()), Clip(edge.frames.front()));
  capture.overhang = std::move(test);
  return capture;
}

double unit_factor(const TomlTable& table, std::string_view key,
                   const std::vector<std::pair<std::string, double>>& units) {
  std::vector<std::string> names;
  for (const auto& [name, factor] : units) names.push_back(name);
  const std::string found = table.optional_choice(key, names).value_or(names.front());
  for (const auto& [name, factor] : units)
    if (name == found) return factor;
  return 1;
}

double length_factor(const TomlTable& table, std::string_view key) {
  return unit_factor(table, key, {{"m", 1}, {"mm", 1e-3}, {"cm", 1e-2}});
}

}  // namespace weft
