#include "weft/capture/capture_file.h"

#include "weft/base/error.h"

namespace weft {

TomlTable parse_capture_file(const std::filesystem::path& folder) {
  if (!std::filesystem::is_directory(folder))
    throw error_at({folder, 0, {}}, "not a folder; a capture is a folder with a capture.toml");
  return TomlTable::parse_file(folder / "capture.toml");
}

}  // namespace weft
