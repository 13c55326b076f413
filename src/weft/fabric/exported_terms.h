#pragma once
/// What the exports to other simulators have in common.
#include <string>
#include <string_view>
#include <vector>

#include "weft/fabric/fabric.h"

namespace weft {

/// What is lost is said from this share of what remains.
inline constexpr double kWorthSaying = 0.05;

/// Throws Error, "WHAT is VALUE UNIT, must be above 0", unless it is that and finite.
void require_positive(std::string_view what, double value, std::string_view unit);
/// 0 where the fabric has no such term.
double value_or_none(const Fabric& fabric, std::string_view parameter);
/// N m: `twist_stiffness`, or `bend_stiffness` where the fabric has none.
double twist_of(const Fabric& fabric);

/// Drag along the normal at `speed` v (m/s), over that speed, N s/m^3: drag_normal_linear +
/// drag_quadratic v / (1 + drag_degradation v^2).
double normal_drag(const Fabric& fabric, double speed);
/// Drag for simulators in which it is linear and alike in every direction, N s/m^3: what the fabric
/// has along the normal at `speed` (m/s). Adds to `lost` what that leaves out.
double linear_drag(const Fabric& fabric, double speed, std::vector<std::string>& lost);

}  // namespace weft
