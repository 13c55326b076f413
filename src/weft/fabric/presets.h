#pragma once
#include <vector>

#include "weft/fabric/fabric.h"

namespace weft::detail {

std::vector<Fabric> make_presets();

}  // namespace weft::detail
