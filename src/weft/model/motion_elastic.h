#pragma once
#include <memory>

#include "weft/model/elastic_model.h"

namespace weft::detail {

/// The elastic part of a ClothModel for statics: damping and drag, which do nothing at rest, have
/// zero derivatives. `mesh` is valid, `fabric` of a motion model. Bending has the twist factor of
/// bending.h.
std::unique_ptr<ElasticModel> make_motion_elastic(const TriangleMesh& mesh, const Fabric& fabric,
                                                  double grain_angle, double hem_width);

}  // namespace weft::detail
