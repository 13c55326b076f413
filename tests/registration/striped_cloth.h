#pragma once
/// A swatch bent to a cylinder of given profile (hence without any strain), under projected
/// stripes: the exact surface is known at every (u, v).
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include "weft/base/random.h"
#include "weft/registration/stripe_surface.h"

namespace weft::testing {

/// Camera and projector one above the other, 1.5 m away, looking along +y; z up. The projector
/// shines from `baseline` m above the camera, both aim at (0, 0, -0.2).
inline Rig vertical_rig(double baseline = 0.33) {
  const auto look = [](const Vec3& from, double focal, double width, double height) {
    const Vec3 forward = (Vec3(0, 0, -0.2) - from).normalized();
    const Vec3 right = forward.cross(Vec3::UnitZ()).normalized();
    Eigen::Matrix<double, 3, 4> extrinsic;
    extrinsic.row(0).head<3>() = right;
    extrinsic.row(1).head<3>() = forward.cross(right);
    extrinsic.row(2).head<3>() = forward;
    extrinsic.col(3) = -extrinsic.leftCols<3>() * from;
    Mat3 intrinsic;
    intrinsic << focal, 0, width / 2, 0, focal, height / 2, 0, 0, 1;
    return Projection(intrinsic * extrinsic);
  };
  Rig rig;
  rig.width = 480;
  rig.height = 480;
  const Vec3 target(0, 0, -0.2);
  rig.camera = Pinhole(look({0, -1.5, 0}, 900, rig.width, rig.height), target, "camera");
  rig.projector = Pinhole(look({0.1, -1.5, baseline}, 1200, 1280, 800), target, "projector");
  rig.pattern.period = 22;
  return rig;
}

/// The plane curve with tangent angle phi(s), from the origin, by Simpson's rule on 2000 intervals.
class Profile {
 public:
  Profile(std::function<double(double)> phi, double length) : length_(length), points_(count + 1) {
    const double h = length / count;
    for (int i = 0; i < count; ++i) {
      const double s = i * h;
      const double a = phi(s), b = phi(s + h / 2), c = phi(s + h);
      const Vec2 step(std::cos(a) + 4 * std::cos(b) + std::cos(c),
                      std::sin(a) + 4 * std::sin(b) + std::sin(c));
      points_[static_cast<std::size_t>(i) + 1] =
          points_[static_cast<std::size_t>(i)] + h / 6 * step;
    }
  }
  Vec2 at(double s) const {
    const double t = std::clamp(s / length_, 0.0, 1.0) * count;
    const int i = std::min(static_cast<int>(t), count - 1);
    const auto k = static_cast<std::size_t>(i);
    return points_[k] + (t - i) * (points_[k + 1] - points_[k]);
  }

 private:
  static constexpr int count = 2000;
  double length_;
  std::vector<Vec2> points_ = {};
};

inline constexpr double kSize = 0.4;  // m, edge of the swatch

/// Vertical folds: the profile runs across the swatch. Centred on x = 0, top edge at z = 0.
inline Points vertical_folds(const MaterialPoints& uv, double amplitude = 0.6) {
  const Profile profile(
      [&](double s) { return amplitude * std::sin(4 * std::numbers::pi * s / kSize); }, kSize);
  const double shift = profile.at(kSize).x() / 2;
  Points x(3, uv.cols());
  for (Eigen::Index k = 0; k < uv.cols(); ++k) {
    const Vec2 p = profile.at(uv(0, k));
    x.col(k) << p.x() - shift, p.y(), -uv(1, k);
  }
  return x;
}

/// One horizontal fold that bulges towards the camera: it hides cloth below it from the camera,
/// which looks from its height, and shadows some from the projector.
inline Points horizontal_fold(const MaterialPoints& uv, double amplitude = 1.25) {
  const Profile profile(
      [&](double s) {
        const double t = (s - 0.12) / 0.16;
        return t > 0 && t < 1 ? amplitude * std::sin(2 * std::numbers::pi * t) : 0.0;
      },
      kSize);
  Points x(3, uv.cols());
  for (Eigen::Index k = 0; k < uv.cols(); ++k) {
    const Vec2 p = profile.at(uv(1, k));
    x.col(k) << uv(0, k) - kSize / 2, -p.y(), -p.x();
  }
  return x;
}

/// The swatch to fit, held by the top corners of `x`.
inline Scene swatch_scene(int vertices, Points (*shape)(const MaterialPoints&, double),
                          double amplitude) {
  Scene scene;
  scene.mesh = make_swatch(kSize, kSize, vertices, vertices);
  scene.areal_density = 0.2;
  scene.frame_times = {0};
  const Points x = shape(scene.mesh.material, amplitude);
  scene.fixtures = {{"left", 0, Motion::fixed(x.col(0))},
                    {"right", vertices - 1, Motion::fixed(x.col(vertices - 1))}};
  return scene;
}

/// The frame of a surface drawn with 65 x 65 vertices, with normal noise of `noise` (of full
/// scale).
inline RenderedFrame striped_frame(const Rig& rig, Points (*shape)(const MaterialPoints&, double),
                                   double amplitude, double noise) {
  const TriangleMesh fine = make_swatch(kSize, kSize, 65, 65);
  RenderOptions options;
  options.projector_row = true;
  Renderer renderer(rig, fine, options);
  RenderedFrame frame = renderer.render(shape(fine.material, amplitude));
  Rng random(7);
  for (Eigen::Index k = 0; k < frame.intensity.size(); ++k) {
    float& value = frame.intensity.data()[k];
    value = std::max(0.0f, value + static_cast<float>(noise * random.normal()));
  }
  return frame;
}

}  // namespace weft::testing
