#pragma once
#include <charconv>
#include <optional>
#include <string_view>
#include <system_error>
#include <vector>

namespace weft {

/// The number that `text` is, all of it: without spaces or a plus in front. Doubles may be "inf"
/// and "nan".
template <typename Number>
std::optional<Number> number_of(std::string_view text) {
  Number value{};
  const char* const end = text.data() + text.size();
  const auto [stop, status] = std::from_chars(text.data(), end, value);
  if (status != std::errc() || stop != end) return std::nullopt;
  return value;
}

/// The finite numbers of "1.5,2,-3e4", at least one; nothing if `text` is anything else.
std::optional<std::vector<double>> numbers_of(std::string_view text, char separator);

}  // namespace weft
