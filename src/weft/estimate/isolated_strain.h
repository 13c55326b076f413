#pragma once
#include <string_view>

#include "weft/capture/mechanical_capture.h"

namespace weft {

/// The strain that a test exercises most.
enum class IsolatedStrain {
  weft_stretch,
  warp_stretch,
  shear,
  weft_bend,
  warp_bend,
  diagonal_bend
};
std::string_view name_of(IsolatedStrain strain);
bool is_stretch(IsolatedStrain strain);
/// By the motion of the clips alone. A single clip: a bend along the threads, or the diagonal,
/// nearest to the direction in which most free cloth lies. Otherwise the largest component, over
/// all frames, of the Green strain (twice its off-diagonal) of the affine map nearest to the clips'
/// corners, or of that of a picture frame.
IsolatedStrain isolated_strain(const MechanicalCapture& capture);

}  // namespace weft
