#include "weft/base/parallel.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/info.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/partitioner.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>

namespace weft {
namespace {

/// The exception of the lowest failing index. Tasks above it may be left out, tasks below it never
/// are, so that the same exception surfaces whatever the number of threads.
class FirstFailure {
 public:
  explicit FirstFailure(std::size_t count) : index_(count) {}

  void run(const std::function<void(std::size_t)>& task, std::size_t index) {
    if (index > index_.load(std::memory_order_relaxed)) return;
    try {
      task(index);
    } catch (...) {
      const std::lock_guard lock(mutex_);
      if (index < index_.load(std::memory_order_relaxed)) {
        index_.store(index, std::memory_order_relaxed);
        exception_ = std::current_exception();
      }
    }
  }

  void rethrow() const {
    if (exception_) std::rethrow_exception(exception_);
  }

 private:
  std::atomic<std::size_t> index_;
  std::mutex mutex_;
  std::exception_ptr exception_;
};

}  // namespace

int hardware_threads() { return oneapi::tbb::info::default_concurrency(); }

int all_threads(int threads) { return threads > 0 ? threads : hardware_threads(); }

void parallel_for(std::size_t count, int threads, const std::function<void(std::size_t)>& task) {
  // More threads than cores gain nothing, and TBB warns of them on stderr.
  threads = std::min(all_threads(threads), hardware_threads());
  if (threads == 1 || count < 2) {
    for (std::size_t i = 0; i < count; ++i) task(i);
    return;
  }
  FirstFailure failure(count);
  // An arena of its own: while this call waits, its thread takes no task of an enclosing
  // parallel_for, whose buffers are in use further up the stack.
  oneapi::tbb::task_arena arena(threads);
  arena.execute([&] {
    oneapi::tbb::parallel_for(
        oneapi::tbb::blocked_range<std::size_t>(0, count, 1),
        [&](const oneapi::tbb::blocked_range<std::size_t>& range) {
          for (std::size_t i = range.begin(); i != range.end(); ++i) failure.run(task, i);
        },
        oneapi::tbb::simple_partitioner());
  });
  failure.rethrow();
}

}  // namespace weft
