#pragma once
#include <vector>

#include "weft/objective/residuals.h"

namespace weft {

/// A picture cut into columns x rows equal parts between (left, top) and (right, bottom), px;
/// pixels outside belong to the nearest part.
struct PatchGrid {
  double left = 0, top = 0, right = 1, bottom = 1;
  int columns = 4, rows = 4;
  int count() const { return columns * rows; }
  int patch(int row, int column) const;
};

/// The sums of FrameResiduals::linearize(), split among the parts of the picture.
struct PatchLinearization {
  FrameCost whole;
  struct Sums {
    VecX gradient;
    MatX hessian;
  };
  std::vector<Sums> patches;  ///< those of all patches add up to the frame's
};
PatchLinearization linearize_patches(const Rig& rig, const TriangleMesh& mesh,
                                     const RenderOptions& render, const AngleMapOptions& angle_map,
                                     const ResidualOptions& options, const FrameFeatures& measured,
                                     const Points& x, const MatX& directions,
                                     const PatchGrid& grid);

}  // namespace weft
