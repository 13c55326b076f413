#pragma once
#include <algorithm>

namespace weft {

/// When to try again what is cheap if it succeeds and vain if not: on the next occasion after a
/// success, and after each failure in a row on the second, fourth, eighth ... occasion.
class RetryPause {
 public:
  /// `longest`: occasions, at least 1.
  explicit RetryPause(int longest) : longest_(longest) {}

  /// Counts an occasion; whether to try on it.
  bool is_due() { return --left_ <= 0; }
  /// How the try went.
  void note(bool success) {
    pause_ = success ? 1 : std::min(2 * pause_, longest_);
    left_ = pause_;
  }

 private:
  int longest_;
  int pause_ = 1, left_ = 1;
};

}  // namespace weft
