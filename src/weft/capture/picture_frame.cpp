#include "weft/capture/picture_frame.h"

#include <cmath>
#include <numbers>

namespace weft {
namespace {

constexpr double kQuarter = 0.25 * std::numbers::pi;

/// Between a bar and the diagonal.
double half_angle(double shear) { return kQuarter - 0.5 * shear; }

}  // namespace

double frame_displacement(double side, double shear) {
  return 2 * side * (std::cos(half_angle(shear)) - std::cos(kQuarter));
}

double frame_shear(double side, double displacement) {
  return 2 * (kQuarter - std::acos(std::cos(kQuarter) + displacement / (2 * side)));
}

double frame_displacement_rate(double side, double shear) {
  return side * std::sin(half_angle(shear));
}

FrameThreads frame_threads(double shear) {
  const double c = std::cos(half_angle(shear)), s = std::sin(half_angle(shear));
  FrameThreads threads;
  threads.along << c, c,  //
      -s, s,              //
      0, 0;
  threads.rate << 0.5 * s, 0.5 * s,  //
      0.5 * c, -0.5 * c,             //
      0, 0;
  return threads;
}

}  // namespace weft
