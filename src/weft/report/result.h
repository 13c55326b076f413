#pragma once
#include <filesystem>
#include <string>
#include <string_view>

#include "weft/report/report.h"

namespace weft {

/// result.json (docs/formats.md) without what the subcommands add of mechanical captures and scans:
/// everything else that a report shows but the pictures, and how it was made. A number that is not
/// finite is null, and "KEY_not_finite" beside it says which: "infinity",
/// "-infinity" or "nan"; for an array, an object from index to that word. An absent optional value
/// is null alone.
std::string result_to_json(const Report& report);

/// The reverse. Keys that are not known are passed over, so that later versions can add some.
/// Throws Error naming file, line or key for text that is not JSON, another format or version,
/// missing keys and values of a wrong type.
Report result_from_json(std::string_view text, const std::filesystem::path& name);

/// Throws Error if the file cannot be written or read.
void write_result(const std::filesystem::path& path, const Report& report);
Report read_result(const std::filesystem::path& path);

}  // namespace weft
