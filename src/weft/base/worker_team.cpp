#include "weft/base/worker_team.h"

#include <algorithm>
#include <cassert>

#include "weft/base/parallel.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace weft {
namespace {

constexpr int kSpins = 1000;

void pause() {
#if defined(__x86_64__)
  _mm_pause();
#endif
}

}  // namespace

WorkerTeam::WorkerTeam(int threads) {
  const int count = std::min(threads, hardware_threads());
  for (int i = 1; i < count; ++i) workers_.emplace_back([this] { work(); });
}

WorkerTeam::~WorkerTeam() {
  stop_.store(true);
  round_.fetch_add(std::uint64_t{1} << (2 * kBits));
  round_.notify_all();
  for (std::thread& worker : workers_) worker.join();
}

bool WorkerTeam::take_one() {
  std::uint64_t round = round_.load(std::memory_order_acquire);
  while (next(round) < count(round)) {
    if (!round_.compare_exchange_weak(round, round + 1, std::memory_order_acq_rel)) continue;
    (*task_)(next(round));
    done_.fetch_add(1, std::memory_order_release);
    return true;
  }
  return false;
}

void WorkerTeam::work() {
  while (!stop_.load(std::memory_order_relaxed)) {
    if (take_one()) continue;
    std::uint64_t seen = round_.load(std::memory_order_acquire);
    for (int i = 0; i < kSpins && next(seen) >= count(seen); ++i) {
      pause();
      seen = round_.load(std::memory_order_acquire);
    }
    // The word only changes when there is more to do, or the end has come.
    if (next(seen) >= count(seen) && !stop_.load()) round_.wait(seen, std::memory_order_acquire);
  }
}

void WorkerTeam::run(std::size_t count, const std::function<void(std::size_t)>& task) {
  assert(count < kMask);
  if (workers_.empty() || count < 2) {
    for (std::size_t i = 0; i < count; ++i) task(i);
    return;
  }
  task_ = &task;
  done_.store(0, std::memory_order_relaxed);
  const std::uint64_t number = (round_.load(std::memory_order_relaxed) >> (2 * kBits)) + 1;
  round_.store((number << (2 * kBits)) | (std::uint64_t{count} << kBits),
               std::memory_order_release);
  round_.notify_all();
  while (take_one()) {
  }
  for (int spins = 0; done_.load(std::memory_order_acquire) != count; ++spins) {
    if (spins < kSpins) {
      pause();
    } else {
      std::this_thread::yield();
    }
  }
}

}  // namespace weft
