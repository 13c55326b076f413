#include "weft/model/elastic_model.h"

#include <fmt/format.h>

#include <cmath>

#include "weft/base/error.h"
#include "weft/model/sheet_model.h"

namespace weft {
namespace {

constexpr double kMembraneShear = 1;  // the third strain is 2 E_uv
constexpr double kPlateTwist = 2;     // the third curvature is sqrt(2) K_uv

}  // namespace

std::unique_ptr<ElasticModel> make_elastic_model(const TriangleMesh& mesh, const Fabric& fabric,
                                                 double grain_angle) {
  validate(mesh, "mesh");
  if (!std::isfinite(grain_angle))
    throw Error(fmt::format("grain angle {} is not a finite number of radians", grain_angle));
  if (fabric.model == "stvk")
    return std::make_unique<detail::SheetModel>(mesh, fabric, grain_angle,
                                                detail::make_orthotropic_law(kMembraneShear),
                                                detail::make_orthotropic_law(kPlateTwist));
  throw Error(fmt::format("fabric \"{}\" is of model \"{}\", which has no statics; known: \"stvk\"",
                          fabric.name, fabric.model));
}

}  // namespace weft
