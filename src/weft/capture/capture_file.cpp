#include "weft/capture/capture_file.h"

#include <fmt/format.h>

#include "weft/base/error.h"
#include "weft/base/files.h"
#include "weft/base/utf8.h"

namespace weft {

std::filesystem::path capture_folder(const std::filesystem::path& folder) {
  std::error_code failure;
  const auto absolute = std::filesystem::absolute(folder, failure).lexically_normal();
  if (failure)
    throw error_at({folder, 0, {}}, fmt::format("cannot be found: {}", failure.message()));
  if (!is_utf8(absolute.string()))
    throw Error(fmt::format("{}: the path of a capture must be valid UTF-8",
                            utf8_escaped(absolute.string())));
  return absolute;
}

TomlTable parse_capture_file(const std::filesystem::path& folder) {
  if (!is_folder(folder))
    throw error_at({folder, 0, {}}, "not a folder; a capture is a folder with a capture.toml");
  return TomlTable::parse_file(folder / "capture.toml");
}

}  // namespace weft
