#pragma once
#include <cstddef>
#include <functional>

namespace weft {

/// Runs task(0) ... task(count - 1) on up to `threads` threads (0: all cores). The first exception is
/// thrown again here. Tasks must not depend on each other; results go to slots of their own, so that
/// they are the same for every number of threads.
void parallel_for(std::size_t count, int threads, const std::function<void(std::size_t)>& task);

int hardware_threads();

}  // namespace weft
