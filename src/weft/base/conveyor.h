#pragma once
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

namespace weft {

/// Carries items from the thread that makes them to one that uses them, in their order, while the
/// next are made. It owns a fixed number of items, which are filled again and again: what they
/// allocate is allocated once.
template <class Item>
class Conveyor {
 public:
  using Use = std::function<void(Item&)>;

  /// `threads`: with 1, put() uses the item itself; with more, a thread of its own does. `items`: 1
  /// or more; put() waits while that many are filled and not yet used.
  Conveyor(int threads, std::size_t items, Use use)
      : items_(threads > 1 ? items : 1), use_(std::move(use)) {
    if (threads > 1) user_ = std::thread([this] { work(); });
  }
  /// Items that wait are dropped.
  ~Conveyor() { stop(State::dropped); }
  Conveyor(const Conveyor&) = delete;
  Conveyor& operator=(const Conveyor&) = delete;

  /// Calls `fill` with an item and sends it off. Throws what `use` threw for one before; nothing is
  /// used after that.
  template <class Fill>
  void put(const Fill& fill) {
    Item& item = items_[filled_ % items_.size()];
    if (!user_.joinable()) {
      fill(item);
      return use_(item);
    }
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [&] { return failure_ || filled_ - used_ < items_.size(); });
      if (failure_) std::rethrow_exception(failure_);
    }
    fill(item);
    {
      const std::lock_guard lock(mutex_);
      ++filled_;
    }
    changed_.notify_all();
  }

  /// Returns when every item has been used. Throws what `use` threw. The last call.
  void finish() {
    stop(State::finished);
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
  enum class State { open, finished, dropped };

  void stop(State state) {
    if (!user_.joinable()) return;
    {
      const std::lock_guard lock(mutex_);
      state_ = state;
    }
    changed_.notify_all();
    user_.join();
  }

  void work() {
    for (;;) {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [&] { return used_ < filled_ || state_ != State::open; });
      if (used_ == filled_ || state_ == State::dropped) return;
      lock.unlock();
      try {
        use_(items_[used_ % items_.size()]);
      } catch (...) {
        lock.lock();
        failure_ = std::current_exception();
        changed_.notify_all();
        return;
      }
      lock.lock();
      ++used_;
      changed_.notify_all();
    }
  }

  std::vector<Item> items_;
  Use use_;
  std::mutex mutex_;  // of all below
  std::condition_variable changed_;
  std::size_t filled_ = 0, used_ = 0;
  State state_ = State::open;
  std::exception_ptr failure_;
  std::thread user_;
};

}  // namespace weft
