#pragma once
/// How much the cloth of a computed mechanical capture is strained, and where most of it is.
#include <array>
#include <vector>

#include "weft/estimate/mechanical_trial.h"
#include "weft/model/material_response.h"

namespace weft {

/// Strain of one kind, as material_response() takes it, of every element that is not wholly inside
/// a clip, in all frames: of triangles stretch |w| - 1 along a thread and the tangent of the shear
/// angle, of bending elements the curvature along a thread or a diagonal (1/m); of both diagonals,
/// each with half of the area.
struct StrainSample {
  std::vector<double> value;
  std::vector<double> area;  ///< m^2, of the element
};
using StrainSamples = std::array<StrainSample, kMaterialTests.size()>;
/// One a test, in the order of kMaterialTests. Frames without equilibrium are left out.
StrainSamples strain_samples(const MechanicalTrial& trial,
                             const std::vector<MechanicalFrame>& frames);

/// The value below which the share `q` (0 to 1) of the area lies; 0 for an empty sample.
double quantile(const StrainSample& sample, double q);

}  // namespace weft
