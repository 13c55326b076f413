#pragma once
#include <filesystem>

#include "weft/base/toml_reader.h"

namespace weft {

/// The capture.toml of a capture's folder. Throws Error if `folder` is none, or if the file cannot
/// be read or is no TOML.
TomlTable parse_capture_file(const std::filesystem::path& folder);

}  // namespace weft
