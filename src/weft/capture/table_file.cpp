#include "weft/capture/table_file.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <set>

#include "weft/base/number_text.h"

namespace weft {
namespace {

std::string trimmed(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r\"";
  const std::size_t first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return std::string(text.substr(first, text.find_last_not_of(kBlank) - first + 1));
}

/// Where the first cell ends; a comma within quotes around it does not end it.
std::size_t end_of_cell(std::string_view line) {
  const std::size_t first = line.find_first_not_of(" \t");
  if (first == std::string_view::npos || line[first] != '"') return line.find(',');
  const std::size_t closing = line.find('"', first + 1);
  return line.find(',', closing == std::string_view::npos ? first : closing);
}

std::vector<std::string> split(std::string_view line) {
  std::vector<std::string> cells;
  for (;;) {
    const std::size_t comma = end_of_cell(line);
    cells.push_back(trimmed(line.substr(0, comma)));
    if (comma == std::string_view::npos) return cells;
    line.remove_prefix(comma + 1);
  }
}

/// Throws for a header of one cell that other separators would divide.
void check_separator(std::string_view header, const SourceLocation& where) {
  for (const auto& [separator, name] : {std::pair{';', "semicolons"}, {'\t', "tabs"}})
    if (header.find(separator) != std::string_view::npos)
      throw error_at(where, fmt::format("columns seem to be separated by {}; commas are needed, "
                                        "and points in numbers",
                                        name));
}

}  // namespace

TableFile::TableFile(const std::filesystem::path& path) : path_(path) {
  std::error_code status;
  if (!std::filesystem::is_regular_file(path_, status))
    throw error_at({path_, 0, {}}, "no such file");
  std::ifstream stream(path_);
  std::string line;
  for (int number = 1; std::getline(stream, line); ++number) {
    if (number == 1 && line.starts_with("\xef\xbb\xbf")) line.erase(0, 3);
    if (trimmed(line).empty()) continue;
    std::vector<std::string> cells = split(line);
    if (header_.empty()) {
      if (cells.size() == 1) check_separator(cells.front(), {path_, number, {}});
      header_ = std::move(cells);
      header_line_ = number;
      continue;
    }
    if (cells.size() != header_.size()) {
      throw error_at({path_, number, {}}, fmt::format("{} cells; the header has {} columns",
                                                      cells.size(), header_.size()));
    }
    rows_.push_back(std::move(cells));
    lines_.push_back(number);
  }
  if (!stream.eof()) throw error_at({path_, 0, {}}, "cannot be read");
  if (header_.empty()) throw error_at({path_, 0, {}}, "empty; a header row is needed");
  std::set<std::string> names;
  for (const std::string& name : header_) {
    if (!names.insert(name).second)
      throw error_at({path_, header_line_, name}, "two columns of this name");
  }
}

bool TableFile::has(std::string_view column) const {
  return std::find(header_.begin(), header_.end(), column) != header_.end();
}

std::string TableFile::missing(std::string_view column) const {
  return fmt::format("{} has no column \"{}\"; there are {}", path_.filename().string(), column,
                     fmt::join(header_, ", "));
}

std::size_t TableFile::column_index(std::string_view column) const {
  const auto found = std::find(header_.begin(), header_.end(), column);
  if (found == header_.end())
    throw error_at({path_, header_line_, std::string(column)},
                   fmt::format("no such column; there are {}", fmt::join(header_, ", ")));
  return static_cast<std::size_t>(found - header_.begin());
}

double TableFile::number(std::size_t row, std::size_t column) const {
  const std::string& cell = rows_[row][column];
  const auto value = number_of<double>(cell);
  if (!value || !std::isfinite(*value))
    throw fail(row, header_[column], fmt::format("\"{}\" is not a finite number", cell));
  return *value;
}

VecX TableFile::numbers(std::string_view column) const {
  const std::size_t index = column_index(column);
  VecX values(static_cast<Eigen::Index>(rows_.size()));
  for (std::size_t row = 0; row < rows_.size(); ++row)
    values[static_cast<Eigen::Index>(row)] = number(row, index);
  return values;
}

Error TableFile::fail(std::size_t row, std::string_view column, std::string_view reason) const {
  return error_at({path_, lines_[row], std::string(column)}, reason);
}

}  // namespace weft
