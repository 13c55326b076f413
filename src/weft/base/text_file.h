#pragma once
/// Text files, and text in TOML files.
#include <filesystem>
#include <string>
#include <string_view>

namespace weft {

/// Throws Error, with the path, if the file cannot be written or the folder cannot be made.
void write_text(const std::filesystem::path& path, const std::string& text);
void make_folder(const std::filesystem::path& folder);
/// `text` as a basic string of TOML, with its quotes.
std::string toml_string(std::string_view text);

}  // namespace weft
