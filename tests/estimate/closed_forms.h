#pragma once
/// Strips and cantilevers on a mesh, for every elastic model, beside closed forms.
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "weft/dynamics/clips.h"
#include "weft/estimate/cantilever.h"
#include "weft/mesh/grid_lines.h"

namespace weft::test {

/// A model whose strip along the weft has no Poisson effect.
struct ElasticCase {
  Fabric fabric;
  /// Force per width at a stretch.
  std::function<double(double)> strip;
};

/// All with a membrane of `membrane` N/m along both threads and, but for springs, the flexural
/// rigidity `bend`. Springs are the last.
inline std::vector<ElasticCase> elastic_cases(double membrane, double bend) {
  const auto engineering = [membrane](double s) { return membrane * (s - 1); };
  const auto green = [membrane](double s) { return s * membrane * 0.5 * (s * s - 1); };
  std::vector<ElasticCase> cases;
  for (const char* model :
       {"baraff-witkin", "baraff-witkin-diagonals", "baraff-witkin-hinges", "stvk",
        "soft-constraints", "stvk-diagonal", "piecewise-linear", "springs"}) {
    Fabric fabric = Fabric::with_defaults("case", model);
    const std::string name = model;
    const bool in_motion = name.starts_with("baraff-witkin");
    const bool on_elongation = in_motion || name == "soft-constraints" || name == "springs";
    if (name == "stvk") {
      for (const char* p : {"membrane_uu", "membrane_vv"}) fabric.set(p, membrane);
      fabric.set("membrane_uv", 1e-4);
      for (const char* p : {"bend_uu", "bend_vv"}) fabric.set(p, bend);
      fabric.set("bend_uv", 1e-12);
      fabric.set("bend_twist", 0.5 * bend);
    } else if (in_motion) {
      fabric.set("stretch_stiffness", membrane);
      fabric.set("shear_stiffness", 0.2 * membrane);
      fabric.set("bend_stiffness", bend);
      // Taut diagonals couple weft and warp: next to none, below their range.
      if (name != "baraff-witkin")
        fabric.values[fabric.value_index("diagonal_stiffness")] = 1e-5 * membrane;
    } else if (name == "piecewise-linear") {
      for (const char* row : {"rest", "weft", "deg22", "deg45", "deg67", "warp"}) {
        for (const char* p : {"_uu", "_vv"}) fabric.set(row + std::string(p), membrane);
        fabric.set(row + std::string("_uv"), 0);
        fabric.set(row + std::string("_shear"), 0.2 * membrane);
      }
      for (const char* row : {"weft_bend_", "diagonal_bend_", "warp_bend_"})
        for (const char* p : {"0", "10", "20", "30", "40"}) fabric.set(row + std::string(p), bend);
    } else {
      for (const char* p : {"weft_stretch", "warp_stretch"}) fabric.set(p, membrane);
      // Diagonal springs couple weft and warp: as few of them as the range allows.
      fabric.set("shear", name == "springs" ? 0.01 : 0.2 * membrane);
      for (const char* p : {"weft_bend", "warp_bend", "diagonal_bend"})
        fabric.set(p, name == "springs" ? 1e-6 : bend);
    }
    cases.push_back({fabric, on_elongation ? std::function<double(double)>(engineering)
                                           : std::function<double(double)>(green)});
  }
  return cases;
}

/// Force per width of a strip of 0.1 x 0.02 m between two clips, N/m; NaN without equilibrium.
/// `grain_angle` (rad): of the weft, from the pull.
inline double strip_on_mesh(const Fabric& fabric, double stretch, int cells,
                            double grain_angle = 0) {
  const double length = 0.1, width = 0.02, h = length / cells;
  const TriangleMesh mesh = make_swatch(grid_lines(length + 2 * h, {h, length + h}, h),
                                        grid_lines(width, {}, h), GridPattern::uniform);
  std::vector<Clip> clips(2);
  clips[0].region = {{0, 0}, {h, width}};
  clips[1].region = {{length + h, 0}, {length + 2 * h, width}};
  for (Clip& clip : clips) {
    const Vec2 centre = clip.region.center();
    clip.position = Vec3(centre.x(), centre.y(), 0);
  }
  clips[1].position.x() += (stretch - 1) * length;
  const auto model = make_elastic_model(mesh, fabric, grain_angle);
  const HeavyCloth cloth(*model, 0.1, Vec3::Zero());
  const ClipEquilibrium found = solve_clips(cloth, clips, blend_of_clips(mesh.material, clips));
  return found.converged ? found.forces(0, 1) / width : std::nan("");
}

/// Tip deflection over length of a strip of 0.1 x 0.02 m that a clip holds horizontally, at the
/// load w L^3 / `rigidity`. Springs get a regular grid, sheets a thin cell inside the clip
/// (mechanical_trial.h).
inline double cantilever_on_mesh(const Fabric& fabric, double rigidity, double load, int cells) {
  const double length = 0.1, width = 0.02, h = length / cells;
  const double depth = fabric.model == "springs" ? h : 0.02 * h;
  std::vector<double> u{0};
  for (int i = 0; i <= cells; ++i) u.push_back(depth + i * h);
  const TriangleMesh mesh = make_swatch(u, grid_lines(width, {}, h), GridPattern::uniform);
  std::vector<Clip> clips(1);
  clips[0].region = {{0, 0}, {depth, width}};
  clips[0].position = Vec3(depth / 2, width / 2, 0);
  const double weight = load * rigidity / std::pow(length, 3), density = 0.2;
  const auto model = make_elastic_model(mesh, fabric);
  const HeavyCloth cloth(*model, density, Vec3(0, 0, -weight / density));
  const ClipEquilibrium found = solve_clips(cloth, clips, blend_of_clips(mesh.material, clips));
  if (!found.converged) return std::nan("");
  return -found.x(2, mesh.vertex_count() - 1) / length;
}

/// What springs of the stiffness `spring` (N/m) between next neighbours but one make of a strip of
/// cells h: M = spring h^4 kappa^3 / 32, as a curve up to `largest` 1/m, with a thousandth of its
/// largest stiffness at no curvature, where the springs have none.
inline BendLaw bend_law_of_springs(double spring, double h, double largest) {
  const auto stiffness = [&](double c) {
    return spring * std::pow(h, 4) / 32 * (c * c + 1e-3 * largest * largest);
  };
  const Vec3 knots(0, 0.5 * largest, largest);
  return {
      StiffnessCurve(knots, Vec3(stiffness(knots[0]), stiffness(knots[1]), stiffness(knots[2])))};
}

}  // namespace weft::test
