#include "weft/vision/plane.h"

namespace weft::detail {

Box bounding_box(const Mask& mask) {
  Box box{int(mask.cols()), int(mask.rows()), 0, 0};
  for (Eigen::Index y = 0; y < mask.rows(); ++y) {
    const std::uint8_t* begin = mask.data() + y * mask.cols();
    const std::uint8_t* end = begin + mask.cols();
    const auto* first = std::find_if(begin, end, [](std::uint8_t value) { return value != 0; });
    if (first == end) continue;
    const auto* last = end - 1;
    while (*last == 0) --last;
    box.x0 = std::min(box.x0, int(first - begin));
    box.x1 = std::max(box.x1, int(last - begin) + 1);
    box.y0 = std::min(box.y0, int(y));
    box.y1 = int(y) + 1;
  }
  return box;
}

}  // namespace weft::detail
