#pragma once
#include "weft/dynamics/scene.h"

namespace weft {

/// The sheet as a plane: through the fixtures at the first frame time, as the undeformed fabric
/// lies along them (narrowed or widened to their distance), the rest hanging straight down. 3 x
/// vertices. Needs at least one fixture; throws Error without.
Points flat_sheet(const Scene& scene);

}  // namespace weft
