#pragma once
#include <chrono>

namespace weft {

/// What durations are measured by: it is never set back.
using Clock = std::chrono::steady_clock;

/// Wall time, s.
inline double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

}  // namespace weft
