#include "weft/estimate/mechanical_strains.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <numeric>

#include "weft/dynamics/clips.h"
#include "weft/model/bending.h"
#include "weft/model/sheet_model.h"
#include "weft/strain/triangle_shape.h"

namespace weft {
namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

/// A frame's share of the samples.
void add_frame(const TriangleMesh& mesh, const std::vector<BendingElement>& plates,
               const std::vector<int>& clip_of, const Points& x,
               std::array<StrainSample, 5>& samples) {
  for (int t = 0; t < mesh.triangle_count(); ++t) {
    const auto& v = mesh.triangles[at(t)];
    if (std::all_of(v.begin(), v.end(), [&](int i) { return clip_of[at(i)] >= 0; })) continue;
    const auto shape =
        triangle_shape(mesh.material.col(v[0]), mesh.material.col(v[1]), mesh.material.col(v[2]));
    const auto w = deformation_gradient(shape, to_vector3(x.col(v[0])), to_vector3(x.col(v[1])),
                                        to_vector3(x.col(v[2])));
    const Vec3 wu = to_eigen(w.wu), wv = to_eigen(w.wv);
    const BendingElement& plate = plates[at(t)];
    std::array<Vector3<double>, 6> stencil;
    for (std::size_t i = 0; i < 6; ++i) stencil[i] = to_vector3(x.col(plate.vertices[i]));
    const auto curvature = triangle_curvature(plate.map, stencil);
    const std::array<double, 5> strains{wu.norm() - 1, wv.norm() - 1,
                                        wu.dot(wv) / wu.cross(wv).norm(), curvature.value[0],
                                        curvature.value[1]};
    for (std::size_t k = 0; k < 5; ++k) {
      samples[k].value.push_back(strains[k]);
      samples[k].area.push_back(shape.area);
    }
  }
}

}  // namespace

std::array<StrainSample, 5> strain_samples(const MechanicalTrial& trial,
                                           const std::vector<MechanicalFrame>& frames) {
  std::array<StrainSample, 5> samples;
  for (std::size_t s = 0; s < trial.stages.size(); ++s) {
    const MechanicalStage& stage = trial.stages[s];
    const TriangleMesh mesh = detail::along_the_threads(stage.mesh, trial.capture.grain_angle);
    const auto plates = bending_elements(mesh);
    for (const MechanicalFrame& frame : frames) {
      if (trial.stage_of_frame[at(frame.frame)] != static_cast<int>(s) || !frame.converged)
        continue;
      const auto clip_of = clip_of_vertices(stage.mesh, trial.capture.clips(frame.frame));
      add_frame(mesh, plates, clip_of, frame.x, samples);
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
