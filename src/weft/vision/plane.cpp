#include "weft/vision/plane.h"

namespace weft::detail {

Box bounding_box(const Mask& mask) {
  Box box{int(mask.cols()), int(mask.rows()), 0, 0};
  for (Eigen::Index y = 0; y < mask.rows(); ++y) {
    const std::uint8_t* begin = mask.data() + y * mask.cols();
    const std::uint8_t* end = begin + mask.cols();
    std::uint8_t any = 0;
    for (const std::uint8_t* at = begin; at < end; ++at) any |= *at;
    if (any == 0) continue;
    // Only what would widen the box is looked at.
    const auto inside = [&](int x) { return begin[x] != 0; };
    int left = 0, right = int(mask.cols());
    while (left < box.x0 && !inside(left)) ++left;
    while (right > box.x1 && !inside(right - 1)) --right;
    box.x0 = left;
    box.x1 = right;
    box.y0 = std::min(box.y0, int(y));
    box.y1 = int(y) + 1;
  }
  return box;
}

}  // namespace weft::detail
