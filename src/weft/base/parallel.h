#pragma once
#include <cstddef>
#include <functional>

namespace weft {

/// Runs task(0) ... task(count - 1) on up to `threads` threads (0, or more than there are: all
/// cores). The exception of the lowest failing task is thrown again here; tasks above it may not
/// have run. Tasks must not depend on each other; results go to slots of their own, so that they
/// are the same for every number of threads. Calls may be nested: a waiting thread starts no task
/// of an enclosing call.
void parallel_for(std::size_t count, int threads, const std::function<void(std::size_t)>& task);

int hardware_threads();
/// `threads`, or, for 0 and less, all cores.
int all_threads(int threads);

}  // namespace weft
