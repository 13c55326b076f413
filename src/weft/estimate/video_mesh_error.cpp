#include "weft/estimate/video_mesh_error.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "weft/base/error.h"

namespace weft {
namespace {

QuadraticModel sum_of(const std::vector<CostPart>& parts, Eigen::Index dimension) {
  QuadraticModel model{0, VecX::Zero(dimension), MatX::Zero(dimension, dimension)};
  for (const CostPart& part : parts) {
    model.gradient += part.gradient;
    model.hessian += part.hessian;
  }
  return model;
}

Problem refined(const Problem& problem) {
  std::vector<std::shared_ptr<const Trial>> trials;
  for (const auto& trial : problem.trials()) trials.push_back(refined(*trial));
  return {std::move(trials),   problem.initial(), problem.free(),
          problem.evaluator(), problem.priors(),  problem.other()};
}

}  // namespace

std::shared_ptr<const Trial> refined(const Trial& trial) {
  auto finer = std::make_shared<Trial>(trial);
  TrialOptions& options = finer->options;
  options.columns = 2 * options.columns - 1;
  options.rows = 2 * options.rows - 1;
  options.simulation.steps_per_frame *= 2;
  constexpr int kMostVertices = 1000;
  if (std::max(options.columns, options.rows) > kMostVertices)
    throw Error(fmt::format("{} x {} vertices are more than {} along a side", options.columns,
                            options.rows, kMostVertices));
  finer->scene = make_scene(trial.capture, options.columns, options.rows, 0,
                            trial.first_frame + trial.frame_count() - 1);
  finer->scene.start = interpolate(trial.scene.mesh, MaterialLocator(trial.scene.mesh),
                                   trial.scene.start, finer->scene.mesh.material);
  return finer;
}

MeshShift find_mesh_shift(const Problem& problem, const VecX& scaled,
                          const std::vector<CostPart>& parts, double dispersion,
                          const LinearizationOptions& options) {
  const auto unknown = [](const std::string& reason) {
    return MeshShift{{}, "on cells of half the width, " + reason};
  };
  if (problem.evaluator()) return unknown("an evaluator of its own has no cells");
  try {
    const Problem finer = refined(problem);
    QuadraticModel there = linearize(finer, scaled, options).model;
    if (!std::isfinite(there.cost)) return unknown("the motion diverges");
    QuadraticModel here = sum_of(parts, scaled.size());
    if (problem.has_prior()) {
      const QuadraticModel prior = problem.prior_model(scaled);
      for (QuadraticModel* model : {&here, &there}) {
        model->gradient += dispersion * prior.gradient;
        model->hessian += dispersion * prior.hessian;
      }
    }
    return {mesh_shift(scaled, here, there, dispersion), {}};
  } catch (const Error& error) {
    return unknown(error.what());
  }
}

UncertaintyWithMesh estimate_uncertainty_with_mesh(const Problem& problem, const VecX& scaled,
                                                   const std::vector<PatchPart>& parts,
                                                   double dispersion,
                                                   const LinearizationOptions& options) {
  MeshShift mesh = find_mesh_shift(problem, scaled, frames_of(parts), dispersion, options);
  UncertaintyOptions with_mesh;
  with_mesh.systematic = mesh_half_widths(mesh.shift);
  return {estimate_uncertainty(problem, scaled, parts, with_mesh), std::move(mesh)};
}

}  // namespace weft
