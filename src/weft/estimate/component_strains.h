#pragma once
/// The strains that occur in a mechanical test, component by component: over which range a
/// stiffness curve is determined, and the histograms of Miguel et al. 2012, section 5.2.
#include <string_view>
#include <vector>

#include "weft/estimate/mechanical_trial.h"

namespace weft {

/// Strains of elements (triangles, or springs) with the areas that they stand for, m^2.
struct ComponentSample {
  std::vector<double> strains, areas;
};

/// Of the component `row` ("weft_stretch", "shear", "diagonal_bend", ...; of stvk "membrane_uu",
/// "membrane_vv", "membrane_shear", "bend_uu", "bend_vv", "bend_twist") over all computed frames of
/// a trial, but for elements in the clips: the strain that a stiffness curve of it runs over, so
/// magnitudes for the shear and the bends of sheets. Throws Error for another row or model.
ComponentSample component_strains(const MechanicalTrial& trial,
                                  const std::vector<MechanicalFrame>& frames, const Fabric& fabric,
                                  std::string_view row);
void append(const ComponentSample& more, ComponentSample& sample);

struct StrainRange {
  double lower = 0, upper = 0;
};
/// Between the strains below and above which the part `outliers` of the area lies, [0, 0.5). Throws
/// Error for an empty sample.
StrainRange strain_range(const ComponentSample& sample, double outliers = 0.02);

}  // namespace weft
