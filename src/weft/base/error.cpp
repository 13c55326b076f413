#include "weft/base/error.h"

#include <fmt/format.h>

namespace weft {

Error error_at(const SourceLocation& where, std::string_view reason) {
  std::string text = where.file.string();
  if (where.line > 0) text += (text.empty() ? "line " : ":") + std::to_string(where.line);
  if (!text.empty()) text += ": ";
  if (!where.key.empty()) text += where.key + ": ";
  text += reason;
  return Error(text);
}

}  // namespace weft
