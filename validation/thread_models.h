#pragma once
/// Models that know weft, warp and diagonals by themselves (stvk-diagonal, soft-constraints,
/// springs), as fits to mechanical captures start from them.
#include <string>
#include <string_view>
#include <vector>

#include "weft/fabric/fabric.h"

namespace weft::validation {

/// A parameter of theirs, and what stvk has for it.
struct ThreadParameter {
  std::string_view name, of_stvk;
  bool bends() const { return name.ends_with("bend"); }
};
inline constexpr ThreadParameter kThreadParameters[] = {
    {"weft_stretch", "membrane_uu"}, {"warp_stretch", "membrane_vv"},
    {"shear", "membrane_shear"},     {"weft_bend", "bend_uu"},
    {"warp_bend", "bend_vv"},        {"diagonal_bend", "bend_twist"}};

/// A flat sheet of ring-2 springs has no bending stiffness, a bent one one that depends on the
/// mesh, which is another one for each overhang: they are fitted in the plane only, with
/// next to no bends.
inline bool in_plane_only(std::string_view model) { return model == "springs"; }
/// Of bends that mean nothing on another mesh and resist stretch, N/m.
inline constexpr double kNextToNoBend = 1e-3;

/// The names of what is searched.
inline std::vector<std::string> searched_parameters(std::string_view model) {
  std::vector<std::string> names;
  for (const ThreadParameter& p : kThreadParameters)
    if (!p.bends() || !in_plane_only(model)) names.emplace_back(p.name);
  return names;
}

/// A start with `value(parameter)` for what is searched.
template <class Value>
Fabric thread_fabric(const std::string& name, const std::string& model, const Value& value) {
  Fabric fabric = Fabric::with_defaults(name, model);
  for (const ThreadParameter& p : kThreadParameters)
    fabric.set(p.name, p.bends() && in_plane_only(model) ? kNextToNoBend : value(p));
  return fabric;
}

}  // namespace weft::validation
