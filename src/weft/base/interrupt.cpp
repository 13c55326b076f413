#include "weft/base/interrupt.h"

#include <atomic>
#include <csignal>

namespace weft {
namespace {

// A signal handler has no other way to speak: this flag and the saved handlers are the one
// exception to "no global state".
std::atomic<bool> flag{false};
static_assert(std::atomic<bool>::is_always_lock_free);
struct sigaction previous_interrupt;
struct sigaction previous_terminate;

extern "C" void on_signal(int signal) {
  if (flag.exchange(true)) {
    std::signal(signal, SIG_DFL);
    std::raise(signal);
  }
}

}  // namespace

InterruptGuard::InterruptGuard() {
  flag = false;
  struct sigaction action {};
  action.sa_handler = on_signal;
  sigemptyset(&action.sa_mask);
  action.sa_flags = SA_RESTART;
  sigaction(SIGINT, &action, &previous_interrupt);
  sigaction(SIGTERM, &action, &previous_terminate);
}

InterruptGuard::~InterruptGuard() {
  sigaction(SIGINT, &previous_interrupt, nullptr);
  sigaction(SIGTERM, &previous_terminate, nullptr);
  flag = false;
}

bool interrupted() { return flag.load(std::memory_order_relaxed); }

}  // namespace weft
