#pragma once
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "weft/base/error.h"
#include "weft/base/types.h"

namespace weft {

/// A motion CSV (docs/formats.md): a header row of column names, among them `time_s`; then one row
/// a sample. Cells are kept as text: only the columns that a fixture names must hold numbers.
class MotionFile {
 public:
  /// Throws Error (file, line, column) if the file cannot be read, has no header, no `time_s`, no
  /// rows, rows of another length, or times that are not finite and strictly increasing.
  explicit MotionFile(const std::filesystem::path& path);

  const std::filesystem::path& path() const { return path_; }
  const std::vector<double>& times() const { return times_; }  ///< s
  const std::vector<std::string>& header() const { return header_; }
  bool has(std::string_view column) const;
  /// One coordinate a column of `columns` (which the header has); 3 x samples, m. Throws Error for
  /// a cell that is not a finite number.
  Points positions(const std::vector<std::string>& columns) const;

 private:
  Error fail(std::size_t row, std::string_view column, std::string_view reason) const;
  double number(std::size_t row, std::size_t column) const;
  std::size_t column_index(std::string_view column) const;
  void read_rows();
  void read_times();

  std::filesystem::path path_;
  std::vector<std::string> header_;
  std::vector<std::vector<std::string>> rows_;
  std::vector<int> lines_;  ///< where each row stands
  std::vector<double> times_;
};

}  // namespace weft
