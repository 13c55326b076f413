#pragma once
#include "weft/capture/capture.h"
#include "weft/registration/stripe_surface.h"

namespace weft {

/// Cloth and stripes of a capture's frame 0, where settling starts.
struct FirstFrame {
  Mask silhouette;
  StripePoints points;
};
FirstFrame decode_first_frame(const Image& frame, const Capture& capture, const Scene& scene);
/// Reads the frame, too.
FirstFrame decode_first_frame(const Capture& capture, const Scene& scene);

}  // namespace weft
