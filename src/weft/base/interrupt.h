#pragma once
namespace weft {

/// Turns Ctrl-C (SIGINT) and SIGTERM into a flag while it lives; a second signal ends the process.
/// Only apps/ construct it; long loops ask interrupted().
class InterruptGuard {
 public:
  InterruptGuard();
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;
};

bool interrupted();

}  // namespace weft
