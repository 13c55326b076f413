#pragma once
/// The end of a validation program.
#include <cstdio>
#include <exception>

namespace weft::validation {

/// What main() returns: what `run` does, or 2 where it throws, with `name` and why on stderr.
template <class Run>
int run_program(const char* name, const Run& run) {
  try {
    return run();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", name, error.what());
    return 2;
  }
}

}  // namespace weft::validation
