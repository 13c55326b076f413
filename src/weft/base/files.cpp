#include "weft/base/files.h"

#include <fmt/format.h>

namespace weft {
namespace {

namespace fs = std::filesystem;

fs::file_type type_at(const fs::path& path, const SourceLocation& where) {
  std::error_code failure;
  const fs::file_status status = fs::status(path, failure);
  if (fs::status_known(status)) return status.type();
  const std::string reason = fmt::format("cannot be read: {}", failure.message());
  throw error_at(where, where.file == path ? reason : fmt::format("{}: {}", path.string(), reason));
}

SourceLocation at_path(const fs::path& path) { return {path, 0, {}}; }

}  // namespace

bool path_exists(const fs::path& path) {
  return type_at(path, at_path(path)) != fs::file_type::not_found;
}

bool is_file(const fs::path& path) { return is_file(path, at_path(path)); }
bool is_file(const fs::path& path, const SourceLocation& where) {
  return type_at(path, where) == fs::file_type::regular;
}

bool is_folder(const fs::path& path) { return is_folder(path, at_path(path)); }
bool is_folder(const fs::path& path, const SourceLocation& where) {
  return type_at(path, where) == fs::file_type::directory;
}

std::vector<fs::path> entries_of(const fs::path& folder) {
  std::vector<fs::path> entries;
  std::error_code failure;
  fs::directory_iterator entry(folder, failure);
  for (; !failure && entry != fs::directory_iterator(); entry.increment(failure))
    entries.push_back(entry->path());
  if (failure)
    throw error_at(at_path(folder), fmt::format("cannot be read: {}", failure.message()));
  return entries;
}

void remove_file(const fs::path& path) {
  std::error_code failure;
  fs::remove(path, failure);
  if (failure)
    throw error_at(at_path(path), fmt::format("cannot be removed: {}", failure.message()));
}

}  // namespace weft
