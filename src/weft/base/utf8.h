#pragma once
/// JSON and TOML are UTF-8; names of files and arguments may be any bytes.
#include <string>
#include <string_view>

namespace weft {

/// Bytes of the character that `text`, which is not empty, begins with; 0: with none.
std::size_t utf8_length(std::string_view text);

bool is_utf8(std::string_view text);
/// `text` with its bytes that are no UTF-8 as \xNN.
std::string utf8_escaped(std::string_view text);

}  // namespace weft
