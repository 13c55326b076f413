#pragma once
/// What the widths of the cells and of the time steps do to a fit to video.
#include <memory>
#include <vector>

#include "weft/estimate/linearize_trial.h"
#include "weft/estimate/mesh_error.h"
#include "weft/estimate/uncertainty.h"

namespace weft {

/// The same trial with cells and steps of half the width, from the same start. Throws Error for
/// more than 1000 vertices along a side or more than 10000 steps a frame.
std::shared_ptr<const Trial> refined(const Trial& trial);

/// Of the estimate at `scaled`, whose linearization has these parts (frames or patches of frames)
/// and the `dispersion` of uncertainty.h; one linearization of the refined trials. Unknown for a
/// problem with an evaluator of its own, where the refined motion diverges, and where there are no
/// derivatives (an explicit integrator).
MeshShift find_mesh_shift(const Problem& problem, const VecX& scaled,
                          const std::vector<CostPart>& parts, double dispersion,
                          const LinearizationOptions& options = {});

/// Intervals that hold what noise and the mesh do.
struct UncertaintyWithMesh {
  Uncertainty uncertainty;
  MeshShift mesh;
};

/// Of the estimate at `scaled`, whose linearization has these parts (at least two frames) and the
/// `dispersion` of estimate_uncertainty().
UncertaintyWithMesh estimate_uncertainty_with_mesh(const Problem& problem, const VecX& scaled,
                                                   const std::vector<PatchPart>& parts,
                                                   double dispersion,
                                                   const LinearizationOptions& options = {});

}  // namespace weft
