#pragma once
#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>

namespace weft {

/// A mistake in what the user gave: a file, a key, an argument. The program prints what() as one
/// line and exits with status 2. Internal invariants are assertions, never this.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Where in a file a value stands. `line` is 1-based, 0 where there is none; `key` may be empty.
struct SourceLocation {
  std::filesystem::path file = {};
  int line = 0;
  std::string key = {};
};

/// "FILE:LINE: KEY: REASON", leaving out what `where` does not have.
Error error_at(const SourceLocation& where, std::string_view reason);

/// What `call` returns. An Error that it throws gets `where` before its text; an option is a key
/// without a file.
template <typename Call>
decltype(auto) with_errors_at(const SourceLocation& where, const Call& call) {
  try {
    return call();
  } catch (const Error& error) {
    throw error_at(where, error.what());
  }
}

}  // namespace weft
