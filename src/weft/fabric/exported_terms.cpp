#include "weft/fabric/exported_terms.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "weft/base/error.h"

namespace weft {

void require_positive(std::string_view what, double value, std::string_view unit) {
  if (!(value > 0 && std::isfinite(value)))
    throw Error(fmt::format("{} is {} {}, must be above 0", what, value, unit));
}

double value_or_none(const Fabric& fabric, std::string_view parameter) {
  const auto names = fabric.value_names();
  const bool there = std::ranges::find(names, parameter) != names.end();
  return there ? fabric.value(parameter) : 0;
}

double twist_of(const Fabric& fabric) {
  return fabric.value(fabric.value_count("twist_stiffness") > 0 ? "twist_stiffness"
                                                                : "bend_stiffness");
}

double normal_drag(const Fabric& fabric, double speed) {
  return value_or_none(fabric, "drag_normal_linear") +
         fabric.value("drag_quadratic") * speed /
             (1 + fabric.value("drag_degradation") * speed * speed);
}

double linear_drag(const Fabric& fabric, double speed, std::vector<std::string>& lost) {
  const double drag = normal_drag(fabric, speed);
  const double quadratic = drag - value_or_none(fabric, "drag_normal_linear");
  const double tangential = fabric.value("drag_linear");
  if (quadratic > kWorthSaying * drag)
    lost.push_back(fmt::format(
        "Drag is linear, {:.3g} N s/m^3 at every speed: as the fabric's along the normal at {:g} "
        "m/s.",
        drag, speed));
  if (std::abs(tangential - drag) > kWorthSaying * drag)
    lost.push_back(fmt::format(
        "Drag along the surface is {:.3g} N s/m^3, as along the normal; the fabric has {:.3g}.",
        drag, tangential));
  return drag;
}

}  // namespace weft
