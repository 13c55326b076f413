#include "weft/base/number_text.h"

#include <cmath>

namespace weft {

std::optional<std::vector<double>> numbers_of(std::string_view text, char separator) {
  std::vector<double> numbers;
  while (true) {
    const std::size_t end = text.find(separator);
    const auto number = number_of<double>(text.substr(0, end));
    if (!number || !std::isfinite(*number)) return std::nullopt;
    numbers.push_back(*number);
    if (end == std::string_view::npos) return numbers;
    text.remove_prefix(end + 1);
  }
}

}  // namespace weft
