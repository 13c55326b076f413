#pragma once
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "weft/base/error.h"
#include "weft/base/types.h"

namespace weft {

/// A CSV of measurements (docs/formats.md): a header row of distinct column names, then one row a
/// sample. Cells are kept as text: only the columns that somebody asks for must hold numbers.
class TableFile {
 public:
  /// Throws Error (file, line, column) if the file cannot be read, has no header, one of a single
  /// column with semicolons or tabs in it, two columns of one name, or rows of another length than
  /// the header.
  explicit TableFile(const std::filesystem::path& path);

  const std::filesystem::path& path() const { return path_; }
  const std::vector<std::string>& header() const { return header_; }
  int header_line() const { return header_line_; }
  std::size_t row_count() const { return rows_.size(); }
  bool has(std::string_view column) const;
  /// That the header does not have `column`, and what it has, for an error elsewhere.
  std::string missing(std::string_view column) const;
  /// Throws Error for a column that the header does not have, naming those it has.
  std::size_t column_index(std::string_view column) const;
  /// Throws Error for a cell that is not a finite number.
  double number(std::size_t row, std::size_t column) const;
  VecX numbers(std::string_view column) const;
  /// Names the file, the line of `row` and the column.
  Error fail(std::size_t row, std::string_view column, std::string_view reason) const;

 private:
  std::filesystem::path path_;
  std::vector<std::string> header_;
  int header_line_ = 0;
  std::vector<std::vector<std::string>> rows_;
  std::vector<int> lines_;  ///< where each row stands
};

}  // namespace weft
