#pragma once
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string_view>

namespace weft {

enum class JsonComments { refused, passed_over };

/// Throws Error, with line and `name` of the file, where `text` is not JSON or has a number that no
/// double holds.
nlohmann::ordered_json parse_json(std::string_view text, const std::filesystem::path& name,
                                  JsonComments comments = JsonComments::refused);

}  // namespace weft
