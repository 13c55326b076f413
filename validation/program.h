#pragma once
/// The arguments and the end of a validation program.
#include <fmt/format.h>

#include <cstdio>
#include <exception>
#include <string>

#include "weft/base/error.h"
#include "weft/base/number_text.h"

namespace weft::validation {

/// The number that an argument is. Throws Error where it is none, or less than `least`.
template <typename Number>
Number number(const std::string& name, const std::string& text, Number least) {
  const auto value = number_of<Number>(text);
  if (!value || !(*value >= least))
    throw Error(fmt::format("{} {}: a number of at least {} is needed", name, text, least));
  return *value;
}

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
