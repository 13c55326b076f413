#pragma once
#include <filesystem>

#include "weft/estimate/problem.h"

namespace weft {

/// The file in `folder` that holds what was prepared under `key`.
std::filesystem::path cache_file(const std::filesystem::path& folder, const Capture& capture,
                                 const std::string& key);
/// Fills features and start of `trial` (whose scene is made already). False if the file is missing,
/// damaged, or made for another scene.
bool read_cached(const std::filesystem::path& file, const std::string& key, Trial& trial);
/// Written to a temporary file first, so that no reader ever sees half of it. Throws Error if the
/// folder cannot be written.
void write_cached(const std::filesystem::path& file, const std::string& key, const Trial& trial);

}  // namespace weft
