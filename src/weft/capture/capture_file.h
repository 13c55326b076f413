#pragma once
#include <filesystem>

#include "weft/base/toml_reader.h"

namespace weft {

/// The folder of a capture as results name it: absolute. Throws Error unless it is UTF-8, as these
/// are.
std::filesystem::path capture_folder(const std::filesystem::path& folder);

/// The capture.toml of a capture's folder. Throws Error if `folder` is none, or if the file cannot
/// be read or is no TOML.
TomlTable parse_capture_file(const std::filesystem::path& folder);

}  // namespace weft
