#include "weft/estimate/first_frame.h"

#include "weft/vision/silhouette.h"

namespace weft {

FirstFrame decode_first_frame(const Image& frame, const Capture& capture, const Scene& scene) {
  FirstFrame result;
  result.silhouette =
      find_silhouette(frame, {.stripe_period = image_stripe_period(capture)}).silhouette;
  result.points = decode_stripes(frame, result.silhouette, capture.rig, scene);
  return result;
}

FirstFrame decode_first_frame(const Capture& capture, const Scene& scene) {
  return decode_first_frame(read_video(capture, 0, 0).front(), capture, scene);
}

}  // namespace weft
