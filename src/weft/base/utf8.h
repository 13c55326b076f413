#pragma once
/// JSON and TOML are UTF-8; names of files and arguments may be any bytes.
#include <string>
#include <string_view>

namespace weft {

bool is_utf8(std::string_view text);
/// `text` with its bytes that are no UTF-8 as \xNN.
std::string utf8_escaped(std::string_view text);

}  // namespace weft
