#pragma once
/// The arguments and the end of a validation program.
#include <fmt/format.h>

#include <cstdio>
#include <exception>
#include <initializer_list>
#include <string>
#include <string_view>

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

/// `word` where it is one of `parts`. Throws Error with `usage` otherwise: a misspelt option would
/// be taken for a part that nobody runs.
inline std::string part(const std::string& word, std::initializer_list<std::string_view> parts,
                        const std::string& usage) {
  for (const std::string_view known : parts)
    if (word == known) return word;
  throw Error(fmt::format("{} is no part, no option, or lacks its value\n{}", word, usage));
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
