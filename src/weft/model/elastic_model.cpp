#include "weft/model/elastic_model.h"

#include <fmt/format.h>

#include <cmath>

#include "weft/base/error.h"
#include "weft/model/diagonal_law.h"
#include "weft/model/motion_elastic.h"
#include "weft/model/piecewise_linear_law.h"
#include "weft/model/sheet_model.h"
#include "weft/model/spring_model.h"

namespace weft {
namespace {

constexpr double kMembraneShear = 1;  // the third strain is 2 E_uv
constexpr double kPlateTwist = 2;     // the third curvature is sqrt(2) K_uv

}  // namespace

void ElasticModel::set_history(const VecX& history) {
  if (history.size() != history_size())
    throw Error(
        fmt::format("the history has {} numbers; {} are needed", history.size(), history_size()));
}

std::unique_ptr<ElasticModel> make_elastic_model(const TriangleMesh& mesh, const Fabric& fabric,
                                                 double grain_angle, double hem_width) {
  validate(mesh, "mesh");
  if (!std::isfinite(grain_angle))
    throw Error(fmt::format("grain angle {} is not a finite number of radians", grain_angle));
  const auto sheet = [&](std::unique_ptr<detail::SheetLaw> membrane,
                         std::unique_ptr<detail::SheetLaw> bending) {
    return std::make_unique<detail::SheetModel>(mesh, fabric, grain_angle, std::move(membrane),
                                                std::move(bending));
  };
  validate(fabric);
  if (hem_width > 0) require_motion_model(fabric);
  if (fabric.model == "stvk")
    return sheet(detail::make_orthotropic_law(kMembraneShear),
                 detail::make_orthotropic_law(kPlateTwist));
  if (fabric.model == "stvk-diagonal")
    return sheet(detail::make_diagonal_membrane(fabric, detail::StretchStrain::green),
                 detail::make_diagonal_bending(fabric));
  if (fabric.model == "soft-constraints")
    return sheet(detail::make_diagonal_membrane(fabric, detail::StretchStrain::relative_elongation),
                 detail::make_diagonal_bending(fabric));
  if (fabric.model == "springs")
    return std::make_unique<detail::SpringModel>(mesh, fabric, grain_angle);
  if (fabric.model == "piecewise-linear")
    return sheet(detail::make_piecewise_linear_membrane(), detail::make_piecewise_linear_bending());
  return detail::make_motion_elastic(mesh, fabric, grain_angle, hem_width);
}

}  // namespace weft
