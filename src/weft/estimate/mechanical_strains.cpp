#include "weft/estimate/mechanical_strains.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <numbers>
#include <numeric>
#include <span>

#include "weft/dynamics/clips.h"
#include "weft/model/bending.h"
#include "weft/model/sheet_model.h"
#include "weft/strain/triangle_shape.h"

namespace weft {
namespace {

/// A frame's share of the samples, rigid pieces left out.
class Sampler {
 public:
  Sampler(const std::vector<int>& clip_of, const Points& x, StrainSamples& samples)
      : clip_of_(clip_of), x_(x), samples_(samples) {}

  void add_strains(const TriangleMesh& mesh) {
    for (const auto& v : mesh.triangles) {
      if (is_rigid(v)) continue;
      const auto shape =
          triangle_shape(mesh.material.col(v[0]), mesh.material.col(v[1]), mesh.material.col(v[2]));
      const auto w = deformation_gradient(shape, to_vector3(x_.col(v[0])), to_vector3(x_.col(v[1])),
                                          to_vector3(x_.col(v[2])));
      const Vec3 wu = to_eigen(w.wu), wv = to_eigen(w.wv);
      add(0, wu.norm() - 1, shape.area);
      add(1, wv.norm() - 1, shape.area);
      add(2, wu.dot(wv) / wu.cross(wv).norm(), shape.area);
    }
  }

  void add_curvatures(const std::vector<BendingElement>& plates) {
    for (const BendingElement& plate : plates) {
      if (is_rigid(std::span(plate.vertices).first<3>())) continue;
      std::array<Vector3<double>, 6> stencil;
      for (std::size_t i = 0; i < 6; ++i) stencil[i] = to_vector3(x_.col(plate.vertices[i]));
      const auto curvature = triangle_curvature(plate.map, stencil);
      add(3, curvature.value[0], plate.area);
      add(4, curvature.value[1], plate.area);
      const double mean = 0.5 * (curvature.value[0] + curvature.value[1]);
      const double twist = curvature.value[2] / std::numbers::sqrt2;  // K_uv
      add(5, mean + twist, 0.5 * plate.area);
      add(5, mean - twist, 0.5 * plate.area);
    }
  }

 private:
  template <class Vertices>
  bool is_rigid(const Vertices& vertices) const {
    return std::ranges::all_of(vertices, [&](int i) { return clip_of_[at(i)] >= 0; });
  }
  void add(std::size_t component, double value, double area) {
    samples_[component].value.push_back(value);
    samples_[component].area.push_back(area);
  }

  const std::vector<int>& clip_of_;
  const Points& x_;
  StrainSamples& samples_;
};

}  // namespace

StrainSamples strain_samples(const MechanicalTrial& trial,
                             const std::vector<MechanicalFrame>& frames) {
  StrainSamples samples;
  for (std::size_t s = 0; s < trial.stages.size(); ++s) {
    const MechanicalStage& stage = trial.stages[s];
    const TriangleMesh mesh = detail::along_the_threads(stage.mesh, trial.capture.grain_angle);
    const auto plates = bending_elements(mesh);
    for (const MechanicalFrame& frame : frames) {
      if (trial.stage_of_frame[at(frame.frame)] != static_cast<int>(s) || !frame.converged)
        continue;
      // What a picture frame holds is not rigid.
      const auto clip_of = trial.capture.picture_frame
                               ? std::vector<int>(at(stage.mesh.vertex_count()), -1)
                               : clip_of_vertices(stage.mesh, trial.capture.clips(frame.frame));
      Sampler sampler(clip_of, frame.x, samples);
      sampler.add_strains(mesh);
      sampler.add_curvatures(plates);
    }
  }
  return samples;
}

double quantile(const StrainSample& sample, double q) {
  if (sample.value.empty()) return 0;
  std::vector<std::size_t> order(sample.value.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::sort(order, {}, [&](std::size_t i) { return sample.value[i]; });
  const double target = q * std::accumulate(sample.area.begin(), sample.area.end(), 0.0);
  double below = 0;
  for (const std::size_t i : order) {
    below += sample.area[i];
    if (below >= target) return sample.value[i];
  }
  return sample.value[order.back()];
}

}  // namespace weft
