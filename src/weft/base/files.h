#pragma once
/// What is at a path that a user gave. Each throws Error, at `where` (or the path), with the
/// system's reason if that cannot be told: links that lead round in a circle, a name that is too
/// long, a folder that may not be read.
#include <filesystem>
#include <vector>

#include "weft/base/error.h"

namespace weft {

bool path_exists(const std::filesystem::path& path);
bool is_file(const std::filesystem::path& path);
bool is_file(const std::filesystem::path& path, const SourceLocation& where);
bool is_folder(const std::filesystem::path& path);
bool is_folder(const std::filesystem::path& path, const SourceLocation& where);

/// What a folder holds, in no order.
std::vector<std::filesystem::path> entries_of(const std::filesystem::path& folder);

/// Nothing where there is none.
void remove_file(const std::filesystem::path& path);

}  // namespace weft
