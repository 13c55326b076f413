#pragma once
#include <chrono>
#include <cstdio>
#include <optional>
#include <string>

#include "weft/base/clock.h"

namespace weft {

/// One line of progress with an estimate of the time left. On a terminal the line is rewritten in
/// place; in a log a plain line is printed, at most one every `log_interval`.
class Progress {
 public:
  struct Options {
    std::FILE* stream = stderr;
    std::chrono::milliseconds terminal_interval{100};
    std::chrono::milliseconds log_interval{10000};
    bool quiet = false;  ///< print nothing
    /// When the work began, if that was before the construction.
    Clock::time_point start = Clock::now();
  };

  Progress(std::string label, std::size_t total, Options options);
  Progress(std::string label, std::size_t total) : Progress(std::move(label), total, Options()) {}
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// `done` of `total` (0: not known); `note` is appended ("error 0.0123").
  void update(std::size_t done, const std::string& note = {});
  /// The last line, with the time taken until the last update: what comes between that and this
  /// call may be of the next work. Called by the destructor if not before.
  void finish(const std::string& note = {});

 private:
  /// On a terminal the next line takes the place of a passing one.
  enum class Place { passing, last };
  void print(const std::string& line, Place place);
  std::string label_;
  std::size_t total_;
  Options options_;
  bool terminal_ = false;
  bool finished_ = false;
  std::size_t done_ = 0;
  Clock::time_point start_;
  Clock::time_point last_print_;
  std::optional<Clock::time_point> last_update_;
};

}  // namespace weft
