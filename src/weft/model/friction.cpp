#include "weft/model/friction.h"

#include <algorithm>
#include <array>
#include <string_view>

namespace weft::detail {

std::vector<int> friction_components(const Fabric& fabric) {
  constexpr std::array<std::string_view, 6> kNames = {
      "weft_stretch_friction", "warp_stretch_friction", "shear_friction",
      "weft_bend_friction",    "warp_bend_friction",    "diagonal_bend_friction"};
  const auto infos = model_parameters(fabric.model);
  std::vector<int> components;
  for (std::size_t i = 0; i < kNames.size(); ++i)
    if (std::ranges::find(infos, kNames[i], &ParameterInfo::name) != infos.end() &&
        fabric.value_count(kNames[i]) > 0)
      components.push_back(static_cast<int>(i));
  return components;
}

}  // namespace weft::detail
