#pragma once
#include <chrono>

namespace weft {

/// What durations are measured by: it is never set back.
using Clock = std::chrono::steady_clock;

/// Wall time, s.
inline double seconds_between(Clock::time_point begin, Clock::time_point end) {
  return std::chrono::duration<double>(end - begin).count();
}
inline double seconds_since(Clock::time_point begin) {
  return seconds_between(begin, Clock::now());
}

}  // namespace weft
