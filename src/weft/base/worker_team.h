#pragma once
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <thread>
#include <vector>

namespace weft {

/// Threads that stay, for many short rounds of tasks: a round costs about a microsecond where they
/// are awake, against some ten of parallel_for() (hundreds on a busy machine). Between rounds they
/// spin for some 50 microseconds, then sleep. The calling thread works too, and does all of a round
/// if nobody comes. One caller at a time.
class WorkerTeam {
 public:
  /// `threads`, the caller included: 1 or more; more than there are cores count as all cores.
  explicit WorkerTeam(int threads);
  ~WorkerTeam();
  WorkerTeam(const WorkerTeam&) = delete;
  WorkerTeam& operator=(const WorkerTeam&) = delete;

  /// Runs task(0) ... task(count - 1), each once, and returns when all are done. They must not
  /// depend on each other, nor throw. count < 2^20.
  void run(std::size_t count, const std::function<void(std::size_t)>& task);

 private:
  // A round: its number, how many tasks it has and the next that nobody has taken, in one word, so
  // that a task is taken only of the round that was looked at.
  static constexpr int kBits = 20;
  static constexpr std::uint64_t kMask = (std::uint64_t{1} << kBits) - 1;
  static std::size_t next(std::uint64_t round) { return round & kMask; }
  static std::size_t count(std::uint64_t round) { return (round >> kBits) & kMask; }

  void work();
  bool take_one();

  alignas(64) std::atomic<std::uint64_t> round_{0};
  alignas(64) std::atomic<std::size_t> done_{0};
  std::atomic<bool> stop_{false};
  const std::function<void(std::size_t)>* task_ = nullptr;
  std::vector<std::thread> workers_;
};

}  // namespace weft
